"""The quadrotor against closed forms: hover, terminal speed, steady tilt in wind; its order, its limits, its memory."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, strategies as st

import airflock
from airflock.core.contract import call_rule
from airflock.parts.bodies import quadrotor
from airflock.parts.bodies.battery import hovering, left
from airflock.parts.bodies.quadrotor import Memory, Parameters, move
from airflock.scenarios.files import load
from airflock.support.errors import RuleError, ScenarioError

STILL = (0.0, 0.0, 0.0)


def flown(command, seconds, dt=0.01, v=STILL, wind=STILL, memory=None, **numbers):
    """Velocities (step, 3) and memories of a quadrotor that is told to fly at a velocity, or at one for each step."""
    b, memory, found, kept = Parameters(**numbers), memory or Memory(), [v], [memory or Memory()]
    for step in range(round(seconds / dt)):
        c = command(step * dt) if callable(command) else command
        w = wind(step * dt) if callable(wind) else wind
        *v, memory = move(*v, *v, *c, *w, memory, dt, b)
        found.append(tuple(v))
        kept.append(memory)
    return np.array(found), kept


def test_it_hovers_to_the_bit():
    velocity, kept = flown(STILL, 10.0)
    assert not velocity.any() and kept[-1] == Memory()


@pytest.mark.parametrize("rho", [1.225, 0.6])
def test_it_sinks_at_its_terminal_speed(rho):
    """Least thrust, weight and quadratic drag: v² = (1 - thrust) g / (k drag), with drag as thick as the air."""
    b = Parameters(rho=rho)
    velocity, kept = flown((0.0, 0.0, -500.0), 120.0, rho=rho)
    thrust = 0.5  # the controller keeps half the weight upwards
    assert kept[-1].thrust == pytest.approx(thrust, rel=1e-12)
    falling = math.sqrt((1.0 - thrust) * b.gravity / (b.drag * rho / b.rho_0))
    assert velocity[-1, 2] == pytest.approx(-falling, rel=1e-9)


@pytest.mark.parametrize("wind", [(6.0, 0.0, 0.0), (-3.0, 8.0, 1.0)])
def test_it_keeps_its_place_in_wind_and_leans_as_the_drag_asks(wind):
    """At rest T n = g - drag(n): the tilt that the balance of forces has, and no error of velocity is left."""
    velocity, kept = flown(STILL, 120.0, wind=wind)
    b, m = Parameters(), kept[-1]
    assert np.abs(velocity[-1]).max() < 1e-9
    drag = quadrotor.dragged(*(-np.array(wind)), m.nx, m.ny, m.nz, b)
    need = np.array([0.0, 0.0, b.gravity]) - drag
    assert [m.thrust * b.gravity * n for n in (m.nx, m.ny, m.nz)] == pytest.approx(need, abs=1e-9)
    level = math.hypot(*wind[:2])
    assert m.nx * wind[0] + m.ny * wind[1] < -0.1 * level  # into the wind


def test_it_follows_a_step_without_an_error_that_stays():
    velocity, kept = flown((4.0, 0.0, 0.0), 60.0)
    assert velocity[-1] == pytest.approx([4.0, 0.0, 0.0], abs=1e-6)
    assert velocity[:, 0].max() < 4.0 * 1.15
    reached = 0.01 * np.argmax(velocity[:, 0] > 0.632 * 4.0)
    assert 0.8 < reached < 1.2  # tau = 1 s


def test_halving_the_step_halves_the_error():
    """Semi-implicit Euler is of first order."""
    steps = (0.01, 0.005, 0.0025)
    ends = [flown((3.0, -2.0, 1.0), 0.8, dt, wind=(2.0, 1.0, 0.0))[0][-1] for dt in (*steps, 0.0001)]
    errors = [np.linalg.norm(end - ends[-1]) for end in ends[:-1]]
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert 1.8 < coarse / fine < 2.3


def test_what_is_asked_of_it_is_limited():
    b = Parameters()
    velocity, kept = flown((60.0, 0.0, 30.0), 5.0)
    tilt = np.array([math.acos(min(m.nz, 1.0)) for m in kept])
    rate = np.array([(m.wx, m.wy, m.wz) for m in kept])
    assert tilt.max() < b.tilt_max + 0.02
    assert np.abs(np.diff(rate, axis=0)).max() <= b.alpha * 0.01 + 1e-9
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() < b.thrust_max * b.gravity * 0.01
    assert all(m.ix == m.iy == m.iz == 0.0 for m in kept)  # no wind-up while limited


def test_a_step_too_long_for_its_attitude_is_one_line():
    with pytest.raises(ScenarioError, match=r"^[^\n]*: dt = 0.1 s: body quadrotor [^\n]* at most 0.0408 s$"):
        load("vasarhelyi_2018/4ms", {"body.kind": "quadrotor", "dt": 0.1, "sensors.period": 0.2})
    velocity, kept = flown((60.0, 0.0, 0.0), 20.0, dt=0.04)  # at the longest it swings, but settles
    tilt = np.array([math.acos(min(m.nz, 1.0)) for m in kept])
    assert tilt.max() < 1.2 * Parameters().tilt_max and np.ptp(tilt[-100:]) < 0.01


@pytest.mark.parametrize("density", [1.0, 0.5])
def test_it_hovers_as_long_as_its_battery_lasts_and_then_falls(density):
    """Momentum theory: power of hovering over the root of the density; a fall ends at v² = g / (k drag)."""
    rho = 1.225 * density
    numbers = {"battery": "lithium", "capacity": 300.0, "hover_power": 150.0, "rho": rho, "thrust_max": 4.0}
    velocity, kept = flown(STILL, 60.0, **numbers)
    power = 150.0 / math.sqrt(density)
    empty = math.ceil(300.0 / (power * 0.01) - 1e-9)  # step at which nothing is left
    assert not velocity[: empty + 1].any() and velocity[empty + 1, 2] < 0.0
    assert kept[empty // 2].used == pytest.approx(power * 0.01 * (empty // 2), rel=1e-12)
    assert kept[-1].thrust < 1e-9 and kept[-1].used == pytest.approx(300.0, rel=0.05)  # and no more is drawn
    assert velocity[-1, 2] == pytest.approx(-math.sqrt(Parameters().gravity / (Parameters().drag * density)), rel=1e-6)


@given(thrust=st.floats(0.0, 4.0), times=st.floats(1.0, 9.0), used=st.floats(0.0, 2e5))
def test_power_and_thrust_of_a_battery(thrust, times, used):
    """Power grows with thrust to the power of 1.5; the emptier, the less thrust is left, from all to `weak`."""
    b = Parameters()
    assert hovering(times * thrust, 1.0, b) == pytest.approx(times**1.5 * hovering(thrust, 1.0, b), abs=1e-9)
    share = left(used, b)
    assert share == 0.0 if used >= b.capacity else b.weak < share <= 1.0
    assert left(1.01 * used, b) <= share and left(0.0, b) == 1.0


def test_a_tired_battery_leaves_less_thrust():
    """Told to climb, with a tenth of the energy left: the largest thrust is that of the cells' voltage."""
    b = Parameters(battery="lithium", tilt_max=0.1, a_max=100.0)
    _, kept = flown(
        (0.0, 0.0, 99.0), 1.0, memory=Memory(used=0.9 * b.capacity), battery="lithium", tilt_max=0.1, a_max=100.0
    )
    assert kept[-1].thrust == pytest.approx(b.thrust_max * (1.0 - 0.9 * (1.0 - b.weak)), rel=1e-3)


