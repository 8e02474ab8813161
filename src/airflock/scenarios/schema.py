"""Validation: from a nested dict to records, with every fault found at once.

One pydantic schema per section is derived from the parameters' declarations; its complaints become one line each:
file, key, value, unit, allowed range, and the nearest right key for a wrong one.
"""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from airflock.core.parameters import Choice, Points, Quantity, Text, declarations, with_unit

LONG_FORM = {"value", "unit", "source", "note", "interval"}


@cache
def schema(record: type) -> type[BaseModel]:
    """Pydantic schema of one record of parameters."""
    fields: dict[str, Any] = {}
    for name, declared, default in declarations(record):
        if isinstance(declared, Quantity):
            number: Any = Annotated[float, Field(ge=declared.low, le=declared.high, allow_inf_nan=False, strict=True)]
            number = Annotated[number, Field(multiple_of=1.0)] if declared.whole else number
            fields[name] = (number | None if declared.optional else number, default)
        elif isinstance(declared, Choice):
            fields[name] = (Literal[declared.options], default)
        elif isinstance(declared, Text):
            fields[name] = (str, default)
        else:
            inner = Annotated[float, Field(allow_inf_nan=False)]
            shape: Any = list[Annotated[list[inner], Field(min_length=declared.axes, max_length=declared.axes)]]
            fields[name] = (list[shape] if declared.depth == 3 else shape, [])
    return create_model(f"{record.__module__}.{record.__name__}", __config__=ConfigDict(extra="forbid"), **fields)


def plain(section: str, given: Mapping[str, Any], record: type) -> tuple[dict[str, Any], list[str]]:
    """Values without their units and sources; faults for units that differ from the declared ones."""
    known = {name: declared for name, declared, _ in declarations(record)}
    units = {name: getattr(declared, "unit", "") for name, declared in known.items()}
    values, faults = {}, []
    for key, value in given.items():
        if isinstance(value, Mapping):
            name = f"{section}.{key}".lstrip(".")
            unknown = set(value) - LONG_FORM
            if "value" not in value or unknown:
                faults.append(f"{name}: give a value, or a table with value, unit and source")
                continue
            if "interval" in value and not _holds(value["interval"], value["value"]):
                faults.append(f"{name}: interval = {value['interval']!r} is not [low, high] about {value['value']!r}")
                continue
            unit = value.get("unit", "")
            if unit and units.get(key) is not None and unit != units[key]:
                faults.append(f"{name} = {value['value']} {unit}: the unit is {units[key] or 'none'}")
            value = value["value"]
        if isinstance(known.get(key), Choice) and isinstance(value, int) and not isinstance(value, bool):
            value = str(value)  # model.scheme = 2
        values[key] = value
    return values, faults


def _holds(interval: Any, value: Any) -> bool:
    """Whether an interval, written by identify, is two numbers about a value."""
    numbers = [interval[0], value, interval[1]] if isinstance(interval, list) and len(interval) == 2 else [None]
    sound = all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in numbers)
    return sound and numbers[0] <= value <= numbers[-1]


def check(
    section: str, given: Mapping[str, Any], record: type, beside: Sequence[str] = (),
    kinds: Mapping[str, type] | None = None,
) -> tuple[Any, list[str]]:  # fmt: skip
    """Record made from a section, or None, and all faults in it.

    beside : further keys that its table may hold; kinds : records that the section has with another kind
    """
    if not isinstance(given, Mapping):
        return None, [f"{section} = {given!r} is not a table of keys"]
    values, faults = plain(section, given, record)
    try:
        clean = schema(record)(**values)
    except ValidationError as error:
        for item in error.errors():
            line = _line(section, item, record, beside, kinds or {})
            if line not in faults:
                faults.append(line)
        return None, faults
    return (None if faults else record(**clean.model_dump())), faults


def _line(section: str, item: Any, record: type, beside: Sequence[str], kinds: Mapping[str, type]) -> str:
    """One complaint of pydantic in our words; `beside`, `kinds`: as of `check`."""
    key = str(item["loc"][0]) if item["loc"] else ""
    name = f"{section}.{key}".lstrip(".")
    known = {n: d for n, d, _ in declarations(record)}
    if item["type"] == "extra_forbidden":
        may = [*known, *beside]
        near = get_close_matches(key, may, n=1, cutoff=0.5)
        of = [kind for kind, other in kinds.items() if key in {known for known, _, _ in declarations(other)}]
        hint = f"did you mean {f'{section}.{near[0]}'.lstrip('.')}?" if near else f"known: {', '.join(may)}"
        hint = f"it belongs to {section}.kind = {' or '.join(map(repr, of))}" if of else hint
        return f"{name}: unknown key; {hint}"
    declared, value = known[key], item["input"]
    if isinstance(declared, Quantity):
        if item["type"] == "multiple_of":
            return f"{name} = {value:g} is not a whole number; give one in {declared.span}"
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return f"{name} = {with_unit(_number(value), declared.unit)} lies outside {declared.span}"
        return f"{name} = {value!r} is not a number; give {declared.span}"
    if isinstance(declared, Choice):
        near = get_close_matches(str(value), declared.options, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        return f"{name} = {value!r} is none of {', '.join(declared.options)}{hint}"
    if isinstance(declared, Text):
        return f"{name} = {value!r} is not text"
    assert isinstance(declared, Points)
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


def _number(value: float) -> str:
    """A number for a person; a whole number may be too large to be a float."""
    try:
        return f"{value:g}"
    except OverflowError:
        return "a whole number beyond 1e308"
