"""The fixed wing against closed forms: turn, climb, glide, stall, power; its order; what it cannot fly."""

import math

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.parts.aero.wing import Parameters as Wing
from airflock.parts.bodies.fixed_wing import Memory, Parameters, drag_of, move, stall_speed
from airflock.scenarios.files import load
from airflock.support.errors import ScenarioError
from reference.flight import fly_plainly

WING = Wing(span=3.0, chord=0.3, weight=60.0, cd0=0.02)
STILL = (0.0, 0.0, 0.0)


def flown(command, seconds, v, dt=0.01, wind=STILL, wing=WING, memory=None, **numbers):
    """Velocities (step, 3) and memories; command: a velocity, or one for a velocity."""
    b, memory, found, kept = Parameters(**numbers), memory or Memory(), [tuple(v)], []
    for _ in range(round(seconds / dt)):
        c = command(v) if callable(command) else command
        *v, memory = move(*v, *c, *wind, memory, dt, b, wing)
        found.append(tuple(v))
        kept.append(memory)
    return np.array(found), kept


def left(v):
    """Always a quarter turn to the left of the present course, at 16 m/s."""
    k = 16.0 / math.hypot(*v[:2])
    return -k * v[1], k * v[0], 0.0


@pytest.mark.parametrize("bank", [0.3, 0.6, 0.87])
def test_the_sustained_turn_is_coordinated(bank):
    """Rate g tan(bank) / V, radius V² / (g tan(bank)), load 1 / cos(bank), and the thrust that this load asks for."""
    b = Parameters(bank_max=bank)
    velocity, kept = flown(left, 40.0, (16.0, 0.0, 0.0), bank_max=bank)
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    assert (course[-1] - course[-1001]) / 10.0 == pytest.approx(b.gravity * math.tan(bank) / 16.0, rel=5e-3)
    assert np.linalg.norm(velocity[-1000:], axis=1) == pytest.approx(np.full(1000, 16.0), rel=5e-3)
    assert np.abs(velocity[-1000:, 2]).max() < 0.02
    assert kept[-1].thrust == pytest.approx(drag_of(16.0, 1.0 / math.cos(bank), WING, b), rel=5e-3)


def test_the_fastest_sustained_turn_is_that_of_its_thrust():
    """With a bank for which thrust just suffices: n² = (T - q S cd0) q π e b² / W²."""
    b, v = Parameters(thrust_max=0.1, bank_max=1.2, n_max=9.0), 16.0
    q = 0.5 * WING.density * v * v
    spare = b.thrust_max * WING.weight - q * WING.span * WING.chord * WING.cd0
    n = math.sqrt(spare * q * math.pi * b.efficiency * WING.span**2) / WING.weight
    assert drag_of(v, n, WING, b) == pytest.approx(b.thrust_max, rel=1e-12)
    bank = math.acos(1.0 / n)
    held, lost = (
        flown(left, 60.0, (v, 0.0, 0.0), thrust_max=0.1, bank_max=bank + more, n_max=9.0)[0][-1]
        for more in (-0.02, 0.08)
    )
    assert abs(held[2]) < 0.01 and np.linalg.norm(held) == pytest.approx(v, rel=5e-3)
    assert lost[2] < -0.02  # beyond, height pays for the turn


def test_it_climbs_as_its_excess_power_allows():
    b, v = Parameters(), 16.0
    velocity, _ = flown((16.0, 0.0, 99.0), 60.0, (v, 0.0, 0.0), v_max=v)
    sine = velocity[-1, 2] / np.linalg.norm(velocity[-1])
    assert np.linalg.norm(velocity[-1]) == pytest.approx(v, rel=5e-3)
    load = math.sqrt(1.0 - sine * sine)
    most = min(b.thrust_max, b.power_max / (v * WING.weight))
    assert velocity[-1, 2] == pytest.approx(v * (most - drag_of(v, load, WING, b)), rel=5e-3)


def test_it_glides_at_its_best_ratio():
    """Without thrust: L / D = sqrt(π e A / cd0) / 2 at the speed at which both drags are equal."""
    b = Parameters()
    best = 0.5 * math.sqrt(math.pi * b.efficiency * (WING.span / WING.chord) / WING.cd0)
    lift = math.sqrt(math.pi * b.efficiency * (WING.span / WING.chord) * WING.cd0)
    v = math.sqrt(2.0 * WING.weight / (WING.density * WING.span * WING.chord * lift))
    velocity, kept = flown((v, 0.0, 0.0), 60.0, (v, 0.0, 0.0), thrust_max=0.0)
    assert kept[-1].energy == 0.0 and v > b.margin * stall_speed(WING, 1.0)
    assert velocity[-1, 0] / -velocity[-1, 2] == pytest.approx(best, rel=5e-3)


