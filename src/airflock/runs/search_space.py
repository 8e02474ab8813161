"""Search space: which parameters vary, between which bounds, and how a point of the unit cube becomes parameters.

An optimiser only sees points in [0, 1]^n. Bounds come from the parameters' declarations; a study
file narrows them, or sets, ties and orders parameters. Bounds wider than declared are refused: no
scenario could hold such a value.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import TopologicalSorter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import Quantity, declarations
from airflock.scenarios import FaultEntry, Scenario

DECADES = 3.0  # a declared range at least this many decades wide is searched on a logarithmic scale


@dataclass(frozen=True)
class SearchAxis:
    """One parameter that varies.

    key       : for instance model.p_rep
    unit      : of low and high, both included
    scale     : "linear" or "log": even steps of a point are even differences or even ratios of the
                value
    integer   : only whole numbers
    above     : key of a parameter that this one never lies below
    """

    key: str
    unit: str
    low: float
    high: float
    scale: str = "linear"
    integer: bool = False
    above: str = ""

    def value(self, x: float, floor: float = -math.inf) -> float:
        """Value at coordinate x in [0, 1], not below `floor`."""
        # The range shrinks to what the floor leaves, so that every point of the cube is an allowed
        # set.
        low, high = min(max(self.low, floor), self.high), self.high
        x = min(max(x, 0.0), 1.0)
        if self.integer:
            low = float(math.ceil(low))
            return min(low + math.floor(x * (math.floor(high) - low + 1.0)), float(math.floor(high)))
        if self.scale == "log":
            return min(max(float(low * (high / low) ** x), low), high)
        return low + x * (high - low)

    def coordinate(self, value: float, floor: float = -math.inf) -> float:
        """Coordinate of a value, clipped to [0, 1]."""
        low, high = min(max(self.low, floor), self.high), self.high
        if self.integer:
            low = float(math.ceil(low))
            x = (value - low + 0.5) / (math.floor(high) - low + 1.0)
        elif high <= low:
            x = 0.5
        elif self.scale == "log":
            x = math.log(max(value, low) / low) / math.log(high / low)
        else:
            x = (value - low) / (high - low)
        return min(max(x, 0.0), 1.0)


@dataclass(frozen=True)
class TiedParameter:
    """A parameter that follows another: factor times its value plus offset."""

    of: str
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class SearchSpace:
    """Varied, fixed and tied parameters of a study."""

    axes: tuple[SearchAxis, ...]
    fixed: Mapping[str, float] = field(default_factory=dict)
    tied: Mapping[str, TiedParameter] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the varied parameters."""
        return tuple(axis.key for axis in self.axes)

    def parameters(self, point: Sequence[float] | NDArray[np.float64]) -> dict[str, float]:
        """All varied, fixed and tied parameters at a point (axis,) of the unit cube."""
        found = dict(self.fixed)
        for i in _order(self.axes):
            axis = self.axes[i]
            floor = found[axis.above] if axis.above else -math.inf
            found[axis.key] = axis.value(float(point[i]), floor)
        varied = {key: found[key] for key in self.keys} | dict(self.fixed)
        return varied | {key: tie.factor * found[tie.of] + tie.offset for key, tie in self.tied.items()}

    def point(self, parameters: Mapping[str, float]) -> NDArray[np.float64]:
        """Point (axis,) of given parameters, clipped to the unit cube."""
        return np.array(
            [a.coordinate(parameters[a.key], parameters[a.above] if a.above else -math.inf) for a in self.axes]
        )

    def document(self) -> dict[str, Any]:
        """The space as plain values, section by section, as a study file writes it."""
        found: dict[str, Any] = {}
        for axis in self.axes:
            entry: dict[str, Any] = {"low": axis.low, "high": axis.high, "unit": axis.unit, "scale": axis.scale}
            entry |= {"integer": True} if axis.integer else {}
            entry |= {"above": axis.above} if axis.above else {}
            _nest(found, axis.key, entry)
        for key, value in self.fixed.items():
            _nest(found, key, {"fixed": value})
        for key, tie in self.tied.items():
            _nest(found, key, {"tied": tie.of, "factor": tie.factor, "offset": tie.offset})
        return found


def _nest(table: dict[str, Any], key: str, entry: Mapping[str, Any]) -> None:
    section, _, name = key.rpartition(".")
    (table.setdefault(section, {}) if section else table)[name] = dict(entry)


def _order(axes: Sequence[SearchAxis]) -> list[int]:
    """Indices of axes, each after the one that it lies above."""
    index = {axis.key: i for i, axis in enumerate(axes)}
    below = {i: [index[axis.above]] if axis.above in index else [] for i, axis in enumerate(axes)}
    return list(TopologicalSorter(below).static_order())


def with_parameters(scenario: Scenario, parameters: Mapping[str, float]) -> Scenario:
    """Return the scenario with other numbers, without reading it again. Raises ParameterError out of range.

    Of faults, faults[0].per_hour and faults[0].number can be changed.
    """
    changed: dict[str, dict[str, float]] = {}
    for key, value in parameters.items():
        section, _, name = key.rpartition(".")
        changed.setdefault(section, {})[name] = value
    records = scenario.records
    numbers_of_faults = {section: changed.pop(section) for section in list(changed) if section.startswith("faults[")}
    if numbers_of_faults:
        entries = (
            _with_numbers(entry, numbers_of_faults.get(f"faults[{i}]", {})) for i, entry in enumerate(scenario.faults)
        )
        scenario = replace(scenario, faults=tuple(entries))
    return scenario.with_records({key: replace(records[key], **values) for key, values in changed.items()})


def _with_numbers(entry: FaultEntry, values: Mapping[str, float]) -> FaultEntry:
    """Return an entry of faults with other numbers; the number of agents is rounded."""
    number = round(values["number"]) if "number" in values else entry.number
    return replace(entry, per_hour=values.get("per_hour", entry.per_hour), number=number)


def declared_numbers(scenario: Scenario) -> dict[str, tuple[Quantity, float | None]]:
    """Return key → declaration and value of each number; drag descent and silence only if the scenario flies them."""
    return {
        f"{section}.{name}".lstrip("."): (how, getattr(record, name))
        for section, record in scenario.records.items()
        if (section != "aero" or scenario.is_aerodynamic) and (section != "silence" or scenario.silence.rule == "stop")
        for name, how, _ in declarations(record)
        if isinstance(how, Quantity)
    }


def full_space(scenario: Scenario) -> SearchSpace:
    """Return the space of all numbers of the model between declared bounds, except those that set the speed."""
    axes = []
    for key, (how, value) in declared_numbers(scenario).items():
        if key.startswith("model.") and value is not None and not _sets_speed(scenario, key, how, value):
            axes.append(SearchAxis(key, how.unit, how.low, how.high, default_scale(how.low, how.high), how.whole))
    return SearchSpace(tuple(axes))


def _sets_speed(scenario: Scenario, key: str, how: Quantity, value: float) -> bool:
    """Return True if a number changes the model's preferred speed."""
    # Such a number is the task, and no means to fulfil it: a search would make the task easier.
    speed = scenario.model.preferred_speed
    if speed is None:
        return False
    other = 0.5 * (value + (how.high if value < how.high else how.low))
    return float(speed(with_parameters(scenario, {key: other}).parameters)) != float(speed(scenario.parameters))


def default_scale(low: float, high: float) -> str:
    """Return "log" for a positive range at least DECADES wide, else "linear"."""
    return "log" if low > 0.0 and high >= low * 10.0**DECADES else "linear"
