"""Resample tracks to one grid of times: gaps are bridged up to a stated length, otherwise the individual is absent."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings.dataset import DIMENSIONS, VARIABLE_UNITS, central_difference, poses
from airflock.recordings.imports.track import COMMAND_TARGETS, POSITION_TARGETS, VELOCITY_TARGETS, ImportedTrack
from airflock.recordings.imports.track_checks import median_period
from airflock.support import RecordingError, trim_heap

MOST = 2_000_000_000  # numbers of one recording
MOST_FRAMES = 1000  # for each row of the tracks; a slip of the pen makes more, and nothing new is in them
NORMAL = 1.5  # times the usual step: longer is a gap
NTSC = 1.001  # colour television is slower than its nominal rate by this factor (SMPTE 170M)
SLOWEST_CAMERA = 1.0  # s between frames; slower rows are fixes, which are minutes apart and no rates of television
SAME_RATE = 2e-5  # relative: times in whole microseconds, at 30 Hz, are 1e-5 off
FARTHEST = 1e9  # m from the origin; our choice: no animal and no drone has been there
COARSE = 0.01  # m; where places are farther apart in single precision, they are kept in double


def time_grid(
    tracks: list[ImportedTrack], rate: float | None, begin: float | None, end: float | None
) -> tuple[Any, float]:
    """Return times (s) from the first to the last row, and their distance: the tracks' own rate by default.

    A window that begins between two rows of the tracks' own rate begins at the later one, so that
    its times are theirs.
    """
    usual = [median_period(track) for track in tracks if len(track.time) > 1]
    own = float(np.median(usual)) if usual else 1.0
    if rate and rate * own > MOST_FRAMES:
        raise RecordingError(
            f"--rate {rate:g}: {rate * own:.4g} frames for each row, of which there are {1 / own:.4g} a second; write "
            f"--rate {MOST_FRAMES / own:.4g} or less"
        )
    period = 1.0 / rate if rate else _round(own)
    first = float(min(track.time[0] for track in tracks))
    if begin is not None:
        early = np.floor((first - begin + grid_tolerance(period, first, begin)) / period)
        first = begin if rate else first - float(early) * period
    last = max(track.time[-1] for track in tracks) if end is None else end
    if last < first:
        raise RecordingError(f"no rows between {first:g} and {last:g} s")
    count = int(np.floor((last - first + grid_tolerance(period, first, last)) / period)) + 1
    if count * len(tracks) * 6 > MOST:
        raise RecordingError(
            f"{count} times of {len(tracks)} individuals do not fit; write --rate or --begin and --end"
        )
    return first + np.arange(count) * period, period


def grid_tolerance(period: float, *instants: float) -> float:
    """Return the time (s) by which rows may miss the grid: 1e-6 of a period, and the resolution of these instants.

    Seconds since 1970 are resolved to 2.4e-7 s.
    """
    return 1e-6 * period + 2.0 * float(np.spacing(max(abs(instant) for instant in instants)))


# At 30 Hz a step of 0.03333 s drifts past every frame after ten: positions were interpolated, which
# smooths their noise, and 10,000 frames became 10,001.
def _round(period: float) -> float:
    """Round a period (s) to a rate of four digits, such as 30 or 29.97 Hz, else to four digits of itself.

    Frames of a video are met then, rather than drifted past: with 0.03333 s one is lost in each
    10,000 of 30 Hz.
    """
    if period > SLOWEST_CAMERA:
        return float(f"{period:.6g}")
    rates = [float(f"{slower / period:.4g}") / slower for slower in (1.0, NTSC)]
    rate = min(rates, key=lambda rate: abs(rate * period - 1.0))
    return 1.0 / rate if abs(rate * period - 1.0) < SAME_RATE else float(f"{period:.4g}")


def needed_bits(tracks: list[ImportedTrack], min_bits: int) -> tuple[int, float]:
    """Return the bits per number that tracks need, at least `min_bits`, and the step of places in single precision, m.

    Raises RecordingError for places that nobody flies at.
    """
    far = [float(np.nanmax(np.abs(track.stack(POSITION_TARGETS, 3)), initial=0.0)) for track in tracks]
    farthest = max(far)
    if farthest > FARTHEST:
        track = tracks[far.index(farthest)]
        raise RecordingError(
            f"{track.source}: {track.name}: a position of {farthest:.3g} m; at most {FARTHEST:g} m from the origin; "
            "check the unit and which columns are read"
        )
    # Single precision at 100 km resolves 8 mm; farther away noise of rounding would look like
    # motion.
    step = float(np.spacing(np.float32(farthest)))
    return (64 if step > COARSE else min_bits), step


def resample(
    tracks: list[ImportedTrack], times: NDArray[np.float64], period: float, bridge: float, precision: int
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Resample tracks to the given times; return the dataset, and the shares that are present and bridged.

    If rows are in no frame: their number `lost`, the first, `lost_at`, and the longest time to a
    next row, `apart`, s.

    bridge : longest gap (s) that is bridged, by cubic Hermite with the velocities at its ends
    """
    axes = 3 if any("z" in track.columns for track in tracks) else 2
    kind = np.float32 if precision == 32 else np.float64
    names = ["position", "velocity", *(["command"] if any(track.has(COMMAND_TARGETS) for track in tracks) else [])]
    # one individual after another, so that memory is taken for each as its rows are given back
    filled = {name: np.empty((len(tracks), axes, len(times)), kind) for name in names}
    sure = np.empty((len(times), len(tracks)), np.float32)
    lost: list[tuple[float, str]] = []  # time to the nearer neighbour, s, and where it is
    for who, track in enumerate(tracks):
        lost += _lonely_rows(track, times, period, bridge)
        _fill(track, who, times, period, bridge, {name: array[who].T for name, array in filled.items()}, sure)
        if len(tracks) > 1:
            track.columns, track.time, track.rows = {}, track.time[:0], track.rows[:0]  # a long log is in memory once
            trim_heap()
    variables: dict[str, Any] = {}
    for name in names:
        whole = np.ascontiguousarray(filled.pop(name).transpose(2, 1, 0))
        variables[name] = (DIMENSIONS, whole[:, :, None, :], {"units": VARIABLE_UNITS.get(name, "m/s")})
    shares: dict[str, Any] = {"present": float((sure > 0.0).mean()), "bridged": float((sure == 0.5).mean())}
    if lost:
        shares |= {"lost": len(lost), "lost_at": lost[0][1], "apart": max(lost)[0]}
    begin, instants = {"airflock_begin": float(times[0])}, np.arange(len(times)) * period
    return poses(variables, sure, instants, period, [track.name for track in tracks], begin), shares


