"""Sensors in flight: any cuts, branches and changes; with faults; and a sensor of a user's own, from a file."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world
from airflock.parts import SENSORS
from airflock.scenarios.files import load
from airflock.support.errors import RuleError, ScenarioError
from reference.flight import fly_plainly

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 5, "duration": 3.0, "world.side": 60.0, "start.separation": 5.0}
NUMBERS = {
    "gnss": {
        "sensors.drift_time": 1.0, "sensors.bias": 1.0, "sensors.white": 0.3, "sensors.jump_rate": 0.7,
        "sensors.jump_time": 0.5, "sensors.outage_rate": 0.7, "sensors.outage_time": 0.5,
    },
    "delayed": {"sensors.lag": 0.3}, "langevin": {}, "perfect": {},
}  # fmt: skip


def with_sensor(kind, **more):
    return load(PAPER, SMALL | {"sensors.kind": kind} | NUMBERS[kind] | more)


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("dims", ["2", "3"])
def test_a_sensor_flies_as_the_reference_does(kind, dims, seed):
    scenario = with_sensor(kind, **{"world.dimensions": dims, "radio.delay": 0.3})
    known = fly_plainly(scenario, seed)
    found = fly_world(scenario, seed, record=True, device="python")
    np.testing.assert_allclose(found.frames, known.frames, atol=1e-9)


@pytest.mark.parametrize("kind", SENSORS)
def test_cuts_snapshots_and_branches_keep_the_bits(kind):
    scenario = with_sensor(kind)
    closed = airflock.open(scenario, 4, device="python").advance(3.0)
    flight = airflock.open(scenario, 4, device="python").advance(steps=37).advance(steps=58)
    kept, branch = flight.snapshot(), flight.branch()
    flight.advance(1.0)
    assert not np.array_equal(flight.state, closed.state)
    flight.restore(kept).advance(3.0 - flight.time)
    branch.advance(3.0 - branch.time)
    assert np.array_equal(flight.state, closed.state) and np.array_equal(branch.state, closed.state)


def test_an_open_flight_takes_another_sensor_and_its_numbers():
    """What a sensor remembers goes on where only numbers change, and begins anew with another kind."""
    still = {"body.noise": 0.0, "sensors.bias": 2.0, "sensors.white": 0.0, "sensors.jump_rate": 0.0,
             "sensors.outage_rate": 0.0, "sensors.sd": 0.0, "sensors.sd_velocity": 0.0}  # fmt: skip
    flight = airflock.open(with_sensor("gnss", **still), 4, device="python").advance(steps=1)

    def off():
        return (flight.measured - flight.state)[:2]

    first = off()
    assert np.abs(first).min() > 1e-3
    flight.advance(steps=20).change({"sensors.sd_velocity": 0.1}).advance(steps=20)
    # a measurement is some steps old, the bias is that of the beginning
    view = flight.look(2)
    assert view.own.x - view.true.x == pytest.approx(first[0, 2], abs=0.5)
    flight.change({"sensors.kind": "perfect"}).advance(steps=20)
    assert np.array_equal(flight.measured, flight.state)
    flight.change({"sensors.kind": "delayed", "sensors.lag": 0.2}).advance(steps=40)
    late = flight.look(2)
    assert 0.0 < math.hypot(late.own.x - late.true.x, late.own.y - late.true.y) < 0.2 * 8.0 + 0.1


def test_who_joins_measures_as_at_the_start_and_the_others_as_before():
    alone = {"radio.range": 0.0, "world.arena": "none", "world.walls": "every_edge"}
    alone |= {"start.kind": "ball", "start.radius": 100.0, "start.separation": 0.0}
    scenario = with_sensor("gnss", **alone)
    known = airflock.open(scenario, 4, device="python").advance(2.0)
    flight = airflock.open(scenario, 4, device="python").advance(0.5).remove(1).advance(0.7)
    flight.add(1, [500.0, 0.0]).advance(0.8)
    others = [0, 2, 3, 4]
    assert np.array_equal(flight.state[:, others], known.state[:, others])
    assert np.isfinite(flight.state).all()


@pytest.mark.parametrize("fault", ["gnss_offset", "gnss_drift", "gnss_frozen", "gnss_spoofed"])
def test_faults_of_satellite_navigation_come_on_top_of_a_sensor(fault, seed):
    ill = with_sensor("gnss", faults=[{"kind": fault, "at": 1.0, "agents": [2]}], **{"radio.range": 1e4})
    found = fly_world(ill, seed, record=True, device="python").frames
    np.testing.assert_allclose(found, fly_plainly(ill, seed).frames, atol=1e-9)
    sound = airflock.open(with_sensor("gnss", **{"radio.range": 1e4}), seed, device="python").advance(1.01)
    flight = airflock.open(ill, seed, device="python").advance(1.01)
    apart = (flight.measured - sound.measured)[:2]
    assert np.array_equal(apart[:, [0, 1, 3, 4]], np.zeros((2, 4)))
    if fault == "gnss_offset":  # to the rounding of one sum
        np.testing.assert_allclose(apart[:, 2], [10.0, 0.0], atol=1e-9)


def test_what_is_sent_carries_the_error_of_the_last_measurement():
    """A bias is the same in what an agent measures and in what the others hear of it."""
    keys = {"sensors.bias": 3.0, "sensors.sd": 0.0, "sensors.white": 0.0, "sensors.sd_velocity": 0.0,
            "sensors.jump_rate": 0.0, "sensors.outage_rate": 0.0, "radio.delay": 0.2, "radio.range": 1e4}  # fmt: skip
    flight = airflock.open(with_sensor("gnss", **keys), 4, device="python").advance(steps=41)
    bias = (flight.measured - flight.state)[:2]
    before = airflock.open(with_sensor("gnss", **keys), 4, device="python").advance(steps=20)
    heard = {h.who: h.state for h in flight.look(0).heard}
    for who, state in heard.items():
        assert state.x - before.state[0, who] == pytest.approx(bias[0, who], abs=0.2)
        assert abs(bias[0, who]) > 1e-3


OWN = Path(__file__).parents[2] / "docs" / "sensors.md"


def of_page(name):
    """A file that the documentation shows."""
    return re.search(rf"```python\n# {name}\n(.*?)```", OWN.read_text(encoding="utf-8"), re.S).group(1)


def test_a_sensor_of_ones_own_is_one_file_outside_the_package(tmp_path, seed):
    """Those of the documentation: by consent only, as the reference does, in float32, checked and typed."""
    for name in ("compass.py", "white.py"):
        (tmp_path / name).write_text(of_page(name), encoding="utf-8")
        text = f'extends = "{PAPER}"\nagents = 4\nduration = 2.0\n[sensors]\nkind = "{name}"\nperiod = "100 ms"\n'
        (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match="if you trust it, add --trust"):
            load(tmp_path / "mine.toml")
        scenario = load(tmp_path / "mine.toml", trust=True)
        assert scenario.sensors.period == 0.1 and scenario.sensors.rule.name == name[:-3]
        found = fly_world(scenario, seed, record=True, device="python").frames
        np.testing.assert_allclose(found, fly_plainly(scenario, seed).frames, atol=1e-9)
        given = load(PAPER, {"agents": 4, "duration": 2.0, "sensors.period": 0.1}, sensor=tmp_path / name)
        assert np.array_equal(fly_world(given, seed, record=True, device="python").frames, found)
        airflock.check_sensor(str(tmp_path / name))
    keys = {"agents": 2, "duration": 1.0, "sensors.off": 0.5, "start.speed": 3.0}
    turned = load(PAPER, keys, sensor=tmp_path / "compass.py")
    kept = airflock.simulate(turned, 1, device="python", keep=("measured",)).isel(time=slice(None, -1))
    true, own = (kept[name].transpose(..., "space").values for name in ("velocity", "measured_velocity"))
    turn = np.array([[math.cos(0.5), -math.sin(0.5)], [math.sin(0.5), math.cos(0.5)]])
    np.testing.assert_allclose(own, true @ turn.T, atol=1e-6)  # recordings are in single precision
    assert np.array_equal(kept["measured_position"], kept["position"])


def two_of_six(x, y):
    return x, y


def one_of_two(dx):
    return dx


def remembers(x, y, z, vx, vy, vz, memory):
    return x, y, z, vx, vy, vz


def asks_for_more(x, altitude):
    return x


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ({}, "sensor mine has no rule; give measure, or error"),
        ({"measure": two_of_six, "error": two_of_six}, "has measure and error; give measure, or error"),
        ({"measure": asks_for_more}, r"mine.measure\(x, altitude\) asks for 'altitude'"),
        ({"measure": remembers}, "that asks for memory and a NamedTuple Memory come together"),
        ({"measure": two_of_six}, "mine.measure must return x, y, z, vx, vy, vz"),
        ({"error": one_of_two}, "mine.error must return dx, dv"),
    ],
)
def test_what_is_no_sensor_is_said_in_one_line(rules, said):
    with pytest.raises(RuleError, match=said):
        fly_world(load(PAPER, {**SMALL, "duration": 0.1}, sensor=airflock.sensor(rules, "mine")), 1, device="python")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"sensors.kind": "gns"}, "sensors.kind = 'gns': unknown sensor; did you mean gnss"),
        ({"sensors.kind": "gnss", "sensors.noise": 0.1}, "sensors.noise: unknown key"),
        ({"sensors.kind": "gnss", "sensors.sd": -1.0}, r"sensors.sd = -1 m lies outside \[0, 1000\] m"),
        ({"sensors.kind": "delayed", "sensors.lag": 2.0}, "sensors.lag = 2 s is more than 4 periods of 0.2 s"),
        ({"sensors.kind": "gnss", "update": "sequential", "radio.delay": 0.0}, "set sensors.kind = 'perfect'"),
    ],
)
def test_a_wrong_key_of_a_sensor_is_said_in_one_line(keys, said):
    with pytest.raises(ScenarioError, match=said):
        load(PAPER, keys)


def mirrored(x, y, z, vx, vy, vz):
    return x, y, z, -vx, vy, vz


def test_a_sensor_given_directly_stays_through_changes_and_its_recordings_are_scored():
    scenario = load(PAPER, {**SMALL, "duration": 1.0}, sensor={"measure": mirrored, "NAME": "mirror"})
    flight = airflock.open(scenario, 2, device="python").advance(0.5).change({"model.p_rep": 0.2})
    assert flight.scenario.sensors.rule.measure is mirrored and flight.scenario.parameters.p_rep == 0.2
    recording = airflock.simulate(scenario, 2, device="python")
    scored = float(airflock.score(recording)["phi_vel"].iloc[0])
    assert scored == pytest.approx(fly_world(scenario, 2, device="python").values["phi_vel"], rel=1e-5)
