"""The published controller flown again: full gradient, 28 starts around the unprinted one."""

from itertools import product

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.dimock_2003.flights import Birds, Flight, Start, Task, holds_vee, median, spacing
from airflock.papers.dimock_2003.units import BEST, FT_LBF, both

STARTS = tuple(Start(sx=sx, sy=sy) for sx, sy in product((2.5, 5.0, 7.5, 10.0), (4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5)))
# of the same conventions, by a prototype: best, median and worst of 28 starts, ft lbf/s
RANGE = (12.0, 18.6)


def fly(birds: Birds, quick: bool) -> list[Flight]:
    """Flights of the published gains from every start."""
    starts = STARTS[::4] if quick else STARTS
    return birds.fly("published controller", [Task(BEST, start) for start in starts], gradient="cells")


def claims(flights: list[Flight]) -> list[Claim]:
    """Verdicts on the published controller."""
    alive = [flight for flight in flights if not flight.collided]
    powers = [flight.power for flight in alive]
    found = statistics.median(powers)
    held = sum(holds_vee(flight) for flight in alive)
    swing = median(spacing(flight)[1] for flight in alive)
    return [
        Claim(
            id="controller.fitness", statement="the published gains reach -9.8 (read as ft lbf/s per bird)",
            source="Results", test="a start of those tried comes within 5 % of it", published=9.8 * FT_LBF,
            **found.fields(),
            **judged(
                min(powers) <= 1.05 * 9.8 * FT_LBF,
                f"{both(min(powers))} at best, median {both(found.ours)}, worst {both(max(powers))} over "
                f"{len(flights)} starts: neither the start nor Eqs 1 and 2 are legible enough to choose by",
            ),
        ),
        Claim(
            id="controller.range", statement="the published gains with C1 and 1/n weights, 10 segments",
            source="a prototype with the same conventions: 12.2 to 18.4, median 12.8 ft lbf/s",
            test="every start inside 12.0 to 18.6 ft lbf/s", published=12.8 * FT_LBF, ours=found.ours,
            low=min(powers), high=max(powers), runs=len(powers),
            **judged(all(RANGE[0] <= p / FT_LBF <= RANGE[1] for p in powers), f"median {both(found.ours)}"),
        ),
        Claim(
            id="controller.vee", statement="the best controller maintains the V", source="Results, Fig. 8",
            test="a V at the end from half of the starts", ours=held / len(flights), runs=len(flights),
            **judged(held >= 0.5 * len(flights), f"{held} of {len(flights)} starts"),
        ),
        Claim(
            id="controller.swing", statement="birds in the rear oscillate about the vortices of others",
            source="Future Work", test="median swing of a bird in the last 5 s is at least one cell, 0.5 ft (in ft)",
            ours=swing, runs=len(alive), **judged(swing >= 0.5, f"{swing:.2g} ft from side to side"),
        ),
        Claim(
            id="controller.collisions", statement="the published gains collide", verdict="finding",
            source="Results: K_a is too small to prevent most collisions", test="share of starts within 20 s",
            ours=1.0 - len(alive) / len(flights), runs=len(flights),
            reason=f"{len(flights) - len(alive)} of {len(flights)} starts",
        ),
    ]  # fmt: skip
