"""A controller from a sound fitness: many starts, 60 s, graded collisions; compared on starts that it never saw.

Same air and same rules as the paper's, except that collision avoidance is a barrier over pairs: Eq. 4 is bounded and
cannot win against a gradient near a vortex.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from airflock.metrics.fitness_dimock import fitness
from airflock.papers.claims import Claim, judged
from airflock.papers.dimock_2003.flights import Birds, Flight, Start, Task
from airflock.papers.dimock_2003.units import BEST, FT_LBF, HIGH, LOW, Gains, both, gains

DURATION = 60.0  # s
TRAINED = (
    Start(jitter=0.5),
    Start(sx=3.0, sy=5.5, jitter=0.5),
    Start(sx=8.0, sy=8.0, jitter=0.5),
    Start(kind="echelon", sx=6.0, sy=0.0, jitter=0.5),
    Start(kind="box", sx=35.0, sy=6.0),
    Start(sx=5.0, sy=6.0, sz=1.0, jitter=0.5),
)
KINDS = ("V", "tight V", "wide V", "column", "random", "3-D V")
SEED = 7
TEST = 10_000  # first seed of held-out starts; training uses seeds below


@dataclass
class Comparison:
    """Held-out flights of each controller by name, the robust gains, and each candidate's power and collision rate."""

    flights: dict[str, list[Flight]]
    gains: Gains
    front: list[tuple[float, float]]


def compare(birds: Birds, winners: list[Gains], count: int, quick: bool) -> Comparison:
    """Evolve the robust controller, then fly it, the winner and the published one on `count` held-out starts."""
    found, front = evolve(birds, 4 if quick else 25)
    tasks = [(TRAINED[k % len(TRAINED)], TEST + k) for k in range(count)]
    flights = {
        "published": birds.fly("held out: published", [Task(BEST, *t) for t in tasks], DURATION),
        "winner": birds.fly("held out: winner of the GA", [Task(winners[0], *t) for t in tasks], DURATION),
        "robust": birds.fly("held out: robust", [Task(found, *t) for t in tasks], DURATION, avoidance="barrier"),
    }
    return Comparison(flights, found, front)


def evolve(birds: Birds, generations: int, population: int = 10) -> tuple[Gains, list[tuple[float, float]]]:
    """CMA-ES on the mean sound fitness over the training starts; the best mean of the search, and all candidates."""
    import cma

    start = (np.array([*BEST]) - LOW) / (HIGH - LOW)
    start[1] = 0.1  # 10 ft/s
    search = cma.CMAEvolutionStrategy(
        start, 0.15, {"bounds": [0.0, 1.0], "popsize": population, "seed": SEED, "verbose": -9}
    )
    front = []
    for generation in range(generations):
        candidates = search.ask()
        tasks = [Task(gains(c), s, generation * len(TRAINED) + k) for c in candidates for k, s in enumerate(TRAINED)]
        flown = birds.fly("", tasks, DURATION, avoidance="barrier")
        groups = [flown[i : i + len(TRAINED)] for i in range(0, len(flown), len(TRAINED))]
        search.tell(candidates, [float(np.mean([-judged_by(flight.values) for flight in group])) for group in groups])
        front += [
            (float(np.mean([f.power for f in group])) / FT_LBF, float(np.mean([f.collided for f in group])))
            for group in groups
        ]
        if birds.progress:
            birds.progress("sound fitness", generation + 1, generations)
    return gains(np.clip(search.result.xfavorite, 0.0, 1.0)), front


def judged_by(values: dict[str, Any]) -> float:
    """Sound fitness of one flight, W; a collision ends a flight of the paper's preset, so power is that until then."""
    return fitness(values, "sound")["fitness"]


def rates(flights: list[Flight]) -> tuple[float, float, float]:
    """Share of flights that collide, with its 95 % interval (Wilson)."""
    n, k, z = len(flights), sum(flight.collided for flight in flights), 1.96
    middle = (k + 0.5 * z * z) / (n + z * z)
    half = z / (n + z * z) * (k * (n - k) / n + 0.25 * z * z) ** 0.5
    return k / n, max(middle - half, 0.0), min(middle + half, 1.0)


def claims(found: Comparison) -> list[Claim]:
    """Is the robust controller safer than both, at nearly the same power?"""
    from scipy.stats import fisher_exact

    robust = found.flights["robust"]
    rate, low, high = rates(robust)
    hits = sum(flight.collided for flight in robust)
    lines = []
    for other in ("published", "winner"):
        theirs = found.flights[other]
        k = sum(flight.collided for flight in theirs)
        p = float(fisher_exact([[hits, len(robust) - hits], [k, len(theirs) - k]], alternative="less").pvalue)
        them = rates(theirs)
        lines.append(
            Claim(
                id=f"robust.{other}", statement=f"fewer collisions than the {other} controller, held-out starts, 60 s",
                source="our target", test="one-sided exact test, p < 0.05", published=them[0], ours=rate, low=low,
                high=high, runs=len(robust),
                **judged(p < 0.05, f"{rate:.0%} ({low:.0%} to {high:.0%}) against {them[0]:.0%} ({them[1]:.0%} to "
                         f"{them[2]:.0%}), p = {p:.2g}"),
            )
        )  # fmt: skip
    pairs = [(a.power, b.power) for a, b in zip(robust, found.flights["winner"], strict=True)
             if not (a.collided or b.collided)]  # fmt: skip
    ours, theirs_ = (float(np.mean([pair[c] for pair in pairs])) if pairs else float("nan") for c in (0, 1))
    ratio = ours / theirs_ if pairs else float("nan")
    lines.append(
        Claim(
            id="robust.power", statement="power on flights that both survive, over the winner's", source="our target",
            test="at most 1.05", ours=ratio, runs=len(pairs),
            **judged(bool(ratio <= 1.05), f"{both(ours)} against {both(theirs_)} on {len(pairs)} flights; gains: "
                     f"{found.gains.text()}"),
        )
    )  # fmt: skip
    return lines
