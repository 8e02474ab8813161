"""Score a law on tracks: a Kalman filter in innovation form, and the likelihood of what it does not predict."""

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import Plan, load_loops
from airflock.estimate.inference.law_candidates import FitParameter, LawCandidate
from airflock.estimate.inference.observed_tracks import (
    ABSENT,
    COUNTED,
    ENTERS,
    UNSEEN,
    SpanTracks,
    TrackScale,
)

Array = NDArray[np.float64]
# The filter. This is the innovation form of a Kalman filter in steady state. A step of the compiled
# flight predicts position and velocity of each individual; the difference to the observation
# corrects both by gains, one pair along the heading and one across. Gains are numbers of the fit,
# so the noise of the tracks and that of the motion need not be known: the state is never one noisy
# frame, and never contains the future.
AWAY = 1e9  # m; beyond every range
SCORED = COUNTED  # by the name that loops use; the text of a driver has a COUNTED of its own
GAPS = 12  # frames unseen, beyond which gains grow no more


@dataclass(frozen=True)
class FilterGains:
    """Shares of a difference that correct position (1) and, per period, velocity (1); along and across.

    keep : share of its own difference from the usual speed that an individual keeps for a period
    """

    along: tuple[float, float]
    across: tuple[float, float]
    keep: float = 1.0

    def table(self, period: float) -> Array:
        """Return (along or across, position or velocity, frames unseen): gains, which grow while an individual is
        unseen.
        """
        return np.array([_growing(*self.along, period), _growing(*self.across, period)])


def _growing(into_position: float, into_velocity: float, period: float) -> Array:
    """Return the gains after 0, 1, 2, ... frames unseen: the variances of the steady gains, propagated."""
    kp, kv = into_position, into_velocity / period
    vv = max(kp * kp - 2.0 * period * (1.0 - kp) * kv, 0.0) / period**2 + kv * kv
    pp, pv, noise = kp, kv, 1.0 - kp
    found = np.zeros((2, GAPS))
    # While an individual is unseen nothing corrects it, so its variances grow, and the first new
    # observation counts more.
    for unseen in range(GAPS):
        found[:, unseen] = pp / (pp + noise), pv / (pp + noise)
        pp, pv, vv = pp + 2.0 * period * pv + period**2 * vv, pv + period * vv, vv + kv * kv
    return found


def apply_own_speed(rows, before, i, axes, half, pace, mean_speed, keep):  # type: ignore[no-untyped-def]
    """Move individual i of a law of headings by its own speed, which relaxes to the usual one."""
    was = 0.0
    for a in range(axes):
        was += before[axes + a, i] ** 2
    # A law of headings moves all at one speed; the step of each individual is scaled to its own,
    # which relaxes.
    k = (mean_speed + keep * (math.sqrt(was) - mean_speed)) / pace
    for a in range(axes):
        step = rows[a, i] - before[a, i]
        if half[a] > 0.0:
            step -= 2.0 * half[a] * round(step / (2.0 * half[a]))
        rows[a, i] = before[a, i] + k * step
        rows[axes + a, i] *= k


def correct_state(rows, k, i, axes, half, seen, gains, gap, e, out, counted):  # type: ignore[no-untyped-def]
    """Compare individual i with its observation in frame k, and correct its state by a share; e: 3 numbers of memory.

    gap : frames for which it was not seen
    """
    size, along = 1e-30, 0.0
    # Speed and heading first: errors along and across the heading have different variances and
    # gains.
    for a in range(axes):
        size += rows[axes + a, i] ** 2
    size = 1.0 / math.sqrt(size)
    for a in range(axes):
        e[a] = seen[k, a, i] - rows[a, i]
        if half[a] > 0.0:
            e[a] -= 2.0 * half[a] * round(e[a] / (2.0 * half[a]))
        along += e[a] * (rows[axes + a, i] * size)
    x, y = rows[axes, i] * size, rows[axes + 1, i] * size
    if counted:
        out[k, 0, i], out[k, 1, i] = along, x * e[1] - y * e[0]
        if axes == 3:  # to the left, and upwards of heading and left
            flat = math.sqrt(x * x + y * y) + 1e-30
            out[k, 1, i] /= flat
            out[k, 2, i] = flat * e[2] - rows[axes + 2, i] * size * (x * e[0] + y * e[1]) / flat
    for a in range(axes):
        ahead = along * (rows[axes + a, i] * size)
        rows[a, i] += gains[0, 0, gap] * ahead + gains[1, 0, gap] * (e[a] - ahead)
        rows[axes + a, i] += gains[0, 1, gap] * ahead + gains[1, 1, gap] * (e[a] - ahead)


