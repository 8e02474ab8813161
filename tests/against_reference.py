"""One drawn flight by the driver text, interpreted, against the reference; and how much of a difference is chaos."""

from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from airflock.engine import plan_of
from inside import cpu, interpreted, tables
from reference.flight import fly_plainly
from scenarios_drawn import Draw

EXACT = 1e-9  # m, m/s: rounding of sums taken in another order, over a second
NUDGE = 1e-13  # m; every agent's start is moved by as much
CHAOS = 1000.0  # how much more than the nudged flight departs from itself the two may differ


class Verdict(NamedTuple):
    """How far two flights of one draw lie apart, and how far they may.

    frames, values : largest differences of states and commands (m, m/s), and of order parameters, relative above 1
    allowed        : the same that the draw allows, for frames and for values
    moved          : how far anything moved between two samples; fault : what both raised instead of flying
    """

    frames: float
    values: float
    allowed: tuple[float, float]
    moved: float = 0.0
    fault: str = ""

    @property
    def agrees(self) -> bool:
        """Whether the two are the same flight."""
        return self.frames <= self.allowed[0] and self.values <= self.allowed[1]


def compared(draw: Draw) -> Verdict:
    """Fly a draw twice, and if need be a third time with its start nudged."""
    text, told = _attempt(interpreted_flight, draw)
    known, known_told = _attempt(reference_flight, draw)
    if text is None or known is None or text.status or known.status:
        said = (told or f"status {text.status}", known_told or f"status {known.status}")  # type: ignore[union-attr]
        return Verdict(0.0 if said[0] == said[1] else np.inf, 0.0, (0.0, 0.0), fault=" / ".join(dict.fromkeys(said)))
    frames, values = _apart(text, known)
    moved = float(np.abs(np.diff(known.frames, axis=0)).max(initial=0.0))
    if frames <= EXACT and values <= EXACT:
        return Verdict(frames, values, (EXACT, EXACT), moved)
    nudged, _ = _attempt(interpreted_flight, _nudged(draw, known))
    if nudged is None:
        return Verdict(frames, values, (np.inf, np.inf), moved)
    here, _ = _attempt(interpreted_flight, draw._replace(start=_start(known, draw)))
    chaos = _apart(here, nudged)
    return Verdict(frames, values, (max(EXACT, CHAOS * chaos[0]), max(EXACT, CHAOS * chaos[1])), moved)


def interpreted_flight(draw: Draw) -> cpu.DriverResult:
    """The flight by the text of its driver, every line of it."""
    scenario = draw.scenario.with_drawn_scene(draw.seed)
    plan = plan_of(scenario, precision=64, record=True, grid=False).built(given_start=draw.start is not None)
    with_all_lines = interpreted.flight_driver(plan, exact=True)
    with patch.object(cpu, "driver_of", lambda plan, device="cpu": with_all_lines):
        return cpu.fly_on_cpu(plan, tables(scenario, plan, draw.seed), draw.start, "python")


def reference_flight(draw: Draw) -> cpu.DriverResult:
    """The same by the reference."""
    return fly_plainly(draw.scenario, draw.seed, draw.start)


def _attempt(flight: Any, draw: Draw) -> tuple[cpu.DriverResult | None, str]:
    """A flight, or what it raised: a rule may divide by zero in plain Python, where a driver says inf."""
    try:
        return flight(draw), ""
    except (ArithmeticError, ValueError) as fault:
        return None, type(fault).__name__


def _start(flown: cpu.DriverResult, draw: Draw) -> np.ndarray:
    """Where a flight began, (component, agent)."""
    return draw.start if draw.start is not None else flown.frames[0, : 2 * draw.scenario.dimensions]


def _nudged(draw: Draw, flown: cpu.DriverResult) -> Draw:
    start = _start(flown, draw).copy()
    start[: draw.scenario.dimensions] += NUDGE * np.random.default_rng(0).choice(
        (-1.0, 1.0), start[: draw.scenario.dimensions].shape
    )
    return draw._replace(start=start)


def _apart(one: cpu.DriverResult, other: cpu.DriverResult) -> tuple[float, float]:
    """Largest difference of frames and states, and of order parameters; inf where one has what the other lacks."""
    if one.frames.shape != other.frames.shape or one.values.keys() != other.values.keys():
        return np.inf, np.inf
    frames = max(_largest(one.frames, other.frames), _largest(one.state, other.state))
    values = [_relative(one.values[name], other.values[name]) for name in one.values]
    return frames, max(values, default=0.0)


def _largest(one: np.ndarray, other: np.ndarray) -> float:
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    apart = np.abs(np.where(same, 0.0, one - other))
    return float(np.where(np.isnan(apart), np.inf, apart).max(initial=0.0))


def _relative(one: Any, other: Any) -> float:
    if isinstance(one, list):
        return 0.0 if np.array_equal(one, other, equal_nan=True) else np.inf
    if one != one or other != other:
        return 0.0 if one != one and other != other else np.inf
    return abs(one - other) / max(1.0, abs(other))
