"""Radios in flight: as the reference, any cuts, branches and changes; with faults; and a radio of a user's own."""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world, plan_of
from airflock.parts import RADIOS
from airflock.scenarios.files import load
from airflock.support.errors import RuleError, ScenarioError
from flocks import ISLANDS
from inside import no_cuda
from reference.flight import fly_plainly

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 5, "duration": 3.0, "world.side": 60.0, "start.separation": 5.0, "radio.delay": 0.3}
NUMBERS = {
    "constant": {"radio.loss": 0.5, "radio.loss_at": 30.0}, "links": {"radio.near": 5.0, "radio.far": 25.0},
    "table": {"radio.spacing": 4.0}, "congestion": {"radio.airtime": 0.02},
    "shadow": {"radio.near": 5.0, "radio.far": 25.0, "world.obstacles": ISLANDS},
    "bursts": {"radio.outage_rate": 1.0, "radio.outage_time": 0.5}, "jitter": {"radio.jitter": 0.2},
    "vision": {"radio.field": 4.0, "radio.hold": 1.0, "world.obstacles": ISLANDS},
}  # fmt: skip
PAGE = Path(__file__).parents[2] / "docs" / "radios.md"


def over(kind, **more):
    return load(PAPER, SMALL | {"radio.kind": kind} | NUMBERS[kind] | more)


@pytest.mark.parametrize("kind", RADIOS)
@pytest.mark.parametrize("dims", ["2", "3"])
def test_a_radio_flies_as_the_reference_does(kind, dims, seed):
    scenario = over(kind, **{"world.dimensions": dims})
    known = fly_plainly(scenario, seed)
    found = fly_world(scenario, seed, record=True, device="python")
    np.testing.assert_allclose(found.frames, known.frames, atol=1e-9)
    free = fly_world(
        over("constant", **{"world.dimensions": dims, "radio.loss": 0.0}), seed, record=True, device="python"
    )
    assert np.abs(found.frames - free.frames).max() > 1e-3  # it does something


class Kept(NamedTuple):
    """How many packets came in a row."""

    row: float = 1.0


def everything(u0, g1, clear, talkers, distance, dx, dz, age, step, period, packet, k):
    lucky = u0 + 0.1 * g1 < 0.9 - 0.1 * talkers / (1.0 + talkers) - 0.3 * (1.0 - clear) - 0.001 * abs(dx - dz)
    came = 1.0 if lucky and packet.row < 6.0 and distance < k.range and age > 0.5 * period and step > 1.0 else 0.0
    return came, Kept(packet.row + 1.0 if came > 0.5 else 0.0)


def waits(u1, talkers, clear):
    return 0.3 * u1 + 0.01 * talkers + 0.1 * (1.0 - clear)


def half(x, y, z, vx, vy, vz, age):
    return x + 0.5 * vx * age, y + 0.5 * vy * age, z + 0.5 * vz * age


WHOLE = {"receive": everything, "late": waits, "carry": half, "Packet": Kept}


@pytest.mark.parametrize("dims", ["2", "3"])
def test_a_radio_that_asks_for_everything_flies_compiled_as_the_reference_does(dims, seed):
    keys = SMALL | {"world.dimensions": dims, "world.obstacles": ISLANDS, "radio.loss": 0.2, "duration": 6.0}
    keys |= {"metrics.kind": "order"}
    scenario = load(PAPER, keys, radio=airflock.radio(WHOLE, "whole"))
    known = fly_plainly(scenario, seed)
    devices = ("python", "cpu") if dims == "2" else ("python",)
    for device in devices:
        found = fly_world(scenario, seed, record=True, device=device, precision=64)
        np.testing.assert_allclose(found.frames, known.frames, atol=1e-9)


@pytest.mark.parametrize("kind", ["bursts", "jitter", "shadow"])
def test_cuts_snapshots_and_branches_keep_the_bits(kind):
    scenario = over(kind)
    closed = airflock.open(scenario, 4, device="python").advance(3.0)
    flight = airflock.open(scenario, 4, device="python").advance(steps=37).advance(steps=58)
    kept, branch = flight.snapshot(), flight.branch()
    flight.advance(1.0)
    flight.restore(kept).advance(3.0 - flight.time)
    branch.advance(3.0 - branch.time)
    assert np.array_equal(flight.state, closed.state) and np.array_equal(branch.state, closed.state)


def test_an_open_flight_takes_another_radio_and_looks_through_it():
    """What was heard stays known; what is under way and what a radio keeps of a pair begin anew."""
    flight = airflock.open(over("jitter"), 4, device="python").advance(steps=101)
    before = {heard.who: heard.age for heard in flight.look(0).heard}
    assert before and all(age >= 0.3 for age in before.values())
    flight.change({"radio.kind": "bursts", "radio.received_good": 0.0}).advance(steps=20)
    after = {heard.who: heard.age for heard in flight.look(0).heard}
    assert set(after) == set(before) and all(after[who] > before[who] for who in before)
    flight.change({"radio.kind": "constant"}).advance(steps=20)
    assert all(heard.age == pytest.approx(0.3) for heard in flight.look(0).heard)