def advance(first, last, half, rows, axes, usual, period):  # type: ignore[no-untyped-def]
    """Move everybody straight on for a period at the usual speed: the driver of those whom no law moves."""
    for i in range(rows.shape[1] if last > first else 0):
        size = 1e-30
        for a in range(axes):
            size += rows[axes + a, i] ** 2
        for a in range(axes):
            rows[axes + a, i] *= usual / math.sqrt(size)
            rows[a, i] += rows[axes + a, i] * period


def begin_span(rest, rows, before, start):  # type: ignore[no-untyped-def]
    """Start the driver with the present individuals: past states that arrive late are filled with their states."""
    for a in range(before.shape[0]):
        for i in range(before.shape[1]):
            start[a, i] = before[a, i]
    advance(0, 0, 0, *rest)
    for a in range(before.shape[0]):
        for i in range(before.shape[1]):
            rows[a, i] = before[a, i]


def filter_span(  # type: ignore[no-untyped-def]
    rest, steps, rows, before, start, unseen, e, seen, state, speed, gains, out, kept, pushes, axes, half, pace, usual,
    keep,
):  # fmt: skip
    """Predict each frame of a span from the corrected states of the one before, and compare."""
    for k in range(state.shape[0]):
        if k > 0:
            advance((k - 1) * steps, k * steps, 0, *rest)
            for i in range(state.shape[1] if pushes.shape[0] > 0 else 0):
                size = 0.0
                for a in range(axes):
                    size += before[axes + a, i] ** 2
                scale = math.sqrt(size) / pace if pace > 0.0 else 1.0
                for a in range(axes):
                    pushes[k - 1, a, i] = rows[axes + a, i] * scale - before[axes + a, i]
        # One individual after another; those who enter take the observed state, and absent ones
        # wait beyond every range, each at a place of its own, so that no law meets them or divides
        # by zero.
        for i in range(state.shape[1]):
            what = state[k, i]
            if what in (ABSENT, ENTERS):
                for a in range(axes):
                    rows[a, i] = seen[k, a, i] if what == ENTERS else AWAY * (2.0 + i)
                    rows[axes + a, i] = speed[k, a, i] if what == ENTERS else 1.0
                unseen[i] = 0
            else:
                # Before the correction: the step that is scaled is the predicted one.
                if pace > 0.0:
                    apply_own_speed(rows, before, i, axes, half, pace, usual, keep)
                if what == UNSEEN:
                    unseen[i] += 1
                else:
                    gap = unseen[i] if unseen[i] < gains.shape[2] else gains.shape[2] - 1
                    correct_state(rows, k, i, axes, half, seen, gains, gap, e, out, what == SCORED)
                    unseen[i] = 0
            for a in range(2 * axes):
                before[a, i] = rows[a, i]
                if kept.shape[0] > 0:
                    kept[k, a, i] = rows[a, i]
        # Delayed or averaged percepts need states before the first frame; the first observed ones
        # stand for them.
        if k == 0:
            begin_span(rest, rows, before, start)


def stretch_step(rows, before, i, axes, half, usual, keep, change):  # type: ignore[no-untyped-def]
    """Stretch the last step of individual i of a law of headings: its speed relaxes to the usual one, and wanders."""
    size = 0.0
    for a in range(axes):
        size += before[axes + a, i] ** 2
    own = usual + keep * (math.sqrt(size) - usual) + change
    own = (own if own > 0.05 * usual else 0.05 * usual) / usual
    for a in range(axes):
        step = rows[a, i] - before[a, i]
        if half[a] > 0.0:
            step -= 2.0 * half[a] * round(step / (2.0 * half[a]))
        rows[a, i] = before[a, i] + own * step
        rows[axes + a, i] *= own


