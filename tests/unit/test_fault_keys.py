"""Keys of faults: in settings and in flight they mean what the file would; what is wrong is one line, all at once."""

import re
import tracemalloc

import numpy as np
import pytest

import airflock
from airflock.engine import fly_world
from airflock.scenarios.files import load
from airflock.support.errors import ScenarioError

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 4, "duration": 3.0, "dt": 0.05, "world.side": 60.0, "start.separation": 5.0}
WEAK = {"kind": "motor", "at": 0.5, "agents": [1], "share": 0.0}
LATE = {"kind": "motor", "at": 2.0, "agents": [2]}
DEAF = {"kind": "radio_deaf", "at": 1.0, "agents": [3]}


def flock(settings=None, faults=(WEAK, DEAF)):
    return load(PAPER, SMALL | {"faults": list(faults)} | (settings or {}))


def frames(scenario, seed):
    return fly_world(scenario, seed, record=True, device="python").frames


def lines_of(settings=None, faults=(WEAK, DEAF)):
    with pytest.raises(ScenarioError) as caught:
        flock(settings, faults)
    return [line.removeprefix(f"{PAPER}: ") for line in str(caught.value).splitlines()]


@pytest.mark.parametrize(("key", "value", "number", "written"), [
    ("faults.motor.share", 0.4, 0, {"share": 0.4}),
    ("faults.0.share", 0.4, 0, {"share": 0.4}),
    ("faults.1.agents", [0], 1, {"agents": [0]}),
    ("faults.motor.at", "1000 ms", 0, {"at": 1.0}),
])  # fmt: skip
def test_a_key_means_what_the_file_would(key, value, number, written, seed):
    tables = [WEAK, DEAF]
    tables[number] = {**tables[number], **written}
    found, known = flock({key: value}), flock(faults=tables)
    assert found.faults == known.faults != flock().faults
    assert np.array_equal(frames(found, seed), frames(known, seed))
    assert WEAK["share"] == 0.0  # what was given is left as it was


@pytest.mark.parametrize(("key", "said"), [
    ("faults.share", "write faults.KIND.KEY or faults.NUMBER.KEY"),
    ("faults.2.share", "there is no fault 2; the scenario has the faults 0 to 1"),
    ("faults.moter.share", "the scenario has no fault 'moter'; did you mean motor?"),
    ("faults.motor.shar", "faults[0].shar: unknown key; did you mean faults[0].share?"),
    ("faults.motor.share", "faults[0].share = 7 lies outside [0, 1]"),
])  # fmt: skip
def test_a_wrong_key_is_one_line(key, said):
    (line,) = lines_of({key: 7})
    assert said in line and line.startswith("faults")


def test_a_kind_that_comes_twice_is_named_by_its_number():
    (line,) = lines_of({"faults.motor.share": 0.5}, [WEAK, DEAF, LATE])
    assert "2 faults are of this kind; write one of faults.0.share, faults.2.share" in line
    (line,) = lines_of({"faults.motor.share": 0.5}, [])
    assert "the scenario has no [[faults]]" in line


def test_a_kind_of_ones_own_is_named_by_its_file(tmp_path):
    (tmp_path / "lame.py").write_text(
        "from dataclasses import dataclass\nimport airflock\n\n\n@dataclass(frozen=True, kw_only=True)\n"
        "class Parameters(airflock.Parameters):\n"
        '    """A limp."""\n\n    left: float = airflock.quantity(0.5, "1", low=0.0, high=1.0, meaning="share")\n\n\n'
        "def motion(vx, vy, vz, nx, ny, nz, f):\n    return f.left * nx, f.left * ny, f.left * nz\n"
    )
    entry = {"kind": str(tmp_path / "lame.py"), "at": 0.0}
    made = load(PAPER, SMALL | {"faults": [entry], "faults.lame.left": 0.25}, trust=True)
    assert made.faults[0].numbers.left == 0.25


def test_all_that_is_wrong_with_an_entry_is_told():
    """Neither an unknown kind nor an unknown agent hid the times; a unit that cannot be made `at` seem forgotten."""
    assert len(lines_of(faults=[{"kind": "moter", "at": -1.0, "agents": [9]}])) == 3
    lines = lines_of(faults=[{**WEAK, "agents": [9], "until": 0.1, "lasts": 1.0}])
    assert [any(word in line for line in lines) for word in ("no agent 9", "says twice", "not after at")] == [True] * 3
    (line,) = lines_of(faults=[{"kind": "motor", "per_hour": "2 1/h"}])
    assert "faults[0].per_hour = 2 1/h: has no unit" in line


def test_a_fault_after_the_end_is_noted():
    (note,) = flock(faults=[{**WEAK, "at": 3.0}, DEAF]).notes
    assert note.startswith("faults[0].at = 3 s: the flight is over by then, after duration = 3 s")
    assert not flock().notes


