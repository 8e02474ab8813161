"""Check tracks: missing rows, presence, names, times, heights, axes against velocities, and jumps."""

import itertools
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.table_columns import (
    LENGTH_UNITS,
    SPEED_UNITS,
    TIME_UNITS,
    header_meaning,
    quote_column,
    split_header,
)
from airflock.recordings.imports.track import (
    COMMAND_TARGETS,
    GEODETIC_TARGETS,
    POSITION_TARGETS,
    VELOCITY_TARGETS,
    ImportedTrack,
    ImportReport,
)
from airflock.support import RecordingError

Array = NDArray[np.float64]
SPEED_TARGETS = (*VELOCITY_TARGETS, *COMMAND_TARGETS)
PLACE_TARGETS = (*POSITION_TARGETS[:2], *GEODETIC_TARGETS[:2])
# column → of each individual the rows, and how many are inf
MissingRows = dict[str, list[tuple[NDArray[np.int64], int]]]


def drop_rejected_rows(tracks: list[ImportedTrack], findings: ImportReport) -> list[ImportedTrack]:
    """Drop the rows that a column of the file rejects; keep one of several receivers of one drone.

    Raises RecordingError for a file of which no row counts.
    """
    kept = []
    for source, own in tracks_by_source(tracks).items():
        counts = [np.ones(len(track.time), bool) for track in own]
        for column, (flag, _) in own[0].flags.items():
            if flag.words not in ("receiver", "used"):
                _reject(source, column, own, counts, findings)
        if not any(count.any() for count in counts):
            columns = ", ".join(own[0].flags)
            raise RecordingError(f"{source}: column {columns}: no row counts; to read them all, write --accept rows")
        for track, count in zip(own, counts, strict=True):
            if not count.any():
                findings.notes.append(f"{source}: {track.name}: no row of it counts: left out")
                continue
            _choose_receiver(track, count, findings)
            track.flags = {}
            if not count.all():
                track.keep(count)
            kept.append(track)
    return kept


def _reject(source: str, column: str, own: list[ImportedTrack], counts: list[Any], findings: ImportReport) -> None:
    """Take the rows that a column rejects out of `counts`, (row,) of each track, and say how many and why."""
    flag, where = own[0].flags[column][0], f"{source}: column {column}"
    values = [track.flags[column][1] for track in own]
    known = np.concatenate(values)
    known = known[np.isfinite(known)]
    if flag.least == 0.6 and len(known) and known.min() >= 0.0 and 50.0 < known.max() <= 100.0:
        findings.notes.append(f"{where}, row {own[0].rows[0]} on: taken as per cent")
        values, known = [0.01 * each for each in values], 0.01 * known
    # Types of fixes end at 8 in MAVLink and NMEA: more are a number of the fix.
    most, name = {0.6: (1.0, "likelihood"), 2.0: (8.0, "type of fix")}.get(flag.least, (np.inf, ""))
    if name and len(known) and not (known.min() >= 0.0 and known.max() <= most):
        findings.notes.append(f"{where}: lies outside 0 to {most:g}, row {own[0].rows[0]} on: not read as a {name}")
        return
    # A column `fix` of 0 and 1 says yes or no, and counts no dimensions.
    least = min(flag.least, max(1.0, known.max(initial=0.0))) if flag.least == 2.0 else flag.least
    bad = [flag.sign * each < least for each in values]  # never of nan
    rows = np.concatenate([track.rows[out] for track, out in zip(own, bad, strict=True)])
    line, kept = f"{where}: {len(rows)} rows {flag.words}", "rows" in findings.accepted_kinds
    if kept and len(rows):
        findings.notes.append(f"accepted (rows): {line} kept, first row {rows.min()}")
    elif len(rows):
        findings.notes.append(f"{line} left out, first row {rows.min()}; to keep them, write --accept rows")
        for count, out in zip(counts, bad, strict=True):
            count &= ~out


def _choose_receiver(track: ImportedTrack, counts: NDArray[np.bool_], findings: ImportReport) -> None:
    """Keep the rows of the receiver or filter that the autopilot used most, else of the first of those that work."""
    for column, (flag, values) in track.flags.items():
        numbers, rows = np.unique(values[counts & np.isfinite(values)], return_counts=True)
        if flag.words != "receiver" or len(numbers) < 2:
            continue
        used = [on for kind, on in track.flags.values() if kind.words == "used"]
        share = [float((on[counts & (values == number)] > 0.5).sum()) for on in used[:1] for number in numbers]
        # One that was switched on late, or failed early, is no first choice.
        best = int(np.argmax(share)) if any(share) else int(np.argmax(rows > 0.5 * rows.max()))
        other = track.rows[counts & (values != numbers[best])]
        reason = "which the autopilot used" if any(share) else "the first"
        name = next((name for name, k in flag.numbers.items() if k == numbers[best]), f"{numbers[best]:g}")
        findings.notes.append(
            f"{track.source}: column {column}: {track.name} has {len(numbers)} receivers or filters: {name} is read, "
            f"{reason}; {len(other)} rows of others left out, first row {other.min()}; to read another one, take the "
            "rows of this one out of the file"
        )
        counts &= values == numbers[best]


