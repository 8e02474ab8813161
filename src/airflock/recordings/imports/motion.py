"""Checks of motion: axes, signs and units by velocity (rule 2), resets (5) and outliers (6)."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.recordings.imports.checks import median_period
from airflock.recordings.imports.expressions import quote_column
from airflock.recordings.imports.headers import LENGTH_UNITS, SPEED_UNITS, TIME_UNITS, header_meaning, split_header
from airflock.recordings.imports.track import POSITION_TARGETS, VELOCITY_TARGETS, ImportedTrack, ImportReport

Array = NDArray[np.float64]
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
    """Rule 2: along each axis positions change as the velocities say; else name what is swapped, turned or scaled."""
    by_file: dict[str, list[ImportedTrack]] = {}
    for track in tracks:
        if track.has(VELOCITY_TARGETS):
            by_file.setdefault(track.source, []).append(track)
    for source, own in by_file.items():
        axes = 3 if all("z" in t.columns and "vz" in t.columns for t in own) else 2
        pairs = [_displacements(track, axes) for track in own]
        moved = np.concatenate([p[0] for p in pairs])
        summed = np.concatenate([p[1] for p in pairs])
        if len(moved) < 20:
            findings.notes.append(f"{source}: too few rows to compare positions with velocities")
            continue
        _compare(source, own[0], moved, summed, findings)


def _displacements(track: ImportedTrack, axes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements over about LAG, and the same from the velocities, (pair, axis), m."""
    step = median_period(track)
    place, speed = track.stack(POSITION_TARGETS, axes), track.stack(VELOCITY_TARGETS, axes)
    steps = np.diff(track.time)
    if not step:
        return np.empty((0, axes)), np.empty((0, axes))
    whole = (steps < 3.0 * step) & np.isfinite(speed[1:]).all(axis=1) & np.isfinite(speed[:-1]).all(axis=1)
    path = np.cumsum(np.where(whole[:, None], 0.5 * (speed[1:] + speed[:-1]) * steps[:, None], 0.0), axis=0)
    path = np.concatenate([np.zeros((1, axes)), path])
    broken = np.concatenate([[0], np.cumsum(~whole)])
    k = max(1, round(LAG / step)) if step < LAG else 1
    sound = np.flatnonzero(broken[k:] == broken[:-k])
    # rows by number: a stride over all of them would keep them all in memory
    rows = sound[:: max(1, (len(broken) - k) // 20_000)]
    return place[rows + k] - place[rows], path[rows + k] - path[rows]


class AxisCorrelation(NamedTuple):
    """How displacements (rows) go with velocities (columns), by axis.

    lively : (axis,) whether the velocity along it varies enough to compare
    r      : (axis, axis) correlation
    slopes : (axis,) by how many times the displacement along it changes as the velocity says
    """

    lively: NDArray[np.bool_]
    r: Array
    slopes: Array


def _likeness(moved: Array, summed: Array) -> AxisCorrelation:
    """Compare displacements with the same from velocities, both (pair, axis), m; some velocity must vary."""
    strength, spread = summed.std(axis=0), moved.std(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cross = (moved - moved.mean(0)).T @ (summed - summed.mean(0)) / len(moved)
        r, slopes = np.nan_to_num(cross / np.outer(spread, strength)), np.diag(cross) / strength**2
    return AxisCorrelation(strength > 0.05 * strength.max(), r, slopes)


def _compare(source: str, track: ImportedTrack, moved: Array, summed: Array, findings: ImportReport) -> None:
    """Find where velocities contradict positions: axes that are swapped or turned round, units that differ.

    track : the first of its file, for names in messages
    moved, summed : displacements, and the same from the velocities, (pair, axis), m
    """
    if summed.std(axis=0).max() <= 1e-12:
        findings.notes.append(f"{source}: nothing moves: axes and units cannot be checked against velocities")
        return
    likeness = _likeness(moved, summed)
    lively, r, slopes = likeness
    swapped = _swap_fault(source, track, likeness)
    if swapped:
        findings.fault(swapped, "axes")
        return
    axes = range(len(slopes))
    turned = [i for i in axes if lively[i] and r[i, i] < -0.5]
    for i in turned:
        speed = track.label(VELOCITY_TARGETS[i])
        findings.fault(
            f"{source}: column {track.label(POSITION_TARGETS[i])}, "
            f"row {track.rows[0]} on: {POSITION_TARGETS[i]} grows where "
            f"{speed} is negative (slope {slopes[i]:.2f}): one of them points the other way; "
            f'write --map "{VELOCITY_TARGETS[i]}:=-{quote_column(speed)}"',
            "axes",
        )
    wrong = [i for i in axes if lively[i] and i not in turned and abs(slopes[i] - 1.0) > TOLERANCE]
    wrong = [i for i in wrong if abs(r[i, i]) > 0.5]
    if wrong:
        columns, slope = ", ".join(track.label(POSITION_TARGETS[i]) for i in wrong), float(np.median(slopes[wrong]))
        findings.fault(
            f"{source}: column {columns}, row {track.rows[0]} on: positions change {slope:.3g} times as fast "
            f"as the velocities say: {_scale_reason(track, slope)}",
            "axes",
        )


def _swap_fault(source: str, track: ImportedTrack, likeness: AxisCorrelation) -> str:
    """The first axis of the positions that goes with another axis of the velocities; empty if none does."""
    for i, row in enumerate(likeness.r):
        j = int(np.abs(row).argmax())
        if likeness.lively[i] and i != j and abs(row[i]) < 0.5 and abs(row[j]) > 0.8:
            return (
                f"{source}: column {track.label(POSITION_TARGETS[i])} ({POSITION_TARGETS[i]}), "
                f"row {track.rows[0]} on: moves like "
                f"{track.label(VELOCITY_TARGETS[j])} ({VELOCITY_TARGETS[j]}; r = {row[j]:.2f}): "
                f"{_unswapped(track, i, j)}"
            )
    return ""


def _scale_reason(track: ImportedTrack, slope: float) -> str:
    """Why positions change so many times as fast as velocities say, and what to write."""
    near = min(REASONS, key=lambda known: abs(np.log(known / slope)))
    if abs(np.log(near / slope)) >= 0.1:
        return "units differ"
    words, changes = REASONS[near]
    return f"{words}: write {', or '.join(_mapped(track, *change) for change in changes)}"


def _unswapped(track: ImportedTrack, i: int, j: int) -> str:
    """What to write where axis i of the positions is axis j of the velocities."""
    own = [quote_column(track.label(POSITION_TARGETS[k])) for k in (i, j)]
    told = [header_meaning(track.label(POSITION_TARGETS[k])) for k in (i, j)]
    if [None if one is None else one.target for one in told] == [
        POSITION_TARGETS[j],
        POSITION_TARGETS[i],
    ]:  # they have been exchanged already, by --axes or --map
        return (
            "positions and velocities have different axes; write, without --axes, "
            f'--map "{POSITION_TARGETS[i]}:={own[0]}" --map "{POSITION_TARGETS[j]}:={own[1]}"'
        )
    return (
        f'swapped, or north-east-down; write --map "{POSITION_TARGETS[i]}:={own[1]}" '
        f'--map "{POSITION_TARGETS[j]}:={own[0]}", '
        "or --axes ned"
    )


def _mapped(track: ImportedTrack, target: str, wrong: float) -> str:
    """What to write so that a target is `wrong` times what it is now; an expression loses the unit of its header."""
    label = track.label(target)
    name, unit = split_header(label)
    own = {**TIME_UNITS, **LENGTH_UNITS, **SPEED_UNITS}.get(unit, 1.0) if name else 1.0
    return f'--map "{target}:={quote_column(label)}*{own * wrong:.6g}"'


def check_jumps(track: ImportedTrack, findings: ImportReport) -> None:
    """Rules 5 and 6: a row off its track is left out; a track that goes on elsewhere was reset, and is split there."""
    surprise, scale = prediction_errors(track)
    if not len(surprise):
        return
    place = track.stack(POSITION_TARGETS, 2)
    next_row = float(np.median(np.linalg.norm(place[1:] - place[:-1], axis=1)))
    if next_row > 3.0 * float(np.median(np.linalg.norm(place[2:] - place[:-2], axis=1))):
        findings.fault(
            f"{track.source}: {track.name} jumps back and forth by {next_row:.3g} m, row {track.rows[0]} on: "
            "two individuals under one id? Map another column: --map id:=COLUMN",
            "jumps",
        )
        return
    size = np.linalg.norm(surprise, axis=1)
    limit = (SIGMAS if track.has(VELOCITY_TARGETS) else WILD) * scale
    known = np.isin(np.arange(1, len(track.time)), track.breaks)
    jumps = np.flatnonzero((size > limit) & ~known)
    if len(jumps) > max(20, 0.05 * len(size)):
        row = int(track.rows[jumps[0] + 1])
        findings.fault(
            f"{track.source}: {track.name} jumps {len(jumps)} times, first row {row}: two individuals under one id? "
            "Map another column: --map id:=COLUMN",
            "jumps",
        )
        return
    away = [int(k) for k in jumps if k + 1 < len(size) and _returns(surprise[k], surprise[k + 1])]
    back = {k + 1 for k in away}
    resets = [int(k) for k in jumps if k not in away and k not in back]
    if resets:
        k = resets[0]
        findings.fault(
            f"{track.source}: column {track.label('x')}, row {track.rows[k + 1]}: {track.name} jumps {size[k]:.3g} m "
            f"more than its velocity explains ({len(resets)} times): a reset of the estimator; cut before or "
            "after it with --end or --begin; if accepted, the track is split there",
            "jumps",
        )
        track.breaks = np.unique(np.concatenate([track.breaks, np.array(resets) + 1])).astype(np.int64)
    if away:
        row = int(track.rows[away[0] + 1])
        findings.notes.append(f"{track.source}: {track.name}: {len(away)} outliers left out, first row {row}")
        sound = np.ones(len(track.time), bool)
        sound[np.array(away) + 1] = False
        track.keep(sound)


def _returns(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    return bool(np.linalg.norm(first + second) < 0.3 * np.linalg.norm(first))


def prediction_errors(track: ImportedTrack) -> tuple[NDArray[np.float64], float]:
    """What each step is beyond its prediction (row - 1, 2), m, and a robust scale of it; zero across gaps."""
    step = median_period(track)
    place = track.stack(POSITION_TARGETS, 2)
    moved, steps = np.diff(place, axis=0), np.diff(track.time)
    if len(moved) < 20:
        return np.empty((0, 2)), 0.0
    if track.has(VELOCITY_TARGETS):
        speed = track.stack(VELOCITY_TARGETS, 2)
        predicted = 0.5 * (speed[1:] + speed[:-1]) * steps[:, None]
    else:
        rate = moved / np.maximum(steps, 1e-12)[:, None]
        predicted = np.concatenate([moved[:1], rate[:-1] * steps[1:, None]])
    off = np.nan_to_num(moved - predicted)
    off[steps > 1.5 * step] = 0.0
    near = np.abs(off[steps <= 1.5 * step])
    # of the livelier axis: who flies along one rests in the other
    scale = 1.4826 * float(np.median(near, axis=0).max())
    steps_of = np.abs(moved[moved != 0.0])
    quantum = float(steps_of.min()) if steps_of.size else 0.0  # of positions that come in steps
    return off, max(scale, quantum, 0.1 * float(np.median(np.abs(moved), axis=0).max()), 1e-9)