def test_batteries_of_groups_differ_and_are_told(seed):
    keys = {
        "body.kind": "quadrotor", "body.battery": "lithium", "agents": 3, "start.separation": 5.0, "duration": 9.0,
        "groups": [{"name": "old", "agents": [1], "body": {"capacity": "0.1 Wh"}}],
    }  # fmt: skip
    flight = airflock.open(load("vasarhelyi_2018/4ms", keys), seed, device="python").advance(steps=400)
    used = [flight.look(agent).body.used for agent in range(3)]
    assert 360.0 <= used[1] < 380.0 and min(used[0], used[2]) > 500.0
    assert flight.look(1).body.thrust == pytest.approx(0.0, abs=1e-6) and flight.look(0).body.thrust > 0.5


FALLING = {
    "body.kind": "quadrotor", "body.battery": "lithium", "body.capacity": 450.0, "agents": 4, "duration": 8.0,
    "world.dimensions": "3", "world.walls": "every_edge", "world.floor": 0.0, "world.ceiling": 40.0,
    "start.separation": 5.0, "groups": [{"name": "new", "agents": [1], "body": {"capacity": "1 Wh"}}],
}  # fmt: skip


def test_whoever_falls_with_an_empty_battery_is_absent_on_the_ground(seed):
    """Motors stop after 3 s; from 40 m at most the ground is reached within 4 s more. The cuts change nothing."""
    scenario, found = load("vasarhelyi_2018/4ms", FALLING), []
    for steps in (1000, 7):
        flight = airflock.open(scenario, seed, record=True, device="python")
        while not flight.over:
            flight.advance(steps=steps)
        flight.finish()
        found.append(flight.frames.tobytes())
    heights = flight.frames[:, 2]
    assert found[0] == found[1] and np.nanmin(heights) > 0.0
    assert flight.present.tolist() == [False, True, False, False]
    assert np.isfinite(heights[flight.frame_times < 3.0]).all() and np.isfinite(heights[:, 1]).all()
    assert np.isnan(heights[-1, [0, 2, 3]]).all() and 0.25 < flight.scores()["present"] < 0.9


