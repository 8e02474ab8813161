"""Tables with the fields of PX4: x is north, z is down and times are microseconds, although no header says so."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from airflock.recordings.imports import headers
from airflock.recordings.imports.track import POSITION_TARGETS, VELOCITY_TARGETS, ImportOptions
from airflock.support import RecordingError

FIELDS = {"timestamp", *POSITION_TARGETS, *VELOCITY_TARGETS}
# fields of vehicle_local_position that no other table has; source: PX4, msg/VehicleLocalPosition.msg
MARKS = {"ref_timestamp", "xy_valid", "z_valid", "v_xy_valid", "xy_reset_counter", "vxy_reset_counter", "z_deriv"}
ORIGIN = ("ref_lat", "ref_lon", "ref_alt")
VALID = ("xy_valid", "v_xy_valid")


def px4_options(where: str, columns: Sequence[str], options: ImportOptions) -> tuple[ImportOptions, list[str]]:
    """Options for a table of these columns, and notes: axes and times of PX4 where its fields are there.

    Raises RecordingError where they may be those of PX4 and nobody has said which axes they are.
    """
    names = {headers.split_header(column)[0]: headers.split_header(column)[1] for column in columns}
    if not set(names) >= FIELDS or set(options.map) & {*POSITION_TARGETS, *VELOCITY_TARGETS}:
        return options, []
    micro = "us" in (options.time_unit, names["timestamp"]) or "timestamp" in options.map.get("t", "")
    if is_px4_log(columns):
        unit = options.time_unit or ("" if names["timestamp"] else "us")
        found = replace(options, axes=options.axes or "ned", time_unit=unit, unit=options.unit or "m")
        told = "x is north, y east, z down (otherwise --axes enu), times in us, lengths in m"
        return found, [f"{where}: fields of PX4's vehicle_local_position: {told}"] if not options.axes else []
    if micro and not options.axes:
        raise RecordingError(
            f"{where}: timestamp in us, x, y, z, vx, vy, vz are fields of PX4, whose x is north and z down: "
            "write --axes ned, or --axes enu if x is east"
        )
    return options, []


def is_px4_log(columns: Sequence[str]) -> bool:
    """Whether a table of these columns can only be PX4's vehicle_local_position."""
    names = {headers.split_header(column)[0] for column in columns}
    return names >= FIELDS and bool(names & MARKS)


def extra_columns(columns: Sequence[str], options: ImportOptions) -> list[str]:
    """Further columns of such a table that are read: where its origin is, and whether a row is valid."""
    if options.axes != "ned" or not is_px4_log(columns):
        return []
    return [*(ORIGIN if set(columns) >= set(ORIGIN) else ()), *(name for name in VALID if name in columns)]


def pop_origin_and_validity(columns: dict[str, Any]) -> tuple[tuple[float, float, float] | None, Any]:
    """Take these columns out of a track's, and return its origin, if known, and of each row whether it is valid."""
    origin = px4_origin(columns)
    flags = [columns.pop(name) for name in VALID if name in columns]
    for name in ORIGIN:
        columns.pop(name, None)
    return origin, np.all([flag != 0.0 for flag in flags], axis=0) if flags else None


def invalid_note(where: str, name: str, valid: Any, row_numbers: Any) -> str:
    """What is told of rows that the estimator calls invalid."""
    bad = row_numbers[~valid]
    return f"{where}: {name}: {len(bad)} rows that the estimator calls invalid left out, first row {bad[0]}"


def px4_origin(local: Mapping[str, Any]) -> tuple[float, float, float] | None:
    """Latitude, longitude (degrees) and height (m) of x = y = z = 0, which the estimator tells once it knows them."""
    if not all(name in local for name in ORIGIN):
        return None
    place = np.stack([np.asarray(local[f"ref_{name}"], float) for name in ("lat", "lon", "alt")], axis=1)
    known = place[np.isfinite(place).all(axis=1) & (place[:, :2] != 0.0).any(axis=1)]
    return None if not len(known) else (float(known[-1, 0]), float(known[-1, 1]), float(known[-1, 2]))
