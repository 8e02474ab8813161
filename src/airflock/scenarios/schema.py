"""Tables of a scenario: each key is looked up, converted and checked in one pass, and all errors are collected.

People's units become the declared SI units, and a note reports each conversion: a value may carry
its unit as text, `delay = "400 ms"`, or as a table, `delay = { value = 400, unit = "ms" }`. A
spread is the standard deviation of a manufacturing tolerance, in the unit of its number or as a
share of it.

The declarations of the parameters are the schema. Each error is one line: file, key, value, unit,
allowed range, and the nearest right key for a wrong one.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from airflock.core import Choice, Declaration, Points, Quantity, declarations, expand_vectors, format_with_unit
from airflock.support import ErrorCollector, ParameterError, is_number, suggest

LONG_FORM = {"value", "unit", "source", "note", "interval"}


def value_of(entry: Any) -> Any:
    """Return a value, or that of a table which also holds its unit or source: { value = ..., source = ... }."""
    return entry["value"] if isinstance(entry, Mapping) and "value" in entry else entry


def read_section(
    section: str, table: Any, record: type, errors: ErrorCollector, *, judged: Collection[str] = (),
    beside: Sequence[str] = (), kinds: Mapping[str, Any] | None = None,
) -> tuple[Any, Any]:  # fmt: skip
    """Make a record from a section; return it, or None where it has errors, and the section in declared units.

    judged : keys that are judged elsewhere
    beside : other keys that the table may hold, for the hint where one is misspelt
    kinds : parts that the section may name, for the hint where a key belongs to one of them
    """
    if not isinstance(table, Mapping):
        errors.add(f"{section} = {table!r} is not a table of keys")
        return None, table
    known = {name: declared for name, declared, _ in declarations(record)}
    prefix = f"{section}." if section else ""
    table, of_vectors = expand_vectors(section, table, record)
    errors.add(*of_vectors)
    result: dict[str, Any] = {}
    values: dict[str, Any] = {}
    wrong, unknown = ErrorCollector(), []
    for key, entry in table.items():
        if key in judged or key not in known:
            result[key] = entry
            unknown += [] if key in judged else [_unknown(section, str(key), (*known, *beside), kinds or {})]
            continue
        # Every conversion is noted: a wrong unit that passes in silence is worse than a refusal.
        entry, note, error = converted(f"{prefix}{key}", entry, known[key])
        if error:  # left out, so that it is reported once and all else is judged with the default
            errors.add(error)
            continue
        errors.notes += [note] if note else []
        result[key] = entry
        values[key], error = _plain(f"{prefix}{key}", entry, known[key])
        if error:
            wrong.add(error)
            del values[key]
    try:
        made = record(**values)
    except ParameterError as error:
        lines = (line.removeprefix(f"{record.__name__}.") for line in str(error).splitlines())
        wrong.add(*(f"{prefix}{line}" for line in lines))
    wrong.add(*unknown)
    errors.add(*wrong.errors)
    return (None if wrong else made), result


def _plain(name: str, entry: Any, declared: Declaration) -> tuple[Any, str]:
    """Return a value without its source, of Python's own types, and the error of what stands beside it."""
    value = entry
    if isinstance(entry, Mapping):
        if "value" not in entry or set(entry) - LONG_FORM:
            return None, f"{name}: give a value, or a table with value, unit and source"
        value, unit, declared_unit = entry["value"], entry.get("unit", ""), getattr(declared, "unit", "")
        if "interval" in entry and not _holds(entry["interval"], value):
            return None, f"{name}: interval = {entry['interval']!r} is not [low, high] about {value!r}"
        if unit not in ("", declared_unit):
            return None, f"{name} = {value} {unit}: the unit is {declared_unit or 'none'}"
    value = value.tolist() if hasattr(value, "tolist") else value
    # TOML has whole numbers, and some choices are digits: model.scheme = 2.
    if isinstance(declared, Choice) and isinstance(value, int) and not isinstance(value, bool):
        return str(value), ""
    # A range without an end lets inf pass, but no file may set an infinite number.
    if isinstance(value, float) and math.isinf(value) and isinstance(declared, Quantity):
        return None, f"{name} = {format_with_unit(f'{value}', declared.unit)} lies outside {declared.span}"
    return (str(value) if isinstance(value, str) else value), ""


def _holds(interval: Any, value: Any) -> bool:
    """Return True if an interval, as identify writes it, is two numbers about a value."""
    numbers = [interval[0], value, interval[1]] if isinstance(interval, list) and len(interval) == 2 else [None]
    return all(map(is_number, numbers)) and numbers[0] <= value <= numbers[-1]


def _unknown(section: str, key: str, may: Sequence[str], kinds: Mapping[str, Any]) -> str:
    """Return the error line for a key that a section does not have; `kinds` as in `read_section`."""
    records = {kind: getattr(part, "Parameters", None) for kind, part in kinds.items()}
    of = [kind for kind, other in records.items() if other and key in {name for name, _, _ in declarations(other)}]
    prefix = f"{section}." if section else ""
    hint = suggest(key, may, f"known: {', '.join(may)}", prefix=prefix)
    # A key of another kind of this section is more helpful than the nearest spelling.
    hint = f"it belongs to {section}.kind = {' or '.join(map(repr, of))}" if of else hint
    return f"{prefix}{key}: unknown key; {hint}"


