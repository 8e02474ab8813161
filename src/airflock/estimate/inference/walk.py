"""The walk: a flight kept on the record. It flies to the next frame, is compared there, and is put right by a share.

This is the innovation form of a Kalman filter in steady state. A step of the compiled flight predicts each individual's
position and velocity; the difference to where it was seen goes into both by gains, one pair along the heading and one
across. Gains are numbers of the fit, so that the noise of the tracks and that of the motion need not be known: where an
individual is said to be is never one noisy frame, and never contains the future.
"""

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.estimate.inference.candidates import LawCandidate
from airflock.estimate.inference.tracks import ABSENT, COUNTED, ENTERS, UNSEEN, SpanTracks

Array = NDArray[np.float64]
AWAY = 1e9  # m; beyond every range
GAPS = 12  # frames unseen, beyond which gains grow no more


@dataclass(frozen=True)
class FilterGains:
    """Shares of a difference that go into position (1) and, per period, into velocity (1); along and across.

    keep : share of its own difference from the usual speed that an individual keeps for a period
    """

    along: tuple[float, float]
    across: tuple[float, float]
    keep: float = 1.0

    def table(self, period: float) -> Array:
        """(along or across, position or velocity, frames unseen): gains, which grow while an individual is unseen."""
        return np.array([_growing(*self.along, period), _growing(*self.across, period)])


def _growing(into_position: float, into_velocity: float, period: float) -> Array:
    """Gains after 0, 1, 2, ... frames unseen: the variances that the steady gains stand for, carried on."""
    kp, kv = into_position, into_velocity / period
    vv = max(kp * kp - 2.0 * period * (1.0 - kp) * kv, 0.0) / period**2 + kv * kv
    pp, pv, noise = kp, kv, 1.0 - kp
    found = np.zeros((2, GAPS))
    for unseen in range(GAPS):
        found[:, unseen] = pp / (pp + noise), pv / (pp + noise)
        pp, pv, vv = pp + 2.0 * period * pv + period**2 * vv, pv + period * vv, vv + kv * kv
    return found


def apply_own_speed(rows, before, i, axes, half, pace, mean_speed, keep):  # type: ignore[no-untyped-def]
    """Let individual i of a law of headings have covered its way at its own speed, which returns to the usual one."""
    was = 0.0
    for a in range(axes):
        was += before[axes + a, i] ** 2
    k = (mean_speed + keep * (math.sqrt(was) - mean_speed)) / pace
    for a in range(axes):
        step = rows[a, i] - before[a, i]
        if half[a] > 0.0:
            step -= 2.0 * half[a] * round(step / (2.0 * half[a]))
        rows[a, i] = before[a, i] + k * step
        rows[axes + a, i] *= k


def correct_state(rows, i, axes, half, seen, gains, h, e, out, counted):  # type: ignore[no-untyped-def]
    """Compare individual i with where it was seen, and move its state there by a share; h, e: memory of 3 numbers."""
    size, along = 1e-30, 0.0
    for a in range(axes):
        size += rows[axes + a, i] ** 2
    size = math.sqrt(size)
    for a in range(axes):
        h[a] = rows[axes + a, i] / size
        e[a] = seen[a, i] - rows[a, i]
        if half[a] > 0.0:
            e[a] -= 2.0 * half[a] * round(e[a] / (2.0 * half[a]))
        along += e[a] * h[a]
    if counted:
        out[0, i], out[1, i] = along, h[0] * e[1] - h[1] * e[0]
        if axes == 3:  # to the left, and upwards of heading and left
            flat = math.sqrt(h[0] * h[0] + h[1] * h[1]) + 1e-30
            out[1, i] /= flat
            out[2, i] = flat * e[2] - h[2] * (h[0] * e[0] + h[1] * e[1]) / flat
    for a in range(axes):
        across = e[a] - along * h[a]
        rows[a, i] += gains[0, 0] * along * h[a] + gains[1, 0] * across
        rows[axes + a, i] += gains[0, 1] * along * h[a] + gains[1, 1] * across


@cache
def _kernel() -> Any:
    """One frame of the walk, compiled: compare with what was seen and put the flight right."""
    from numba import njit

    speed_, right_ = njit(apply_own_speed), njit(correct_state)

    @njit
    def kernel(rows, before, unseen, seen, state, speed, gains, out, axes, half, pace, usual, keep):  # type: ignore[no-untyped-def]
        h, e = np.zeros(3), np.zeros(3)
        for i in range(state.shape[0]):
            what = state[i]
            if what in (ABSENT, ENTERS):
                for a in range(axes):
                    rows[a, i] = seen[a, i] if what == ENTERS else AWAY * (2.0 + i)
                    rows[axes + a, i] = speed[a, i] if what == ENTERS else 1.0
                unseen[i] = 0
            else:
                if pace > 0.0:
                    speed_(rows, before, i, axes, half, pace, usual, keep)
                if what == UNSEEN:
                    unseen[i] += 1
                else:
                    own = gains[:, :, min(unseen[i], gains.shape[2] - 1)]
                    right_(rows, i, axes, half, seen, own, h, e, out, what == COUNTED)
                    unseen[i] = 0
            for a in range(2 * axes):
                before[a, i] = rows[a, i]

    return kernel


