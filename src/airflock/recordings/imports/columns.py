"""Which columns of a table hold what: by --map, or by their headers; and their values in SI units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports import expressions, headers, px4
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    TARGETS,
    VELOCITY_TARGETS,
    ImportOptions,
)
from airflock.support import RecordingError, collect_errors, suggest

MAX_COLUMNS = 2000
OF_A_TRACKER = ("probability", "likelihood", "score", "confidence")


@dataclass
class ColumnLayout:
    """How a table is read: target → tree and factor; the column of names; what to tell the user."""

    where: str
    expressions: dict[str, Any] = field(default_factory=dict)
    factors: dict[str, float] = field(default_factory=dict)
    user_labels: dict[str, str] = field(default_factory=dict)
    id: str = ""  # a column, or "" where the whole file is one individual
    datum: str = ""
    ground: bool = False  # whether its axes are known to point east and north
    notes: list[str] = field(default_factory=list)

    @property
    def used(self) -> list[str]:
        """Columns that are needed."""
        found = [name for tree in self.expressions.values() for name in expressions.column_names(tree)]
        return list(dict.fromkeys(found + ([self.id] if self.id else [])))

    def values(self, table: Mapping[str, NDArray[np.float64]], count: int) -> dict[str, NDArray[np.float64]]:
        """Targets in SI units."""
        return {
            target: np.broadcast_to(self.factors[target] * expressions.evaluate(tree, table), count).astype(float)
            for target, tree in self.expressions.items()
        }


def column_layout(where: str, columns: Sequence[str], options: ImportOptions) -> ColumnLayout:
    """Layout of a table with these columns; raises RecordingError with every fault."""
    if len(columns) > MAX_COLUMNS:
        raise RecordingError(
            f"{where}: {len(columns)} columns are more than {MAX_COLUMNS}; "
            "give a long table with the columns id, t, x, y"
        )
    twice = [name for i, name in enumerate(columns) if name in columns[:i]]
    if twice:
        raise RecordingError(f"{where}: column {twice[0]} appears twice; rename one of them")
    faults: list[str] = []
    options, notes = px4.px4_options(where, columns, options)
    found = ColumnLayout(where, notes=notes)
    other = [column for column in columns if _commands_no_velocity(column)]
    with collect_errors(faults):
        _mapped(found, columns, options)
    with collect_errors(faults):
        _recognised(found, [column for column in columns if column not in other], options)
    if other:
        found.notes.append(f"{where}: {', '.join(other)}: no commanded velocity: left out")
    whole = not faults
    _frames(found, options, faults)
    if whole:
        _complete(found, columns, faults)
    if faults:
        raise RecordingError("\n".join(faults))
    found.ground = bool(options.axes) or headers.split_header(found.user_labels.get("x", ""))[0] in headers.EAST_HEADERS
    _ned(found, options)
    for name in px4.extra_columns(columns, options):
        found.expressions[name], found.factors[name], found.user_labels[name] = (
            expressions.parse_expression(repr(name), name),
            1.0,
            name,
        )
    return found


def _commands_no_velocity(column: str) -> bool:
    """Whether a column holds a heading or an acceleration that was commanded."""
    told = headers.header_meaning(column)
    return told is not None and told.target in COMMAND_TARGETS and told.unit in headers.OTHER_COMMAND_UNITS


def _mapped(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    faults = []
    for target, text in options.map.items():
        try:
            if target not in TARGETS:
                hint = suggest(target, TARGETS, f"known: {', '.join(TARGETS)}", cutoff=0.6)
                raise RecordingError(f"--map {target}:={text}: no target {target}; {hint}")
            if target == "id" and text.strip() == "file":
                continue
            tree = expressions.parse_expression(text, target)
            expressions.check_columns(tree, columns, found.where, target)
            if target == "id":
                found.id = expressions.single_column(tree)
                if not found.id:
                    raise RecordingError(f"--map id:={text}: give one column, or file")
                continue
            one = expressions.single_column(tree)
            told = headers.header_meaning(one) if one else None
            unit = (
                told.unit
                if told is not None and told.target == target
                else (headers.split_header(one)[1] if one else "")
            )
            found.expressions[target], found.user_labels[target] = tree, text.strip()
            alone = bool(one)
            found.factors[target] = headers.column_factor(target, unit, found.where, options) if alone else 1.0
            if target == "alt" and told is not None:
                found.datum = told.datum
        except RecordingError as fault:
            faults.append(str(fault))
    if faults:
        raise RecordingError("\n".join(faults))


def _recognised(found: ColumnLayout, columns: Sequence[str], options: ImportOptions) -> None:
    faults, unsaid = [], []
    for column in columns:
        told = headers.header_meaning(column)
        if told is None or told.target in found.expressions:
            continue
        if told.target == "id":
            if not found.id and options.map.get("id", "").strip() != "file":
                found.id = column
            continue
        if told.target in options.map:
            continue
        try:
            scale = headers.column_factor(told.target, told.unit, f"{found.where}: column {column}", options)
        except RecordingError as fault:
            faults.append(str(fault))
            continue
        found.expressions[told.target] = expressions.parse_expression(repr(column), told.target)
        found.factors[told.target] = told.sign * scale
        found.user_labels[told.target] = column
        found.datum = told.datum or found.datum
        if told.target in POSITION_TARGETS and not told.unit and not options.unit:
            unsaid.append(column)
    if {"lat", "lon", "alt", "z"} <= set(found.expressions) and "z" not in options.map and "x" not in found.expressions:
        unsaid = [
            column for column in unsaid if column != found.user_labels["z"]
        ]  # such as U, used, of ArduPilot's GPS
        _drop(found, "z")
    if faults:
        raise RecordingError("\n".join(faults))
    if unsaid:
        tells = [f"{c} comes from a tracker" for c in columns if headers.split_header(c)[0] in OF_A_TRACKER]
        if "t" not in found.expressions and "frame" in found.expressions:
            tells.append(f"{found.user_labels['frame']} comes from a camera")
        if tells:
            raise RecordingError(f"{found.where}: column {unsaid[0]} has no unit, and {tells[0]}; {headers.UNIT_HINT}")
        found.notes.append(
            f"{found.where}: {', '.join(unsaid)} without a unit: taken as m; if not, write for instance --unit mm"
        )


def _frames(found: ColumnLayout, options: ImportOptions, faults: list[str]) -> None:
    """Time from numbers of frames, where there is no other."""
    counted = options.time_unit == "frames" and "t" in found.expressions
    if "t" not in found.expressions and "frame" in found.expressions:
        _copy(found, "frame", "t")
        counted = True
    if counted:
        if options.fps is None:
            faults.append(
                f"{found.where}: column {found.user_labels['t']} counts frames; say how many a second: --fps 25"
            )
        else:
            found.factors["t"] = 1.0 / options.fps
    _drop(found, "frame")


def _complete(found: ColumnLayout, columns: Sequence[str], faults: list[str]) -> None:
    shown = ", ".join(list(columns)[:12]) + (", ..." if len(columns) > 12 else "")
    if "t" not in found.expressions and "utc" not in found.expressions:
        faults.append(f"{found.where}: no column of times among {shown}; write for instance --map t:=COLUMN")
    local = all(name in found.expressions for name in POSITION_TARGETS[:2])
    geodetic = all(name in found.expressions for name in ("lat", "lon"))
    if not (local or geodetic):
        faults.append(f"{found.where}: no position among {shown}; write for instance --map x:=COLUMN --map y:=COLUMN")
    for part in (VELOCITY_TARGETS, COMMAND_TARGETS):
        if sum(name in found.expressions for name in part[:2]) == 1:
            there = next(name for name in part[:2] if name in found.expressions)
            lacks = next(name for name in part[:2] if name not in found.expressions)
            faults.append(
                f"{found.where}: has {there} ({found.user_labels[there]}) but no {lacks}; --map {lacks}:=COLUMN"
            )


def _ned(found: ColumnLayout, options: ImportOptions) -> None:
    """Swap north and east and turn z over, where the user says that x is north."""
    if options.axes != "ned":
        return
    for first, second, third in (POSITION_TARGETS, VELOCITY_TARGETS, COMMAND_TARGETS):
        if first in found.expressions and second in found.expressions:
            _copy(found, first, "")
            _copy(found, second, first)
            _copy(found, "", second)
        if third in found.factors:
            found.factors[third] = -found.factors[third]
    _drop(found, "")


def _copy(found: ColumnLayout, source: str, target: str) -> None:
    found.expressions[target], found.factors[target] = found.expressions[source], found.factors[source]
    found.user_labels[target] = found.user_labels[source]


def _drop(found: ColumnLayout, target: str) -> None:
    for table in (found.expressions, found.factors, found.user_labels):
        table.pop(target, None)
