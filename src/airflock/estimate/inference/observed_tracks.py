"""Observed tracks: positions in spans of time, and who is present, seen and counted at each frame."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import check_recording
from airflock.support import RecordingError

Array = NDArray[np.float64]
ABSENT, UNSEEN, COUNTED, SEEN, ENTERS = 0, 1, 2, 3, 4  # what an individual is at a frame
LONGEST_GAP = 1.0  # s; an individual that is not seen for longer has left
SETTLING = 10  # frames after an entry that are not counted
BEGINNING = 5  # frames from which the velocity at an entry is taken
SPAN = 12.0  # s; spans are what is held out, and what errors are taken over
SLOWEST = 60.0  # s; the longest sensors.period of a scenario
SPANS = (8, 400)  # least and largest number of spans
SHORT = 30  # frames; no span is shorter
FEW = 4 * SHORT  # frames below which nothing is inferred


@dataclass(frozen=True)
class SpanTracks:
    """One recording, cut into spans.

    period  : between frames, s
    seen    : (frame, axis, individual) positions, m; nan where an individual was not seen
    state   : (frame, individual) ABSENT, UNSEEN, COUNTED, SEEN or ENTERS
    speed   : (frame, axis, individual) velocity of those who enter, m/s; 0 elsewhere
    spans   : first and last frame (exclusive) of each span
    box     : half sides of a periodic box, m; 0 along an axis that is open
    """

    period: float
    seen: Array
    state: NDArray[np.int8]
    speed: Array
    spans: tuple[tuple[int, int], ...]
    name: str
    box: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def axes(self) -> int:
        """Return 2 in a plane, 3 in space."""
        return int(self.seen.shape[1])

    @property
    def individual_count(self) -> int:
        """Return the number of individuals that are present at any time."""
        return int(self.seen.shape[2])

    def nearest(self, offset: Array) -> Array:
        """Return offsets (axis, individual), m, to the nearest image of the box."""
        return nearest_image(offset, self.box, 0)

    @property
    def counted(self) -> int:
        """Return the steps that are scored."""
        return int((self.state == COUNTED).sum())


@dataclass(frozen=True)
class TrackScale:
    """Observed lengths and speeds: nearest and farthest pair (m), median and largest speed (m/s), period (s).

    begin : radius (m) of the disc or ball with the spread of the first frame
    length : of the longest recording, s
    """

    near: float
    far: float
    speed: float
    max_speed: float
    period: float
    begin: float = 0.0
    length: float = 0.0


def tracks_from_recording(
    recording: xr.Dataset, name: str = "tracks", span: float = SPAN, box: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> SpanTracks:
    """Cut a recording with evenly spaced frames into spans.

    span : length of a span, s; less where the recording is short
    box  : as in `SpanTracks`

    Positions alone are used: velocities of tracks are differentiated, and so contain the future.
    """
    check_recording(recording)
    order = ("time", "space", "individual")
    own = recording.isel(keypoint=0)
    time = own["time"].values.astype(float)
    seen = own["position"].transpose(*order).values.astype(float)
    if len(time) < FEW:
        raise RecordingError(f"{name}: {len(time)} frames are too few to infer a law from; {FEW} or more")
    steps = np.diff(time)
    period = float(np.median(steps))
    if period > SLOWEST:
        raise RecordingError(
            f"{name}: frames are {period:g} s apart, and laws decide every {SLOWEST:g} s or faster: no law can be "
            "inferred at that rate; score, plot and replay take it"
        )
    if np.abs(steps - period).max() > 0.01 * period:
        raise RecordingError(f"{name}: frames are not evenly spaced; import it with --rate")
    if seen.shape[1] == 3 and not np.nanmax(seen[:, 2]) - np.nanmin(seen[:, 2]) > 1e-9:
        seen = seen[:, :2]  # flown at one height
    sure: Any = np.isfinite(seen).all(axis=1)
    if "confidence" in own:
        sure &= own["confidence"].transpose("time", "individual").values >= 1.0  # not those that were bridged
    seen = np.where(sure[:, None], seen, np.nan)
    length = len(time) * period
    parts = int(np.clip(round(length / span), min(SPANS[0], len(time) // SHORT), min(SPANS[1], len(time) // SHORT)))
    cuts = np.linspace(0, len(time), parts + 1).astype(int)
    spans = tuple((int(a), int(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True))
    found = with_positions(
        SpanTracks(period, seen, np.zeros(sure.shape, np.int8), np.zeros_like(seen), spans, name, box), seen
    )
    if not found.counted:
        raise RecordingError(f"{name}: no individual is seen for {SETTLING + 1} frames in a row")
    return found


def with_positions(tracks: SpanTracks, positions: Array) -> SpanTracks:
    """Return the tracks with other positions; presence and entries are computed from them."""
    sure: Any = np.isfinite(positions).all(axis=1)
    state, speed = np.zeros(sure.shape, np.int8), np.zeros_like(positions)
    gap = max(2, round(LONGEST_GAP / tracks.period))
    for begin, end in tracks.spans:
        for i in range(sure.shape[1]):
            own = positions[begin:end, :, i]
            _walk(
                sure[begin:end, i], own, state[begin:end, i], speed[begin:end, :, i], gap, tracks.period, tracks.box
            )  # fmt: skip
    return replace(tracks, seen=np.ascontiguousarray(positions), state=state, speed=speed)


def shifted_in_time(tracks: SpanTracks) -> SpanTracks:
    """Return the tracks with each individual at a time of its own: all move as they did, and nobody meets anybody.

    Shifts are spread evenly over the recording; where an end meets the beginning, the individual
    leaves and enters.
    """
    frames, n = len(tracks.seen), tracks.individual_count
    away = max(2, round(LONGEST_GAP / tracks.period)) + 1
    seen = tracks.seen.copy()
    for i in range(n):
        shift = round(i * frames / n)
        seen[:, :, i] = np.roll(tracks.seen[:, :, i], shift, axis=0)
        seen[shift : shift + away if shift else 0, :, i] = np.nan
    return with_positions(tracks, seen)


def nearest_image(offset: Array, box: tuple[float, ...], axis: int) -> Array:
    """Return offsets (m) to the nearest image of a periodic box; `axis` is that of coordinates."""
    found = offset.copy()
    for a, half in enumerate(box[: offset.shape[axis]]):
        if half > 0.0:
            part = np.take(found, a, axis)
            part = part - 2.0 * half * np.round(part / (2.0 * half))
            found[(slice(None),) * axis + (a,)] = part
    return found


def _walk(
    sure: NDArray[np.bool_], seen: Array, state: NDArray[np.int8], speed: Array, gap: int, period: float,
    box: tuple[float, ...],
) -> None:  # fmt: skip
    """Fill in what one individual is at each frame of a span."""
    frames = np.flatnonzero(sure)
    since, last = 0, -1
    for order, k in enumerate(frames.tolist()):
        if last < 0 or k - last > gap:
            near = frames[order : order + BEGINNING]
            near = near[near - k < 2 * BEGINNING]
            if len(near) < 3:
                last = -1
                continue
            t = (near - near.mean()) * period
            speed[k] = (t[:, None] * nearest_image(seen[near] - seen[k], box, 1)).sum(axis=0) / (t * t).sum()
            state[k], since = ENTERS, 0
        else:
            state[last + 1 : k] = UNSEEN
            since += 1
            state[k] = COUNTED if since > SETTLING and k - last == 1 else SEEN
        last = k


def tracks_scale(all_tracks: list[SpanTracks]) -> TrackScale:
    """Measure lengths and speeds in several tracks of one kind."""
    near, far, speeds = [], [], []
    for tracks in all_tracks:
        lag = max(1, round(0.2 / tracks.period))
        step = nearest_image(tracks.seen[lag:] - tracks.seen[:-lag], tracks.box, 1)
        moved = np.linalg.norm(step, axis=1) / (lag * tracks.period)
        speeds.append(moved[np.isfinite(moved)])
        for frame in tracks.seen[:: max(1, len(tracks.seen) // 200)]:
            x = frame[:, np.isfinite(frame).all(axis=0)]
            if x.shape[1] > 1:
                apart = np.linalg.norm(nearest_image(x[:, :, None] - x[:, None, :], tracks.box, 0), axis=0)
                far.append(float(apart.max()))
                np.fill_diagonal(apart, np.inf)
                near.append(float(np.median(apart.min(axis=0))))
    speed = np.concatenate(speeds)
    if not near or not len(speed):
        raise RecordingError(
            f"{all_tracks[0].name}: no two individuals are ever seen together, so nobody to flock with"
        )
    name = all_tracks[0].name
    if not np.quantile(speed, 0.5) > 0.0:
        raise RecordingError(f"{name}: most individuals stand still, so there is no motion to infer a law from")
    if not np.median(near) > 0.0:
        raise RecordingError(f"{name}: individuals are in one place, so there are no distances to infer a law from")
    return TrackScale(
        float(np.median(near)), float(np.quantile(far, 0.9)), float(np.median(speed)),
        float(np.quantile(speed, 0.999)), all_tracks[0].period, _first_radius(all_tracks[0]),
        max(len(tracks.seen) for tracks in all_tracks) * all_tracks[0].period,
    )  # fmt: skip


def _first_radius(tracks: SpanTracks) -> float:
    """Return the radius (m) of the even disc or ball that is as wide as the flock when most are first seen."""
    seen: Any = np.isfinite(tracks.seen).all(axis=1)
    first = int(np.argmax(seen.sum(axis=1) >= 0.9 * seen.sum(axis=1).max()))
    x = tracks.seen[first][:, seen[first]]
    out = nearest_image(x - x[:, :1], tracks.box, 0)
    spread = float(((out - out.mean(axis=1, keepdims=True)) ** 2).sum(axis=0).mean())
    # The mean square of an even disc or ball is axes / (axes + 2) of its radius squared.
    return float(np.sqrt(spread * (tracks.axes + 2.0) / tracks.axes))
