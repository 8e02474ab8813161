"""Read flight logs: PX4 ULog, ArduPilot DataFlash, MAVLink telemetry, and logs of nodes on board."""

import itertools
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.drones import AIRBORNE_PHASES, FLYING_PHASES, read_log_ticks
from airflock.recordings.imports import reader
from airflock.recordings.imports.common_frame import on_other_clock
from airflock.recordings.imports.table_columns import VALID, invalid_note, px4_origin
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.recordings.reader_process import Contents, OnShare, ReaderProcess
from airflock.support import LinkError, RecordingError

LOGS = "pip install 'airflock[logs]'"
LOCAL, SETPOINT = "vehicle_local_position", "trajectory_setpoint"
TOPICS = [LOCAL, SETPOINT, "vehicle_gps_position", "vehicle_land_detected"]
NED = (("x", "y", "z"), ("vx", "vy", "vz"))


def _track(name: str, path: Path, time: Any, columns: dict[str, Any], rows: Any, **more: Any) -> ImportedTrack:
    """Make a track of an autopilot: its axes are those of the ground, and its units are fixed."""
    how = {"clock": "boot", "datum": "amsl", "fixed_units": True, "ground": True}
    return ImportedTrack(name, str(path), time, columns, rows, **{**how, **more})


@reader("PX4 ULog", suffixes=(".ulg",), needs="pyulog (BSD-3)")
def read_ulog(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """`vehicle_local_position`; the command is `trajectory_setpoint.velocity` (both generations of its fields); clock
    from `vehicle_gps_position`; in the air from `vehicle_land_detected`; split where
    `xy_reset_counter` changes.

    The set-point is the request of the companion; vehicle_local_position_setpoint is the
    controller's own output and is not read. Rows where the estimator calls its position invalid are
    left out.
    """
    try:
        from pyulog import ULog
    except ImportError as error:
        raise RecordingError(f"{path}: PX4 logs need pyulog: {LOGS}") from error
    try:
        log = ULog(str(path), TOPICS)
    except Exception as error:  # pyulog raises TypeError, struct.error, IndexError and others for damaged files
        raise RecordingError(f"{path}: is not a ULog that can be read: {type(error).__name__}: {error}") from error
    topics = {data.name: data.data for data in reversed(log.data_list) if data.multi_id == 0}
    options.done(0.8)
    if LOCAL not in topics:
        raise RecordingError(f"{path}: has no {LOCAL}; log it (SDLOG_PROFILE, default set) or import the GNSS as CSV")
    local = topics[LOCAL]
    time = local["timestamp"] * 1e-6
    columns = _enu({axis: local[axis] for axis in NED[0]}, POSITION_TARGETS) | _enu(
        {a: local[a] for a in NED[1]}, VELOCITY_TARGETS
    )
    valid = np.logical_and.reduce([time >= 0.0, *(local[flag].astype(bool) for flag in VALID if flag in local)])
    labels = {"x": "y", "y": "x", "z": "-z", "vx": "vy", "vy": "vx", "vz": "-vz"}
    found = _track(path.stem, path, time, columns, np.arange(len(time)), user_labels=labels)
    _add_commands(found, *_setpoints(topics.get(SETPOINT)), findings, f"{SETPOINT} (velocities)")
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


def _setpoints(topic: Any) -> tuple[Any, Any]:
    """Return times (s) and velocities east, north, up (m/s); nan where the position was controlled instead."""
    if topic is None:
        return np.empty(0), np.empty((0, 3))
    new = "velocity[0]" in topic  # PX4 from 1.13
    parts = {axis: topic[f"velocity[{c}]" if new else f"v{axis}"] for c, axis in enumerate("xyz")}
    return topic["timestamp"] * 1e-6, np.stack([*_enu(parts, COMMAND_TARGETS).values()], axis=1)


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


# Fields of ArduPilot's logs are read by name, because their sets change between releases, in a process of its own
# (`reader_process`): pymavlink loops without end in some damaged logs.
PARTS = ("PSCN", "PSCE", "PSCD")  # position control: north, east, down
PACE = 1e5  # bytes per second; read by Python, row by row
VELOCITY_SUBMODE = 4  # GUIP.Type of a velocity; others control a position, an acceleration or an attitude
GIVEN_UP = 3.0  # s after which GUIDED mode gives up a velocity; source: ArduPilot, GUID_TIMEOUT
HEAD = b"\xa3\x95"  # of each message; source: ArduPilot, AP_Logger/LogStructure.h
VELOCITY_IGNORED = 8 + 16 + 32  # bits of a type mask; source: MAVLink, POSITION_TARGET_TYPEMASK
REBOOT = 2.0  # s by which time since boot goes back only after a boot; messages overtake each other by less
QUICKEST_OF = 10.0  # s; behind MAVProxy messages were up to 1.9 s late, and now and then at once
GPS_EPOCH = 315964800.0  # 6 January 1980 in seconds since 1970
LEAP_SECONDS = 18.0  # GPS ahead of UTC since 2017; the same for all drones, so that it cannot part them


@reader(
    "DataFlash log of ArduPilot", suffixes=(".bin",), sniff=lambda start: start.startswith(HEAD),
    needs="pymavlink (LGPL-3, imported only to read such a log)",
)  # fmt: skip
def read_dataflash(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """`PSCN, PSCE, PSCD` by field names (position, velocity), `ORGN`, `GPS`. The command is `GUIP` in its own unit, the
    velocity that GUIDED mode was sent. Of planes, rovers and older releases `XKF1`, else `NKF1`,
    `POS` or `GPS`, without commands; a note says which.

    TVN, TVE, TVD are no commands: they are what the position controller makes of GUIP within its
    limits of acceleration and jerk, so that a response to them looks eight times as quick as that
    to a command.
    """
    _need_pymavlink(path)
    contents = ReaderProcess(path, read_dataflash_arrays, "a DataFlash log", pace=PACE).answer(options.done)
    rows = {part: contents[part].values for part in PARTS if part in contents}
    if "PSCN" not in rows or "PSCE" not in rows:
        return [_estimated(path, findings)]
    found = _joined(rows, path)
    guided = contents["GUIP"].values if "GUIP" in contents else np.empty((0, 6))
    _add_commands(found, guided[:, 2] * 1e-6, _guided_velocities(guided), findings, "GUIP (velocities in GUIDED mode)")
    return [_located(found, contents)]


LOCAL_FIELDS = {"y": "PN", "x": "PE", "z": "PD", "vy": "VN", "vx": "VE", "vz": "VD"}
GEODETIC_FIELDS = {"lat": "Lat", "lon": "Lng", "alt": "Alt"}
# Messages that say where a vehicle is, the best first (EKF3, EKF2, what the pilot sees, the receiver), with the number
# of the filter or the receiver.
ESTIMATES = {"XKF1": ("C", LOCAL_FIELDS), "NKF1": ("C", LOCAL_FIELDS), "POS": ("I", GEODETIC_FIELDS),
             "GPS": ("I", GEODETIC_FIELDS)}  # fmt: skip


def _located(track: ImportedTrack, contents: Any) -> ImportedTrack:
    """Add the origin of the local frame, and times of satellites, as far as a log has them."""
    if "ORGN" in contents:
        track.origin = _place(contents["ORGN"].values[-1])
    # Times since the start and since 1970 by the first receiver.
    table = contents["GPS"].values if "GPS" in contents else np.empty((0, 4))
    known = table[(table[:, -2] > 0.0) & (table[:, 1] == 0.0)]
    utc = GPS_EPOCH - LEAP_SECONDS + known[:, -2] * 604800.0 + known[:, -1] * 1e-3
    track.utc = np.stack([known[:, 0] * 1e-6, utc], axis=1) if len(known) >= 2 else None
    return track


def _place(row: Any) -> tuple[float, float, float]:
    latitude, longitude, height = (float(value) for value in row)
    return latitude, longitude, height


def _estimated(path: Path, findings: ImportReport) -> ImportedTrack:
    """Read the estimates of a plane, a rover or an old release, which log no PSCN and PSCE."""
    contents = ReaderProcess(path, read_estimate_arrays, "a DataFlash log", pace=PACE).answer()
    kind = next((kind for kind in ESTIMATES if kind in contents), "")
    if not kind:
        raise RecordingError(
            f"{path}: has no PSCN and PSCE (position control, Copter 4.2 and later), nor {', '.join(ESTIMATES)}; "
            f"it has {contents.attrs['kinds']}; log one of those (LOG_BITMASK)"
        )
    findings.notes.append(
        f"{path}: has no PSCN and PSCE (position control, Copter 4.2 and later): {kind} is read, row 0 on; no commands"
    )
    table, fields = contents[kind].values, ESTIMATES[kind][1]
    numbers = np.nan_to_num(table[:, 1])
    table = table[numbers == numbers.min()]  # the first of several filters or receivers
    columns = {name: (-1.0 if name in ("z", "vz") else 1.0) * table[:, 2 + c] for c, name in enumerate(fields)}
    labels = {name: f"{kind}.{field}" for name, field in fields.items()}
    found = _track(path.stem, path, table[:, 0] * 1e-6, columns, np.arange(len(table)), user_labels=labels)
    return _located(found, contents)


def _joined(rows: dict[str, Any], path: Path) -> ImportedTrack:
    """Join the axes in one table at the times of the north axis; the autopilot writes all axes in one loop."""
    north, east, down = rows["PSCN"], rows["PSCE"], rows.get("PSCD")
    time = north[:, 0] * 1e-6

    def at(table: Any, column: int) -> Any:
        return np.interp(north[:, 0], table[:, 0], table[:, column])

    columns = {"x": at(east, 1), "y": north[:, 1], "vx": at(east, 2), "vy": north[:, 2]}
    if down is not None:
        columns |= {"z": -at(down, 1), "vz": -at(down, 2)}
    known = [k for k in (*POSITION_TARGETS, *VELOCITY_TARGETS) if k in columns and np.isfinite(columns[k]).any()]
    columns = {name: columns[name] for name in known}
    labels = {"x": "PSCE.PE", "y": "PSCN.PN", "z": "-PSCD.PD", "vx": "PSCE.VE", "vy": "PSCN.VN", "vz": "-PSCD.VD"}
    return _track(path.stem, path, time, columns, np.arange(len(time)), user_labels=labels)


def _guided_velocities(guided: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return velocities east, north, up (row, 3), m/s, of GUIP; nan where it controls something else."""
    metres, kind, (north, east, third) = guided[:, 0], guided[:, 1], guided[:, 3:].T
    # Logs in m/s are north-east-down, those in cm/s (Copter to 4.6) north-east-up: measured in a climb.
    velocity = np.stack([east, north, np.where(metres, -third, third)], axis=1) * np.where(metres, 1.0, 0.01)[:, None]
    return np.where((kind == VELOCITY_SUBMODE)[:, None], velocity, np.nan)


def _add_commands(track: ImportedTrack, at: Any, commands: Any, findings: ImportReport, name: str) -> None:
    """Add the command in force at each row: the last one, unless it is so old that the autopilot has given it up.

    at, commands : times (s, of the track's clock) and velocities east, north, up (m/s); name : of
                   these messages
    """
    order = np.argsort(at, kind="stable")
    at, last = at[order], np.searchsorted(at[order], track.time, side="right") - 1
    # A stream that stops has ended long before the time-out: take-off and landing are no "0 m/s".
    longest = min(GIVEN_UP, 5.0 * float(np.median(np.diff(at)))) if len(at) > 1 else GIVEN_UP
    held = np.full((len(track.time), 3), np.nan)
    if len(at):
        there = (last >= 0) & (track.time - at[last] <= longest)
        held[there] = commands[order][last[there]]
    share = float(np.isnan(held[:, 0]).mean())
    if share > 0.0:
        note = f"{share:.0%} of the time without {name}: no commands there"
        findings.notes.append(f"{track.source}: {track.name}: {note}")
    if share < 1.0:
        track.columns |= dict(zip(COMMAND_TARGETS, held.T, strict=True))


@reader("telemetry log of MAVLink", suffixes=(".tlog",), needs="pymavlink")
def read_tlog(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """`LOCAL_POSITION_NED` of each vehicle, velocities of `POSITION_TARGET_LOCAL_NED` as its command; rows have the
    vehicle's own time, put on the receiver's clock.

    A row is put on that clock by `time_boot_ms`, not by its arrival. Positions are about their own
    origins.
    """
    _need_pymavlink(path)
    contents = ReaderProcess(path, read_telemetry_arrays, "telemetry", pace=PACE).answer(options.done)
    if "LOCAL_POSITION_NED" not in contents:
        raise RecordingError(f"{path}: has no LOCAL_POSITION_NED; import the vehicles' own logs instead")
    states = _by_vehicle(contents, "LOCAL_POSITION_NED", (0, 1, 3, 2, 4, 6, 5, 7), (1, 1e-3, 1, 1, -1, 1, 1, -1))
    wishes = _by_vehicle(contents, "POSITION_TARGET_LOCAL_NED", (0, 1, 4, 3, 5, 2), (1, 1e-3, 1, 1, -1, 1))
    origins = _by_vehicle(contents, "GPS_GLOBAL_ORIGIN", (1, 2, 3), (1e-7, 1e-7, 1e-3))
    found = []
    for who, table in sorted(states.items()):
        # Two links to one receiver, or a router, bring the same message twice.
        rows = np.sort(np.unique(table[:, 1:], axis=0, return_index=True)[1])
        table, ask = table[rows], wishes.get(who, np.empty((0, 6)))
        both = np.concatenate([table[:, :2], ask[:, :2]])
        order = np.argsort(both[:, 0], kind="stable")
        time = np.empty(len(both))
        time[order] = state_times(*both[order].T)
        columns = dict(zip((*POSITION_TARGETS, *VELOCITY_TARGETS), table.T[2:].copy(), strict=True))
        track = _track(f"vehicle_{who}", path, time[: len(rows)], columns, rows, clock="utc")
        track.breaks = np.flatnonzero(np.diff(table[:, 1]) < -REBOOT) + 1
        velocity = np.where((ask[:, 5].astype(int) & VELOCITY_IGNORED == 0)[:, None], ask[:, 2:5], np.nan)
        _add_commands(track, time[len(rows) :], velocity, findings, "POSITION_TARGET_LOCAL_NED (velocities)")
        if who in origins:
            track.origin = _place(origins[who][-1])
        found.append(track)
    return found


def state_times(arrival: NDArray[np.float64], boot: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put the times of states, s since boot, on the clock that they arrived by; in order of arrival.

    Arrivals scatter by a period of the link, which would look like jumps of a drone that flies:
    between two boots both clocks go by one straight line, through the message of each 10 s that was
    under way for the shortest time.
    """
    time = arrival.copy()
    edges = [0, *(np.flatnonzero(np.diff(boot) < -REBOOT) + 1), len(boot)]
    for begin, end in itertools.pairwise(edges):
        own = boot[begin:end]
        if len(own) and np.ptp(own) > 0.0:  # an autopilot that does not count has its arrivals
            late, part = arrival[begin:end] - own, (own - own.min()) // QUICKEST_OF
            order = np.lexsort((late, part))
            quick = order[np.unique(part[order], return_index=True)[1]]
            time[begin:end] = on_other_clock(own, own[quick], arrival[begin:end][quick])[0]
    return time


def _by_vehicle(contents: Any, kind: str, columns: tuple[int, ...], factors: tuple[float, ...]) -> dict[int, Any]:
    """Return rows of each vehicle, of these columns (0: the time) times factors, in their order in the log."""
    if kind not in contents:
        return {}
    table = contents[kind].values
    return {int(who): table[table[:, 0] == who][:, 1:][:, columns] * factors for who in np.unique(table[:, 0])}


def read_dataflash_arrays(path: str, _: int, share: OnShare) -> Contents:
    """Read tables of time (µs), position and velocity of each axis; of commands; of origins; of GPS times."""
    from pymavlink import DFReader

    fields: dict[str, tuple[str, ...]] = {part: ("TimeUS", f"P{part[-1]}", f"V{part[-1]}") for part in PARTS}
    fields |= {"ORGN": ("Lat", "Lng", "Alt"), "GPS": ("TimeUS", "I", "GWk", "GMS")}
    fields |= {"GUIP": ("Type", "TimeUS", "vX", "vY", "vZ")}

    def source(message: Any) -> list[float]:
        """Return 1 for a command in m/s, 0 for one in cm/s; a log without units is an early one."""
        return [float(message.fmt.get_unit("vX") == "m/s")] if message.get_type() == "GUIP" else []

    return _tables(DFReader.DFReader_binary(path), fields, source, share)


def read_estimate_arrays(path: str, _: int, share: OnShare) -> Contents:
    """Read tables of time (µs), number of the filter, place and velocity; `kinds` names all messages of the log."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(path)
    fields = {kind: ("TimeUS", number, *own.values()) for kind, (number, own) in ESTIMATES.items()}
    fields |= {"ORGN": ("Lat", "Lng", "Alt"), "GPS": (*fields["GPS"], "GWk", "GMS")}
    tables = _tables(log, fields, lambda message: [], share)[1]
    kinds = [name for name, number in log.name_to_id.items() if log.counts[number]]
    return {"kinds": ", ".join(sorted(kinds))}, tables


def read_telemetry_arrays(path: str, _: int, share: OnShare) -> Contents:
    """Read tables of vehicle, arrival (s), and numbers of states, of commands and of origins."""
    from pymavlink import mavutil

    fields = {
        "LOCAL_POSITION_NED": ("time_boot_ms", "x", "y", "z", "vx", "vy", "vz"),
        "POSITION_TARGET_LOCAL_NED": ("time_boot_ms", "type_mask", "vx", "vy", "vz"),
        "GPS_GLOBAL_ORIGIN": ("latitude", "longitude", "altitude"),
    }

    def source(message: Any) -> list[float]:
        return [message.get_srcSystem(), getattr(message, "_timestamp", 0.0)]

    return _tables(mavutil.mavlink_connection(path), fields, source, share)


def _tables(
    log: Any, fields: Mapping[str, tuple[str, ...]], source: Callable[[Any], list[float]], share: OnShare
) -> Contents:
    """Read one table of float64 for each kind of message, a row each: its source, then its fields."""
    rows: dict[str, list[list[float]]] = {kind: [] for kind in fields}
    percent = 0.0
    # Message by message: pymavlink has no arrays. Only what is needed is kept, as rows of floats.
    while (message := log.recv_match(type=[*fields])) is not None:
        kind = message.get_type()
        # a log without I is of a vehicle with one GPS receiver, number 0
        numbers = [getattr(message, name, 0.0 if name == "I" else np.nan) for name in fields[kind]]
        rows[kind].append([*source(message), *numbers])
        if getattr(log, "percent", 0.0) >= percent + 1.0:
            percent = log.percent
            share(percent / 100.0)
    return {}, {kind: (None, {}, np.array(table, float)) for kind, table in rows.items() if table}


def _need_pymavlink(path: Path) -> None:
    if find_spec("pymavlink") is None:
        raise RecordingError(f"{path}: ArduPilot logs need pymavlink (LGPL-3): {LOGS}")


RECKONED_SPEED = 0.5  # m/s; slower, a step says nothing of the time
CLOCK_GAIN = 0.05  # share of the difference to the ticks that each row takes back: over a second at 20 Hz


@reader(
    "log of a node of Airflock; of ArduPilot give the .bin that it was made from", suffixes=(".log",),
    sniff=lambda start: start.startswith(b'{"log":'), needs="pymavlink",
)  # fmt: skip
def read_node_log(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Place and velocity as the autopilot sent them, at its own time put on the node's clock, and what the node
    commanded, in east-north-up of the mission. Without the autopilot's bytes the time is reckoned
    from the steps.

    A row is a tick at which the own state was another than at the tick before, at the time at which
    the state held, not that of the tick. Commands are those of phases in which the node flies; the
    log's first line relates their clock to UTC.
    """
    try:
        log = read_log_ticks(path)
    except LinkError as error:
        raise RecordingError(str(error)) from error
    options.done(0.8)
    states = [tick.own for tick in log.ticks]
    rows = [k for k, own in enumerate(states) if own is not None and (k == 0 or own != states[k - 1])]
    if not rows:
        raise RecordingError(f"{path}: the autopilot never told where it is")
    ticks = [log.ticks[k] for k in rows]
    place = np.array([tick.own for tick in ticks], float)
    stamps = np.array([tick.stamp or (np.nan, np.nan) for tick in ticks])
    seen, known = np.array([tick.time for tick in ticks]), np.isfinite(stamps[:, 0])
    if known.any():
        time = seen.copy()
        time[known] = state_times(*stamps[known].T)
        time[~known] -= np.median(seen[known] - time[known])
    else:
        time = reckoned_times(seen, place)
    columns = dict(zip((*POSITION_TARGETS, *VELOCITY_TARGETS), place.T, strict=True))
    labels = {name: f"own[{c}]" for c, name in enumerate((*POSITION_TARGETS, *VELOCITY_TARGETS))}
    labels |= {name: f"set[{c}]" for c, name in enumerate(COMMAND_TARGETS)}
    lines = np.array([tick.line for tick in ticks])
    found = _track(f"member_{log.member}", path, time, columns, lines, user_labels=labels, datum="home")
    flown = np.array([tick.phase in FLYING_PHASES for tick in log.ticks])
    if flown.any():
        commands = np.where(flown[:, None], np.array([tick.command for tick in log.ticks]), np.nan)
        at = np.array([tick.time for tick in log.ticks])
        _add_commands(found, at, commands, findings, "a node that flies")
    else:
        findings.notes.append(f"{path}: the node never flew: no commands")
    ends = time[[0, -1]]
    found.utc = np.stack([ends, log.utc * 1e-6 + ends - log.now], axis=1)
    found.in_air = np.array([tick.phase in AIRBORNE_PHASES for tick in ticks])
    return [found]


def reckoned_times(seen: NDArray[np.float64], states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return when states (row, 6) held that were seen at ticks (s) of another clock than that of the states.

    Two clocks of 20 Hz: now and then a tick sees nothing new, and the next one two steps. Position
    and velocity of a drone that flies say how long a step took; the ticks keep the sum of the steps
    from running away.
    """
    moved, speed = np.diff(states[:, :3], axis=0), 0.5 * (states[1:, 3:] + states[:-1, 3:])
    square, passed = (speed**2).sum(axis=1), np.diff(seen)
    took = np.where(square > RECKONED_SPEED**2, (moved * speed).sum(axis=1) / np.maximum(square, 1e-9), passed)
    # More than a tick and a half is no matter of clocks, but a jump, which the checks must see.
    most = 1.5 * float(np.median(passed)) if len(passed) else 0.0
    ahead, found = 0.0, seen.copy()
    for k, gained in enumerate(np.where(np.abs(took - passed) <= most, took - passed, 0.0), 1):
        ahead = (1.0 - CLOCK_GAIN) * (ahead + gained)
        found[k] += ahead
    return found
