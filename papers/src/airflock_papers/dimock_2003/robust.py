"""A controller from a sound fitness: many starts, noise in flight, 60 s, graded collisions; judged on held-out starts.

Same air and same rules as the paper's, except that collision avoidance is a barrier over pairs, because Eq. 4 is
bounded and cannot win against a gradient near a vortex, that cohesion is bounded (C3), and that demands are. The
paper's V is flat, no drag changes with height in it, and so its birds never leave their plane: most starts here are
flown in a plane, where nobody can pass above another.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from airflock.parts.metric_sets import dimock as fitness_dimock
from airflock.search import CMAES
from airflock_papers.dimock_2003.flights import Birds, Flight, Start, Task
from airflock_papers.dimock_2003.units import BEST, Gains, gains

DURATION = 60.0  # s
NOISE = 0.002  # m²/s: left alone a bird is off by a foot after 23 s
STARTS = {
    "V": Start(jitter=0.5, flat=True),
    "tight V": Start(sx=3.0, sy=5.5, jitter=0.5, flat=True),
    "wide V": Start(sx=8.0, sy=8.0, jitter=0.5, flat=True),
    "column": Start(kind="echelon", sx=6.0, sy=0.0, jitter=0.5, flat=True),
    "random": Start(kind="box", sx=35.0, sy=6.0, flat=True),
    "V in space": Start(sx=5.0, sy=6.0, sz=1.0, jitter=0.5),
}
SOUND: dict[str, Any] = {"avoidance": "barrier", "cohesion": "C3", "v_max": 2.0}
SEED = 7
TEST = 1_000_000  # first seed of held-out flights; training uses seeds below


@dataclass(frozen=True)
class Candidate:
    """Gains, mean power (W) of those flights that survive, mean crowding of all, and the share that collides."""

    gains: Gains
    power: float
    crowding: float
    rate: float = 0.0


@dataclass
class Comparison:
    """Held-out flights of each controller by name, the robust gains, the front: training, and flown again held out.

    winners : of the genetic algorithm on the paper's fitness, among the names of `flights`
    """

    flights: dict[str, list[Flight]]
    winners: list[str]
    gains: Gains
    tried: list[Candidate]
    front: list[Candidate]


def compare(birds: Birds, winners: Sequence[Gains], count: int, quick: bool = False) -> Comparison:
    """Evolve the robust controller, then fly it, the winners and the published one on `count` held-out starts."""
    found, tried = evolve(birds, 2 if quick else 30, *((6, 1) if quick else (12, 2)))
    names = {f"winner {k + 1}": winner for k, winner in enumerate(winners)}

    def fly(name: str, controller: Gains, **readings: Any) -> list[Flight]:
        return birds.fly(f"held out: {name}", held_out(controller, count), DURATION, NOISE, **readings)

    flights = {"published": published(birds, count)}
    flights |= {name: fly(name, winner, centroid="others") for name, winner in names.items()}
    flights["robust"] = fly("robust", found, **SOUND)
    best = nondominated(tried)
    best = [best[k] for k in sorted({round(x) for x in np.linspace(0, len(best) - 1, 2 if quick else 8)})]
    again = [candidate(c.gains, fly("front", c.gains, **SOUND)[: max(count // 3, 6)]) for c in best]
    return Comparison(flights, list(names), found, tried, again)


def published(birds: Birds, count: int) -> list[Flight]:
    """Flights of the published gains on `count` held-out starts."""
    tasks = held_out(BEST, count)
    return birds.fly("held out: published", tasks, DURATION, NOISE, centroid="n")


def held_out(controller: Gains, count: int) -> list[Task]:
    """Flights that no search has seen: all kinds of starts by turns, with seeds of their own."""
    kinds = list(STARTS.values())
    return [Task(controller, kinds[k % len(kinds)], TEST + k) for k in range(count)]


def evolve(birds: Birds, generations: int, population: int, repeats: int) -> tuple[Gains, list[Candidate]]:
    """CMA-ES on the mean sound fitness over the starts, `repeats` seeds each; its last mean, and all candidates."""
    search, tried = CMAES(5, population, SEED), []
    kinds = [start for start in STARTS.values() for _ in range(repeats)]
    for generation in range(generations):
        points = search.ask()
        first = generation * len(kinds)  # common random numbers within a generation
        tasks = [Task(gains(point), start, first + k) for point in points for k, start in enumerate(kinds)]
        flown = birds.fly("", tasks, DURATION, NOISE, **SOUND)
        groups = [flown[i : i + len(kinds)] for i in range(0, len(flown), len(kinds))]
        search.tell(points, np.array([[np.mean([-sound(flight.values) for flight in group])] for group in groups]))
        tried += [candidate(gains(point), group) for point, group in zip(points, groups, strict=True)]
        if birds.progress:
            birds.progress("sound fitness", generation + 1, generations)
    return gains(np.clip(search.centre(), 0.0, 1.0)), tried


def sound(values: dict[str, Any]) -> float:
    """Sound fitness of one flight, W; a collision ends a flight of the paper's preset, so power is that until then."""
    return fitness_dimock.sound(values)


def candidate(found: Gains, flights: Sequence[Flight]) -> Candidate:
    """What some flights of one controller say."""
    alive = [flight.power for flight in flights if not flight.collided]
    power = float(np.mean(alive)) if alive else float("inf")
    crowding = float(np.mean([flight.values["crowding"] for flight in flights]))
    return Candidate(found, power, crowding, 1.0 - len(alive) / len(flights))


def nondominated(tried: Sequence[Candidate]) -> list[Candidate]:
    """Those than whom nobody is better in power and in crowding at once, from the cheapest to the safest.

    Crowding, not collisions: with a barrier between birds hardly a candidate collides, but many fly close.
    """
    kept: list[Candidate] = []
    for c in sorted(tried, key=lambda c: (c.power, c.crowding)):
        if not kept or c.crowding < kept[-1].crowding:
            kept.append(c)
    return kept


def rates(flights: Sequence[Flight]) -> tuple[float, float, float]:
    """Share of flights that collide, with its 95 % interval (Wilson)."""
    n, k, z = len(flights), sum(flight.collided for flight in flights), 1.96
    middle = (k + 0.5 * z * z) / (n + z * z)
    half = z / (n + z * z) * (k * (n - k) / n + 0.25 * z * z) ** 0.5
    return k / n, max(middle - half, 0.0), min(middle + half, 1.0)
