"""Several scenarios of one study: read and checked together, and made one number of.

One set of numbers is searched that flies in all of them. Each candidate flies every seed in every scenario, so that
they differ by nothing else; a flight's `repeat` counts scenarios first, then seeds.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.runs import SearchSpace, declared_numbers
from airflock.scenarios import Scenario, load
from airflock.search.bounds import default_space
from airflock.support import ScenarioError, is_file, shortened

OVER_SCENARIOS = ("mean", "worst")
KEYS = ("scenario", "set")  # of an entry that is a table


def combine_scenarios(values: Sequence[float | None], over_scenarios: str, maximise: bool) -> float | None:
    """One number from that of each scenario: their mean, or the worst; None if a flight failed in one of them."""
    if any(value is None for value in values):
        return None
    found = [value for value in values if value is not None]
    if over_scenarios == "worst":
        return min(found) if maximise else max(found)
    return math.fsum(found) / len(found)


def read_scenarios(
    document: Mapping[str, Any], settings: Mapping[str, Any], folder: Path | None, trust: bool
) -> tuple[tuple[Scenario, ...], tuple[str, ...], list[str]]:
    """Scenarios of a study's document, what to call each, and all faults.

    settings : keys to change in all of them, as the document's table `set` does
    """
    keys = document.get("set", {})
    if not isinstance(keys, Mapping):
        return (), (), [f"set = {shortened(repr(keys), 80)} is not a table"]
    if "scenarios" not in document:
        entries: Any = [document.get("scenario")]
        if not isinstance(entries[0], str):
            given = f" = {shortened(repr(entries[0]), 80)} is not a name" if "scenario" in document else " is missing"
            return (), (), [f'scenario{given}; write scenario = "NAME", of a preset or a scenario file']
    else:
        entries = document["scenarios"]
        if "scenario" in document:
            return (), (), ["scenario and scenarios are both given; leave out one"]
        if not isinstance(entries, list) or not entries:
            return (), (), [f"scenarios = {shortened(repr(entries), 80)} is not a list of presets, files or tables"]
    found: list[Scenario] = []
    labels: list[str] = []
    faults: list[str] = []
    for i, entry in enumerate(entries):
        name, own, more = _entry(entry, i)
        faults += more
        if more:
            continue
        beside = folder / name if folder is not None else None
        try:
            path = beside if beside is not None and is_file(beside) else name
            found.append(load(path, {**keys, **own, **settings}, trust=trust))
        except ScenarioError as fault:
            faults += fault.faults
            continue
        told = ", ".join(f"{key} = {value}" for key, value in own.items())
        labels.append(f"{name} with {told}" if told else name)
    return tuple(found), distinct_labels(labels), faults


def distinct_labels(labels: Sequence[str]) -> tuple[str, ...]:
    """Labels with a number where two would be the same."""
    return tuple(f"{label} ({i + 1})" if label in labels[:i] else label for i, label in enumerate(labels))


def _entry(entry: Any, number: int) -> tuple[str, Mapping[str, Any], list[str]]:
    """Name and own settings of an entry of `scenarios`, and its faults."""
    at = f"scenarios[{number}]"
    if isinstance(entry, str):
        return entry, {}, []
    if not isinstance(entry, Mapping) or not isinstance(entry.get("scenario"), str):
        how = 'write a name, or { scenario = "NAME", set = { "radio.delay" = 1.0 } }'
        return "", {}, [f"{at} = {shortened(repr(entry), 80)} names no scenario; {how}"]
    faults = [f"{at}.{key}: unknown key; known: {', '.join(KEYS)}" for key in entry if key not in KEYS]
    own = entry.get("set", {})
    if not isinstance(own, Mapping):
        faults.append(f"{at}.set = {shortened(repr(own), 80)} is not a table")
    return str(entry["scenario"]), own if isinstance(own, Mapping) else {}, faults


def common_space(scenarios: Sequence[Scenario]) -> tuple[SearchSpace, list[str]]:
    """The usual space of the first, its bounds stretched to hold those of the others; and what was done."""
    space, notes = default_space(scenarios[0])
    if len(scenarios) == 1:
        return space, notes
    axes = {axis.key: axis for axis in space.axes}
    for scenario in scenarios[1:]:
        more, told = default_space(scenario)
        notes += [note for note in told if note not in notes]
        for axis in more.axes:
            known = axes.get(axis.key, axis)
            axes[axis.key] = replace(known, low=min(known.low, axis.low), high=max(known.high, axis.high))
    return SearchSpace(tuple(axes.values())), notes


def joint_errors(
    scenarios: Sequence[Scenario], labels: Sequence[str], space: SearchSpace | None, over_scenarios: Any
) -> list[str]:
    """Why one set of numbers cannot be searched for these scenarios, one line each."""
    faults = []
    if over_scenarios not in OVER_SCENARIOS:
        faults.append(f"over_scenarios = {over_scenarios!r} is none of {', '.join(OVER_SCENARIOS)}")
    for label, scenario in zip(labels[1:], scenarios[1:], strict=True):
        first, law = scenarios[0].model.name, scenario.model.name
        if law != first:
            faults.append(f"scenarios: {label} flies {law}, {labels[0]} {first}; one set of numbers needs one law")
            continue
        known = declared_numbers(scenario)
        keys = () if space is None else (*space.keys, *space.fixed, *space.tied)
        faults += [f"space.{key}: {label} has no such number" for key in keys if key not in known]
    return faults
