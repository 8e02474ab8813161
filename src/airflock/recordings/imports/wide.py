"""Wide tables: a pair of columns for each individual, as x1, y1, x2, y2 or fish1_x, fish1_y, fish2_x, fish2_y."""

import re
from collections.abc import Iterable

import pandas as pd

from airflock.recordings.imports import headers
from airflock.recordings.imports.columns import ColumnLayout
from airflock.recordings.imports.track import POSITION_TARGETS

AXIS_FIRST = re.compile(r"([xyz])_?(\d+)")
NAME_FIRST = re.compile(r"([a-z][a-z_]*?_?\d+)_([xyz])")  # a number: head_x, tail_x are places on one individual


def wide_columns(names: list[str]) -> dict[str, dict[str, str]]:
    """Individual → component → column, of a table such as time, x1, y1, x2, y2; empty if it is none."""
    found: dict[str, dict[str, str]] = {}
    plain = [headers.split_header(name)[0] for name in names]
    if any(name in headers.ALIASES["x"] for name in plain):
        return found
    for name, text in zip(names, plain, strict=True):
        first, second = AXIS_FIRST.fullmatch(text), NAME_FIRST.fullmatch(text)
        if first:
            found.setdefault(first[2], {})[first[1]] = name
        elif second:
            found.setdefault(second[1], {})[second[2]] = name
    return found if found and all({"x", "y"} <= set(parts) for parts in found.values()) else {}


def first_individual_columns(names: list[str], wide: dict[str, dict[str, str]]) -> list[str]:
    """Columns of the first individual of a wide table, under the names of a long one."""
    taken = {column for parts in wide.values() for column in parts.values()}
    first = next(iter(wide.values()))
    unit = {part: headers.split_header(column)[1] for part, column in first.items()}
    return [n for n in names if n not in taken] + [f"{part} [{unit[part]}]" if unit[part] else part for part in first]


def split_by_individual(
    table: pd.DataFrame, wide: dict[str, dict[str, str]], layout: ColumnLayout, stem: str
) -> Iterable[tuple[str, pd.DataFrame]]:
    """Rows of a table by individual, each under the names of a long one; all of them as `stem` where it is not wide."""
    if not wide:
        return [(stem, table)]
    taken = [column for parts in wide.values() for column in parts.values()]
    rest = table.drop(columns=taken)
    told = {layout.user_labels[axis]: axis for axis in POSITION_TARGETS if axis in layout.user_labels}
    return (
        (number, rest.assign(**{label: table[parts[axis]] for label, axis in told.items() if axis in parts}))
        for number, parts in wide.items()
    )