def fly_span(  # type: ignore[no-untyped-def]
    rest, steps, rows, before, start, state, follow, draws, pushed, wander, axes, half, usual,
    keep, out,
):  # fmt: skip
    """Fly freely through the frames of a span from the states of its first frame."""
    for k in range(state.shape[0]):
        # Noise that is no number of the law: pushes of the velocity.
        for a in range(axes):
            for i in range(state.shape[1]):
                before[a, i], before[axes + a, i] = rows[a, i], rows[axes + a, i]
                rows[axes + a, i] += pushed * draws[k, a, i]
        if k > 0:
            advance((k - 1) * steps, k * steps, 0, *rest)
        for i in range(state.shape[1]):
            if k > 0 and wander >= 0.0:
                stretch_step(rows, before, i, axes, half, usual, keep, wander * draws[k, axes, i])
            # Who enters or is absent follows the record, so that flights have the gaps of the tracks.
            if k == 0 or state[k, i] in (ABSENT, ENTERS):
                for a in range(2 * axes):
                    rows[a, i] = follow[k, a, i]
                    before[a, i] = rows[a, i]
        if k == 0:
            begin_span(rest, rows, before, start)
        for a in range(2 * axes):
            for i in range(state.shape[1]):
                out[k, a, i] = rows[a, i]


@cache
def span_loops(plan: Plan | None) -> Any:
    """Return the compiled loops over the frames of a span around the driver of a law, or around straight motion.

    A call from Python for each frame took as long as the law itself.
    """
    inner: list[Callable[..., Any]] = [apply_own_speed, correct_state, begin_span, stretch_step]
    names = {"ABSENT": ABSENT, "UNSEEN": UNSEEN, "SCORED": SCORED, "ENTERS": ENTERS, "AWAY": AWAY}
    return load_loops(plan, [*([] if plan else [advance]), *inner], [filter_span, fly_span], names)


# A smoother of both sides contains the future, one of the past lags and flattens slopes. The step
# is the compiled driver itself, so no law is implemented twice.
class InnovationFilter:
    """Flights of one candidate law, or of straight motion, that are corrected by one record.

    candidate : None for individuals that go straight on at their own speed
    """

    def __init__(self, law: LawCandidate | None, tracks: SpanTracks):
        self.law, self.tracks, self.axes = law, tracks, tracks.axes
        self.seen = np.where(np.isfinite(tracks.seen), tracks.seen, 0.0)
        n = tracks.individual_count
        self.out = np.zeros((len(self.seen), tracks.axes, n))
        self.previous_states, self.start = np.zeros((2 * tracks.axes, n)), np.zeros((2 * tracks.axes, n))
        self.unseen, self.scratch = np.zeros(n, np.int64), np.zeros(3)
        self.loops = span_loops(None if law is None else law.plan)
        self.half_sides = np.array([*tracks.box[: tracks.axes], *[0.0] * (3 - tracks.axes)])
        self.rows, self.steps = np.zeros((2 * tracks.axes, n)), 1
        if law is not None:
            self.flight = law.state(tracks)
            self.fresh, self.start = self.flight.buffer.copy(), self.flight.start
            self.steps = max(1, round(tracks.period / law.scenario.flight.dt))
            rows = self.flight.driver.ROWS
            places = [rows[name] for name in (*law.plan.axes, *(f"v{axis}" for axis in law.plan.axes))]
            if places != list(range(places[0], places[0] + len(places))):
                raise ValueError(f"rows of {law.name} do not lie side by side")
            self.rows = self.flight.arrays["work"][places[0] : places[0] + len(places)]

    def errors(
        self,
        numbers: dict[int, float],
        gains: FilterGains,
        mean_speed: float,
        spans: list[int] | range | None = None,
        kept_states: Array | None = None,
        pushes: Array | None = None,
    ) -> Array:
        """Return differences (frame, along and across, individual), m, between prediction and record; 0 if not counted.

        numbers : values by column; usual : speed to which individuals return, m/s (of laws of
                  headings)
        spans   : which; all by default
        kept    : (frame, component, individual), filled with positions (m) and velocities (m/s) as
                  put right
        pushes  : (frame, axis, individual), filled with the change of velocity by the next frame
                  that is predicted, m/s
        """
        tracks, table, none = self.tracks, gains.table(self.tracks.period), np.zeros((0, 0, 0))
        pace = mean_speed if self.law is None or self.law.commands_heading else 0.0
        # Spans are independent: each begins with a clean memory of the driver, so any subset gives
        # the same differences.
        for number in range(len(tracks.spans)) if spans is None else spans:
            part = slice(*tracks.spans[number])
            self.out[part] = 0.0
            self.unseen[:] = 0
            self.loops.filter_span(
                *self.begin(numbers, mean_speed), self.unseen, self.scratch, self.seen[part], tracks.state[part],
                tracks.speed[part], table,
                self.out[part], none if kept_states is None else kept_states[part],
                none if pushes is None else pushes[part], self.axes, self.half_sides, pace, mean_speed, gains.keep,
            )  # fmt: skip
        return self.out

    def begin(self, numbers: dict[int, float], mean_speed: float, world: int = 0) -> tuple[Any, ...]:
        """Forget the span before; return the driver's memory. world : number of the random world of the law."""
        memory = self.rows, self.previous_states, self.start
        if self.law is None:
            return (self.rows, self.axes, mean_speed, self.tracks.period), 1, *memory
        self.flight.buffer[:] = self.fresh
        self.flight.set_integer("world", world)
        row = self.flight.arrays["row"]
        for column, value in numbers.items():
            row[column] = value
        return self.flight.arguments(0, 0)[3:], self.steps, *memory