def _lonely_rows(track: ImportedTrack, times: Any, period: float, bridge: float) -> list[tuple[float, str]]:
    """Return each row that no frame shows, alone between gaps and off the grid: time to the nearer row (s), place."""
    usual = median_period(track) or period
    steps = np.concatenate([[np.inf], np.diff(track.time), [np.inf]])
    near, at = np.minimum(steps[1:], steps[:-1]), (track.time - times[0]) / period
    off = np.abs(at - np.clip(np.round(at), 0, len(times) - 1)) * period >= 1e-3 * min(period, usual)
    alone = np.flatnonzero(off & (near > max(bridge, NORMAL * usual)) & (near < np.inf))
    where = f"{track.source}: column {track.label('t')}, row"
    return [(float(near[k]), f"{where} {track.rows[k]}: {track.name}") for k in alone]


def _fill(
    track: ImportedTrack, who: int, times: Any, period: float, bridge: float, filled: dict[str, Any], sure: Any
) -> None:
    """Fill in an individual's confidence (time, individual) and its arrays by name, each (time, axis)."""
    axes = filled["position"].shape[1]
    own, usual = track.time, median_period(track) or period
    rows = track.stack(POSITION_TARGETS, axes)
    late = grid_tolerance(period, times[0], times[-1])
    # For each time of the grid the row before it; the last row has no row after it, so the pair
    # before is used.
    at = np.searchsorted(own, times + late, side="right") - 1
    inside = (at >= 0) & (times <= own[-1] + late)
    before = np.clip(at, 0, max(len(own) - 2, 0))
    after = np.minimum(before + 1, len(own) - 1)
    step = own[after] - own[before]
    part = np.where(step > 0.0, (times - own[before]) / np.where(step > 0.0, step, 1.0), 0.0)
    # A frame that meets a row takes the row itself, without any interpolation.
    on_row = (np.abs(times - own[np.clip(at, 0, None)]) < 1e-3 * min(period, usual)) & inside
    broken = np.isin(after, track.breaks)
    normal = inside & (step <= NORMAL * usual) & ~broken
    bridged = inside & (step <= max(bridge, NORMAL * usual)) & ~broken
    # Good frames are on a row, between two normal rows, or in a gap that may be bridged, but never
    # across a reset.
    good = on_row | bridged
    if track.in_air is not None:
        good &= track.in_air[before] & track.in_air[after]
    logged = track.has(VELOCITY_TARGETS)
    slopes = _slopes(own, rows, track.breaks, usual)
    for c, name in enumerate(VELOCITY_TARGETS[:axes] if logged else ()):
        velocity = track.columns.get(name, slopes[:, c])
        slopes[:, c] = np.where(np.isfinite(velocity), velocity, slopes[:, c])  # what is not logged is differentiated
    p, v = _hermite(rows, slopes, before, after, step, part)
    if logged:  # between two rows the logged velocity itself, not the slope of the curve through the positions
        v = slopes[before] + part[:, None] * (slopes[after] - slopes[before])
    same = np.clip(at, 0, None)
    p, v = np.where(on_row[:, None], rows[same], p), np.where(on_row[:, None], slopes[same], v)
    filled["position"][:] = np.where(good[:, None], p, np.nan)
    filled["velocity"][:] = np.where(good[:, None], v, np.nan)
    sure[:, who] = np.where(good, np.where(on_row | normal, 1.0, 0.5), 0.0)
    if "command" in filled:
        unsaid = np.full(len(own), np.nan)
        ask = np.stack([track.columns.get(name, unsaid) for name in COMMAND_TARGETS[:axes]], axis=1)
        held = ask[same]  # a command holds until the next one
        filled["command"][:] = np.where((on_row | normal)[:, None] & good[:, None], held, np.nan)