def motions(settings, seed, before=(WEAK, {**WEAK, "agents": [2]})):
    """Which agents change their velocities in the last second, after a change at 1 s; and whom faults are told of."""
    flight = airflock.open(flock(faults=before), seed, device="python").advance(1.0)
    if settings:
        flight.change(settings)
    was = flight.state[2:].copy()
    moved = np.abs(flight.advance(1.0).state[2:] - was).max(axis=0) > 1e-9
    return np.nonzero(moved)[0].tolist(), [fault["agent"] for fault in flight.faults]


def test_what_is_taken_out_in_flight_ends_and_what_stays_goes_on(seed):
    """An entry that was taken out went on as long as another one was of its kind, and was no longer told of."""
    assert motions({}, seed) == ([0, 3], [1, 2])
    assert motions({"faults": [WEAK]}, seed) == ([0, 2, 3], [1])
    assert motions({"faults": []}, seed) == ([0, 1, 2, 3], [])
    assert motions({"faults.0.share": 1.0}, seed) == ([0, 1, 3], [1, 2])
    assert motions({"faults.0.until": 1.2}, seed) == ([0, 1, 3], [1, 2])
    assert motions({"model.v_flock": 3.0}, seed) == ([0, 3], [1, 2])


def test_what_would_have_begun_earlier_does_not_begin(seed):
    """It was told of, and nobody suffered."""
    assert motions({"faults": [{**WEAK, "agents": [3]}]}, seed, [WEAK]) == ([0, 1, 2, 3], [])


def test_in_a_branch_what_has_begun_goes_on():
    """A battery that was failing emptied in the world that it began in, and in no other."""
    failing = {"kind": "battery", "endurance": 1.0, "per_hour": 1800.0, "number": 1}
    flights = (airflock.open(flock(faults=[failing]), number, device="python").advance(0.6) for number in range(99))
    flight = next(flight for flight in flights if flight.faults)
    begun = flight.faults
    branch = flight.branch(2).change({"model.v_flock": 3.0})
    assert branch.faults == begun
    branch.advance(begun[0]["begin"] + 1.05 - branch.time)
    assert not branch.present[begun[0]["agent"]] and branch.faults[: len(begun)] == begun
    assert branch.add(begun[0]["agent"], [0.0, 0.0]).faults[: len(begun)] == begun


def test_a_group_does_not_repeat_what_is_wrong_with_all():
    groups = [{"name": "weak", "agents": 1, "body": {"a_max": 3.0}}, {"name": "rest"}]
    (line,) = lines_of({"body.kind": "quadrotor", "groups": groups})
    assert line.startswith("dt = 0.05 s: body quadrotor")


def test_a_spread_is_named_as_it_is_written():
    groups = [{"name": "all", "model": {"p_rep": {"value": 0.1, "spread": "10 m"}}}]
    (line,) = lines_of({"groups": groups})
    assert line.startswith("groups[0].model.p_rep.spread = 10 m: the unit is 1/s")


HUGE = {"agents": 1e7, "world.side": 1e6, "metrics.kind": "order", "duration": 1e6}
ONE = {"kind": "motor", "at": 1.0}


@pytest.mark.parametrize(("faults", "groups", "said"), [
    ([ONE] * 14, [], "14 entries of all 10000000 agents are 140,000,000 agents to look at"),
    ([ONE | {"group": "a"}] * 14, [{"name": "a"}], "14 entries of all 10000000 agents are 140,000,000 agents"),
    ([ONE, ONE | {"group": "a"}], [{"name": "a", "agents": "50 %"}], "2 entries of groups or all of 10000000 agents"),
    ([{"kind": "motor", "per_hour": 1e6}], [], "about 277,777,778 agents to hit within duration = 1e+06 s are more"),
])  # fmt: skip
def test_faults_of_very_many_agents_are_counted_before_their_lists_are_made(faults, groups, said):
    """Fourteen entries of all ten million agents are 929 bytes of text, and were 5 GB of numbers."""
    tracemalloc.start()
    try:
        with pytest.raises(ScenarioError, match=re.escape(said)):
            airflock.load("vicsek_1995/ordered", HUGE | {"faults": faults, "groups": groups})
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


KEYS = airflock.keys()
COUNTS = [key for key in KEYS if key.kind == "number" and key.unit in ("", "1") and key.high >= 1000.0]


@pytest.mark.parametrize("key", COUNTS, ids=lambda key: key.name)
def test_no_count_that_is_refused_fills_memory(key):
    """Neither alone nor beside the largest flock, in groups with faults: all is counted, and nothing listed."""
    many = HUGE | {"groups": [{"name": "a", "agents": "50 %"}, {"name": "b"}], "faults": [ONE], "world.side": -1.0}
    kind = {} if key.name.startswith("faults") or not key.of else {f"{key.name.partition('.')[0]}.kind": key.of}
    tracemalloc.start()
    try:
        with pytest.raises(ScenarioError, match="world.side = -1 m"):
            airflock.load("vicsek_1995/ordered", many | kind | {key.name.replace("faults.", "faults.0."): key.high})
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()
