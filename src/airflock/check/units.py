"""Other units: every declared number of a scenario with metres and seconds of another length.

A flight must not depend on the units that it is given in. Factors that are powers of two scale without rounding, so
that only guards such as TINY and hidden constants can tell the two flights apart.
"""

import copy
import re
from dataclasses import replace
from typing import Any, NamedTuple

from airflock.core import Points, Quantity, declarations
from airflock.scenarios import ORDER, Scenario
from airflock.support import RuleError


class UnitScale(NamedTuple):
    """Factors by which numbers of metres and of seconds grow."""

    metre: float
    second: float


UNIT_SCALES = (UnitScale(2.0, 4.0), UnitScale(0.5, 0.25))
DIMENSIONS = {
    "": (0, 0), "1": (0, 0), "dB": (0, 0), "rad": (0, 0), "deg": (0, 0), "kg": (0, 0), "m": (1, 0), "cm": (1, 0),
    "km": (1, 0), "s": (0, 1), "Hz": (0, -1), "N": (1, -2), "Pa": (-1, -2), "J": (2, -2), "W": (2, -3),
}  # fmt: skip


def unit_factor(unit: str, units: UnitScale) -> float:
    """By how much a number in this unit grows: "m/s^2" → metre / second². Raises RuleError for an unknown unit."""
    text = unit.replace("²", "^2").replace("³", "^3").replace("·", " ").strip()
    over, _, under = re.sub(r"\((\d+)/(\d+)\)", r"\1:\2", text).partition("/")
    return _product(over, unit, units) / _product(under, unit, units)


def _product(text: str, unit: str, units: UnitScale) -> float:
    result = 1.0
    for name, power, over in re.findall(r"([A-Za-z]+|\b1\b)(?:\^(\d+)(?::(\d+))?)?", text):
        if name not in DIMENSIONS:
            raise RuleError(f"the unit {unit!r} has a part {name!r} that is none of {', '.join(DIMENSIONS)}")
        metres, seconds = DIMENSIONS[name]
        result *= (units.metre**metres * units.second**seconds) ** (int(power or 1) / int(over or 1))
    return result


def rescaled(record: Any, units: UnitScale) -> Any:
    """A record of parameters in the other units; ranges, which are about sense and not about units, are left out."""
    made = copy.copy(record)
    for name, declared, _ in declarations(record):
        value = getattr(record, name)
        if isinstance(declared, Quantity) and value is not None:
            object.__setattr__(made, name, value * unit_factor(declared.unit, units))
        elif isinstance(declared, Points):
            object.__setattr__(made, name, _points(value, declared.unit, units))
    return made


def _points(value: Any, unit: str, units: UnitScale) -> Any:
    """Points, or rows whose last number has another unit ("m and s")."""
    if value and not isinstance(value[0], tuple):
        first, _, last = unit.partition(" and ")
        return tuple(x * unit_factor(first, units) for x in value[:-1]) + (
            value[-1] * unit_factor(last or first, units),
        )
    return tuple(_points(each, unit, units) for each in value)


def rescaled_scenario(scenario: Scenario, units: UnitScale) -> Scenario:
    """A scenario in the other units."""
    records = {key: rescaled(record, units) for key, record in scenario.records.items()}
    return replace(scenario, **{section.field: records[section.key] for section in ORDER})
