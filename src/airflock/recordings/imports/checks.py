"""Checks of times, individuals and heights: rules 1, 4, 7 and who is there at all. Each fault is one line."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.expressions import quoted
from airflock.recordings.imports.track import COMMAND, POSITION, VELOCITY, Findings, Track

STEPS = (1e-5, 1e5)  # s between rows: beyond, no track of an animal or a robot is meant
LEAST = 0.2  # share of the common span below which an individual is worth a question


def period_of(track: Track) -> float:
    """Usual time between rows, s; 0 for a single row."""
    steps = np.diff(track.time)
    return float(np.median(steps)) if steps.size else 0.0


def check_time(track: Track, findings: Findings) -> None:
    """Rule 1: sort by time, tell of repeated instants and of steps that no log has."""
    late = np.flatnonzero(np.diff(track.time) < 0.0)
    if late.size:
        row = int(track.rows[late[0] + 1])
        findings.notes.append(f"{track.source}: {track.name}: {late.size} rows out of order (first row {row}): sorted")
        track.keep(np.argsort(track.time, kind="stable"))
    same = np.flatnonzero(np.diff(track.time) == 0.0)
    if same.size:
        _repeated(track, same, findings)
    step = period_of(track)
    if step and not STEPS[0] <= step <= STEPS[1]:
        name = track.label("t")
        findings.fault(
            f"{track.source}: column {name}: rows of {track.name} are {step:g} s apart, first row {track.rows[0]}; "
            f'the unit is another one: write --map "t:={quoted(name)}*1e-6" (for us) or *1e-3 (for ms)',
            "time",
        )


def _repeated(track: Track, same: NDArray[Any], findings: Findings) -> None:
    """Rows with the time of the row before: the same row again, or another individual."""
    place = track.stack(POSITION, 2)
    apart = np.hypot(*(place[same + 1] - place[same]).T)
    row, where = int(track.rows[same[0] + 1]), f"{track.source}: column {track.label('t')}"
    other = np.flatnonzero(apart > 1e-9)
    if len(other) > 0.5 * len(same):
        first = same[other[0]]
        findings.fault(
            f"{where}: {track.name} is at two places at once, first row {track.rows[first + 1]} "
            f"({apart[other[0]]:.3g} m apart): two individuals under one id; map another column: --map id:=COLUMN",
            "duplicates",
        )
    else:
        findings.fault(
            f"{where}: {same.size} rows of {track.name} repeat a time, first row {row}; remove the duplicates",
            "duplicates",
        )
    track.keep(np.r_[True, np.diff(track.time) > 0.0])


def check_names(tracks: list[Track], findings: Findings) -> None:
    """No two individuals with one name."""
    known: dict[str, Track] = {}
    for track in tracks:
        if track.name in known:
            findings.fault(
                f"{track.source}: {track.name} is also in {known[track.name].source}; write --map id:=file, or rename"
            )
        known.setdefault(track.name, track)


def check_columns(tracks: list[Track], findings: Findings) -> None:
    """A column without a number says nothing, so it is none; a row without a height that others have is no place."""
    for track in tracks:
        for name in (*VELOCITY, *COMMAND):
            if name in track.columns and not np.isfinite(track.columns[name]).any():
                del track.columns[name]
    for name in ("z", "alt"):
        having = [track for track in tracks if name in track.columns]
        flat = not any(np.isfinite(track.columns[name]).any() for track in having)
        for track in having:
            where, known = f"{track.source}: column {track.label(name)}", np.isfinite(track.columns[name])
            if flat:
                del track.columns[name]
                line = f"{where} holds no height: read as in a plane"
                findings.notes += [line] if line not in findings.notes else []
            elif not known.any():
                findings.fault(
                    f"{where} holds no height of {track.name}, but of others; leave it out, "
                    f'or put all at one height: --map "{name}:=0"'
                )
            elif not known.all():
                row, count = track.rows[np.flatnonzero(~known)[0]], int((~known).sum())
                findings.notes.append(
                    f"{where}: {count} rows of {track.name} without a height left out, first row {row}"
                )
                track.keep(known)


def check_heights(tracks: list[Track], axes: str, findings: Findings) -> None:
    """Rule 4: heights of all individuals are above the same level; z points up, if `axes` (enu, ned) are the file's."""
    levels = {track.datum: track for track in tracks if "z" in track.columns or "alt" in track.columns}
    if len(levels) > 1:
        told = ", ".join(f"{t.name}: {level or 'not said'}" for level, t in levels.items())
        findings.fault(f"heights are above different levels ({told}); convert them to one", "height")
    for track in tracks:
        z = track.columns.get("z")
        if z is None or not len(z):
            continue
        low = np.flatnonzero(z < -1.0)
        if len(low) > 0.9 * len(z):
            name = track.label("z")
            turn = f'--map "z:=-{quoted(name)}"'
            if axes == "ned":
                told = f"it points up, where --axes ned has it down; leave --axes ned out, or add {turn} if x is north"
            else:
                told = f"it points down; write {turn}, or --axes ned if x is north"
            findings.fault(
                f"{track.source}: column {name}: z of {track.name} lies below -1 m, first row {track.rows[low[0]]}: "
                + told,
                "down",
            )
            return


def note_steps(track: Track, findings: Findings) -> None:
    """Rule 7: resolution of positions that repeat, the floor of their noise."""
    for axis in POSITION[:2]:
        values = track.columns[axis]
        steps = np.abs(np.diff(values))
        moved = steps[steps > 0.0]
        if len(steps) < 20 or not len(moved) or len(moved) > 0.8 * len(steps):
            continue
        least = float(moved.min())
        if np.abs(moved / least - np.round(moved / least)).max() < 0.05:
            findings.notes.append(
                f"{track.source}: {track.name}: {track.label(axis)} comes in steps of {least:.3g} m "
                f"({1 - len(moved) / len(steps):.0%} of the rows repeat the one before)"
            )
            return


def check_presence(tracks: list[Track], findings: Findings) -> None:
    """Individuals that are hardly there: kept only if that is meant."""
    first, last = min(t.time[0] for t in tracks), max(t.time[-1] for t in tracks)
    if last <= first:
        return
    for track in tracks:
        step = period_of(track)
        share = min(1.0, len(track.time) * step / (last - first))
        if share < LEAST:
            findings.fault(
                f"{track.source}: {track.name} is there for {share:.0%} of {last - first:.4g} s "
                f"(from {track.time[0]:.4g} to {track.time[-1]:.4g} s); leave it out, or cut with --begin and --end",
                "absent",
            )
