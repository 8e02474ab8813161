"""Befalling: faults of the scenario as they befall the drones of a fleet, at the times of a simulation.

A vehicle asks them what its navigation tells, what reaches its motors and how it moves; the ether, how far a drone is
heard; and a node suffers them in `fleets.ailing`. Each asks by the time of the flight, so that on the real clock all of
them let the same fault begin at the same time, each for itself.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from airflock.core.agent import State
from airflock.core.fault import Fault
from airflock.core.vocabulary import answer
from airflock.scenarios.onsets import onsets
from airflock.scenarios.scenario import Scenario

Vector = tuple[float, float, float]


class Case(NamedTuple):
    """A fault of one drone: since when and for how long (s), its numbers, and what was so when it began."""

    begin: float
    lasts: float
    numbers: Any
    known: dict[str, float]


class Faults:
    """Faults of the scenario as they befall the drones of a fleet: the same ones at the same times as in a simulation.

    only : of this drone, by its place; None: of all
    gone : places of drones that have dropped out: the node is dead, the motors are off
    """

    def __init__(self, scenario: Scenario, seed: int, only: int | None = None):
        self._kinds = {kind.name: kind for kind in scenario.fault_kinds}
        due = onsets(scenario, seed) if self._kinds else ()
        self._due = [onset for onset in due if only is None or onset.agent == only]
        self.gone: set[int] = set()
        self._dt = scenario.flight.dt
        self._cases: dict[tuple[int, str], Case] = {}
        self._last: dict[tuple[int, str, str], State] = {}  # what a rule was last given before its fault
        self._reach = min(scenario.radio.range, 1e8)

    def __bool__(self) -> bool:
        return bool(self._kinds)

    def until(self, now: float) -> None:
        """Let begin what is due by a time of the flight, s, for rules that ask for nothing of that moment."""
        self.strike(math.floor(now / self._dt + 1e-6))

    def strike(self, step: int, known: Callable[[int], tuple[State, Vector]] | None = None) -> None:
        """Let begin what is due before a motion step.

        known : true state (m, m/s) of a drone and the command that reached its motors last (m/s); None: nobody asks
        """
        while self._due and self._due[0].step <= step:
            onset = self._due.pop(0)
            if onset.leaves:
                self.gone.add(onset.agent)
            if onset.agent in self.gone:
                continue
            began: dict[str, float] = {}
            if known is not None:
                state, command = known(onset.agent)
                began = {f"at_{name}": value for name, value in state._asdict().items()}
                began |= dict(zip(("at_cx", "at_cy", "at_cz"), command, strict=True))
            numbers = self._kinds[onset.kind].record(*onset.numbers)
            self._cases[onset.agent, onset.kind] = Case(onset.step * self._dt, onset.lasts, numbers, began)

    def _lasting(self, drone: int, rule: str, now: float) -> list[tuple[Fault, Case]]:
        found = [(kind, self._cases.get((drone, kind.name))) for kind in self._kinds.values() if rule in kind.rules]
        return [(kind, case) for kind, case in found if case and self._holds(case, now)]

    def _holds(self, case: Case, now: float) -> bool:
        half = 0.5 * self._dt
        return case.begin - half <= now < case.begin + case.lasts - half

    def _ask(self, kind: Fault, rule: str, case: Case, now: float, **given: float) -> Any:
        known = {**case.known, "since": max(now - case.begin, 0.0), "f": case.numbers, **given}
        return answer(kind.rules[rule], rule, known, kind.name)

    def sensed(self, drone: int, now: float, state: State) -> State:
        """Own state as the navigation of a drone tells it."""
        return self._misled("sense", drone, now, state)

    @property
    def lies(self) -> bool:
        """Whether a drone may send another state than the one that it flies by."""
        return any("tell" in kind.rules for kind in self._kinds.values())

    def told(self, drone: int, now: float, state: State) -> State:
        """The state that a drone sends."""
        return self._misled("tell", drone, now, state)

    def _misled(self, rule: str, drone: int, now: float, state: State) -> State:
        """A state as a rule leaves it, which may repeat the one that it was last given before its fault."""
        lasting = dict(self._lasting(drone, rule, now))
        for kind in self._kinds.values():
            if kind in lasting:
                last = self._last.setdefault((drone, kind.name, rule), state)
                given = {f"at_{name}": value for name, value in last._asdict().items()} | state._asdict()
                state = State(*self._ask(kind, rule, lasting[kind], now, **given))
            elif rule in kind.rules:
                self._last[drone, kind.name, rule] = state
        return state

    def ahead(self, drone: int, now: float) -> float:
        """How far the clock of a drone is ahead, s."""
        return float(sum(self._ask(kind, "clock", case, now) for kind, case in self._lasting(drone, "clock", now)))

    def holding(self, now: float) -> dict[str, set[int]]:
        """Kinds of fault that hold, and whom they have befallen, by their places."""
        found: dict[str, set[int]] = {}
        for drone, kind in self._cases:
            if self._holds(self._cases[drone, kind], now):
                found.setdefault(kind, set()).add(drone)
        return found

    def overruled(self, drone: int, now: float, command: Sequence[float]) -> Vector:
        """The velocity (m/s) that reaches the motors."""
        x, y, z = command
        for kind, case in self._lasting(drone, "overrule", now):
            x, y, z = self._ask(kind, "overrule", case, now, cx=x, cy=y, cz=z)
        return x, y, z

    def moved(self, drone: int, now: float, state: State, command: Sequence[float], velocity: Any, dt: float) -> Any:
        """Velocity after a motion step, m/s."""
        for kind, case in self._lasting(drone, "motion", now):
            given = dict(zip(("vx", "vy", "vz"), state[3:], strict=True))
            given |= dict(zip(("cx", "cy", "cz", "nx", "ny", "nz"), (*command, *velocity), strict=True))
            velocity = self._ask(kind, "motion", case, now, dt=dt, **given)
        return velocity

    def reach(self, who: int, to: int, now: float) -> float:
        """How far (m) a drone is heard by another one; negative for not at all."""
        far = self._reach
        for drone, side in ((who, 0), (to, 1)):
            for kind, case in self._lasting(drone, "radio", now):
                far = min(far, self._ask(kind, "radio", case, now, reach=self._reach)[side])
        return far
