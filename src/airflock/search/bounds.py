"""Search bounds for a scenario that has no study of its own: from what was searched for its law before, or near it.

Declared ranges say what makes sense at all; most of what lies in them does not fly. So the bounds are those of the
shipped study of the same law whose speed is nearest, lengths and speeds scaled by the ratio of the speeds. Where no
study is shipped they enclose the scenario's own values. Numbers that nothing reads are not searched.
"""

import math
import re
from dataclasses import replace
from functools import lru_cache
from typing import Any

from airflock.core import Quantity, number_names
from airflock.runs import SearchAxis, SearchSpace, declared_numbers, default_scale, full_space
from airflock.scenarios import Scenario, largest_extension, load
from airflock.search.space_table import read_space
from airflock.support import read_toml

AROUND = 10.0  # factor about a scenario's own value, where no study is shipped
SCALED = {"m": 1, "m/s": 1}  # units that grow with the speed; times and rates stay


def default_space(scenario: Scenario) -> tuple[SearchSpace, list[str]]:
    """The numbers of the model that matter, between bounds in which it may fly; and what was done, for a person."""
    dead = unread_keys(scenario)
    searched = [axis for axis in full_space(scenario).axes if axis.key not in dead]
    found = _nearest_study(scenario)
    if found is None:
        axes = [_around(scenario, axis) for axis in searched]
        notes = [f"no study of {scenario.model.name} is shipped: bounds a factor of {AROUND:g} about its own values"]
    else:
        name, speed, known = found
        ratio = _speed(scenario) / speed if speed else 1.0
        # what the study held fixed stays as the scenario has it
        axes = [_scaled(scenario, known[axis.key], axis, ratio) for axis in searched if axis.key in known]
        told = f", lengths and speeds times {ratio:.3g}" if ratio != 1.0 else ""
        notes = [f"bounds of the study {name}{told}"]
    if dead:
        notes.append(f"not searched, because nothing reads them here: {', '.join(sorted(dead))}")
    return SearchSpace(tuple(_ordered(axes))), notes


def shipped_study_axes(scenario: Scenario) -> dict[str, tuple[float, float]]:
    """Bounds of the shipped study of the same law that is nearest in speed, by key; none where no study is shipped."""
    found = _nearest_study(scenario)
    if found is None:
        return {}
    _, speed, known = found
    ratio = _speed(scenario) / speed if speed else 1.0
    scaled = [_scaled(scenario, known[own.key], own, ratio) for own in full_space(scenario).axes if own.key in known]
    return {axis.key: (axis.low, axis.high) for axis in scaled}


def unread_keys(scenario: Scenario) -> set[str]:
    """Keys of the model's numbers that no rule reads under the scenario's choices."""
    from airflock.engine import driver_text

    text = driver_text(scenario)
    read = set(re.findall(r"\bp\.(\w+)", text)) | set(scenario.model.usual)
    return {f"model.{name}" for name in number_names(scenario.parameters) if name not in read}


def _speed(scenario: Scenario) -> float:
    """Preferred speed, m/s; 0 where the model has none."""
    preferred = scenario.model.preferred_speed
    return float(preferred(scenario.parameters)) if preferred else 0.0


def _nearest_study(scenario: Scenario) -> tuple[str, float, dict[str, SearchAxis]] | None:
    """Name, speed (m/s) and axes of the shipped study of the same law, nearest in speed; None if there is none."""
    speed, best = _speed(scenario), None
    for name, model, theirs, axes in _studies():
        if model != scenario.model.name or not axes:
            continue
        away = abs(math.log(speed / theirs)) if speed > 0.0 and theirs > 0.0 else 0.0
        if name == scenario.name:
            away = -1.0
        if best is None or away < best[0]:
            best = (away, name, theirs if speed > 0.0 else 0.0, {axis.key: axis for axis in axes})
    return None if best is None else best[1:]


@lru_cache(maxsize=1)
def _studies() -> list[tuple[str, str, float, tuple[SearchAxis, ...]]]:
    """Name, law, speed and axes of the shipped studies."""
    from airflock.search.study import shipped_studies

    found = []
    for name, path in shipped_studies().items():
        document = read_toml(path)
        if "scenario" not in document:  # one set for several scenarios: no speed of its own
            continue
        scenario = load(str(document["scenario"]), document.get("set"))
        space, _ = read_space(document["space"], scenario) if "space" in document else (None, [])
        found.append((name, scenario.model.name, _speed(scenario), space.axes if space else ()))
    return found


def _scaled(scenario: Scenario, axis: SearchAxis, own: SearchAxis, ratio: float) -> SearchAxis:
    """An axis of a study at another speed, stretched to hold the scenario's own value; `own` has the declared ends."""
    factor = ratio ** SCALED.get(axis.unit, 0)
    low, high = axis.low * factor, axis.high * factor
    if axis.unit == "m" and (arena := largest_extension(scenario.world)):
        high = min(high, arena)
    value = float(declared_numbers(scenario)[axis.key][1] or 0.0)
    low, high = max(own.low, min(low, value)), min(own.high, max(high, value))
    scale = axis.scale if low > 0.0 else "linear"
    return replace(axis, low=low, high=high, scale=scale)


def _around(scenario: Scenario, axis: SearchAxis) -> SearchAxis:
    """An axis about the scenario's own value; from 0 where that is 0."""
    how, value = declared_numbers(scenario)[axis.key]
    own = float(value or 0.0)
    size = abs(own) if own else _typical(scenario, how)
    low, high = (own / AROUND, own * AROUND) if own > 0.0 else (-size, size)
    low, high = max(axis.low, low), min(axis.high, high)
    return replace(axis, low=low, high=high, scale=default_scale(low, high))


def _typical(scenario: Scenario, how: Quantity) -> float:
    """Size of a quantity of which nothing is known but its unit."""
    sizes: dict[str, Any] = {
        "m": 0.25 * (largest_extension(scenario.world) or scenario.radio.range), "m/s": _speed(scenario),
    }  # fmt: skip
    return min(float(sizes.get(how.unit) or 1.0), how.high - how.low)


def _ordered(axes: list[SearchAxis]) -> list[SearchAxis]:
    """Axes without an order that no longer holds: above a number that is not searched."""
    keys = {axis.key for axis in axes}
    return [axis if axis.above in keys or not axis.above else replace(axis, above="") for axis in axes]
