"""What a boid costs: processor time per boid and frame, rays cast, and a crowd against real time."""

import time
from typing import NamedTuple

from airflock.engine import score_flight
from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

CROWD = {"agents": 300, "start.side": 200.0}  # 300 drones do not fit into the usual start
REPEATS = 5


class Cost(NamedTuple):
    """Least processor time of a flight, s; its frames, boids, simulated time (s), rays and share that avoid."""

    seconds: float
    frames: int
    boids: int
    simulated: float
    rays: float
    avoiding: float


def fly(flights: Flights) -> dict[str, Cost]:
    """Time single flights, one after another, and keep the least of several times."""
    long = 5.0 if flights.quick else 20.0
    cases = {
        "city.10": load("kidger/city", {"duration": long}),
        "forest.10": load("kidger/forest", {"duration": long}),
        "city.300": load("kidger/city", {**CROWD, "duration": long}),
    }
    found = {}
    for name, scenario in cases.items():
        score_flight(scenario, 0)
        least, values = 1e30, {}
        for _ in range(2 if flights.quick else REPEATS):
            began = time.process_time()
            values = score_flight(scenario, 0)
            least = min(least, time.process_time() - began)
        frames = round(scenario.flight.duration / scenario.flight.dt)
        found[name] = Cost(least, frames, scenario.agents, long, values["rays"], values["avoiding"])
    return found


def measured(found: dict[str, Cost]) -> list[Measured]:
    """Microseconds per boid and frame; how many times faster than real time 300 drones fly on one core."""
    costs = [
        Measured(
            f"cost.{name}",
            "processor time",
            f"µs per boid and frame, {name}",
            statistics.one(1e6 * cost.seconds / (cost.frames * cost.boids)),
            f"{cost.rays:.3g} rays per boid and frame, {cost.avoiding:.0%} of boids avoiding",
        )
        for name, cost in found.items()
    ]
    crowd = found["city.300"]
    factor = crowd.simulated / crowd.seconds
    note = (
        f"{crowd.rays:.3g} rays cast per drone and frame, {crowd.rays * 300 * 60 * factor / 1e6:.3g} million rays per "
        f"second; {crowd.avoiding:.0%} of drones avoiding"
    )
    return [
        *costs,
        Measured(
            "cost.real_time", "processor time", "times real time, 300 drones in the city", statistics.one(factor), note
        ),
    ]
