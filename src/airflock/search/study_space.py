"""The table [space] of a study file: reading it, and everything that can be wrong with it, all errors at once."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

from airflock.core import Quantity, format_with_unit, number_names
from airflock.runs import SearchAxis, SearchSpace, TiedParameter, declared_numbers, default_scale, full_space
from airflock.scenarios import Scenario, largest_extension, load
from airflock.support import ErrorCollector, is_number, read_toml, suggest

ENTRY = ("low", "high", "unit", "scale", "integer", "above", "fixed", "tied", "factor", "offset", "source", "note")


def read_space(table: Any, scenario: Scenario, errors: ErrorCollector) -> SearchSpace | None:
    """Read the space from the table [space] of a study file; None where it has errors. Only what is listed varies."""
    known, wrong = declared_numbers(scenario), ErrorCollector()
    axes: list[SearchAxis] = []
    fixed: dict[str, float] = {}
    tied: dict[str, TiedParameter] = {}
    for key, entry in _entries(table, wrong).items():
        if key not in known:
            hint = suggest(key, known, lead="; ", prefix="space.")
            if key.startswith("aero.") and not scenario.is_aerodynamic:
                hint = f", which has no section [aero]; --set {key}=VALUE adds drag descent to it"
            wrong.add(f"space.{key} is not a number of {scenario.name}{hint}")
        elif of_entry := _entry_errors(key, entry, known[key][0], known):
            wrong.add(*of_entry)
        elif "fixed" in entry:
            fixed[key] = float(entry["fixed"])
        elif "tied" in entry:
            tie = float(entry.get("factor", 1.0)), float(entry.get("offset", 0.0))
            tied[key] = TiedParameter(str(entry["tied"]), *tie)
        else:
            axes.append(_axis(key, entry, known[key][0]))
    for axis in axes:  # a number that another one must stay above takes part even if it does not vary
        other = axis.above
        if other in known and other not in {a.key for a in axes} | set(fixed) and known[other][1] is not None:
            fixed[other] = float(known[other][1] or 0.0)
    space = SearchSpace(tuple(axes), fixed, tied)
    wrong.add(*_errors_between(space, known, bool(wrong)))
    return None if errors.merge(wrong) else space


def _axis(key: str, entry: Mapping[str, Any], how: Quantity) -> SearchAxis:
    low, high = float(entry.get("low", how.low)), float(entry.get("high", how.high))
    scale = str(entry.get("scale", default_scale(low, high)))
    return SearchAxis(
        key, how.unit, low, high, scale, how.whole or bool(entry.get("integer", False)), str(entry.get("above", ""))
    )


def _entries(table: Any, errors: ErrorCollector) -> dict[str, Mapping[str, Any]]:
    """Return key → entry, from sections or dotted keys."""
    if not isinstance(table, Mapping):
        errors.add(f"space = {table!r} is not a table of keys")
        return {}
    found: dict[str, Any] = {}
    for section, entries in table.items():
        if not isinstance(entries, Mapping) or "." in section or (entries and set(entries) <= set(ENTRY)):
            found[section] = entries
        else:
            found |= {f"{section}.{name}": entry for name, entry in entries.items()}
    no_tables = {key: entry for key, entry in found.items() if not isinstance(entry, Mapping)}
    errors.add(
        *(f"space.{k} = {entry!r} is not a table; write {{ low = ..., high = ... }}" for k, entry in no_tables.items())
    )
    return {key: entry for key, entry in found.items() if key not in no_tables}


def _entry_errors(key: str, entry: Mapping[str, Any], how: Quantity, known: Mapping[str, Any]) -> list[str]:
    """Return the errors of one entry by itself."""
    errors = []
    for name, value in entry.items():
        numeric = is_number(value) and math.isfinite(value)
        if name not in ENTRY:
            errors.append(f"space.{key}.{name}: unknown key; {suggest(name, ENTRY, ', '.join(ENTRY))}")
        elif name in ("low", "high", "fixed", "factor", "offset") and not numeric:
            errors.append(f"space.{key}.{name} = {value!r} is not a number; give {how.span}")
        elif name in ("low", "high", "fixed") and not how.low <= value <= how.high:
            errors.append(
                f"space.{key}.{name} = {format_with_unit(f'{value:g}', how.unit)} lies outside the declared {how.span}"
            )
        elif name == "unit" and value != how.unit:
            errors.append(f"space.{key}.unit = {value!r}: the unit is {how.unit}")
        elif name == "scale" and value not in ("linear", "log"):
            errors.append(f"space.{key}.scale = {value!r} is none of linear, log")
        elif name == "integer" and not isinstance(value, bool):
            errors.append(f"space.{key}.integer = {value!r} is none of true, false")
        elif how.whole and (name == "tied" or (name == "integer" and not value)):
            errors.append(f"space.{key}.{name} = {str(value).lower()}: only whole numbers make sense")
        elif how.whole and name == "fixed" and value != int(value):
            errors.append(f"space.{key}.fixed = {value:g} is not a whole number")
        elif name in ("above", "tied") and not (isinstance(value, str) and value in known):
            errors.append(f"space.{key}.{name} = {value!r} is not a number{suggest(value, known, lead='; ')}")
    if errors or "fixed" in entry or "tied" in entry:
        return errors
    return _range_errors(_axis(key, entry, how))


def _range_errors(axis: SearchAxis) -> list[str]:
    where, span = f"space.{axis.key}", format_with_unit(f"[{axis.low:g}, {axis.high:g}]", axis.unit)
    if not axis.low < axis.high:
        word = "empty" if axis.low == axis.high else "inverted"
        return [f"{where}: the range {span} is {word}; low must lie below high"]
    if axis.scale == "log" and axis.low <= 0.0:
        return [f"{where}: low = {format_with_unit(f'{axis.low:g}', axis.unit)} must be above 0 on a logarithmic scale"]
    if axis.integer and math.floor(axis.high) < math.ceil(axis.low):
        return [f"{where}: the range {span} holds no whole number"]
    return []


def _errors_between(
    space: SearchSpace, known: Mapping[str, tuple[Quantity, float | None]], is_reported: bool
) -> list[str]:
    """Ties and orders that cannot hold."""
    errors = []
    axes = {axis.key: axis for axis in space.axes}
    for axis in space.axes:
        # Followed to its end: numbers that lie above each other in a circle have no order.
        chain = [axis.key]
        while axes.get(chain[-1]) and axes[chain[-1]].above:
            chain.append(axes[chain[-1]].above)
            if chain[-1] in chain[:-1]:
                errors.append(f"space.{axis.key}: above runs in a circle: {' > '.join(chain)}")
                break
        if axis.above and axis.above not in axes and axis.above not in space.fixed:
            errors.append(f"space.{axis.key}.above = {axis.above!r} neither varies nor is fixed")
        lower = axes[axis.above].high if axis.above in axes else space.fixed.get(axis.above, axis.low)
        if axis.above and lower > axis.high:
            high = format_with_unit(f"{axis.high:g}", axis.unit)
            errors.append(f"space.{axis.key}.high = {high} lies below {axis.above} = {lower:g}")
    for key, tie in space.tied.items():
        if tie.of not in axes and tie.of not in space.fixed:
            errors.append(f"space.{key}.tied = {tie.of!r} neither varies nor is fixed")
            continue
        # A tie is a straight line, so its extremes are at the ends of the range.
        ends = (axes[tie.of].low, axes[tie.of].high) if tie.of in axes else (space.fixed[tie.of],)
        how = known[key][0]
        for end in ends:
            value = tie.factor * end + tie.offset
            if not how.low <= value <= how.high:
                reached = format_with_unit(f"{value:g}", how.unit)
                errors.append(f"space.{key} = {reached} at {tie.of} = {end:g} lies outside {how.span}")
    if not space.axes and not is_reported:
        errors.append("space: nothing varies; give at least one key low and high")
    return errors


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
        scaled = f", lengths and speeds times {ratio:.3g}" if ratio != 1.0 else ""
        notes = [f"bounds of the study {name}{scaled}"]
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
    # The text of the driver is the proof: a choice has removed what it leaves unread.
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
        space = read_space(document["space"], scenario, ErrorCollector()) if "space" in document else None
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