# The likelihood: surprise at the next frames under a law with its numbers and the gains of the
# filter. Differences along and across the heading are normal; their two variances are the likeliest
# ones. Large differences count less: four of 20,908 steps near an edge of the law were 69 of the
# 100 units by which the truth lost against the fit.
SOFT = 1.345  # of a standard deviation: where nothing is wild, estimates are 0.95 as efficient (Huber 1964)
LOST, TINY = 1e6, 1e-15  # m; somebody who flew off, and less than any difference
LOOKS = 100  # at most, for a standard deviation; about six do
_DENSITY, _WITHIN = math.exp(-0.5 * SOFT**2) / math.sqrt(2.0 * math.pi), math.erf(SOFT / math.sqrt(2.0))
# Factor by which normal differences keep their variance: 1 over the root of the mean of twice
# Huber's function.
SAME = (_WITHIN + 2.0 * SOFT * _DENSITY - SOFT**2 * (1.0 - _WITHIN)) ** -0.5
AS_NORMAL = _WITHIN  # mean of min(z², SOFT |z|) of normal numbers
FIRST_GAINS = (0.6, 0.3, 0.6, 0.3, 0.9)
SMALL = (7_000, 150, 360)  # individual steps on which is searched; least and largest number of frames
KP = FitParameter("gain", -1, "1", 0.01, 0.999, False, 0.6)
KV = FitParameter("gain", -1, "1", 3e-4, 1.3, True, 0.3)
KEEP = FitParameter("keep", -1, "1", 0.0, 1.0, False, 0.9)


def huber_differences(e: Array) -> Array:
    """Return differences whose squares grow only linearly where they are large (Huber 1964).

    A law has edges: somebody just within a radius flies on otherwise than somebody just outside.
    Who is near an edge, and is seen with noise, is now and then predicted on its wrong side, also
    by the numbers that flew. The square of one such step would outweigh all that thousands of
    others say of a number. Normal differences keep their variance.

    e : (step, component); differences up to `SOFT` of their `robust_deviation` stay as they are but
        for a factor, the same for all of a component
    """
    if not len(e):
        return e
    e = np.clip(np.nan_to_num(e, nan=LOST), -LOST, LOST)
    size = np.array([robust_deviation(component) for component in e.T])
    far = np.abs(e) / size
    rest = np.sqrt(np.maximum(2.0 * SOFT * far - SOFT * SOFT, 0.0))
    found: Array = np.copysign(SAME * size * np.where(far < SOFT, far, rest), e)
    return found


