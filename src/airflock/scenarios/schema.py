"""Tables of a scenario: each key is looked up, converted and checked in one pass, and all errors are collected.

The declarations of the parameters are the schema. Each error is one line: file, key, value, unit,
allowed range, and the nearest right key for a wrong one.
"""

from collections.abc import Collection, Mapping, Sequence
from math import isinf
from typing import Any

from airflock.core import Choice, Declaration, Quantity, declarations, expand_vectors, format_with_unit
from airflock.scenarios.units import converted
from airflock.support import ErrorCollector, ParameterError, suggest

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
    if isinstance(value, float) and isinf(value) and isinstance(declared, Quantity):
        return None, f"{name} = {format_with_unit(f'{value}', declared.unit)} lies outside {declared.span}"
    return (str(value) if isinstance(value, str) else value), ""


def _holds(interval: Any, value: Any) -> bool:
    """Return True if an interval, as identify writes it, is two numbers about a value."""
    numbers = [interval[0], value, interval[1]] if isinstance(interval, list) and len(interval) == 2 else [None]
    sound = all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in numbers)
    return sound and numbers[0] <= value <= numbers[-1]


def _unknown(section: str, key: str, may: Sequence[str], kinds: Mapping[str, Any]) -> str:
    """Return the error line for a key that a section does not have; `kinds` as in `read_section`."""
    records = {kind: getattr(part, "Parameters", None) for kind, part in kinds.items()}
    of = [kind for kind, other in records.items() if other and key in {name for name, _, _ in declarations(other)}]
    prefix = f"{section}." if section else ""
    hint = suggest(key, may, f"known: {', '.join(may)}", prefix=prefix)
    # A key of another kind of this section is more helpful than the nearest spelling.
    hint = f"it belongs to {section}.kind = {' or '.join(map(repr, of))}" if of else hint
    return f"{prefix}{key}: unknown key; {hint}"
