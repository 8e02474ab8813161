"""ArduPilot DataFlash logs (.bin) and telemetry logs (.tlog), by pymavlink (LGPL-3, an extra that is only imported).

Fields are asked for by name, because their sets change between releases.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from airflock.errors import RecordingError
from airflock.recordings.imports.track import COMMAND, POSITION, VELOCITY, Findings, Options, Track

GPS_EPOCH = 315964800.0  # 6 January 1980 in seconds since 1970
LEAP_SECONDS = 18.0  # GPS ahead of UTC since 2017; the same for all drones, so that it cannot part them


def read_dataflash(path: Path, options: Options, findings: Findings) -> list[Track]:
    """Track of a DataFlash log: PSCN, PSCE, PSCD (position, velocity, commanded velocity), ORGN and GPS."""
    reader, _ = _pymavlink(path)
    try:
        log = reader.DFReader_binary(str(path))
    except Exception as fault:  # pymavlink raises struct.error, ValueError and others for other files
        raise RecordingError(f"{path}: is not a DataFlash log: {type(fault).__name__}: {fault}") from fault
    rows: dict[str, list[Any]] = {"PSCN": [], "PSCE": [], "PSCD": []}
    origin, clock = None, []
    kinds = [*rows, "ORGN", "GPS"]
    while (message := log.recv_match(type=kinds)) is not None:
        kind = message.get_type()
        if kind == "ORGN":
            origin = (float(message.Lat), float(message.Lng), float(message.Alt))
        elif kind == "GPS":
            if getattr(message, "GWk", 0) > 0 and getattr(message, "I", 0) == 0:
                clock.append(
                    (message.TimeUS * 1e-6, GPS_EPOCH - LEAP_SECONDS + message.GWk * 604800.0 + message.GMS * 1e-3)
                )
        else:
            axis = kind[-1]
            rows[kind].append([getattr(message, name, np.nan) for name in _fields(axis)])
            if len(rows[kind]) % 5000 == 0:
                options.done(min(0.99, getattr(log, "percent", 0.0) / 100.0))
    if not rows["PSCN"] or not rows["PSCE"]:
        raise RecordingError(f"{path}: has no PSCN and PSCE (position control, Copter 4.2 and later)")
    found = _joined(rows, path)
    found.origin, found.clock, found.datum = origin, "boot", "amsl"
    found.utc = np.array(clock) if len(clock) >= 2 else None
    return [found]


def _fields(axis: str) -> tuple[str, str, str, str]:
    return "TimeUS", f"P{axis}", f"V{axis}", f"TV{axis}"


def _joined(rows: dict[str, list[Any]], path: Path) -> Track:
    """One table on the times of the north axis; the other axes are written within the same loop."""
    north, east = np.array(rows["PSCN"], float), np.array(rows["PSCE"], float)
    down = np.array(rows["PSCD"], float) if rows["PSCD"] else None
    time = north[:, 0] * 1e-6

    def at(table: Any, column: int) -> Any:
        return np.interp(north[:, 0], table[:, 0], table[:, column])

    def held(table: Any) -> Any:
        place = np.searchsorted(table[:, 0], north[:, 0], side="right") - 1
        return table[np.maximum(place, 0), 3]

    columns = {"x": at(east, 1), "y": north[:, 1], "vx": at(east, 2), "vy": north[:, 2]}
    columns |= {"cx": held(east), "cy": north[:, 3]}
    if down is not None:
        columns |= {"z": -at(down, 1), "vz": -at(down, 2), "cz": -held(down)}
    columns = {
        k: columns[k] for k in (*POSITION, *VELOCITY, *COMMAND) if k in columns and np.isfinite(columns[k]).any()
    }
    labels = {"x": "PSCE.PE", "y": "PSCN.PN", "z": "-PSCD.PD", "vx": "PSCE.VE", "vy": "PSCN.VN", "vz": "-PSCD.VD"}
    return Track(path.stem, str(path), time, columns, np.arange(len(time)), labels)


def read_tlog(path: Path, options: Options, findings: Findings) -> list[Track]:
    """Tracks of a telemetry log: LOCAL_POSITION_NED of each vehicle, POSITION_TARGET_LOCAL_NED as its command.

    All vehicles are stamped by the receiver's clock, so they share it; their positions are about their own origins.
    """
    _, mavutil = _pymavlink(path)

    try:
        log = mavutil.mavlink_connection(str(path))
    except Exception as fault:
        raise RecordingError(f"{path}: is not a telemetry log: {type(fault).__name__}: {fault}") from fault
    states: dict[int, list[Any]] = {}
    wishes: dict[int, list[Any]] = {}
    origins: dict[int, tuple[float, float, float]] = {}
    kinds = ["LOCAL_POSITION_NED", "POSITION_TARGET_LOCAL_NED", "GPS_GLOBAL_ORIGIN"]
    while (message := log.recv_match(type=kinds)) is not None:
        who, when = message.get_srcSystem(), float(getattr(message, "_timestamp", 0.0))
        if message.get_type() == "GPS_GLOBAL_ORIGIN":
            origins[who] = (message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)
        elif message.get_type() == "LOCAL_POSITION_NED":
            states.setdefault(who, []).append(
                [when, message.y, message.x, -message.z, message.vy, message.vx, -message.vz]
            )
        else:
            wishes.setdefault(who, []).append([when, message.vy, message.vx, -message.vz])
        options.done(min(0.99, getattr(log, "percent", 0.0) / 100.0))
    if not states:
        raise RecordingError(f"{path}: has no LOCAL_POSITION_NED; import the vehicles' own logs instead")
    found = []
    for who, rows in sorted(states.items()):
        table = np.array(rows)
        columns = dict(zip((*POSITION, *VELOCITY), table.T[1:].copy(), strict=True))
        if who in wishes:
            ask = np.array(wishes[who])
            at = np.searchsorted(ask[:, 0], table[:, 0], side="right") - 1
            columns |= {n: np.where(at >= 0, ask[np.maximum(at, 0), c + 1], np.nan) for c, n in enumerate(COMMAND)}
        track = Track(f"vehicle_{who}", str(path), table[:, 0], columns, np.arange(len(table)), {}, "utc", datum="amsl")
        track.origin = origins.get(who)
        found.append(track)
    return found


def _pymavlink(path: Path) -> Any:
    try:
        return import_module("pymavlink.DFReader"), import_module("pymavlink.mavutil")
    except ImportError as fault:
        raise RecordingError(f"{path}: ArduPilot logs need pymavlink (LGPL-3): pip install 'airflock[logs]'") from fault
