"""Logs that nodes write on board: what the autopilot said of place and velocity, and what the node commanded."""

from pathlib import Path

import numpy as np

from airflock.drones import AIRBORNE_PHASES, FLYING_PHASES, read_log_ticks
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportOptions,
    ImportReport,
)
from airflock.support import LinkError, RecordingError

OTHERS = "of ArduPilot give the .bin that it was made from"  # whose text logs end in .log, too


def read_node_log(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Track of the drone on which a node flew: local east-north-up of its mission, by the clock of its computer.

    A row is a tick at which the own state was another than at the tick before; between such rows the autopilot had said
    nothing new. Commands are those of phases in which the node flies; their clock is told UTC by the log's first line.
    """
    with open(path, "rb") as file:
        if not file.read(8).startswith(b'{"log":'):
            raise RecordingError(f"{path}: .log: unknown format; {OTHERS}")
    try:
        told = read_log_ticks(path)
    except LinkError as fault:
        raise RecordingError(str(fault)) from fault
    options.done(0.8)
    states = [tick.own for tick in told.ticks]
    rows = [k for k, own in enumerate(states) if own is not None and (k == 0 or own != states[k - 1])]
    if not rows:
        raise RecordingError(f"{path}: the autopilot never told where it is")
    ticks = [told.ticks[k] for k in rows]
    time = np.array([tick.time for tick in ticks])
    flown = np.array([tick.phase in FLYING_PHASES for tick in ticks])
    place = np.array([tick.own for tick in ticks], float)
    command = np.where(flown[:, None], np.array([tick.command for tick in ticks], float), np.nan)
    columns = dict(zip((*POSITION_TARGETS, *VELOCITY_TARGETS), place.T, strict=True)) | dict(
        zip(COMMAND_TARGETS, command.T, strict=True)
    )
    if not flown.any():
        findings.notes.append(f"{path}: the node never flew: no commands")
        columns = {name: column for name, column in columns.items() if name not in COMMAND_TARGETS}
    labels = {name: f"own[{c}]" for c, name in enumerate((*POSITION_TARGETS, *VELOCITY_TARGETS))}
    labels |= {name: f"set[{c}]" for c, name in enumerate(COMMAND_TARGETS)}
    found = ImportedTrack(
        f"member_{told.member}",
        str(path),
        time,
        columns,
        np.array([tick.line for tick in ticks]),
        labels,
        "boot",
        datum="home",
    )
    ends = time[[0, -1]]
    found.utc = np.stack([ends, told.utc * 1e-6 + ends - told.now], axis=1)
    found.in_air = np.array([tick.phase in AIRBORNE_PHASES for tick in ticks])
    return [found]
