"""What single drones of a fleet differ in: numbers of their groups, and faults of the scenario that befall them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from airflock.core.agent import State
from airflock.core.fault import Fault
from airflock.core.vocabulary import answer
from airflock.errors import ScenarioError
from airflock.scenarios.onsets import onsets
from airflock.scenarios.scenario import Scenario

INSTEAD = {  # rules of faults that no fleet flies
    "clock": "a clock that jumps in flight sends a drone home; give a table of --faults with kind = 'clock'",
}


def records_of(scenario: Scenario, count: int, seed: int | None) -> list[tuple[Any, Any]]:
    """Numbers of law and body of each of the first `count` agents.

    seed : with tolerances of manufacture as this seed draws them; None: without, for real drones have their own

    Raises ScenarioError where groups are of fewer agents.
    """
    if not scenario.varied and len(scenario.laws) == 1:
        return [(scenario.parameters, scenario.body)] * count
    if count > scenario.agents:
        raise ScenarioError(
            [f"groups are of {scenario.agents} agents, and {count} drones are to fly; set agents = {count}"]
        )
    groups = tuple(replace(group, spread={}) for group in scenario.groups) if seed is None else scenario.groups
    told = replace(scenario, groups=groups)
    varied = dict.fromkeys([*told.varied, *(each for law in told.laws for each in law.varied)])
    columns = {(of, name): told.own_numbers(of, name, seed or 0) for of, name in varied}

    def own(agent: int) -> tuple[Any, Any]:
        law = told.law_of(agent)
        p = {name: columns["p", name][agent] for _, name in law.varied}
        b = {name: column[agent] for (of, name), column in columns.items() if of == "b"}
        return replace(law.parameters, **p), replace(scenario.body, **b)

    return [own(agent) for agent in range(count)]


def sensors_of(scenario: Scenario, count: int, seed: int) -> list[Any]:
    """Numbers of the sensor of each of the first `count` agents, with tolerances as a seed draws them."""
    columns = {name: scenario.own_numbers("s", name, seed) for of, name in scenario.varied if of == "s"}
    own = [{name: column[agent] for name, column in columns.items()} for agent in range(count)]
    return [replace(scenario.sensors, **numbers) for numbers in own]


def refused(scenario: Scenario) -> list[str]:
    """Faults of a scenario that no fleet flies, one line each, with what to do instead."""
    return [
        f"faults.kind = {kind.name!r}: {INSTEAD[rule]}"
        for kind in scenario.fault_kinds
        for rule in kind.rules
        if rule in INSTEAD
    ]


class Case(NamedTuple):
    """A fault of one drone: since when and for how long (s), its numbers, and what was so when it began."""

    begin: float
    lasts: float
    numbers: Any
    known: dict[str, float]


class Faults:
    """Faults of the scenario as they befall the drones of a fleet: the same ones at the same times as in a simulation.

    gone : places of drones that have dropped out: the node is dead, the motors are off

    Raises ScenarioError for kinds that a fleet cannot fly.
    """

    def __init__(self, scenario: Scenario, seed: int):
        wrong = refused(scenario)
        if wrong:
            raise ScenarioError(wrong)
        self._kinds = {kind.name: kind for kind in scenario.fault_kinds}
        self._due = list(onsets(scenario, seed)) if self._kinds else []
        self.gone: set[int] = set()
        self._dt, self._cases = scenario.flight.dt, {}  # type: ignore[var-annotated]
        self._last: dict[tuple[int, str, str], State] = {}  # what a rule was last given before its fault
        self._reach = min(scenario.radio.range, 1e8)

    def __bool__(self) -> bool:
        return bool(self._kinds)

    def strike(self, step: int, states: Sequence[State], commands: Sequence[tuple[float, float, float]]) -> None:
        """Let begin what is due before a motion step; states are true ones (m, m/s), commands in m/s."""
        while self._due and self._due[0].step <= step:
            onset = self._due.pop(0)
            if onset.leaves:
                self.gone.add(onset.agent)
            if onset.agent in self.gone:
                continue
            known = {f"at_{name}": value for name, value in states[onset.agent]._asdict().items()}
            known |= dict(zip(("at_cx", "at_cy", "at_cz"), commands[onset.agent], strict=True))
            numbers = self._kinds[onset.kind].record(*onset.numbers)
            self._cases[onset.agent, onset.kind] = Case(onset.step * self._dt, onset.lasts, numbers, known)

    def _lasting(self, drone: int, rule: str, now: float) -> list[tuple[Fault, Case]]:
        half = 0.5 * self._dt
        found = [(kind, self._cases.get((drone, kind.name))) for kind in self._kinds.values() if rule in kind.rules]
        return [(kind, c) for kind, c in found if c and c.begin - half <= now < c.begin + c.lasts - half]

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

    def overruled(self, drone: int, now: float, command: Sequence[float]) -> tuple[float, float, float]:
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