@pytest.mark.parametrize("kind", ["bursts", "jitter", "congestion"])
@pytest.mark.parametrize("fault", ["radio_deaf", "radio_silent", "radio_range", "fails"])
def test_faults_and_absence_come_on_top_of_a_radio(kind, fault, seed):
    ill = over(kind, faults=[{"kind": fault, "at": 0.9, "agents": [2]}])
    found = fly_world(ill, seed, record=True, device="python").frames
    np.testing.assert_allclose(found, fly_plainly(ill, seed).frames, atol=1e-9)


def of_page(name):
    """A file that the documentation shows."""
    return re.search(rf"```python\n# {name}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S).group(1)


def test_a_radio_of_ones_own_is_one_file_outside_the_package(tmp_path, seed):
    """Those of the documentation: by consent only, as the reference does, checked and typed."""
    for name in ("rain.py", "duty.py"):
        (tmp_path / name).write_text(of_page(name), encoding="utf-8")
        text = f'extends = "{PAPER}"\nagents = 4\nduration = 2.0\n[radio]\nkind = "{name}"\ndelay = "200 ms"\n'
        (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match="if you trust it, add --trust"):
            load(tmp_path / "mine.toml")
        scenario = load(tmp_path / "mine.toml", trust=True)
        assert scenario.radio.delay == 0.2 and scenario.radio.rule.name == name[:-3]
        found = fly_world(scenario, seed, record=True, device="python").frames
        np.testing.assert_allclose(found, fly_plainly(scenario, seed).frames, atol=1e-9)
        given = load(PAPER, {"agents": 4, "duration": 2.0, "radio.delay": 0.2}, radio=tmp_path / name)
        assert np.array_equal(fly_world(given, seed, record=True, device="python").frames, found)
        airflock.check_radio(str(tmp_path / name))


def test_a_radio_that_may_send_once_a_second_is_heard_once_a_second(tmp_path):
    (tmp_path / "duty.py").write_text(of_page("duty.py"), encoding="utf-8")
    keys = {"agents": 3, "duration": 5.0, "radio.delay": 0.0, "radio.range": 1e4, "radio.pause": 1.0}
    flight = airflock.open(load(PAPER, keys, radio=tmp_path / "duty.py"), 1, device="python")
    stamps = {float(flight.advance(0.2).sent[0, 1]) for _ in range(20)}
    assert sorted(stamps) == pytest.approx([0.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ({}, "radio mine has no rule; give missed or receive, late, see, carry, lasts"),
        ({"missed": waits, "receive": waits}, "asks for 'u1'"),
        ({"carry": half}, "radio mine has only carry; give missed, receive, late or see as well"),
        ({"receive": everything}, "that asks for packet and a NamedTuple Packet come together"),
        ({"late": waits, "RATES": ("rate",)}, r"RATES = \('rate',\) are not at most two numbers of Parameters"),
    ],
)
def test_what_is_no_radio_is_said_in_one_line(rules, said):
    with pytest.raises(RuleError, match=said):
        airflock.radio(rules, "mine")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"radio.kind": "lnks"}, "radio.kind = 'lnks': unknown radio; did you mean links"),
        ({"radio.kind": "table", "radio.near": 3.0}, "radio.near: unknown key; it belongs to radio.kind"),
        ({"radio.kind": "jitter", "radio.jitter": -1.0}, r"radio.jitter = -1 s lies outside \[0, 30\] s"),
        ({"radio.kind": "table", "update": "sequential", "radio.delay": 0.0}, "set radio.kind = 'constant'"),
    ],
)
def test_a_wrong_key_of_a_radio_is_said_in_one_line(keys, said):
    with pytest.raises(ScenarioError, match=said):
        load(PAPER, keys)


def test_a_gpu_flies_every_radio():
    assert [kind for kind in RADIOS if no_cuda(plan_of(over(kind)), 5)] == []


def test_a_radio_given_directly_stays_through_changes_and_its_recordings_are_scored():
    scenario = load(PAPER, {**SMALL, "duration": 1.0}, radio={**WHOLE, "NAME": "whole"})
    flight = airflock.open(scenario, 2, device="python").advance(0.5).change({"model.p_rep": 0.2})
    assert flight.scenario.radio.rule.receive is everything and flight.scenario.parameters.p_rep == 0.2
    recording = airflock.simulate(scenario, 2, device="python")
    scored = float(airflock.score(recording)["phi_vel"].iloc[0])
    assert scored == pytest.approx(fly_world(scenario, 2, device="python").values["phi_vel"], rel=1e-5)