def robust_deviation(e: Array) -> float:
    """Return the standard deviation of differences, with less weight of large ones (Huber 1964, proposal 2).

    It is that at which the mean of min(z², SOFT |z|) is what it is of normal numbers z. A median
    would do as well, but hangs on one difference alone, and with it each slope.
    """
    sizes = np.sort(np.abs(e)) + TINY
    square, linear = np.cumsum(sizes * sizes), np.cumsum(sizes)
    last, found = -1, float(np.sqrt(square[-1] / len(sizes)))
    # Fixed point: the set of small differences fixes the deviation by a quadratic equation, which
    # fixes the set.
    for _ in range(LOOKS):
        near = int(np.searchsorted(sizes, SOFT * found))
        if near == last:
            break
        last = near
        within = float(square[near - 1]) if near else 0.0
        beyond = SOFT * float(linear[-1] - (linear[near - 1] if near else 0.0))
        found = (beyond + math.sqrt(beyond * beyond + 4.0 * AS_NORMAL * len(sizes) * within)) / (
            2.0 * AS_NORMAL * len(sizes)
        )
    return found


@dataclass
class SpanScore:
    """Sums over counted steps: number, and squares along and across, m²; one row per span."""

    count: Array
    along: Array
    across: Array
    axes: int

    def loss(self) -> float:
        """Return the negative log-likelihood at the likeliest variances."""
        n = float(self.count.sum())
        a, b = float(self.along.sum()) / n, float(self.across.sum()) / (n * (self.axes - 1))
        # A law that loses somebody gives nan or infinity; a large finite loss lets searches go on.
        if not (math.isfinite(a) and math.isfinite(b) and a > 0.0 and b > 0.0):
            return 1e15
        return 0.5 * n * (math.log(a) + (self.axes - 1) * math.log(b) + self.axes * (1.0 + math.log(2.0 * math.pi)))

    def variances(self) -> tuple[float, float]:
        """Return variances along and across, m²."""
        n = float(self.count.sum())
        return float(self.along.sum()) / n, float(self.across.sum()) / (n * (self.axes - 1))


