"""Fields of a flight card: from plain JSON to checked records, every fault noted with its key."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from airflock.support.errors import ParameterError
from airflock.support.spelling import meant
from airflock.world.shapes import COLUMNS


def record(kind: Any, table: Any, where: str, faults: list[str]) -> Any:
    """A record of parameters from a table, its faults noted."""
    if not isinstance(table, dict):
        faults.append(f"{where} = {table!r} is not a table")
        return None
    known = kind.__dataclass_fields__
    for key in table:
        if key not in known:
            faults.append(f"{where}.{key} is not known{meant(key, known, lead='; ', prefix=f'{where}.', cutoff=0.6)}")
    try:
        return kind(**frozen({key: value for key, value in table.items() if key in known}))
    except ParameterError as fault:
        faults += [f"{where}.{line.partition('.')[2]}" for line in str(fault).splitlines()]
    except (TypeError, ValueError) as fault:
        faults.append(f"{where}: {fault}")
    return None


def frozen(table: Any) -> Any:
    """A table whose lists are tuples."""
    if isinstance(table, dict):
        return {key: frozen(value) for key, value in table.items()}
    return tuple(frozen(value) for value in table) if isinstance(table, list) else table


def numbers_in(
    table: Any, where: str, spans: Mapping[str, tuple[float, float]], faults: list[str], more: tuple[str, ...] = ()
) -> dict[str, float]:
    """Numbers of a table within their ranges; what is wrong is noted."""
    found = {}
    if not isinstance(table, dict):
        faults.append(f"{where} = {table!r} is not a table")
        return {}
    at = f"{where}." if where else ""
    faults += [f"{at}{key} is not known" for key in table if key not in spans and key not in more]
    faults += [f"{at}{key} is missing" for key in more if key not in table]
    for key, (low, high) in spans.items():
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
            faults.append(f"{at}{key} = {value!r} is not a number")
        elif not low <= value <= high:
            faults.append(f"{at}{key} = {value:g} lies outside [{low:g}, {high:g}]")
        else:
            found[key] = value
    return found


def are_shapes(rows: Any) -> bool:
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


def hexadecimal(text: Any, faults: list[str]) -> bytes:
    """A public key from its digits; empty for none."""
    try:
        key = bytes.fromhex(text)
    except (TypeError, ValueError):
        key = b"?"
    if len(key) not in (0, 32):
        faults.append("operator: is not a public key of 64 hexadecimal digits")
    return key
