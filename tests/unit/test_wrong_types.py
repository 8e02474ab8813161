"""What a caller gives by mistake ends in one line that names it and says what to give, whatever its type."""

import itertools
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.recordings.imports.load_tracks import load_tracks
from airflock.scenarios import events
from airflock.scenarios.files import load

PAPER = "vasarhelyi_2018/4ms"
SMALL = {"agents": 3, "duration": 0.2}
WRONG = [pd.NA, "two", [1.0], {"a": 1}, object()]


def tracks(**options):
    t = np.arange(20) * 0.1
    table = pd.DataFrame({"t": np.tile(t, 2), "id": np.repeat(["a", "b"], 20), "x": np.tile(t, 2), "y": 0.0})
    return load_tracks(table, **options)


def told(call):
    """The lines of the error that a call ends with."""
    with pytest.raises(airflock.AirflockError) as fault:
        call()
    return str(fault.value).splitlines()


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("name", ["fps", "rate", "scale", "begin", "end", "bridge", "origin", "precision", "map"])
def test_an_option_of_an_import_that_is_none_is_named(name, wrong):
    if (name, wrong) == ("map", {"a": 1}):
        assert told(lambda: tracks(map=wrong)) == ["map: a = 1 is no text; an expression is one"]
        return
    line, *more = told(lambda: tracks(**{name: wrong}))
    assert line.startswith(f"{name} = ") and not more


def test_one_kind_of_fault_may_stand_without_a_list():
    assert tracks(accept="jumps").identical(tracks(accept=["jumps"]))
    assert told(lambda: tracks(accept="jump")) == [
        "accept = jump is none of absent, axes, down, duplicates, height, jumps, rows, time"
    ]
    assert len(told(lambda: tracks(accept=None))) == 1


@pytest.mark.parametrize("wrong", [None, 3, 2.5, [1], object()])
def test_what_holds_no_rules_is_told_so(wrong):
    end = " holds no rules; give a module, a class, or names such as globals()"
    for name in ("model", "body", "sensor", "radio", "topology"):
        assert told(lambda name=name: getattr(airflock, f"check_{name}")(wrong))[0].endswith(end), name
    if wrong is not None:
        for name in ("body", "sensor", "radio", "topology", "faults"):
            assert told(lambda name=name: load(PAPER, **{name: wrong}))[0].endswith(end), name


@pytest.mark.parametrize(
    ("name", "kind", "line"),
    [
        ("model", "reynolds_1987", "model.sped: unknown key"),
        ("body", "multirotor", "body.sped: unknown key"),
        ("sensor", "gnss", "sensors.sped: unknown key"),
        ("radio", "shadow", "radio.sped: unknown key"),
        ("topology", "nearest", "topology.sped: unknown key"),
    ],
)
def test_a_number_that_a_rule_does_not_have_is_told_by_its_check(name, kind, line):
    check = getattr(airflock, f"check_{name}")
    assert told(lambda: check(kind, {"sped": 1.0}))[0].startswith(line)
    assert "are no keys with values" in told(lambda: check(kind, [1.0]))[0]
    assert told(lambda: check(kind, seed="one")) == ["seed = 'one' is not a whole number in [0, 2^64 - 1]"]


def test_flights_are_counted_before_they_are_listed(monkeypatch):
    """Lists that never end filled the memory; a flock's agents were compared each with each."""
    many, endless = range(10**11), itertools.count()
    grid = "over: a grid of 10000200001 points or more, which is more than 100000"
    assert told(lambda: airflock.sweep(PAPER, {"dt": many, "radio.delay": endless})) == [grid]
    monkeypatch.setattr(events, "MAX_FLIGHTS", 1000)
    for seeds in (many, endless):
        assert told(lambda seeds=seeds: events.check_seeds(seeds)) == ["seeds: more than 1000 flights at a time"]
    assert events.check_agents(range(200_000), 200_000)[-1] == 199_999


def test_what_is_no_flight_and_what_are_no_events_is_told():
    assert told(lambda: airflock.recording_of(3)) == ["int is no open flight; airflock.open gives one"]
    for wrong in (None, 3):
        line = f"events = {wrong}: give a list of events, such as those of a flight"
        assert told(lambda events=wrong: airflock.open(load(PAPER, SMALL), 1, events=events)) == [line]


def test_what_is_no_law_and_what_holds_no_tracks_is_told_before_anything_is_fitted():
    assert told(lambda: airflock.infer(3)) == ["int holds no tracks; give recordings or files"]
    assert told(lambda: airflock.infer(tracks(), 3)) == [
        "infer: models = 3: give a list of laws, such as ['couzin_2002']"
    ]
    assert told(lambda: airflock.infer(tracks(), [None])) == [
        "None is not a law; give a name of ours, a preset, a scenario file or a Scenario"
    ]
    assert told(lambda: airflock.infer(tracks(), "couzin_2002")) == [
        "recording 1: 20 frames are too few to infer a law from; 120 or more"
    ]


def test_a_number_without_a_range_is_told():
    assert told(lambda: airflock.quantity(1.0, "m", low=0.0, high=None, meaning="reach")) == [
        "high = None is not a number (reach)"
    ]


