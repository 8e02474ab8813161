"""The thesis's first wish: parameters learnt from its measures, against its final set in scenes that neither knows.

`airflock evolve kidger/city` and `kidger/forest` learnt them, every flight in a city or forest of its own. Here both
sets fly the same seeds, and so the same scenes, goals and starts; no seed of a study is among them, and half of the
scenes are of a density that no study had.
"""

from typing import NamedTuple

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.scenarios.files import load

SEEDS = 20
SETS = {"city": "kidger/learnt_city", "forest": "kidger/learnt_forest"}
DENSITIES = {"city": (1.0, 0.5), "forest": (1.0, 2.0)}
SOURCE = "Kidger, section 7: tuning by generational learning from the measures"


class Measure(NamedTuple):
    """An order parameter, what it is, and +1 if more of it is better."""

    name: str
    words: str
    better: int


MEASURES = (
    Measure("flocked", "share flocked", 1),
    Measure("time_to_flock", "s to all flocked", -1),
    Measure("goals_reached", "goals reached", 1),
    Measure("f_goals", "share of goals reached, averaged over the flight", 1),
    Measure("n_coll", "collisions of two boids", -1),
    Measure("phi_coll", "share of pairs in contact", -1),
    Measure("n_env_coll", "collisions with the scene", -1),
)


def fly(flights: Flights) -> pd.DataFrame:
    """Order parameters by (scene, density, set, seed); set is final, learnt, or the one learnt in the other scene."""
    keys = {"scene.draw": "flight", **({"duration": 20.0} if flights.quick else {})}
    scenarios = {}
    for scene, densities in DENSITIES.items():
        (other,) = set(SETS) - {scene}
        for density in densities:
            here = {**keys, "scene.kind": scene, "scene.density": density}
            for kind, preset in (("final", f"kidger/{scene}"), ("learnt", SETS[scene]), ("other", SETS[other])):
                scenarios[scene, density, kind] = load(preset, here)
    return flights.score("Learnt parameters", scenarios, flights.count(SEEDS, 3)).sort_index()


def claims(table: pd.DataFrame) -> list[Claim]:
    """Fitness, every measure behind it, and how the sets do in the scene that they were not learnt in."""
    found = []
    for scene, densities in DENSITIES.items():
        for density in densities:
            place = table.loc[(scene, density)]
            found += [_fitness(place, scene, density), *(_measure(place, scene, density, m) for m in MEASURES)]
            found.append(_other(place, scene, density))
    return found


def _gap(place: pd.DataFrame, name: str, kind: str = "learnt") -> tuple[statistics.Estimate, str]:
    """Paired difference to the final set over the scenes in which both have a value; both means, as words."""
    both = place[name].unstack(level=0)[[kind, "final"]].dropna()
    means = both.mean()
    count = "" if len(both) == len(place.loc["final"]) else f", of the {len(both)} scenes in which both have one"
    words = f"{kind} {means[kind]:.3g}, final {means['final']:.3g}{count}"
    return statistics.mean(both[kind] - both["final"]), words


def _fitness(place: pd.DataFrame, scene: str, density: float) -> Claim:
    gap, words = _gap(place, "fitness")
    return Claim(
        id=f"learnt.{scene}.{density:g}.fitness",
        statement=f"learnt parameters beat the final set in unknown scenes: {scene}, density {density:g}: difference",
        source=SOURCE, test="95 % interval of the paired difference above 0", **gap.fields(),
        **judged(gap.low > 0.0, words),
    )  # fmt: skip


def _measure(place: pd.DataFrame, scene: str, density: float, measure: Measure) -> Claim:
    gap, words = _gap(place, measure.name)
    sign = measure.better
    better, worse = (gap.low if sign > 0 else -gap.high) > 0.0, (gap.high if sign > 0 else -gap.low) < 0.0
    said = "better" if better else "worse" if worse else "no difference"
    return Claim(
        id=f"learnt.{scene}.{density:g}.{measure.name}",
        statement=f"{measure.words}, {scene}, density {density:g}: learnt less final",
        source=SOURCE, test="none: a part of the fitness", verdict="finding", **gap.fields(),
        reason=f"{said}: {words}",
    )  # fmt: skip


def _other(place: pd.DataFrame, scene: str, density: float) -> Claim:
    gap, words = _gap(place, "fitness", "other")
    return Claim(
        id=f"learnt.{scene}.{density:g}.other",
        statement=f"fitness of the set learnt in the other scene, {scene}, density {density:g}: less final",
        source=SOURCE, test="none", verdict="finding", **gap.fields(), reason=words,
    )  # fmt: skip
