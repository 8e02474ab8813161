"""PX4 ULog files, by pyulog (BSD-3, an extra): topics by name, NED to ENU, resets and clock as the file tells them."""

from pathlib import Path
from typing import Any

import numpy as np

from airflock.recordings.imports.px4 import invalid_note, px4_origin
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.support import RecordingError

LOCAL, SETPOINT = "vehicle_local_position", "trajectory_setpoint"
TOPICS = [LOCAL, SETPOINT, "vehicle_gps_position", "vehicle_land_detected"]
NED = (("x", "y", "z"), ("vx", "vy", "vz"))


def read_ulog(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Track of a PX4 log: vehicle_local_position, and trajectory_setpoint as the command in force.

    The set-point is what the companion asked for; vehicle_local_position_setpoint is the controller's own output and
    is not read. Rows where the estimator calls its position invalid are left out.
    """
    try:
        from pyulog import ULog
    except ImportError as fault:
        raise RecordingError(f"{path}: PX4 logs need pyulog: pip install 'airflock[logs]'") from fault
    try:
        log = ULog(str(path), TOPICS)
    except Exception as fault:  # pyulog raises TypeError, struct.error, IndexError and others for damaged files
        raise RecordingError(f"{path}: is not a ULog that can be read: {type(fault).__name__}: {fault}") from fault
    topics = {data.name: data.data for data in reversed(log.data_list) if data.multi_id == 0}
    options.done(0.8)
    if LOCAL not in topics:
        raise RecordingError(f"{path}: has no {LOCAL}; log it (SDLOG_PROFILE, default set) or import the GNSS as CSV")
    local = topics[LOCAL]
    time = local["timestamp"] * 1e-6
    columns = _enu({axis: local[axis] for axis in NED[0]}, POSITION_TARGETS) | _enu(
        {a: local[a] for a in NED[1]}, VELOCITY_TARGETS
    )
    columns |= _command(topics.get(SETPOINT), time, path, findings)
    valid = np.ones(len(time), bool)
    for flag in ("xy_valid", "v_xy_valid"):
        valid &= local[flag].astype(bool) if flag in local else True
    labels = {"x": "y", "y": "x", "z": "-z", "vx": "vy", "vy": "vx", "vz": "-vz"}
    found = ImportedTrack(path.stem, str(path), time, columns, np.arange(len(time)), labels, "boot", datum="amsl")
    if "xy_reset_counter" in local:
        found.breaks = np.flatnonzero(np.diff(local["xy_reset_counter"].astype(np.int64)) != 0) + 1
        if found.breaks.size:
            findings.notes.append(f"{path}: {found.breaks.size} resets of the estimator: the track is split there")
    found.origin = px4_origin(local)
    found.utc = _utc(topics.get("vehicle_gps_position"))
    found.in_air = _air(topics.get("vehicle_land_detected"), time)
    if not valid.any():
        raise RecordingError(f"{path}: the estimator never called its position valid")
    if not valid.all():
        findings.notes.append(invalid_note(str(path), path.stem, valid, found.rows))
        found.keep(valid)
    return [found]


def _enu(ned: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    north, east, down = (np.asarray(values, float) for values in ned.values())
    return {names[0]: east, names[1]: north, names[2]: -down}


def _command(topic: Any, time: Any, path: Path, findings: ImportReport) -> dict[str, Any]:
    """Velocity set-point held until the next one; nan where the position was controlled instead."""
    if topic is None:
        findings.notes.append(f"{path}: has no {SETPOINT}: no commands")
        return {}
    new = "velocity[0]" in topic  # PX4 from 1.13
    parts = {axis: topic[f"velocity[{c}]" if new else f"v{axis}"] for c, axis in enumerate("xyz")}
    ask = _enu(parts, COMMAND_TARGETS)
    at = np.searchsorted(topic["timestamp"] * 1e-6, time, side="right") - 1
    held = {name: np.where(at >= 0, values[np.maximum(at, 0)], np.nan) for name, values in ask.items()}
    share = float(np.isnan(held["cx"]).mean()) if len(time) else 1.0
    if share > 0.0:
        findings.notes.append(f"{path}: {share:.0%} of the time no velocity was commanded")
    return held if share < 1.0 else {}


def _utc(topic: Any) -> Any:
    if topic is None or "time_utc_usec" not in topic:
        return None
    pairs = np.stack([topic["timestamp"] * 1e-6, topic["time_utc_usec"].astype(float) * 1e-6], axis=1)
    pairs = pairs[pairs[:, 1] > 1e9]
    return pairs if len(pairs) >= 2 else None


def _air(topic: Any, time: Any) -> Any:
    if topic is None or "landed" not in topic or not len(topic["timestamp"]):
        return None
    at = np.searchsorted(topic["timestamp"] * 1e-6, time, side="right") - 1
    return ~topic["landed"].astype(bool)[np.maximum(at, 0)] & (at >= 0)