class FitModel:
    """A law (or none) with the numbers that are fitted, on the tracks.

    numbers : of the law and its body, then four gains and, for a law of headings, what share of its
              speed one keeps
    Places are points of a unit cube, one coordinate per number.
    """

    def __init__(self, law: LawCandidate | None, tracks: Sequence[SpanTracks], scale: TrackScale):
        self.law, self.tracks, self.scale = law, tuple(tracks), scale
        self.filters = [InnovationFilter(law, each) for each in tracks]
        self.axes = tracks[0].axes
        self.own_speed = law is None or law.commands_heading
        named = (
            list(law.numbers)
            if law
            else [FitParameter("speed", -1, "m/s", 0.02 * scale.speed, 2.0 * scale.max_speed, True, 0.0)]
        )
        self.numbers: list[FitParameter] = [*named, KP, KV, KP, KV, KEEP]
        self.named = len(named)
        speeds = [i for i, n in enumerate(named) if n.key in ("speed", "body.speed")]
        self.speed_index = speeds[0] if self.own_speed else None
        self.spans = [(t, s) for t, each in enumerate(self.tracks) for s in range(len(each.spans))]
        self.soft = False
        self.pool: Sequence[int] = range(len(self.spans))

    def on(self, pool: Sequence[int]) -> "FitModel":
        """Return the model that sees these spans alone when it is fitted."""
        twin = copy(self)
        twin.pool = pool
        return twin

    def with_parameters(self, numbers: Sequence[FitParameter]) -> "FitModel":
        """Return the law on these tracks with only these numbers fitted."""
        assert self.law is not None
        found = FitModel(replace(self.law, numbers=tuple(numbers)), self.tracks, self.scale).on(self.pool)
        return found.robust() if self.soft else found

    def first(self) -> Array:
        """Return the point to begin with: defaults, usual gains, and observed speeds."""
        values = [n.default for n in self.numbers[: self.named]] + list(FIRST_GAINS)
        if self.speed_index is not None:
            values[self.speed_index] = self.scale.speed
        return np.array([n.place(v) for n, v in zip(self.numbers, values, strict=True)])

    def split(self, u: Array) -> tuple[dict[int, float], FilterGains, float]:
        """Return values by column, gains, and the usual speed (m/s) at a point."""
        values = [n.value(float(min(max(x, 0.0), 1.0))) for n, x in zip(self.numbers, u, strict=True)]
        kpa, kva, kpb, kvb, keep = values[self.named :]
        named = zip(self.numbers[: self.named], values, strict=False)
        by_column = {n.column: v for n, v in named if n.column >= 0}
        usual = values[self.speed_index] if self.speed_index is not None else 0.0
        return by_column, FilterGains((kpa, kva), (kpb, kvb), keep), usual

    def differences(self, u: Array, spans: Sequence[int] | None = None) -> tuple[Array, NDArray[np.int64]]:
        """Return the fitted innovations, of which large ones may count less (`robust`), and the span of each."""
        e, owner = self.innovations(u, spans)
        return (huber_differences(e) if self.soft else e), owner

    def robust(self) -> "FitModel":
        """Return the model in which a few large differences count less."""
        twin = copy(self)
        twin.soft = True
        return twin

    def innovations(self, u: Array, spans: Sequence[int] | None = None) -> tuple[Array, NDArray[np.int64]]:
        """Return differences of counted steps (step, along and across), m, to their predictions; the span of each."""
        by_column, gains, usual = self.split(u)
        parts, owners = [], []
        first = dict(zip(self.spans, range(len(self.spans)), strict=True))
        for walk, own in self.parts(spans):
            t = self.filters.index(walk)
            found = walk.errors(by_column, gains, usual, own)
            for s in own:
                begin, end = walk.tracks.spans[s]
                counted = walk.tracks.state[begin:end] == COUNTED
                part = found[begin:end].transpose(0, 2, 1)[counted]
                parts.append(part)
                owners.append(np.full(len(part), first[t, s]))
        return np.concatenate(parts), np.concatenate(owners)

    def parts(self, spans: Sequence[int] | None = None) -> list[tuple[InnovationFilter, list[int]]]:
        """Yield the filters, and which of their spans are selected."""
        chosen = [self.spans[k] for k in (range(len(self.spans)) if spans is None else spans)]
        found = [(walk, [s for t, s in chosen if t == number]) for number, walk in enumerate(self.filters)]
        return [(walk, own) for walk, own in found if own]

    def score(self, u: Array, spans: Sequence[int] | None = None) -> SpanScore:
        """Return sums of squares by span."""
        return self.score_differences(*self.differences(u, spans))

    def score_differences(self, e: Array, owner: NDArray[np.int64]) -> SpanScore:
        """Return sums of squares of differences by span."""
        m = len(self.spans)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.nan_to_num(e * e, nan=1e12, posinf=1e12)
        along = np.bincount(owner, squares[:, 0], m).astype(float)
        across = np.bincount(owner, squares[:, 1:].sum(axis=1), m).astype(float)
        return SpanScore(np.bincount(owner, minlength=m).astype(float), along, across, self.axes)

    def few(self, frames: int = 0) -> list[int]:
        """Return spans of the pool, evenly over all tracks, with about so many frames; 0 : enough for a search."""
        pool = list(self.pool)
        individuals = max(tracks.individual_count for tracks in self.tracks)
        frames = frames or int(np.clip(SMALL[0] / individuals, *SMALL[1:]))
        lengths = [self.tracks[t].spans[s][1] - self.tracks[t].spans[s][0] for t, s in (self.spans[k] for k in pool)]
        count = int(np.clip(round(frames / np.mean(lengths)), min(2, len(pool)), len(pool)))
        if count > 0.7 * len(pool):
            return pool
        return sorted({pool[int(k)] for k in np.linspace(0, len(pool) - 1, count + 2)[1:-1].round()})