def drop_incomplete_rows(tracks: list[ImportedTrack], findings: ImportReport) -> list[ImportedTrack]:
    """Drop the rows without a time or a place; raise RecordingError for a file with no others.

    An individual is absent where its place is nan or inf; one that has no place at any time is left
    out.
    """
    kept = []
    # By file: a thousand individuals with the same gap give one note.
    for source, own in tracks_by_source(tracks).items():
        _drop_null_islands(source, own, findings)
        whole = [np.isfinite(track.time) & _placed(track) for track in own]
        there = [track for track, sound in zip(own, whole, strict=True) if sound.any()]
        if not there:
            raise RecordingError(f"{source}: no row has both a time and a position")
        gone = [track.name for track, sound in zip(own, whole, strict=True) if not sound.any()]
        findings.notes += [f"{source}: {name}: has no position at any time: left out" for name in gone]
        late = [track.rows[_placed(track) & ~np.isfinite(track.time)] for track in there]
        _tell(findings, source, {"": [(rows, 0) for rows in late]}, "without a time left out")
        _tell(findings, source, _lacking(there, PLACE_TARGETS), "without a number taken as absent")
        for track, sound in zip(own, whole, strict=True):
            if sound.any() and not sound.all():
                track.keep(sound)
        kept += there
    return kept


def _drop_null_islands(source: str, own: list[ImportedTrack], findings: ImportReport) -> None:
    """Drop rows at latitude and longitude 0, which receivers write before a fix, of tracks that have no row near it."""
    gone: list[tuple[NDArray[np.int64], int]] = []
    for track in own:
        if "lat" in track.columns and "lon" in track.columns:
            off = np.maximum(np.abs(track.columns["lat"]), np.abs(track.columns["lon"]))
            zero = off == 0.0
            if zero.any() and not ((off > 0.0) & (off < 0.1)).any():  # degrees
                gone.append((track.rows[zero], 0))
                track.keep(~zero)
    if gone:
        label = ", ".join(own[0].label(name) for name in ("lat", "lon"))
        _tell(findings, source, {label: gone}, "at 0, 0, where no fix is, taken as absent")


