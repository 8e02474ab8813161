"""Collisions as the authors' program counts them, where flocks are so dense that it matters.

Eq. 18 counts every boid with another within r_b. The program goes through the pairs i < j and skips those whose first
boid is already marked, so that members of a chain can be missed (an undercount, never an overcount) and the answer
depends on the order of the boids. No order parameter of ours does; here frames are counted both ways, to tell how much
of a distance to the published figures is the count.
"""

import numpy as np
from numpy.typing import NDArray

from airflock.engine.cpu import in_threads
from airflock.engine.simulate import fly
from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.zapotecatl_2016.verdicts import BANDS
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

DENSE = 10  # r_s in cm: without alignment, the one row of bands in which a quarter of the boids collide
EVERY = 0.09  # s between the frames that are counted: 1000 of the 100,000


def in_contact(position: NDArray[np.float64], r_b: float) -> NDArray[np.bool_]:
    """Whether two boids are nearer than r_b; position (boid, axis) in m."""
    offset = position[:, None] - position[None]
    touching: NDArray[np.bool_] = (offset * offset).sum(axis=-1) < r_b * r_b
    np.fill_diagonal(touching, False)
    return touching


def marked(touching: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Boids that the program marks as colliding."""
    found = np.zeros(len(touching), bool)
    for i in range(len(touching)):
        later = touching[i, i + 1 :]
        if not found[i] and later.any():
            found[i] = True
            found[i + 1 :] |= later
    return found


def qualities(position: NDArray[np.float64], velocity: NDArray[np.float64], scenario: Scenario) -> tuple[float, float]:
    """Quality of one frame (Eqs 21-23) by Eq. 18 and by the program's count."""
    q, n = scenario.measured_by(), len(position)
    k, max_e = float(q.k or 0.0), float(q.max_e or 0.0)
    offset = np.linalg.norm(position - position.mean(axis=0), axis=1)
    heading = velocity / np.linalg.norm(velocity, axis=1)[:, None]
    mean = heading.mean(axis=0)
    angle = np.arccos(np.clip(heading @ mean / np.linalg.norm(mean), -1.0, 1.0))
    touching = in_contact(position, q.r_b)
    exact: NDArray[np.bool_] = np.asarray(touching.any(axis=1))

    def quality(hit: NDArray[np.bool_]) -> float:
        ext = 1.0 - (offset[~hit].sum() + k * hit.sum()) / (max_e * n)
        pol = 1.0 - (angle[~hit].sum() + q.rho * hit.sum()) / (np.pi * n)
        return float(q.sigma * ext + q.gamma * pol)

    return quality(exact), quality(marked(touching))


def of_flight(scenario: Scenario, seed: int) -> tuple[float, float]:
    """Quality of a whole flight by both counts."""
    frames = fly(scenario, seed, record=True).frames
    assert frames is not None
    rows = [qualities(f[:3].T.astype(float), f[3:6].T.astype(float), scenario) for f in frames]
    exact, program = np.mean(rows, axis=0)
    return float(exact), float(program)


def claims(flights: Flights) -> list[Claim]:
    """The band of the dense row, by the count that the figures were made with."""
    settings = {"model.r_s": DENSE / 100, "model.r_a": 0.0, "metrics.period": EVERY}
    scenario = load("zapotecatl_2016/best", settings)
    seeds = flights.count(15, 2)
    of_flight(load("zapotecatl_2016/best", {**settings, "duration": EVERY}), 0)  # compiled before threads ask for it
    jobs = [lambda seed=seed: of_flight(scenario, seed) for seed in range(seeds)]
    values = list(in_threads(jobs, flights.threads))
    exact, program = (statistics.mean(column) for column in zip(*values, strict=True))
    low, high = BANDS[DENSE]
    inside = low <= round(program.ours, 3) <= high
    return [
        Claim(
            id=f"sequential.band.{DENSE}.program_count",
            statement=f"quality at r_s = {DENSE} cm without alignment, collisions counted as the program does",
            source="Fig. 7 and runs of the authors' program",
            test=f"mean in [{low:g}, {high:g}]",
            **program.fields(),
            **judged(inside, f"with every colliding boid counted (Eq. 18) the same flights have {exact.ours:.4f}"),
        )
    ]
