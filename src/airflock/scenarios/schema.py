"""Validation: make records from nested dicts, and report all errors at once.

The declarations of the parameters are the schema. Each error is one line: file, key, value, unit,
allowed range, and the nearest right key for a wrong one.
"""

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from numbers import Real
from typing import Any

from airflock.core import (
    Choice,
    Declaration,
    Quantity,
    Text,
    choice_error,
    declarations,
    format_with_unit,
    points_error,
    quantity_error,
    telling_digits,
)
from airflock.support import suggest

LONG_FORM = {"value", "unit", "source", "note", "interval"}


def plain_values(section: str, table: Mapping[str, Any], record: type) -> tuple[dict[str, Any], list[str]]:
    """Return the values of a section without units and sources, and errors for units that are not the declared ones."""
    known = {name: declared for name, declared, _ in declarations(record)}
    units = {name: getattr(declared, "unit", "") for name, declared in known.items()}
    values, errors = {}, []
    for key, value in table.items():
        if isinstance(value, Mapping):
            name = f"{section}.{key}".lstrip(".")
            unknown = set(value) - LONG_FORM
            if "value" not in value or unknown:
                errors.append(f"{name}: give a value, or a table with value, unit and source")
                continue
            if "interval" in value and not _holds(value["interval"], value["value"]):
                errors.append(f"{name}: interval = {value['interval']!r} is not [low, high] about {value['value']!r}")
                continue
            unit = value.get("unit", "")
            if unit and units.get(key) is not None and unit != units[key]:
                errors.append(f"{name} = {value['value']} {unit}: the unit is {units[key] or 'none'}")
            value = value["value"]
        # TOML has whole numbers, and some choices are digits: model.scheme = 2.
        if isinstance(known.get(key), Choice) and isinstance(value, int) and not isinstance(value, bool):
            value = str(value)  # model.scheme = 2
        values[key] = value
    return values, errors


def _holds(interval: Any, value: Any) -> bool:
    """Return True if an interval, as identify writes it, is two numbers about a value."""
    numbers = [interval[0], value, interval[1]] if isinstance(interval, list) and len(interval) == 2 else [None]
    sound = all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in numbers)
    return sound and numbers[0] <= value <= numbers[-1]


def value_of(entry: Any) -> Any:
    """Return a value, or that of a table which also holds its unit or source: { value = ..., source = ... }."""
    return entry["value"] if isinstance(entry, Mapping) and "value" in entry else entry


def read_section(
    section: str, table: Mapping[str, Any], record: type, other_keys: Sequence[str] = (),
    kinds: Mapping[str, type] | None = None,
) -> tuple[Any, list[str]]:  # fmt: skip
    """Make a record from a section; return it, or None, with all errors of the section.

    other_keys : further keys that the table may hold
    kinds : records that the section has with another kind, for the hint where a key belongs to one of them
    """
    if not isinstance(table, Mapping):
        return None, [f"{section} = {table!r} is not a table of keys"]
    values, errors = plain_values(section, table, record)
    known = {name: declared for name, declared, _ in declarations(record)}
    # Checked here and not by the constructor of the record, whose lines know neither section nor
    # file.
    values = {key: _python(value, known.get(key)) for key, value in values.items()}
    for name, declared in known.items():
        if name in values and _is_wrong(values[name], declared):
            errors.append(_line(f"{section}.{name}".lstrip("."), values[name], declared))
    errors += [_unknown(section, str(key), (*known, *other_keys), kinds or {}) for key in values if key not in known]
    return (None if errors else record(**values)), errors


def _python(value: Any, declared: Declaration | None) -> Any:
    """Convert a value to the types of records: NumPy's and tomlkit's become Python's own, whole numbers floats."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(declared, Quantity) and isinstance(value, Real) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            return value  # beyond what a float can hold: reported with the range
    return str(value) if isinstance(value, str) else value


def _is_wrong(value: Any, declared: Declaration) -> bool:
    """Return True if a value of Python's own types is not what was declared."""
    # The range check lets inf pass where a bound is inf, but no file may set an infinite number.
    if isinstance(declared, Quantity):
        return bool(quantity_error(value, declared)) or value in (inf, -inf)
    if isinstance(declared, Choice):
        return bool(choice_error(value, declared))
    return not isinstance(value, str) if isinstance(declared, Text) else bool(points_error(value, declared))


def _unknown(section: str, key: str, may: Sequence[str], kinds: Mapping[str, type]) -> str:
    """Return the error line for a key that a section does not have; `kinds` as in `read_section`."""
    of = [kind for kind, other in kinds.items() if key in {name for name, _, _ in declarations(other)}]
    prefix = f"{section}." if section else ""
    hint = suggest(key, may, f"known: {', '.join(may)}", prefix=prefix)
    # A key of another kind of this section is more helpful than the nearest spelling.
    hint = f"it belongs to {section}.kind = {' or '.join(map(repr, of))}" if of else hint
    return f"{prefix}{key}: unknown key; {hint}"


def _line(name: str, value: Any, declared: Declaration) -> str:
    """Return the error line for a value that is not what was declared."""
    if isinstance(declared, Quantity):
        if isinstance(value, float) and isfinite(value) and declared.whole and not value.is_integer():
            text = telling_digits(value, lambda v: v != int(v))
            return f"{name} = {text} is not a whole number; give one in {declared.span}"
        if isinstance(value, Real) and not isinstance(value, bool):
            return f"{name} = {format_with_unit(_number(value, declared), declared.unit)} lies outside {declared.span}"
        return f"{name} = {value!r} is not a number; give {declared.span}"
    if isinstance(declared, Choice):
        hint = suggest(value, declared.options, lead="; ", cutoff=0.6)
        return f"{name} = {value!r} is none of {', '.join(declared.options)}{hint}"
    if isinstance(declared, Text):
        return f"{name} = {value!r} is not text"
    if declared.axes > 3:
        return (
            f"{name} is not a list of rows of {declared.axes} numbers in {declared.unit}; it holds {declared.meaning}"
        )
    what = (
        f"a list of points [east, north{', up' if declared.axes == 3 else ''}]"
        if declared.depth == 2
        else "a list of polygons [[east, north], ...]"
    )
    return f"{name} is not {what} in {declared.unit}"


def _number(value: Real, declared: Quantity) -> str:
    """Format a number for a person; a whole number may be too large to be a float."""
    try:
        return telling_digits(float(value), lambda v: not declared.low <= v <= declared.high)
    except OverflowError:
        return "a whole number beyond 1e308"
