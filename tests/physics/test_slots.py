"""Slots: agents change places in memory, and nothing that is theirs goes astray."""

from pathlib import Path

import numba
import numpy as np
import pytest

import airflock.displays
from airflock.engine import plan_of
from airflock.scenarios.files import load
from inside import EVERY, cpu, slotted, tables

DISPLAY = Path(airflock.displays.__file__).parent / "display.toml"
N = 90
GOALS = [[16.0 * (i % 10) - 80.0, 16.0 * (i // 10) - 80.0, 30.0] for i in range(N)]
# noise of the body by agent, a goal of its own, over two rearrangements; test_boids has laws that remember or draw
DRONES = {
    "agents": N, "dt": 0.05, "sensors.period": 0.1, "duration": 0.1 * (EVERY + 6), "world.dimensions": "3",
    "world.arena": "none", "goals.kind": "own", "goals.points": GOALS, "goals.speed": 20.0, "start.kind": "box",
    "start.side": 160.0, "body.noise": 0.2, "sensors.noise": 0.0, "radio.delay": 0.0, "metrics.kind": "order",
    "metrics.period": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("delay", [0.0, 0.25])
def test_agents_of_a_grid_fly_and_are_recorded_as_those_of_all_pairs(delay, seed):
    """Commands that wait change places with their agents."""
    found = load(DISPLAY, DRONES | {"body.delay": delay})
    pairs, cells = (plan_of(found, precision=64, record=True, grid=grid) for grid in (False, True))
    assert slotted(cells) and not slotted(pairs)
    one, two = (cpu.fly_on_cpu(plan, tables(found, plan, seed), device="python") for plan in (pairs, cells))
    assert one.status == two.status == 0
    assert one.frames is not None and two.frames is not None and len(one.frames) > EVERY
    np.testing.assert_allclose(one.frames, two.frames, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(one.state, two.state, rtol=0.0, atol=1e-8)
    assert two.values == pytest.approx(one.values, rel=1e-7, abs=1e-9, nan_ok=True)


def test_agents_that_decide_side_by_side_gather_shapes_of_their_own(seed):
    """Each casts at what stands around it, whoever decides in another thread meanwhile."""
    found = load("kidger/city", {"agents": 400, "duration": 1.2, "start.separation": 0.5, "metrics.kind": "order"})
    plan = plan_of(found, precision=64, grid=True)
    most = numba.get_num_threads()
    flown = []
    for threads in (1, most, most):
        numba.set_num_threads(threads)
        flown.append(cpu.fly_on_cpu(plan, tables(found, plan, seed)))
    numba.set_num_threads(most)
    assert all((one.state == flown[0].state).all() for one in flown)
