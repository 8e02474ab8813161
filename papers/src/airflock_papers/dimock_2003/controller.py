"""The published controller flown again: full gradient, 28 starts around the unprinted one."""

from itertools import product

from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.dimock_2003.flights import Birds, Flight, Start, Task, holds_vee, spacing
from airflock_papers.dimock_2003.units import BEST, FT_LBF

STARTS = tuple(Start(sx=sx, sy=sy) for sx, sy in product((2.5, 5.0, 7.5, 10.0), (4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5)))


def fly(birds: Birds, quick: bool) -> list[Flight]:
    """Flights of the published gains from every start."""
    starts = STARTS[::4] if quick else STARTS
    return birds.fly("published controller", [Task(BEST, start) for start in starts], gradient="cells")


def measured(flights: list[Flight]) -> list[Measured]:
    """What the published gains do from every start."""
    alive = [flight for flight in flights if not flight.collided]
    powers = [flight.power / FT_LBF for flight in alive]
    found = statistics.median(powers)
    held = sum(holds_vee(flight) for flight in alive)
    swing = statistics.median([spacing(flight)[1] for flight in alive])
    best, told = min(powers), f"least {min(powers):.4g}, greatest {max(powers):.4g} ft lbf/s over {len(flights)} starts"
    return [
        Measured(
            "controller.fitness",
            "power",
            "published gains, best of the starts",
            statistics.one(best, len(flights)),
            told,
        ),
        Measured(
            "controller.range",
            "power",
            "published gains, median of the starts",
            found._replace(low=best, high=max(powers)),
            told,
        ),
        Measured(
            "controller.vee",
            "share in a V",
            "published gains, all starts",
            statistics.one(held / len(flights), len(flights)),
        ),
        Measured("controller.swing", "swing", "published gains, last 5 s", swing),
        Measured(
            "controller.collisions",
            "collided",
            "published gains, 20 s from a V",
            statistics.one(1.0 - len(alive) / len(flights), len(flights)),
        ),
    ]
