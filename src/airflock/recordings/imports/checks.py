"""Checks of times, individuals and heights: rules 1, 4, 7 and who is there at all. Each fault is one line."""

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.absent import tracks_by_source
from airflock.recordings.imports.expressions import quote_column
from airflock.recordings.imports.headers import split_header
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportReport,
)

STEPS = (1e-5, 1e5)  # s between rows: beyond, no track of an animal or a robot is meant
SLOW = 5.0  # s between rows: a unit of thousandths would be odd for so slow a log
SINCE_1970 = 1e8  # s; times beyond are dates, and their unit is plain
LEAST = 0.2  # share of the common span below which an individual is worth a question


def median_period(track: ImportedTrack) -> float:
    """Usual time between rows, s; 0 for a single row."""
    steps = np.diff(track.time)
    return float(np.median(steps)) if steps.size else 0.0


def check_times(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Rule 1: sort by time, tell of repeated instants and of steps that no log has, each once for a file."""
    for source, own in tracks_by_source(tracks).items():
        late = [_sorted(track) for track in own]
        _tell_order(source, [rows for rows in late if rows.size], findings)
        _repeated(source, own, findings)
        wrong = [line for line in map(_wrong_step, own) if line]
        if wrong:
            findings.fault(wrong[0], "time")
        else:
            findings.notes += [line for line in map(_unsaid_step, own) if line][:1]


def _sorted(track: ImportedTrack) -> NDArray[np.int64]:
    """Sort a track by time; the rows that came before an earlier one."""
    late = np.flatnonzero(np.diff(track.time) < 0.0) + 1
    rows = track.rows[late]
    if late.size:
        track.keep(np.argsort(track.time, kind="stable"))
    return rows


def _tell_order(source: str, late: list[NDArray[np.int64]], findings: ImportReport) -> None:
    if late:
        count, first = sum(len(rows) for rows in late), min(int(rows[0]) for rows in late)
        findings.notes.append(f"{source}: {count} rows out of order (first row {first}): sorted")


def _wrong_step(track: ImportedTrack) -> str:
    """What is wrong with the time between rows; empty if nothing is."""
    step, name = median_period(track), track.label("t")
    where = f"{track.source}: column {name}: rows of {track.name} are {step:g} s apart, first row {track.rows[0]}"
    if step and not STEPS[0] <= step <= STEPS[1]:
        return (
            f'{where}; the unit is another one: write --map "t:={quote_column(name)}*1e-6" (for us) or *1e-3 (for ms)'
        )
    unit, finer = split_header(name)[1], {"ms": ("us", 1e-6), "us": ("ns", 1e-9), "µs": ("ns", 1e-9)}
    if unit in finer and step >= SLOW and track.time[0] < SINCE_1970 and not track.has(VELOCITY_TARGETS):
        other, factor = finer[unit]
        return f'{where}: {other} named {unit}? Write --map "t:={quote_column(name)}*{factor:g}"'
    return ""


def _unsaid_step(track: ImportedTrack) -> str:
    """What is told of times without a unit that would be far apart in seconds; empty if there are none."""
    step, name = median_period(track), track.user_labels.get("t", "")
    if (
        not name.isidentifier()
        or split_header(name)[1]
        or step < SLOW
        or track.time[0] >= SINCE_1970
        or track.has(VELOCITY_TARGETS)
    ):
        return ""
    return (
        f"{track.source}: column {name}: rows of {track.name} are {step:g} s apart; if it does not count seconds, "
        "write for instance --time-unit us"
    )


def _repeated(source: str, own: list[ImportedTrack], findings: ImportReport) -> None:
    """Rows with the time of the row before: the same row again, or another individual. The first of them is kept."""
    again: list[tuple[ImportedTrack, NDArray[np.int64]]] = []
    for track in own:
        same = np.flatnonzero(np.diff(track.time) == 0.0)
        if not same.size:
            continue
        place = track.stack(POSITION_TARGETS, 2)
        apart = np.hypot(*(place[same + 1] - place[same]).T)
        other = np.flatnonzero(apart > 1e-9)
        if len(other) > 0.5 * len(same):
            findings.fault(
                f"{source}: column {track.label('t')}: {track.name} is at two places at once, first row "
                f"{track.rows[same[other[0]] + 1]} ({apart[other[0]]:.3g} m apart): two individuals under one id; "
                "map another column: --map id:=COLUMN",
                "duplicates",
            )
        else:
            again.append((track, track.rows[same + 1]))
        track.keep(np.r_[True, np.diff(track.time) > 0.0])
    if again:
        who = again[0][0].name if len(again) == 1 else f"{len(again)} individuals"
        count, first = sum(len(rows) for _, rows in again), min(int(rows[0]) for _, rows in again)
        findings.fault(
            f"{source}: column {again[0][0].label('t')}: {count} rows of {who} repeat a time, first row {first}; "
            "remove the duplicates",
            "duplicates",
        )


def check_names(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """No two individuals with one name."""
    known: dict[str, ImportedTrack] = {}
    for track in tracks:
        if track.name in known:
            findings.fault(
                f"{track.source}: {track.name} is also in {known[track.name].source}; write --map id:=file, or rename"
            )
        known.setdefault(track.name, track)


def check_columns(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """A column without a number says nothing, so it is none; a row without a height that others have is no place."""
    for track in tracks:
        for name in (*VELOCITY_TARGETS, *COMMAND_TARGETS):
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


def check_heights(tracks: list[ImportedTrack], axes: str, findings: ImportReport) -> None:
    """Rule 4: heights of all individuals are above the same level; z points up, if `axes` (enu, ned) are the file's."""
    levels = {track.datum: track for track in tracks if "z" in track.columns or "alt" in track.columns}
    if len(levels) > 1:
        told = ", ".join(f"{t.name}: {level or 'not said'}" for level, t in levels.items())
        findings.fault(f"heights are above different levels ({told}); convert them to one", "height")
    for source, own in tracks_by_source(tracks).items():
        heights = [(track, track.columns["z"]) for track in own if "z" in track.columns]
        rows = sum(len(z) for _, z in heights)
        deep = [(track, np.flatnonzero(z < -1.0)) for track, z in heights]
        if not rows or sum(len(low) for _, low in deep) <= 0.9 * rows:  # around 0 some are always below
            continue
        track, low = next((track, low) for track, low in deep if len(low))
        name = track.label("z")
        turn = f'--map "z:=-{quote_column(name)}"'
        if axes == "ned":
            told = f"it points up, where --axes ned has it down; leave --axes ned out, or add {turn} if x is north"
        else:
            told = f"it points down; write {turn}, or --axes ned if x is north"
        findings.fault(
            f"{source}: column {name}: z of {track.name} lies below -1 m, first row {track.rows[low[0]]}: {told}",
            "down",
        )
        return


def note_resolution(track: ImportedTrack, findings: ImportReport) -> None:
    """Rule 7: resolution of positions that repeat, the floor of their noise."""
    for axis in POSITION_TARGETS[:2]:
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


def check_presence(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Individuals that are hardly there: kept only if that is meant."""
    first, last = min(t.time[0] for t in tracks), max(t.time[-1] for t in tracks)
    if last <= first:
        return
    for source, own in tracks_by_source(tracks).items():
        shares = [min(1.0, len(track.time) * median_period(track) / (last - first)) for track in own]
        rare = [number for number, share in enumerate(shares) if share < LEAST]
        if not rare:
            continue
        track, share = own[rare[0]], shares[rare[0]]
        more = f", {len(rare) - 1} more for less than {LEAST:.0%}" if len(rare) > 1 else ""
        findings.fault(
            f"{source}: {track.name} is there for {share:.0%} of {last - first:.4g} s "
            f"(from {track.time[0]:.4g} to {track.time[-1]:.4g} s){more}; leave it out, or cut with --begin and --end",
            "absent",
        )