DEGREE = math.pi / 180.0
FOOT, MILE, NAUTICAL_MILE = 0.3048, 1609.344, 1852.0
# declared unit → what else may be written → factor to the declared one; feet, miles, pounds and
# knots are the international ones of 1959, g is the standard gravity of 1901
UNITS: dict[str, dict[str, float]] = {
    "m": {
        "mm": 1e-3, "cm": 1e-2, "km": 1e3, "in": 0.0254, "ft": FOOT, "yd": 3.0 * FOOT, "mi": MILE,
        "nmi": NAUTICAL_MILE,
    },
    "s": {"us": 1e-6, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "m/s": {
        "mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1.0 / 3.6, "ft/s": FOOT, "ft/min": FOOT / 60.0, "mph": MILE / 3600.0,
        "kn": NAUTICAL_MILE / 3600.0,
    },
    "m/s^2": {"cm/s^2": 1e-2, "ft/s^2": FOOT, "g": 9.80665},
    "1/s": {"Hz": 1.0, "kHz": 1e3, "1/ms": 1e3, "1/min": 1.0 / 60.0, "1/h": 1.0 / 3600.0},
    "rad": {"deg": DEGREE, "mrad": 1e-3, "turn": 2.0 * math.pi},
    "deg": {"rad": 1.0 / DEGREE, "mrad": 1e-3 / DEGREE, "turn": 360.0},
    "rad/s": {"deg/s": DEGREE, "rpm": 2.0 * math.pi / 60.0},
    "m^2": {"cm^2": 1e-4, "ft^2": FOOT**2},
    "m^2/s^2": {"cm^2/s^2": 1e-4, "ft^2/s^2": FOOT**2},
    "kg": {"g": 1e-3, "lb": 0.45359237},
    "N": {"mN": 1e-3, "kN": 1e3, "lbf": 4.4482216152605},
    "J": {"kJ": 1e3, "MJ": 1e6, "Wh": 3600.0, "kWh": 3.6e6},
    "W": {"mW": 1e-3, "kW": 1e3},
    "kg/m^3": {"g/cm^3": 1e3, "g/L": 1.0},
    "1": {"%": 1e-2},
}  # fmt: skip
# A table of our own and not pint: fifty entries, no registry that depends on context, and an error
# can name the units that would be right for this key.
SPELLINGS = {
    "sec": "s", "second": "s", "seconds": "s", "metre": "m", "metres": "m", "meter": "m", "meters": "m",
    "feet": "ft", "foot": "ft", "kph": "km/h", "kmh": "km/h", "knots": "kn", "kt": "kn", "kts": "kn", "°": "deg",
    "degrees": "deg", "hz": "Hz", "minutes": "min", "hours": "h", "mps": "m/s", "percent": "%", "μs": "us", "µs": "us",
}  # fmt: skip
# a digit can go on only after a blank (1 1/s), so that no unit takes digits from its number
NUMBER_WITH_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?:\s+(?=\S)|(?![\d.]))(.*?)\s*")
DECIMAL_COMMA = re.compile(r",\d+")


def conversion_factor(unit: str, declared: str) -> float | None:
    """Return how many declared units one `unit` is, such as 0.001 for ms where s is declared; None if unknown."""
    name = unit.strip().replace("²", "^2").replace("³", "^3").replace("**", "^").replace("m/s/s", "m/s^2")
    name = SPELLINGS.get(name, name)
    return 1.0 if name == declared else UNITS.get(declared, {}).get(name)


def unit_names(declared: str) -> set[str]:
    """Return all units that may be written where this one is declared, in each spelling."""
    units = {declared, *UNITS.get(declared, ())} - {""}
    spelt = {name.replace("^", mark) for name in units for mark in ("**", "^")}
    spelt |= {name.replace("^2", "²").replace("^3", "³") for name in units}
    return spelt | {name for name, unit in SPELLINGS.items() if unit in units}


