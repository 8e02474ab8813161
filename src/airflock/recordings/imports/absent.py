"""Rows without a time, a place or a speed: what becomes of them, told with file, column, number and first row."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportReport,
)
from airflock.support import RecordingError

PLACE_TARGETS = (*POSITION_TARGETS[:2], *GEODETIC_TARGETS[:2])
MissingRows = dict[
    str, list[tuple[NDArray[np.int64], int]]
]  # column → of each individual the rows, and how many are inf


def drop_incomplete_rows(tracks: list[ImportedTrack], findings: ImportReport) -> list[ImportedTrack]:
    """Tracks without the rows that have no time or no place; raises RecordingError for a file with no others.

    An individual is absent where its place is nan or inf; one that has no place at any time is left out.
    """
    kept = []
    for source, own in tracks_by_source(tracks).items():
        whole = [_timed(track) & _placed(track) for track in own]
        there = [track for track, sound in zip(own, whole, strict=True) if sound.any()]
        if not there:
            raise RecordingError(f"{source}: no row has both a time and a position")
        gone = [track.name for track, sound in zip(own, whole, strict=True) if not sound.any()]
        findings.notes += [f"{source}: {name}: has no position at any time: left out" for name in gone]
        late = [track.rows[_placed(track) & ~_timed(track)] for track in there]
        _tell(findings, source, {"": [(rows, 0) for rows in late]}, "without a time left out")
        _tell(findings, source, _lacking(there, PLACE_TARGETS), "without a number taken as absent")
        for track, sound in zip(own, whole, strict=True):
            if sound.any() and not sound.all():
                track.keep(sound)
        kept += there
    return kept


def note_missing_velocities(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Tell where a velocity or a command is nan or inf; an infinite one is none."""
    for source, own in tracks_by_source(tracks).items():
        _tell(
            findings, source, _lacking(own, VELOCITY_TARGETS), "without a number: differentiated from positions there"
        )
        endless = _lacking(own, COMMAND_TARGETS)
        endless = {name: found for name, found in endless.items() if any(count for _, count in found)}
        _tell(findings, source, endless, "without a number: no command there")
    for track in tracks:
        for name in (*VELOCITY_TARGETS, *COMMAND_TARGETS):
            if name in track.columns and np.isinf(track.columns[name]).any():
                track.columns[name] = np.where(np.isinf(track.columns[name]), np.nan, track.columns[name])


def tracks_by_source(tracks: Iterable[ImportedTrack]) -> dict[str, list[ImportedTrack]]:
    """Tracks by the file that they were read from."""
    found: dict[str, list[ImportedTrack]] = {}
    for track in tracks:
        found.setdefault(track.source, []).append(track)
    return found


def _timed(track: ImportedTrack) -> NDArray[np.bool_]:
    return np.isfinite(track.time)


def _placed(track: ImportedTrack) -> NDArray[np.bool_]:
    found = np.ones(len(track.time), bool)
    for name in PLACE_TARGETS:
        if name in track.columns:
            found &= np.isfinite(track.columns[name])
    return found


def _lacking(tracks: list[ImportedTrack], names: Iterable[str]) -> MissingRows:
    """Rows with a time but no number, by column, under the user's own word for it."""
    found: MissingRows = {}
    for track in tracks:
        for name in names:
            values = track.columns.get(name)
            if values is not None:
                bad = ~np.isfinite(values) & _timed(track)
                found.setdefault(track.label(name), []).append((track.rows[bad], int(np.isinf(values[bad]).sum())))
    return found


def _tell(findings: ImportReport, source: str, lacking: MissingRows, what: str) -> None:
    """One note for columns that lack a number in the same rows."""
    lines: dict[tuple[bytes, str], list[str]] = {}
    for column, parts in lacking.items():
        rows = np.concatenate([rows for rows, _ in parts])
        if len(rows):
            endless = sum(count for _, count in parts)
            told = f" ({endless} of them inf)" if endless else ""
            line = f"{len(rows)} rows {what}{told}, first row {rows.min()}"
            lines.setdefault((rows.tobytes(), line), []).append(column)
    for (_, line), columns in lines.items():
        named = f"column {', '.join(columns)}: " if any(columns) else ""
        findings.notes.append(f"{source}: {named}{line}")
