"""Fields of a flight card: from plain JSON to checked records, every fault noted with its key."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from airflock.support import ParameterError, suggest
from airflock.world import COLUMNS


def read_record(record_class: Any, table: Any, section: str, errors: list[str]) -> Any:
    """A record of parameters from a table, its faults noted."""
    if not isinstance(table, dict):
        errors.append(f"{section} = {table!r} is not a table")
        return None
    known = record_class.__dataclass_fields__
    for key in table:
        if key not in known:
            errors.append(
                f"{section}.{key} is not known{suggest(key, known, lead='; ', prefix=f'{section}.', cutoff=0.6)}"
            )
    try:
        return record_class(**to_tuples({key: value for key, value in table.items() if key in known}))
    except ParameterError as fault:
        errors += [f"{section}.{line.partition('.')[2]}" for line in str(fault).splitlines()]
    except (TypeError, ValueError) as fault:
        errors.append(f"{section}: {fault}")
    return None


def to_tuples(table: Any) -> Any:
    """A table whose lists are tuples."""
    if isinstance(table, dict):
        return {key: to_tuples(value) for key, value in table.items()}
    return tuple(to_tuples(value) for value in table) if isinstance(table, list) else table


def read_numbers(
    table: Any,
    key_prefix: str,
    ranges: Mapping[str, tuple[float, float]],
    errors: list[str],
    other_keys: tuple[str, ...] = (),
) -> dict[str, float]:
    """Numbers of a table within their ranges; what is wrong is noted."""
    found = {}
    if not isinstance(table, dict):
        errors.append(f"{key_prefix} = {table!r} is not a table")
        return {}
    at = f"{key_prefix}." if key_prefix else ""
    errors += [f"{at}{key} is not known" for key in table if key not in ranges and key not in other_keys]
    errors += [f"{at}{key} is missing" for key in other_keys if key not in table]
    for key, (low, high) in ranges.items():
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
            errors.append(f"{at}{key} = {value!r} is not a number")
        elif not low <= value <= high:
            errors.append(f"{at}{key} = {value:g} lies outside [{low:g}, {high:g}]")
        else:
            found[key] = value
    return found


def are_valid_shapes(rows: Any) -> bool:
    """Whether the rows of a scene can be read: `world.shapes` and the tree of `world.bvh`."""
    if not isinstance(rows, dict) or set(rows) != {"shapes", "nodes", "links"}:
        return False
    wide = {"shapes": COLUMNS, "nodes": 6, "links": 3}
    for name, width in wide.items():
        for row in rows[name] if isinstance(rows[name], list) else [None]:
            if not isinstance(row, list) or len(row) != width or not all(type(v) in (int, float) for v in row):
                return False
    count, last = len(rows["nodes"]), len(rows["shapes"])
    if len(rows["links"]) != count:
        return False
    return all(k < s <= count and 0 <= a <= b <= last for k, (s, a, b) in enumerate(rows["links"]))


def is_ring(corners: Any) -> bool:
    """Whether it is a list of points."""
    return isinstance(corners, list) and all(
        isinstance(c, list) and len(c) == 2 and all(type(v) in (int, float) and isfinite(v) for v in c) for c in corners
    )


def read_public_key(text: Any, errors: list[str]) -> bytes:
    """A public key from its digits; empty for none."""
    try:
        key = bytes.fromhex(text)
    except (TypeError, ValueError):
        key = b"?"
    if len(key) not in (0, 32):
        errors.append("operator: is not a public key of 64 hexadecimal digits")
    return key
