"""The thesis's first wish: parameters learnt from its measures, against its final set in scenes that neither knows.

`airflock evolve kidger/city` and `kidger/forest` learnt them, every flight in a city or forest of its own. Here both
sets fly the same seeds, and so the same scenes, goals and starts; no seed of a study is among them, and half of the
scenes are of a density that no study had.
"""

import pandas as pd

from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SEEDS = 20
SETS = {"city": "kidger/learnt_city", "forest": "kidger/learnt_forest"}
DENSITIES = {"city": (1.0, 0.5), "forest": (1.0, 2.0)}
MEASURES = ("flocked", "time_to_flock", "goals_reached", "f_goals", "n_coll", "phi_coll", "n_env_coll")


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


def measured(table: pd.DataFrame) -> list[Measured]:
    """Fitness, every measure behind it, and how the sets do in the scene that they were not learnt in."""
    found = []
    for scene, densities in DENSITIES.items():
        for density in densities:
            place, at = table.loc[(scene, density)], f"{scene}, density {density:g}"
            cases = [(name, name, "learnt", f"{at}, learnt less final") for name in ("fitness", *MEASURES)]
            cases.append(("other", "fitness", "other", f"{at}, learnt in the other scene less final"))
            for label, name, kind, told in cases:
                both = place[name].unstack(level=0)[[kind, "final"]].dropna()
                if len(both) > 1:  # in a few short flights no flock may ever be complete
                    gap, words = _gap(place, both, kind)
                    found.append(Measured(f"learnt.{scene}.{density:g}.{label}", name, told, gap, words))
    return found


def _gap(place: pd.DataFrame, both: pd.DataFrame, kind: str) -> tuple[statistics.Estimate, str]:
    """Paired difference to the final set over the scenes in which both have a value; both means, as words."""
    means = both.mean()
    count = "" if len(both) == len(place.loc["final"]) else f", of the {len(both)} scenes in which both have one"
    words = f"{kind} {means[kind]:.3g}, final {means['final']:.3g}{count}"
    return statistics.mean(both[kind] - both["final"]), words