def test_a_note_says_what_becomes_of_whoever_is_empty():
    def said(**keys):
        return next(note for note in load("vasarhelyi_2018/4ms", FALLING | keys).notes if "motors stop" in note)

    assert said().endswith("its motors stop, and on the ground it is absent")
    free = {"world.floor": None, "world.ceiling": None}
    nowhere = free | {"world.arena": "none", "start.kind": "ball", "start.radius": 30.0}
    assert "falls without end, and counts; give a ground" in said(**nowhere)
    assert said(**nowhere | {"scene.kind": "forest"}).endswith("on the ground it is absent")
    assert said(**free | {"world.dimensions": "2"}).endswith("it stays in the plane and counts")


@pytest.mark.parametrize("battery", ["endless", "lithium"])
def test_any_cuts_of_a_flight_with_a_memory_give_its_bits(battery, seed):
    keys = {"body.kind": "quadrotor", "agents": 4, "duration": 4.0, "start.separation": 5.0, "wind.gust": 1.0}
    keys |= {"body.battery": battery, "body.capacity": 400.0}
    scenario, frames = load("vasarhelyi_2018/4ms", keys), []
    for steps in (400, 7, 1):
        flight = airflock.open(scenario, seed, record=True, device="python")
        while not flight.over:
            flight.advance(steps=steps)
        flight.finish()
        frames.append(flight.frames.tobytes())
    assert frames[0] == frames[1] == frames[2]


def test_a_body_that_is_changed_in_flight_begins_to_remember_anew(seed):
    scenario = load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 2.0, "start.separation": 5.0})
    flight = airflock.open(scenario, seed, device="python")
    flight.advance(steps=50)
    flight.change({"body.kind": "quadrotor"})
    assert flight._state.rows(["body2", "body9"]).tolist() == [[1.0] * 3] * 2
    flight.advance(steps=50)
    assert flight._state.is_finite and (flight._state.rows(["body2"]) < 1.0).any()


SLOW = """
from dataclasses import dataclass
from typing import NamedTuple
import airflock

ACCEPTS, INTEGRATION = "velocity", "new"

@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    lag: float = airflock.quantity(0.5, "s", low=0.01, high=9.0, meaning="lag of what it was told")

class Memory(NamedTuple):
    told_x: float = 0.0
    told_y: float = 0.0
    told_z: float = 0.0

def move(cx, cy, cz, memory, dt, b):
    k = dt / b.lag
    kept = Memory(memory.told_x + k * (cx - memory.told_x), memory.told_y + k * (cy - memory.told_y), 0.0 * cz)
    return kept.told_x, kept.told_y, kept.told_z, kept
"""


def test_a_body_of_ones_own_remembers_from_one_file(tmp_path, seed):
    """Nothing inside changes: a lag of half a second, as the reference flies it and by its closed form."""
    from airflock.engine import fly_world
    from reference.flight import fly_plainly

    (tmp_path / "slow.py").write_text(SLOW)
    keys = {"agents": 3, "duration": 3.0, "start.separation": 5.0}
    scenario = load("vasarhelyi_2018/4ms", keys, body=str(tmp_path / "slow.py"))
    assert airflock.check_body(scenario.body.rule).broken == ()
    ours = fly_world(scenario, seed, precision=64, record=True, device="python")
    np.testing.assert_array_equal(ours.frames, fly_plainly(scenario, seed).frames)
    memory, b = scenario.body.rule.Memory(), scenario.body.numbers
    for _ in range(100):
        given = {"cx": 2.0, "cy": 0.0, "cz": 0.0, "memory": memory, "dt": 0.01, "b": b}
        *velocity, memory = call_rule(scenario.body.rule.move, "move", given)
    assert velocity[0] == pytest.approx(2.0 * (1.0 - (1.0 - 0.01 / 0.5) ** 100), rel=1e-12)


def test_a_memory_without_a_rule_for_it_is_refused():
    class Forgetful:
        ACCEPTS, INTEGRATION, Parameters = "velocity", "new", Parameters

        class Memory(NamedTuple):
            x: float = 0.0

        def move(cx, cy, cz):
            return cx, cy, cz

    with pytest.raises(RuleError, match="come together"):
        airflock.body(Forgetful)

    class Startless(Forgetful):
        class Memory(NamedTuple):
            x: float

        def move(cx, cy, cz, memory):
            return cx, cy, cz, memory

    with pytest.raises(RuleError, match="all have a value for the start"):
        airflock.body(vars(Forgetful) | vars(Startless))