class InnovationFilter:
    """Flights of one candidate, or of nobody's law at all, kept on one record.

    candidate : None for individuals that go straight on at their own speed
    """

    def __init__(self, law: LawCandidate | None, tracks: SpanTracks):
        self.law, self.tracks, self.axes = law, tracks, tracks.axes
        self.seen = np.where(np.isfinite(tracks.seen), tracks.seen, 0.0)
        n = tracks.individual_count
        self.out = np.zeros((len(self.seen), tracks.axes, n))
        self.previous_states, self.frames_unseen = np.zeros((2 * tracks.axes, n)), np.zeros(n, np.int64)
        self.half_sides = np.array([*tracks.box[: tracks.axes], *[0.0] * (3 - tracks.axes)])
        self.rows = np.zeros((2 * tracks.axes, n))
        self.step = 0
        if law is not None:
            self.flight = law.state(tracks)
            self.row = self.flight.arrays["row"].copy()
            self.fresh = self.flight.buffer.copy()
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
        """Differences (frame, along and across, individual), m, between prediction and record; 0 where none counts.

        numbers : values by column; usual : speed to which individuals return, m/s (of laws of headings)
        spans   : which; all by default
        kept    : (frame, component, individual), filled with positions (m) and velocities (m/s) as put right
        pushes  : (frame, axis, individual), filled with the change of velocity by the next frame that is predicted, m/s
        """
        kernel, tracks, table = _kernel(), self.tracks, gains.table(self.tracks.period)
        law = self.law
        pace = mean_speed if law is None or law.commands_heading else 0.0
        self.out[:] = 0.0
        for number in range(len(tracks.spans)) if spans is None else spans:
            begin, end = tracks.spans[number]
            self.begin(numbers)
            for k in range(begin, end):
                if k > begin:
                    self.fly(mean_speed)
                    if pushes is not None:
                        self._pushes(pushes[k - 1], pace)
                kernel(
                    self.rows,
                    self.previous_states,
                    self.frames_unseen,
                    self.seen[k],
                    tracks.state[k],
                    tracks.speed[k],
                    table,
                    self.out[k],
                    self.axes,
                    self.half_sides,
                    pace,
                    mean_speed,
                    gains.keep,
                )
                if k == begin:
                    self.fill_past_states(self.previous_states)
                if kept_states is not None:
                    kept_states[k] = self.previous_states
        return self.out

    def _pushes(self, found: Array, pace: float) -> None:
        """Changes of velocity in the period that has just been flown."""
        was, new = self.previous_states[self.axes :], self.now()[self.axes :]
        scale = np.sqrt((was**2).sum(axis=0)) / pace if pace > 0.0 else 1.0
        found[:] = new * scale - was

    def begin(self, numbers: dict[int, float], world: int = 0) -> None:
        """Forget the span before. world : which random numbers are drawn, where there is noise."""
        self.step = 0
        if self.law is None:
            return
        self.flight.buffer[:] = self.fresh
        self.flight.set_integer("world", world)
        row = self.flight.arrays["row"]
        for column, value in numbers.items():
            row[column] = value

    def fill_past_states(self, motion: Array) -> None:
        """Let the driver begin with those who are there: past states that are heard late are filled with them.

        motion : positions (m) and velocities (m/s), (component, individual)
        """
        if self.law is not None:
            self.flight.start[:] = motion
            self.flight.advance(0, 0)
        self.now()[:] = motion

    def now(self) -> Array:
        """Positions and velocities in the flight, (component, individual); a view."""
        return self.rows[:, : self.tracks.individual_count]

    def fly(self, mean_speed: float) -> None:
        """Fly for one period of the tracks."""
        if self.law is None:
            self._straight(mean_speed)
            return
        self.flight.advance(self.step, self.step + self.steps)
        self.step += self.steps

    def _straight(self, usual: float) -> None:
        """Everybody goes straight on for a period."""
        axes = self.axes
        speed = np.sqrt((self.rows[axes:] ** 2).sum(axis=0)) + 1e-30
        self.rows[axes:] *= usual / speed
        self.rows[:axes] += self.rows[axes:] * self.tracks.period