def test_level_flight_uses_the_power_of_its_drag():
    b, v = Parameters(), 14.0
    _, kept = flown((v, 0.0, 0.0), 40.0, (v, 0.0, 0.0))
    power = (kept[-1].energy - kept[-1001].energy) / 10.0
    assert power == pytest.approx(drag_of(v, 1.0, WING, b) * WING.weight * v / b.use, rel=5e-3)


def test_it_flies_as_long_as_its_battery_lasts_and_then_glides():
    """Level flight for capacity over power; then the glide of an aircraft without an engine, at no further cost."""
    b, v = Parameters(), 14.0
    power = drag_of(v, 1.0, WING, b) * WING.weight * v / b.use
    start = Memory(thrust=drag_of(v, 1.0, WING, b))
    velocity, kept = flown((v, 0.0, 0.0), 60.0, (v, 0.0, 0.0), memory=start, battery="lithium", capacity=20.0 * power)
    assert np.abs(velocity[:2000, 2]).max() < 1e-3 and velocity[2050, 2] < -0.01
    assert kept[-1].energy == pytest.approx(20.0 * power, rel=0.02)
    glides, _ = flown((v, 0.0, 0.0), 60.0, (v, 0.0, 0.0), thrust_max=0.0)
    assert velocity[-1] == pytest.approx(glides[-1], rel=5e-3)


def test_it_does_not_fly_slower_than_it_stalls():
    velocity, _ = flown((2.0, 0.0, 0.0), 40.0, (16.0, 0.0, 0.0))
    least = Parameters().margin * stall_speed(WING, 1.0)
    assert np.linalg.norm(velocity[-1]) == pytest.approx(least, rel=5e-3) and velocity[:, 2].min() > -1.0
    assert 0.5 * WING.density * stall_speed(WING, 2.0) ** 2 * 0.9 * WING.cl_max == pytest.approx(2.0 * WING.weight)


def test_wind_is_a_true_airspeed():
    """The same flight in moving air is the flight in still air, carried along."""
    wind = np.array([3.0, -5.0, 0.0])
    still, _ = flown((10.0, 9.0, 0.5), 10.0, (14.0, 0.0, 0.0))
    blown, _ = flown(tuple(np.array([10.0, 9.0, 0.5]) + wind), 10.0, (14.0, 0.0, 0.0) + wind, wind=tuple(wind))
    np.testing.assert_allclose(blown - wind, still, atol=1e-9)
    over_ground, _ = flown((10.0, 0.0, 0.0), 60.0, (14.0, 0.0, 0.0), wind=(-4.0, 3.0, 0.0))
    assert over_ground[-1] == pytest.approx([10.0, 0.0, 0.0], abs=0.05)


def test_halving_the_step_halves_the_error():
    ends = [flown((6.0, 14.0, 1.0), 1.2, (14.0, 0.0, 0.0), dt)[0][-1] for dt in (0.02, 0.01, 0.005, 0.0002)]
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert 1.8 < coarse / fine < 2.3


def test_a_law_or_a_start_slower_than_its_stall_is_refused_at_once():
    with pytest.raises(ScenarioError) as caught:
        load("vasarhelyi_2018/4ms", {"body.kind": "fixed_wing"})
    law, start = str(caught.value).splitlines()
    assert "stalls at 11.4 m/s and flies no slower than 12.6 m/s, but the law prefers 4 m/s" in law
    assert "start.speed = 0 m/s; set start.speed to 12.6" in start


KEYS = {
    "body.kind": "fixed_wing", "model.v_flock": 15.0, "model.v_max": 18.0, "start.speed": 15.0, "agents": 3,
    "world.side": 900.0, "start.separation": 30.0, "duration": 6.0, "wind.gust": 1.5,
    "model.r0_shill": 50.0, "dt": 0.02,
}  # fmt: skip


@pytest.mark.parametrize("dims", ["2", "3"])
def test_it_flies_as_the_reference_does(dims, seed):
    scenario = load("vasarhelyi_2018/4ms", KEYS | {"world.dimensions": dims})
    flight = fly_world(scenario, seed, precision=64, record=True, device="python")
    np.testing.assert_allclose(flight.frames, fly_plainly(scenario, seed).frames, rtol=0.0, atol=1e-9)
    speed = np.linalg.norm(flight.frames[:, int(dims) : 2 * int(dims)], axis=1)
    assert speed.min() > 9.0 and np.isfinite(flight.frames).all()
