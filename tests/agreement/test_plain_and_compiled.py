"""A flight is the same as plain Python and compiled, in double and, to its rounding, in single precision."""

from dataclasses import replace

import numpy as np
import pytest

import covering
from airflock.engine import plan_of
from flocks import IDEAL, flown, interpreted, scenario
from inside import cpu, tables
from reference.flight import fly_plainly

IDEALS = {
    "ideal": ("vasarhelyi_2018", IDEAL | {"agents": 7}),
    "ideal_3d": ("vasarhelyi_2018", IDEAL | {"agents": 6, "world.dimensions": "3", "duration": 8.0}),
}  # fmt: skip
FLIGHTS = (*covering.PLANS, *IDEALS)


def build(name):
    if name in covering.PLANS:
        return covering.build(name)
    kind, settings = IDEALS[name]
    return scenario(kind, **{key.replace(".", "__"): value for key, value in (covering.COMMON | settings).items()})


def start_of(found, seed):
    """A start for the flights that are flown from given states: the physics tests share their plans."""
    rng = np.random.default_rng(seed)
    n, dims = found.agents, found.dimensions
    places = rng.permutation(np.stack(np.meshgrid(*[np.arange(-2.0, 3.0) * 9.0] * dims), -1).reshape(-1, dims))[:n]
    return np.concatenate([places.T, rng.normal(0.0, 2.0, (dims, n))])


@pytest.fixture(scope="module")
def plain_flights():
    return {}


def both(name, seed, precision, plain_flights):
    found = build(name)
    start = start_of(found, seed) if name.startswith("ideal") else None
    if name not in plain_flights:
        plain_flights[name] = fly_plainly(found, seed, start)
    return plain_flights[name], flown(found, seed, start, precision)


@pytest.mark.parametrize("name", FLIGHTS)
def test_plain_python_is_the_compiled_flight(name, seed, plain_flights):
    plain, compiled = both(name, seed, 64, plain_flights)
    assert plain.status == compiled.status == 0
    assert np.nanmax(np.abs(np.diff(plain.frames, axis=0))) > 0.1  # something happens
    np.testing.assert_allclose(compiled.frames, plain.frames, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(compiled.state, plain.state, rtol=0.0, atol=1e-9)
    assert compiled.values == pytest.approx(plain.values, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("name", "chaos"), [("paper", 1.0), ("storm", 5.0)])
def test_single_precision_differs_by_its_rounding(name, chaos, seed, plain_flights):
    plain, compiled = both(name, seed, 32, plain_flights)
    assert compiled.frames.dtype == np.float32
    # Positions of 50 m are known to 4 µm; the law's slopes make 1 mm of it in 10 s. A command is a short sum rescaled
    # to v_flock, which magnifies its rounding. In the storm agents meet, and every encounter multiplies it.
    for component, margin in enumerate((1e-3, 1e-3, 2e-3, 2e-3, 2e-2, 2e-2)):
        np.testing.assert_allclose(
            compiled.frames[:, component], plain.frames[:, component], rtol=0.0, atol=chaos * margin
        )
    assert compiled.values["phi_vel"] == pytest.approx(plain.values["phi_vel"], rel=1e-5)
    assert compiled.values["n_coll"] == plain.values["n_coll"]


def test_flights_of_this_file_collide_and_leave_the_arena(seed, plain_flights):
    """So that the agreement above covers collision events and excursions."""
    totals = [both(name, seed, 64, plain_flights)[0].values for name in ("paper", "storm", "silo")]
    assert max(values["n_coll"] for values in totals) >= 2.0
    assert max(values["phi_wall"] for values in totals) > 0.0
    assert max(values["n_min"] for values in totals) > 1.0


def test_a_crowd_without_room_is_refused_by_both(seed):
    found = scenario(agents=12, world__side=31.0, world__walls="nearest_per_axis", start__separation=7.0)
    found = replace(found, world=replace(found.world, side=18.0))  # past the border, which refuses it beforehand
    status = fly_plainly(found, seed).status
    assert status < 0
    plan = plan_of(found, precision=64, record=True)
    assert cpu.fly_on_cpu(plan, tables(found, plan, seed)).status == status


def test_drones_that_land_with_an_empty_battery_are_absent_in_both(seed):
    """The same driver text, interpreted: from 6 to 14 m they fall within the flight."""
    keys = {
        "agents": 5, "duration": 5.0, "world.dimensions": "3", "world.floor": 6.0, "world.ceiling": 14.0,
        "body.kind": "quadrotor", "body.battery": "lithium", "body.capacity": 300.0, "start.separation": 3.0,
    }  # fmt: skip
    found = scenario("vasarhelyi_2018", **{key.replace(".", "__"): value for key, value in keys.items()})
    plain, other = fly_plainly(found, seed), interpreted(found, seed)
    assert np.isnan(plain.frames[-1]).any() and 0.2 < plain.values["present"] < 1.0
    np.testing.assert_allclose(other.frames, plain.frames, rtol=0.0, atol=1e-9)
    assert other.values == pytest.approx(plain.values, rel=1e-9, abs=1e-9, nan_ok=True)