def _slopes(times: Any, rows: Any, breaks: Any, usual: float) -> Any:
    """Differentiate positions: central differences within each unbroken stretch."""
    found = np.zeros_like(rows)
    gaps = np.flatnonzero(np.diff(times) > 5.0 * usual) + 1
    edges = np.unique(np.concatenate([[0], breaks, gaps, [len(times)]])).astype(int)
    # Gaps and resets end a stretch: a difference across them would be a velocity that nobody had.
    for begin, end in zip(edges[:-1], edges[1:], strict=True):
        if end - begin > 1:
            found[begin:end] = central_difference(rows[begin:end], times[begin:end])
        else:
            found[begin:end] = np.nan
    return found


def _hermite(rows: Any, slopes: Any, before: Any, after: Any, step: Any, part: Any) -> tuple[Any, Any]:
    """Interpolate with a cubic through two points with known slopes; return position and velocity."""
    s, h = part[:, None], step[:, None]
    p0, p1, m0, m1 = rows[before], rows[after], slopes[before] * h, slopes[after] * h
    place = (
        (2 * s**3 - 3 * s**2 + 1) * p0 + (s**3 - 2 * s**2 + s) * m0 + (3 * s**2 - 2 * s**3) * p1 + (s**3 - s**2) * m1
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = ((6 * s**2 - 6 * s) * (p0 - p1) + (3 * s**2 - 4 * s + 1) * m0 + (3 * s**2 - 2 * s) * m1) / h
    return place, speed