def test_a_static_method_is_told_to_be_a_plain_function():
    class Height:
        REPORTS = {"height": ("m", "mean height")}  # noqa: RUF012

        class Sample(NamedTuple):
            height: float

        @staticmethod
        def sample(mean):
            return Height.Sample(mean.z)

    lines = told(lambda: airflock.score(load(PAPER, SMALL, metrics=Height)))
    assert lines[0].endswith("rule sample: has a decorator; a rule is a plain function")


def test_a_law_is_checked_by_the_path_of_its_file():
    source = Path(__file__).parents[2] / "examples" / "own_rule.py"
    assert str(airflock.check_model(source)) == str(airflock.check_model(str(source)))


@pytest.mark.parametrize("wrong", WRONG)
def test_other_calls_name_what_they_cannot_use(wrong):
    recording = tracks()
    calls = {
        "Parameters.v_flock = ": lambda: airflock.starting_set(wrong),
        "body_length = ": lambda: airflock.score(recording, body_length=wrong),
        "threads = ": lambda: airflock.score(load(PAPER, SMALL), threads=wrong),
    }
    if not isinstance(wrong, dict):
        calls["over = "] = lambda: airflock.sweep(load(PAPER, SMALL), wrong)
    for start, call in calls.items():
        line, *more = told(call)
        assert line.startswith(start) and not more, line
    if not isinstance(wrong, str):
        assert len(told(lambda: airflock.keys(wrong))) == 1
        write = (lambda path: airflock.save(recording, path), lambda path: airflock.export(recording, path))
        for call in (airflock.load_recording, *write):
            assert "is not a name of a file; give a text or a Path" in told(lambda call=call: call(wrong))[0]
    if not isinstance(wrong, dict):
        assert "are no keys with values" in told(lambda: airflock.score(recording, settings=wrong))[0]
        assert len(told(lambda: airflock.simulate(load(PAPER, SMALL), keep=wrong))) == 1


@pytest.mark.parametrize("wrong", [None, *WRONG])
def test_a_number_of_a_measure_that_is_none_is_named(wrong):
    recording, m = tracks(), airflock.measures
    calls = {
        "least": (m.bursts.bursts, m.delays.leadership),
        "width": (m.correlation.velocity_correlation, m.correlation.correlation_length),
        "longest": (m.delays.delay_correlation, m.delays.leadership),
        "slowest": (m.milling.milling, m.turning.turning_speed),
        "reach": (m.surroundings.density_map, m.surroundings.anisotropy),
    }
    for name, measures in calls.items():
        for measure in measures:
            assert told(lambda f=measure, n=name: f(recording, **{n: wrong})) == [f"{name} = {wrong!r} is not a number"]
    for others in ({"cells": wrong}, {"slowest": wrong}):
        assert len(told(lambda o=others: m.surroundings.density_map(recording, 1.0, **o))) == 1
    assert len(told(lambda: m.neighbours.pair_distances(recording, wrong, wrong))) == 2


def test_a_speed_that_nobody_flies_has_no_starting_set():
    for speed in (0.0, -1.0, float("nan"), 1e9):
        assert told(lambda speed=speed: airflock.starting_set(speed))[0].endswith("lies outside [0.1, 100] m/s")


def test_a_missing_value_of_pandas_is_no_number_and_no_choice():
    lines = told(lambda: load(PAPER, {"agents": pd.NA, "radio.delay": pd.NA, "world.arena": pd.NA}))
    assert f"{PAPER}: radio.delay = <NA> is not a number; give [0, 30] s" in lines and len(lines) == 3


def test_the_unit_of_a_fault_s_number_is_told_at_its_key():
    entry = {"kind": "motor", "at": 1.0, "share": "2 s"}
    assert told(lambda: load(PAPER, {"faults": [entry]})) == [
        f"{PAPER}: faults[0].share = 2 s: has no unit; give a number, or %"
    ]


def test_values_of_numpy_are_written_down_as_plain_ones():
    """Agents are often picked by `np.flatnonzero`; the flight was flown, and its recording could not be made."""
    groups = [{"name": "some", "agents": np.array([0, 2]), "body": {"tau": np.float32(2.0)}}]
    faults = [{"kind": "motor", "agents": np.flatnonzero([0, 1, 0]), "at": np.float64(0.1), "share": np.float32(0.5)}]
    scenario = load(PAPER, {**SMALL, "agents": np.int64(3), "groups": groups, "faults": faults})
    assert scenario.groups[0].agents == (0, 2) and scenario.faults[0].agents == (1,)
    again = json.loads(json.dumps(scenario.document))
    assert again["groups"][0]["agents"] == [0, 2] and again["faults"][0]["agents"] == [1]


def test_values_of_numpy_in_flight_are_events_of_plain_ones():
    flight = airflock.open(load(PAPER, SMALL), 1, device="python")
    flight.advance(steps=2).fault("motor", agents=np.int64(2), share=np.float32(0.5))
    flight.advance(steps=2).change({"model.p_rep": np.float32(0.25)})
    flight.branch(np.int64(3))
    events = json.loads(json.dumps([event.plain() for event in flight.events]))
    assert [event["data"] for event in events] == [
        {"kind": "motor", "agents": [2], "share": 0.5}, {"model.p_rep": 0.25},
    ]  # fmt: skip
