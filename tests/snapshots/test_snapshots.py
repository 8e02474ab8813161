"""What must not change is as recorded; `python tests/snapshots/run.py NAME --write` records a change that is meant."""

import json

import pytest
import run

QUICK = {"drivers", "mission", "options", "scenarios"}  # seconds each; .ci/nightly compares all


@pytest.mark.parametrize("name", sorted(QUICK & set(run.names())))
def test_snapshot_is_as_recorded(name):
    found = run.compare(name)
    assert not found[: run.MOST], f"{len(found)} items differ"


def test_every_snapshot_has_a_record():
    assert [name for name in run.names() if not run.record(name).exists()] == []


def test_one_changed_value_is_seen():
    old = {"a": {"b": [1, 2], "c": {}}, "d": "x"}
    assert run.differences(old, {"a": {"b": [1, 2], "c": {}}, "d": "x"}) == []
    assert run.differences(old, {"a": {"b": [1, 3], "c": {}}, "d": "x"}) == [("a / b / 1", 2, 3)]
    assert run.differences(old, {"a": {"b": [1, 2]}, "d": "x"}) == [("a / c", {}, run.MISSING)]
    assert run.differences({"d": 1}, {"d": 1, "e": None}) == [("e", run.MISSING, None)]


def test_bits_are_compared_only_on_a_kind_of_processor_that_is_on_record(monkeypatch):
    names = [name for name in run.names() if getattr(run.module(name), "BY_PROCESSOR", False)]
    assert {"golden", "store", "users"} <= set(names)
    for name in names:
        kinds = json.loads(run.record(name).read_text(encoding="utf-8"))
        for kind in kinds:
            monkeypatch.setattr(run, "processor", lambda kind=kind: kind)
            assert run.recorded(name) == kinds[kind]
        monkeypatch.setattr(run, "processor", lambda: "i486")
        assert run.recorded(name) is None