def note_missing_velocities(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Note where a velocity or a command is nan or inf; an infinite one becomes nan."""
    for source, own in tracks_by_source(tracks).items():
        way = "without a number: differentiated from positions there"
        _tell(findings, source, _lacking(own, VELOCITY_TARGETS), way)
        every = _lacking(own, COMMAND_TARGETS).items()
        endless = {name: found for name, found in every if any(count for _, count in found)}
        _tell(findings, source, endless, "without a number: no command there")
    for track in tracks:
        speeds = {name: track.columns[name] for name in SPEED_TARGETS if name in track.columns}
        track.columns |= {k: np.where(np.isinf(v), np.nan, v) for k, v in speeds.items() if np.isinf(v).any()}


def tracks_by_source(tracks: Iterable[ImportedTrack]) -> dict[str, list[ImportedTrack]]:
    """Group tracks by the file that they were read from."""
    found: dict[str, list[ImportedTrack]] = {}
    for track in tracks:
        found.setdefault(track.source, []).append(track)
    return found


def _placed(track: ImportedTrack) -> NDArray[np.bool_]:
    places = [np.isfinite(track.columns[name]) for name in PLACE_TARGETS if name in track.columns]
    found: NDArray[np.bool_] = np.logical_and.reduce(places)
    return found


def _lacking(tracks: list[ImportedTrack], names: Iterable[str]) -> MissingRows:
    """Return the rows with a time but no number, by column, under the user's own word for it."""
    found: MissingRows = {}
    for track in tracks:
        for name in names:
            if (values := track.columns.get(name)) is not None:
                bad = ~np.isfinite(values) & np.isfinite(track.time)
                found.setdefault(track.label(name), []).append((track.rows[bad], int(np.isinf(values[bad]).sum())))
    return found


def _tell(findings: ImportReport, source: str, lacking: MissingRows, what: str) -> None:
    """Add one note for columns that lack a number in the same rows."""
    lines: dict[tuple[bytes, str], list[str]] = {}
    for column, parts in lacking.items():
        rows = np.concatenate([rows for rows, _ in parts])
        if len(rows):
            endless = sum(count for _, count in parts)
            infinite = f" ({endless} of them inf)" if endless else ""
            line = f"{len(rows)} rows {what}{infinite}, first row {rows.min()}"
            lines.setdefault((rows.tobytes(), line), []).append(column)
    for (_, line), columns in lines.items():
        named = f"column {', '.join(columns)}: " if any(columns) else ""
        findings.notes.append(f"{source}: {named}{line}")


SEVERAL = (
    "two individuals under one id? Map another column: --map id:=COLUMN; or --map receiver:=COLUMN if it parts "
    "receivers of one drone"
)
SLOW = 5.0  # s between rows: what is as slow may count a thousandth
SINCE_1970 = 1e8  # s; times beyond are dates, and their unit is plain
LEAST = 0.2  # share of the common span below which an individual is worth a question


def median_period(track: ImportedTrack) -> float:
    """Return the usual time between rows, s; 0 for a single row."""
    steps = np.diff(track.time)
    return float(np.median(steps)) if steps.size else 0.0


def check_times(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Rule 1: sort by time, and report repeated instants and impossible steps, each once a file."""
    for source, own in tracks_by_source(tracks).items():
        late = [track.rows[1:][np.diff(track.time) < 0.0] for track in own]
        for track in (track for track, rows in zip(own, late, strict=True) if rows.size):
            track.keep(np.argsort(track.time, kind="stable"))
        if count := sum(map(len, late)):
            first = min(int(rows[0]) for rows in late if rows.size)
            findings.notes.append(f"{source}: {count} rows out of order (first row {first}): sorted")
        _repeated(source, own, findings)
        wrong = [line for line in map(_wrong_step, own) if line]
        if wrong:
            findings.add_error(wrong[0], "time")


def _wrong_step(track: ImportedTrack) -> str:
    """Return the error of a unit that would be odd for so slow a log; empty if there is none."""
    step, name = median_period(track), track.label("t")
    unit, finer = split_header(name)[1], {"ms": ("us", 1e-6), "us": ("ns", 1e-9), "µs": ("ns", 1e-9)}
    if unit not in finer or step < SLOW or track.time[0] >= SINCE_1970 or track.has(VELOCITY_TARGETS):
        return ""
    where = f"{track.source}: column {name}: rows of {track.name} are {step:g} s apart, first row {track.rows[0]}"
    other, factor = finer[unit]
    return f'{where}: {other} named {unit}? Write --map "t:={quote_column(name)}*{factor:g}"'


def _repeated(source: str, own: list[ImportedTrack], findings: ImportReport) -> None:
    """Check rows with the time of the row before: the same row again, or another individual. Keep the first."""
    again: list[tuple[ImportedTrack, NDArray[np.int64]]] = []
    for track in own:
        same = np.flatnonzero(np.diff(track.time) == 0.0)
        if not same.size:
            continue
        place = track.stack(POSITION_TARGETS, 2)
        apart = np.hypot(*(place[same + 1] - place[same]).T)
        other = np.flatnonzero(apart > 1e-9)
        # Mostly at different places: two individuals share an id. Otherwise the logger repeated
        # rows.
        if len(other) > 0.5 * len(same):
            findings.add_error(
                f"{source}: column {track.label('t')}: {track.name} is at two places at once, first row "
                f"{track.rows[same[other[0]] + 1]} ({apart[other[0]]:.3g} m apart): {SEVERAL}",
                "duplicates",
            )
        else:
            again.append((track, track.rows[same + 1]))
        track.keep(np.r_[True, np.diff(track.time) > 0.0])
    if again:
        who = again[0][0].name if len(again) == 1 else f"{len(again)} individuals"
        count, first = sum(len(rows) for _, rows in again), min(int(rows[0]) for _, rows in again)
        findings.add_error(
            f"{source}: column {again[0][0].label('t')}: {count} rows of {who} repeat a time, first row {first}; "
            "remove the duplicates",
            "duplicates",
        )


def check_names(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Refuse two individuals with one name, unless the folders of their files name them."""
    _name_by_folder(tracks, findings)
    known: dict[str, ImportedTrack] = {}
    for track in tracks:
        if track.name in known:
            own = track.name == Path(track.source).stem
            way = "rename one, or give each a folder" if own else "write --map id:=file, or rename"
            findings.add_error(f"{track.source}: {track.name} is also in {known[track.name].source}; {way}")
        known.setdefault(track.name, track)


def _name_by_folder(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Name individuals by the nearest folders that differ, where their files have one name, as logs of ArduPilot do."""
    count = Counter(track.name for track in tracks)
    same = [track for track in tracks if count[track.name] > 1 and track.name == Path(track.source).stem]
    taken = {track.name for track in tracks} - {track.name for track in same}
    for folders in zip(*(reversed(Path(track.source).absolute().parts[:-1]) for track in same), strict=False):
        if len({*folders} - taken) == len(same):
            for track, folder in zip(same, folders, strict=True):
                track.name = folder
            named = ", ".join(f"{track.name} ({track.source})" for track in same[:3])
            more = f" and {len(same) - 3} more" if len(same) > 3 else ""
            findings.notes.append(f"files of one name: individuals are named by their folders: {named}{more}")
            return


def check_columns(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Drop columns without any number, and rows without a height that other rows have."""
    for track in tracks:
        for name in SPEED_TARGETS:
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
                findings.add_error(
                    f"{where} holds no height of {track.name}, but of others; leave it out, "
                    f'or put all at one height: --map "{name}:=0"'
                )
            elif not known.all():
                out = track.rows[~known]
                line = f"{where}: {len(out)} rows of {track.name} without a height left out, first row {out[0]}"
                findings.notes.append(line)
                track.keep(known)


def check_heights(tracks: list[ImportedTrack], axes: str, findings: ImportReport) -> None:
    """Rule 4: require that all heights are above the same level; z points up, if `axes` (enu, ned) are the file's."""
    levels = {track.datum: track for track in tracks if "z" in track.columns or "alt" in track.columns}
    if len(levels) > 1:
        remedy = ", ".join(f"{t.name}: {level or 'not said'}" for level, t in levels.items())
        findings.add_error(f"heights are above different levels ({remedy}); convert them to one", "height")
    for source, own in tracks_by_source(tracks).items():
        heights = [(track, track.columns["z"]) for track in own if "z" in track.columns]
        rows = sum(len(z) for _, z in heights)
        deep = [(track, np.flatnonzero(z < -1.0)) for track, z in heights]
        # Heights above the start scatter about 0 on the ground, so a few below -1 m are no error; but of a log that
        # stands for most of the time only what is off the ground counts.
        below, deepest = sum(len(low) for _, low in deep), min((float(z.min()) for _, z in heights), default=0.0)
        off = sum(int((np.abs(z) > 1.0).sum()) for _, z in heights)
        if not rows or below <= 0.9 * (off if deepest < -5.0 else rows):  # around 0 some are always below
            continue
        track, low = next((track, low) for track, low in deep if len(low))
        name = track.label("z")
        turn = f'--map "z:=-{quote_column(name)}"'
        if axes == "ned":
            remedy = f"it points up, where --axes ned has it down; leave --axes ned out, or add {turn} if x is north"
        else:
            remedy = f"it points down; write {turn}, or --axes ned if x is north"
        findings.add_error(
            f"{source}: column {name}: z of {track.name} lies below -1 m, first row {track.rows[low[0]]}: {remedy}",
            "down",
        )
        return


def note_resolution(track: ImportedTrack, findings: ImportReport) -> None:
    """Rule 7: note the resolution of positions that repeat, the floor of their noise."""
    for axis in POSITION_TARGETS[:2]:
        values = track.columns[axis]
        steps = np.abs(np.diff(values))
        moved = steps[steps > 0.0]
        # Positions that change in most rows have no visible resolution.
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
    """Refuse individuals that are hardly present, unless the user accepts them."""
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
        clock = "; or --map utc:=COLUMN if each counts since it was switched on" if len(rare) == len(own) > 1 else ""
        if first > SINCE_1970 and len(tracks) > 1:
            clock = "; or if their times are of different zones, write these behind them, as 2026-05-04T10:00:00+02:00"
        findings.add_error(
            f"{source}: {track.name} is there for {share:.0%} of {last - first:.4g} s "
            f"(from {track.time[0]:.4g} to {track.time[-1]:.4g} s){more}; leave it out, or cut with --begin and --end"
            f"{clock}",
            "absent",
        )


# Displacements against summed velocities decide axes, signs and units together; names of columns
# cannot.
LAG = 0.5  # s over which velocities are summed up, so that resolution does not hide the slope
TOLERANCE = 0.1  # of a slope that should be 1
SIGMAS, WILD = 8.0, 20.0  # of a jump, with and without a velocity to predict it
REASONS = {  # how many times too fast → why, and what to write: targets and the numbers by which they are wrong
    1e-6: ("the time counts microseconds", (("t", 1e-6),)),
    1e-3: ("the time counts milliseconds (or microseconds are named ms)", (("t", 1e-3),)),
    1e3: ("positions are in mm, or the time is 1000 times too small", (("x", 1e-3), ("t", 1e3))),
    1e6: ("the time is 10^6 times too small", (("t", 1e6),)),
    1e2: ("positions are in cm", (("x", 0.01),)),
    1e-2: ("velocities are in cm/s", (("vx", 0.01),)),
    1 / 3.6: ("velocities are in km/h", (("vx", 1 / 3.6),)),
    3.2808: ("positions are in ft", (("x", 0.3048),)),
}


def check_axes(tracks: Iterable[ImportedTrack], findings: ImportReport) -> None:
    """Rule 2: along each axis positions change as the velocities say; else name the swap, the sign or the scale."""
    for source, own in tracks_by_source(track for track in tracks if track.has(VELOCITY_TARGETS)).items():
        # A group is compared as a whole: one individual may fly straight, and show one axis only.
        axes = 3 if all("z" in t.columns and "vz" in t.columns for t in own) else 2
        pairs = [_displacements(track, axes) for track in own]
        moved = np.concatenate([p[0] for p in pairs])
        summed = np.concatenate([p[1] for p in pairs])
        if len(moved) < 20:
            findings.notes.append(f"{source}: too few rows to compare positions with velocities")
            continue
        _compare(source, own[0], moved, summed, findings)


def _displacements(track: ImportedTrack, axes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return displacements over about LAG, and the same from the velocities, (pair, axis), m."""
    step = median_period(track)
    place, speed = track.stack(POSITION_TARGETS, axes), track.stack(VELOCITY_TARGETS, axes)
    steps = np.diff(track.time)
    if not step:
        return np.empty((0, axes)), np.empty((0, axes))
    whole = (steps < 3.0 * step) & np.isfinite(speed[1:]).all(axis=1) & np.isfinite(speed[:-1]).all(axis=1)
    # Trapezoids of the velocity; rows across a gap count as broken, so that no pair spans one.
    path = np.cumsum(np.where(whole[:, None], 0.5 * (speed[1:] + speed[:-1]) * steps[:, None], 0.0), axis=0)
    path = np.concatenate([np.zeros((1, axes)), path])
    broken = np.concatenate([[0], np.cumsum(~whole)])
    k = max(1, round(LAG / step)) if step < LAG else 1
    sound = np.flatnonzero(broken[k:] == broken[:-k])
    # rows by number: a stride over all of them would keep them all in memory
    rows = sound[:: max(1, (len(broken) - k) // 20_000)]
    return place[rows + k] - place[rows], path[rows + k] - path[rows]


def _likeness(moved: Array, summed: Array) -> tuple[NDArray[np.bool_], Array, Array]:
    """Correlate displacements with the same from velocities, both (pair, axis), m; some velocity must vary.

    Returns (axis,) whether the motion along it varies enough to compare, and more than the noise of
    the positions; (axis, axis) correlation; (axis,) by how many times the displacement along it
    changes as the velocity says.
    """
    strength, spread = summed.std(axis=0), moved.std(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cross = (moved - moved.mean(0)).T @ (summed - summed.mean(0)) / len(moved)
        r, slopes = np.nan_to_num(cross / np.outer(spread, strength)), np.diag(cross) / strength**2
    # What no velocity explains is noise: below it a drone that stands shows no unit and no axis.
    noise = spread * np.sqrt(np.clip(1.0 - np.abs(r).max(axis=1) ** 2, 0.0, 1.0))
    return (strength > 0.05 * strength.max()) & (spread > noise.max()), r, slopes


def _compare(source: str, track: ImportedTrack, moved: Array, summed: Array, findings: ImportReport) -> None:
    """Find where velocities contradict positions: axes that are swapped or turned round, units that differ.

    track : the first of its file, for names in messages
    moved, summed : displacements, and the same from the velocities, (pair, axis), m
    """
    if summed.std(axis=0).max() <= 1e-9 * max(np.abs(summed).max(), 1e-3):
        # Of one velocity there is no correlation, but its size and direction can be compared.
        went, said = (np.array2string(each.mean(axis=0), precision=3) for each in (moved, summed))
        if np.abs(summed).max() <= 1e-12 and np.abs(moved).max() <= 1e-12:
            findings.notes.append(f"{source}: nothing moves: axes and units cannot be checked against velocities")
        elif np.abs(summed - moved).mean() > TOLERANCE * np.abs(summed).max():
            findings.add_error(
                f"{source}: column {track.label('x')}, row {track.rows[0]} on: in the mean positions go {went} m where "
                f"velocities, which are all the same, say {said} m: axes or units differ",
                "axes",
            )
        return
    lively, r, slopes = _likeness(moved, summed)
    axes, best = range(len(slopes)), np.abs(r).argmax(axis=1)
    swapped = [i for i in axes if lively[i] and i != best[i] and abs(r[i, i]) < 0.5 and abs(r[i, best[i]]) > 0.8]
    if swapped:
        findings.add_error(_swap_error(track, swapped[0], int(best[swapped[0]]), r), "axes")
        return
    # Climbs are slow beside flight along the ground, but where they agree with the heights but for the sign it shows.
    turned = [i for i in axes if r[i, i] < (-0.5 if lively[i] else -0.9)]
    for i in turned:
        speed = track.label(VELOCITY_TARGETS[i])
        # Heights lie above the ground: where they do not, it is they that point down, and not the speeds.
        deep = i == 2 and float(track.columns["z"].mean()) < 0.0
        turn, label = ("z", track.label("z")) if deep else (VELOCITY_TARGETS[i], speed)
        findings.add_error(
            f"{source}: column {track.label(POSITION_TARGETS[i])}, "
            f"row {track.rows[0]} on: {POSITION_TARGETS[i]} grows where "
            f"{speed} is negative (slope {slopes[i]:.2f}): one of them points the other way; "
            f'write --map "{turn}:=-{quote_column(label)}"',
            "axes",
        )
    # A sign is reported before a scale: a turned axis has a slope of -1, which is no wrong unit.
    wrong = [i for i in axes if lively[i] and i not in turned and abs(slopes[i] - 1.0) > TOLERANCE]
    wrong = [i for i in wrong if abs(r[i, i]) > 0.5]
    if wrong:
        columns, slope = ", ".join(track.label(POSITION_TARGETS[i]) for i in wrong), float(np.median(slopes[wrong]))
        reason = _scale_reason(track, slope, [i for i in axes if i in wrong or not lively[i]])
        line = f"{source}: column {columns}, row {track.rows[0]} on: positions change {slope:.3g} times as fast as the "
        line += "velocities say"
        # Noise of the velocities flattens a slope, at most to the slope times r^2 (Frisch 1934). Heights and climbs
        # come from different sensors, and an autopilot's units are fixed: there only a factor of units is an error.
        noisy = all(slopes[i] < 1.0 <= (1.0 + TOLERANCE) * slopes[i] / r[i, i] ** 2 for i in wrong)
        if not reason and (noisy or wrong == [2] or track.fixed_units):
            findings.notes.append(f"{line}, which is no factor between units: both kept as they are")
        else:
            findings.add_error(f"{line}: {reason or 'units differ'}", "axes")


def _swap_error(track: ImportedTrack, i: int, j: int, r: Array) -> str:
    """Return the error of axis i of the positions that goes with axis j of the velocities."""
    axes, labels = ([names[k] for k in (i, j)] for names in (POSITION_TARGETS, [*map(track.label, POSITION_TARGETS)]))
    speed, own = VELOCITY_TARGETS[j], [quote_column(label) for label in labels]
    line = (
        f"{track.source}: column {labels[0]} ({axes[0]}), row {track.rows[0]} on: moves like {track.label(speed)} "
        f"({speed}; r = {r[i, j]:.2f}): "
    )
    meanings = [header_meaning(label) for label in labels]
    if [meaning and meaning.target for meaning in meanings] == axes[::-1]:
        # They have been exchanged already, by --axes or --map.
        line += "positions and velocities have different axes; write, without --axes, "
        return f'{line}--map "{axes[0]}:={own[0]}" --map "{axes[1]}:={own[1]}"'
    line += "swapped, or north-east-down; write "
    return f'{line}--map "{axes[0]}:={own[1]}" --map "{axes[1]}:={own[0]}", or --axes ned'


def _scale_reason(track: ImportedTrack, slope: float, axes: list[int]) -> str:
    """Return cause and remedy for positions that change a multiple as fast as the velocities say, along axes; or ""."""
    near = min(REASONS, key=lambda known: abs(np.log(known / slope)))
    if abs(np.log(near / slope)) >= 0.1:
        return ""
    words, changes = REASONS[near]
    names = {"t": ["t"], "x": [POSITION_TARGETS[i] for i in axes], "vx": [VELOCITY_TARGETS[i] for i in axes]}
    ways = [" ".join(_mapped(track, each, wrong) for each in names[target]) for target, wrong in changes]
    return f"{words}: write {', or '.join(ways)}"


def _mapped(track: ImportedTrack, target: str, wrong: float) -> str:
    """Return the option that multiplies a target by 1 / `wrong`; an expression loses the unit of its header."""
    label = track.label(target)
    name, unit = split_header(label)
    own = {**TIME_UNITS, **LENGTH_UNITS, **SPEED_UNITS}.get(unit, 1.0) if name else 1.0
    return f'--map "{target}:={quote_column(label)}*{own * wrong:.6g}"'


# A single step from rest to rest that needs more is no motion: a pike's fast start (Harper & Blake 1990:
# 245 m/s^2) and a peregrine's stoop (Tucker 1998: 88 m/s) are the hardest and the fastest that we know of.
HARDEST, FASTEST = 250.0, 100.0  # m/s^2, m/s
RIVALS = 5.0  # times the noise of a step, beyond which two that exchange places have exchanged identities
LONE = 0.6  # share of a jump that the steps beside it leave unexplained; a burst decays over several


class Step(NamedTuple):
    """One step that the motion of its track does not explain.

    row  : after it, in the track; number : of that row in the file; time : of that row, s
    size : what is not explained, m; meant, place : (2,) where the track should be after it, and is,
           m
    kind : "jump"; "motion" where a living thing could move so; "gap" where rows are missing in
           between; "small"
    """

    row: int
    number: int
    time: float
    size: float
    meant: Array
    place: Array
    kind: str


def check_jumps(tracks: list[ImportedTrack], findings: ImportReport) -> None:
    """Rules 5 and 6: leave out rows off a track and stays of the absent; split a track that continues elsewhere."""
    steps = [_unexplained_steps(track, findings) for track in tracks]
    rivals = _rivals(tracks, steps)
    for who, (track, own) in enumerate(zip(tracks, steps, strict=True)):
        others = [rivals[who, step.row] for step in own if (who, step.row) in rivals]
        jumps = [step for step in own if (who, step.row) in rivals or step.kind == "jump"]
        motion = [step for step in own if (who, step.row) not in rivals and step.kind == "motion"]
        reason = "than its velocity explains" if track.has(VELOCITY_TARGETS) else "than the steps beside it explain"
        where = f"{track.source}: column {track.label('x')}, row"
        if motion:
            findings.notes.append(
                f"{where} {motion[0].number}: {track.name} moves {motion[0].size:.3g} m more {reason} ({len(motion)} "
                f"times): taken as motion, no harder than its own or an animal's ({HARDEST:g} m/s^2); if it is none, "
                "cut before or after it with --end or --begin"
            )
        if jumps:
            cause = f"to where {others[0]} should be: identities exchanged" if others else "a reset of the estimator"
            findings.add_error(
                f"{where} {jumps[0].number}: {track.name} jumps {jumps[0].size:.3g} m more {reason} ({len(jumps)} "
                f"times): {cause}; cut before or after it with --end or --begin; if accepted, the track is split there",
                "jumps",
            )
            track.breaks = np.union1d(track.breaks, [step.row for step in jumps]).astype(np.int64)


def _rivals(tracks: list[ImportedTrack], steps: list[list[Step]]) -> dict[tuple[int, int], str]:
    """Return individual and row → name of the one who should be there, of identities that are exchanged.

    Chance may bring one individual to where another one should be, but not both at an instant: such
    steps are told from motion by the noise alone, however near the two are.
    """
    late = 0.1 * min((median_period(track) for track in tracks), default=0.0)
    every = sorted(((step.time, who, step) for who, own in enumerate(steps) for step in own), key=lambda one: one[:2])
    times = np.array([time for time, _, _ in every])
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for edges in itertools.pairwise([0, *(np.flatnonzero(np.diff(times) > late) + 1), len(every)]):
        group = every[slice(*edges)]
        for _, who, step in group if len(group) > 1 else ():
            apart = [np.linalg.norm(step.place - other.meant) + 1e9 * (n == who) for _, n, other in group]
            if min(apart) < 0.3 * step.size:
                _, n, other = group[int(np.argmin(apart))]
                found[who, step.row] = (n, other.row)
    return {own: tracks[other[0]].name for own, other in found.items() if other in found}


def _unexplained_steps(track: ImportedTrack, findings: ImportReport) -> list[Step]:
    """Return the steps that a track's motion does not explain, after rows off the track and stays are left out."""
    outliers: list[int] = []
    while True:
        error, noise, lone = prediction_errors(track)
        if not len(error):
            return []
        place, steps = track.stack(POSITION_TARGETS, 2), np.diff(track.time)
        moved, size = np.diff(place, axis=0), np.linalg.norm(error, axis=1)
        usual, logged = steps <= 1.5 * median_period(track), track.has(VELOCITY_TARGETS)
        limit = (SIGMAS if logged else WILD) * noise
        jumps = np.setdiff1d(np.flatnonzero((size > limit) & lone), track.breaks - 1)
        jumps = jumps[_beyond_velocities(track, jumps, size - limit, steps)]
        alive = np.zeros(len(size)) if logged else _alive(moved, steps)
        off = _absent_rows(place, jumps)
        if off.size:
            at = ", ".join(f"{axis:g}" for axis in place[off[0]])
            findings.notes.append(
                f"{track.source}: column {track.label('x')}, {track.label('y')}: {len(off)} rows of {track.name} stay "
                f"at {at}, from or to where it jumps: taken as absent, first row {track.rows[off].min()}"
            )
        else:
            near = jumps[usual[jumps]]
            if _is_several(track, place, near, error, findings):
                return []
            off = _outliers(near, error if logged else moved, alive)
            # A lone row before the first jump or behind the last one has no neighbour that agrees with it.
            last = len(size) - 1
            ends = [row for k, row in ((0, 0), (last, last + 1)) if k in jumps and not alive[k]]
            off = off if off.size else np.array(ends, np.int64)
            outliers += track.rows[off].tolist()
        if not off.size:
            break
        # What is left is judged again: an error hides the next one.
        track.keep(np.isin(np.arange(len(place)), off, invert=True))
    if outliers:
        where, count = f"{track.source}: column {track.label('x')}, {track.label('y')}", len(outliers)
        findings.notes.append(f"{where}: {track.name}: {count} outliers left out, first row {min(outliers)}")
    own = np.max(
        np.linalg.norm(moved, axis=1) / steps, initial=0.0, where=np.isin(np.arange(len(steps)), jumps, invert=True)
    )
    unexplained = []
    # Steps within the limit count only where two individuals exchange their places (`_rivals`).
    small = np.setdiff1d(np.flatnonzero(size > RIVALS * noise), track.breaks - 1)
    for k in np.union1d(jumps, small).tolist():
        # Who moves nearly as fast elsewhere may do so once more; and in a gap a logged velocity may have changed.
        flown = not usual[k] if logged else alive[k] or size[k] < 2.0 * own * steps[k]
        kind = "jump" if not flown else "motion" if usual[k] else "gap"
        row, here = k + 1, place[k + 1]
        step = Step(row, int(track.rows[row]), track.time[row], float(size[k]), here - error[k], here, kind)
        unexplained.append(step if k in jumps else step._replace(kind="small"))
    return unexplained


def _is_several(track: ImportedTrack, place: Array, jumps: Any, error: Array, findings: ImportReport) -> bool:
    """Return True, and add an error, if a track can only be of several individuals that alternate."""
    next_row, second_row = (float(np.median(np.linalg.norm(place[rows:] - place[:-rows], axis=1))) for rows in (1, 2))
    undone = np.linalg.norm(error[jumps[1:]] + error[jumps[:-1]], axis=1) < 0.3 * np.linalg.norm(
        error[jumps[1:]], axis=1
    )
    flown = np.linalg.norm(track.stack(VELOCITY_TARGETS, 2), axis=1) if track.has(VELOCITY_TARGETS) else np.zeros(1)
    # Every second row is near, the next one far; by more than the velocity that an estimate of a drone at rest shows.
    if next_row > 3.0 * max(second_row, float(np.median(np.nan_to_num(flown))) * median_period(track)):
        what = f"jumps back and forth by {next_row:.3g} m, row {track.rows[0]} on"
    # An animal may dart often, but two that alternate undo each jump by the next one.
    elif len(jumps) > max(20, 0.05 * len(error)) and (track.has(VELOCITY_TARGETS) or undone.mean() > 0.5):
        what = f"jumps {len(jumps)} times, first row {track.rows[jumps[0] + 1]}"
    else:
        return False
    findings.add_error(f"{track.source}: {track.name} {what}: {SEVERAL}", "jumps")
    return True


def _alive(moved: Array, steps: Array) -> Array:
    """Return the speed of steps, m/s, of which a living thing is capable; 0 of others; moved : m in steps of s."""
    size = np.linalg.norm(moved, axis=1)
    able = (4.0 * size < HARDEST * steps**2) & (size < FASTEST * steps)
    return np.where(able, size / steps, 0.0)


def _outliers(jumps: NDArray[np.int64], moved: Array, speed: Array) -> NDArray[np.int64]:
    """Return rows off the track: between two that agree, so that the next step undoes the jump to it.

    jumps : rows before a jump; moved : (row - 1, 2) of which one undoes the other, m; speed : as in
            `_alive`
    """
    if not jumps.size:
        return jumps
    size = np.linalg.norm(moved, axis=1)
    back = np.append(np.linalg.norm(moved[:-1] + moved[1:], axis=1) < 0.3 * size[:-1], False)
    # Who moves as fast elsewhere may have been there and come back.
    own = np.max(speed, initial=0.0, where=~back & ~np.append(False, back[:-1]))
    rows: list[int] = []
    for k in jumps[back[jumps] & ~((speed[jumps] > 0.0) & (speed[jumps] < 2.0 * own))].tolist():
        if not rows or k > rows[-1]:  # a step is used once, so that no sound row between two is taken
            rows.append(k + 1)
    return np.array(rows, np.int64)


def _beyond_velocities(track: ImportedTrack, jumps: Any, beyond: Array, steps: Array) -> NDArray[np.bool_]:
    """Return the jumps that no logged velocity near them explains; beyond : (row - 1,) what exceeds the limit, m."""
    if not track.has(VELOCITY_TARGETS) or not jumps.size:
        return np.ones(len(jumps), bool)
    speed = np.nan_to_num(track.stack(VELOCITY_TARGETS, 2))
    # A velocity that lags or changes within a step errs by a part of its change. Rows next to a bad one are left out: a
    # velocity that was differentiated from positions shows the jump, too.
    rows = np.clip(jumps[:, None] + np.array([-2, -1, 3, 4]), 0, len(speed) - 1)
    change = np.linalg.norm(np.ptp(speed[rows], axis=1), axis=1)
    within = 0.5 * np.linalg.norm(speed[jumps + 1] - speed[jumps], axis=1)
    return np.asarray(beyond[jumps] > np.maximum(change, within) * steps[jumps])


def _absent_rows(place: Array, jumps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return rows that stay at one place to the bit, at 0, 0 or between two jumps: an animal that is not there.

    place : (row, 2), m; jumps : rows before a jump
    """
    if not jumps.size:
        return jumps
    ends = np.append(np.flatnonzero((np.diff(place, axis=0) != 0.0).any(axis=1)), len(place) - 1)
    known: set[int] = set(jumps.tolist())
    absent: list[int] = []
    for before in (-1, *jumps.tolist()):
        first, last = before + 1, int(ends[np.searchsorted(ends, before + 1)])
        framed = before >= 0 and last in known and last >= first + 2
        zero = not place[first].any() and (before >= 0 or last in known) and (last in known or last == len(place) - 1)
        absent += range(first, last + 1) if framed or zero else []
    return np.array(absent, np.int64)


def prediction_errors(track: ImportedTrack) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the error of each predicted step (row - 1, 2), m, its noise (row - 1,), m, and where it is most of a step.

    The logged velocity predicts a step. Without one anything between the step before and the step
    after it does: a fast start goes on, and a turn began before.
    """
    step = median_period(track)
    place = track.stack(POSITION_TARGETS, 2)
    moved, steps = np.diff(place, axis=0), np.diff(track.time)
    if len(moved) < 20:
        return np.empty((0, 2)), np.empty(0), np.empty(0, bool)
    lone = np.ones(len(moved), bool)
    if track.has(VELOCITY_TARGETS):
        speed = track.stack(VELOCITY_TARGETS, 2)
        error = noise = np.nan_to_num(moved - 0.5 * (speed[1:] + speed[:-1]) * steps[:, None])
    else:
        rate = moved / np.maximum(steps, 1e-12)[:, None]
        noise = np.concatenate([np.zeros((1, 2)), moved[1:] - rate[:-1] * steps[1:, None]])
        before = np.concatenate([rate[2:3], rate[:-1]]) * steps[:, None]
        change = np.concatenate([rate[1:], rate[-3:-2]]) * steps[:, None] - before
        share = np.sum((moved - before) * change, axis=1) / np.maximum(np.sum(change**2, axis=1), 1e-300)
        error = moved - before - np.clip(share, 0.0, 1.0)[:, None] * change
        lone = np.linalg.norm(error, axis=1) >= LONE * np.linalg.norm(moved, axis=1)
    # Rows that repeat a place, of one who is absent or of a slow camera, say nothing about noise.
    moving = (steps <= 1.5 * step) & moved.any(axis=1)
    if not moving.any():
        return np.zeros_like(error), np.ones(len(error)), lone
    # of the livelier axis: who flies along one rests in the other
    scale = 1.4826 * float(np.median(np.abs(noise[moving]), axis=0).max())
    quantum = float(np.abs(moved[moved != 0.0]).min())  # of positions that come in steps, and repeat between them
    if not track.has(VELOCITY_TARGETS) and moved.any(axis=1).mean() > 0.9:
        quantum = 0.0  # even motion, whose steps are no noise
    scale = max(scale, quantum, 0.1 * float(np.median(np.abs(moved[moving]), axis=0).max()), 1e-9)
    return error, scale * np.maximum(steps / step, 1.0), lone
