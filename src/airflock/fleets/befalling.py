"""Befalling: faults of the scenario as they befall the drones of a fleet, at the times of a simulation.

A vehicle asks them what its navigation tells, what reaches its motors and how it moves; the ether, how far a drone is
heard; and a node suffers them in `fleets.ailing`. Each asks by the time of the flight, so that on the real clock all of
them let the same fault begin at the same time, each for itself.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from airflock.core import Fault, State, call_rule
from airflock.scenarios import Scenario, draw_onsets

Velocity = tuple[float, float, float]


class ActiveFault(NamedTuple):
    """A fault of one drone: since when and for how long (s), its numbers, and what was so when it began."""

    begin: float
    lasts: float
    numbers: Any
    start_values: dict[str, float]


class DroneFaults:
    """Faults of the scenario as they befall the drones of a fleet: the same ones at the same times as in a simulation.

    only : of this drone, by its place; None: of all
    gone : places of drones that have dropped out: the node is dead, the motors are off
    """

    def __init__(self, scenario: Scenario, seed: int, only: int | None = None):
        self._kinds = {kind.name: kind for kind in scenario.fault_kinds}
        due = draw_onsets(scenario, seed) if self._kinds else ()
        self._onsets = [onset for onset in due if only is None or onset.agent == only]
        self.dropped_out: set[int] = set()
        self._dt = scenario.flight.dt
        self._active: dict[tuple[int, str], ActiveFault] = {}
        self._last_states: dict[tuple[int, str, str], State] = {}  # what a rule was last given before its fault
        self._default_range = min(scenario.radio.range, 1e8)

    def __bool__(self) -> bool:
        return bool(self._kinds)

    def until(self, now: float) -> None:
        """Let begin what is due by a time of the flight, s, for rules that ask for nothing of that moment."""
        self.begin_due(math.floor(now / self._dt + 1e-6))

    def begin_due(self, step: int, state_and_command: Callable[[int], tuple[State, Velocity]] | None = None) -> None:
        """Let begin what is due before a motion step.

        known : true state (m, m/s) of a drone and the command that reached its motors last (m/s); None: nobody asks
        """
        while self._onsets and self._onsets[0].step <= step:
            onset = self._onsets.pop(0)
            if onset.leaves:
                self.dropped_out.add(onset.agent)
            if onset.agent in self.dropped_out:
                continue
            began: dict[str, float] = {}
            if state_and_command is not None:
                state, command = state_and_command(onset.agent)
                began = {f"at_{name}": value for name, value in state._asdict().items()}
                began |= dict(zip(("at_cx", "at_cy", "at_cz"), command, strict=True))
            numbers = self._kinds[onset.kind].record(*onset.numbers)
            self._active[onset.agent, onset.kind] = ActiveFault(onset.step * self._dt, onset.lasts, numbers, began)

    def _active_with(self, drone: int, rule: str, now: float) -> list[tuple[Fault, ActiveFault]]:
        found = [(kind, self._active.get((drone, kind.name))) for kind in self._kinds.values() if rule in kind.rules]
        return [(kind, case) for kind, case in found if case and self._is_active(case, now)]

    def _is_active(self, case: ActiveFault, now: float) -> bool:
        half = 0.5 * self._dt
        return case.begin - half <= now < case.begin + case.lasts - half

    def _call_rule(self, kind: Fault, rule: str, case: ActiveFault, now: float, **arguments: float) -> Any:
        known = {**case.start_values, "since": max(now - case.begin, 0.0), "f": case.numbers, **arguments}
        return call_rule(kind.rules[rule], rule, known, kind.name)

    def measured_state(self, drone: int, now: float, state: State) -> State:
        """Own state as the navigation of a drone tells it."""
        return self._state_after_rule("sense", drone, now, state)

    @property
    def can_falsify(self) -> bool:
        """Whether a drone may send another state than the one that it flies by."""
        return any("tell" in kind.rules for kind in self._kinds.values())

    def told(self, drone: int, now: float, state: State) -> State:
        """The state that a drone sends."""
        return self._state_after_rule("tell", drone, now, state)

    def _state_after_rule(self, rule: str, drone: int, now: float, state: State) -> State:
        """A state as a rule leaves it, which may repeat the one that it was last given before its fault."""
        lasting = dict(self._active_with(drone, rule, now))
        for kind in self._kinds.values():
            if kind in lasting:
                last = self._last_states.setdefault((drone, kind.name, rule), state)
                given = {f"at_{name}": value for name, value in last._asdict().items()} | state._asdict()
                state = State(*self._call_rule(kind, rule, lasting[kind], now, **given))
            elif rule in kind.rules:
                self._last_states[drone, kind.name, rule] = state
        return state

    def ahead(self, drone: int, now: float) -> float:
        """How far the clock of a drone is ahead, s."""
        return float(
            sum(self._call_rule(kind, "clock", case, now) for kind, case in self._active_with(drone, "clock", now))
        )

    def active_kinds(self, now: float) -> dict[str, set[int]]:
        """Kinds of fault that hold, and whom they have befallen, by their places."""
        found: dict[str, set[int]] = {}
        for drone, kind in self._active:
            if self._is_active(self._active[drone, kind], now):
                found.setdefault(kind, set()).add(drone)
        return found

    def motor_command(self, drone: int, now: float, command: Sequence[float]) -> Velocity:
        """The velocity (m/s) that reaches the motors."""
        x, y, z = command
        for kind, case in self._active_with(drone, "overrule", now):
            x, y, z = self._call_rule(kind, "overrule", case, now, cx=x, cy=y, cz=z)
        return x, y, z

    def velocity_after_step(
        self, drone: int, now: float, state: State, command: Sequence[float], velocity: Any, dt: float
    ) -> Any:
        """Velocity after a motion step, m/s."""
        for kind, case in self._active_with(drone, "motion", now):
            given = dict(zip(("vx", "vy", "vz"), state[3:], strict=True))
            given |= dict(zip(("cx", "cy", "cz", "nx", "ny", "nz"), (*command, *velocity), strict=True))
            velocity = self._call_rule(kind, "motion", case, now, dt=dt, **given)
        return velocity

    def reach(self, sender: int, receiver: int, now: float) -> float:
        """How far (m) a drone is heard by another one; negative for not at all."""
        far = self._default_range
        for drone, side in ((sender, 0), (receiver, 1)):
            for kind, case in self._active_with(drone, "radio", now):
                far = min(far, self._call_rule(kind, "radio", case, now, reach=self._default_range)[side])
        return far