def converted(name: str, entry: Any, declared: Declaration) -> tuple[Any, str, str]:
    """Convert one value to its declared unit; return it, as text or in a table as it was, with a note and an error.

    The error is of a unit that does not fit, or of text without one; what else is wrong is left as
    it is.
    """
    if not isinstance(declared, (Quantity, Points)):
        return entry, "", ""
    long = isinstance(entry, Mapping) and "value" in entry
    value, unit = (entry["value"], entry.get("unit", "")) if long else (entry, "")
    written = f"{value} {unit}".strip() if long else entry
    if isinstance(value, str) and not unit:
        match = NUMBER_WITH_UNIT.fullmatch(value)
        if match is None:
            return entry, "", ""  # no number at all: the declaration reports it with the allowed range
        if not match[2]:
            return None, "", f"{name} = {value!r} {_missing_unit(match[1], declared)}"
        # The pattern reads "0,5 s" as 0 with the unit ",5 s"; name the comma and not the unit.
        if DECIMAL_COMMA.match(match[2]):
            return None, "", f"{name} = {value}: has a decimal comma; write {match[1]}.{match[2][1:]}"
        value, unit = float(match[1]), match[2]
    if unit == "" or not isinstance(unit, str):
        return entry, "", ""
    times = conversion_factor(unit, declared.unit)
    if times is None:
        others = _other_units(declared.unit)
        if declared.unit in ("", "1"):
            return None, "", f"{name} = {written}: has no unit{f'; give a number, or {others}' if others else ''}"
        return None, "", f"{name} = {written}: the unit is {declared.unit}{f', or one of {others}' if others else ''}"
    scaled = _scaled(value, times)
    if scaled is None:
        return entry, "", ""
    result = {**entry, "value": scaled, "unit": declared.unit} if long else scaled
    if unit == declared.unit:
        return result, "", ""
    if isinstance(scaled, list):  # the note leaves out its numbers: a polygon may have 100,000 corners
        return result, f"{name} was converted from {unit} to {declared.unit}", ""
    return result, f"{name} = {_short(value)} {unit} is {format_with_unit(_short(scaled), declared.unit)}", ""


def _other_units(declared: str) -> str:
    """List the units that may be written instead of the declared one."""
    return ", ".join(UNITS.get(declared, ()))


def _missing_unit(number: str, declared: Quantity | Points) -> str:
    """Return the end of an error line about a number in quotes without a unit: what to write instead."""
    if declared.unit in ("", "1"):
        return f"is text; give {number} without quotes"
    others = f" (or {_other_units(declared.unit)})" if _other_units(declared.unit) else ""
    return f"has no unit; give {number} without quotes, or '{number} {declared.unit}'{others}"


def _scaled(value: Any, times: float) -> Any:
    """Multiply a number, or nested lists of numbers, by a factor; return None where something else is in it."""
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        # Twelve digits drop the rounding of the product, so that a note and a file read as a person
        # would write them.
        return float(f"{value * times:.12g}") if times != 1.0 else value
    if isinstance(value, (list, tuple)):
        scaled = [_scaled(entry, times) for entry in value]
        return None if any(entry is None for entry in scaled) else scaled
    return None


def _short(value: Any) -> str:
    """Format a number with six digits, and anything else as text."""
    return f"{value:g}" if isinstance(value, (int, float)) else str(value)


OF_IT = "a share of the number such as '10 %'"


class RelativeSpread(float):
    """A standard deviation that is a share of the number itself."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RelativeSpread) and float(self) == float(other)

    # A class that defines __eq__ loses the hash of float.
    __hash__ = float.__hash__

    @classmethod
    def parse(cls, entry: Any) -> "RelativeSpread | None":
        """Parse a text or table such as "10 %"; return None where it has another unit, or none."""
        match = NUMBER_WITH_UNIT.fullmatch(entry) if isinstance(entry, str) else None
        value, unit = (match[1], match[2]) if match else ("", "")
        if isinstance(entry, Mapping):
            value, unit = entry.get("value"), entry.get("unit")
        # A factor of 1 is the unit 1 itself, so the spread is absolute.
        if isinstance(value, bool) or not isinstance(unit, str) or conversion_factor(unit, "1") in (None, 1.0):
            return None
        try:
            return cls(float(f"{float(value) / 100.0:.12g}"))
        except (TypeError, ValueError):
            return None


def standard_deviation(spread: float, value: float) -> float:
    """Return the standard deviation of a number with this value, in the unit of the number."""
    return spread * abs(value) if isinstance(spread, RelativeSpread) else spread


def share_hint(declared: Any) -> str:
    """Return the end of an error line about a spread, which may be a share as well; "" where it may not."""
    return f", or {OF_IT}" if isinstance(declared, Quantity) and declared.unit not in ("", "1") else ""


def read_spread(name: str, entry: Any, unit: str, declared: Quantity, errors: ErrorCollector) -> float | None:
    """Return a standard deviation in the declared unit, or as a share of its number; None where it is neither.

    name : of the spread, for its errors; unit : of the number that it stands beside, "" for none
    """
    share: Any = RelativeSpread.parse(entry) if share_hint(declared) else None
    if share is None:
        entry, note, error = converted(name, {"value": entry, "unit": unit} if unit else entry, declared)
        if error:
            errors.add(f"{error}{share_hint(declared)}")
            return None
        errors.notes += [note] if note else []
        share = entry.get("value", entry) if isinstance(entry, Mapping) else entry
    if not is_number(share) or not 0.0 <= share < math.inf:
        least = f"{format_with_unit('0', declared.unit)} or more{share_hint(declared)}"
        errors.add(f"{name} = {_as_text(share)} is not a standard deviation of {least}")
        return None
    return share if isinstance(share, RelativeSpread) else float(share)


def _as_text(spread: Any) -> str:
    """Format a spread as a file writes it."""
    return f"'{100.0 * spread:g} %'" if isinstance(spread, RelativeSpread) else repr(spread)
