"""Faults of drones: those that a file injects, and those of the scenario at the times of a simulation.

A vehicle applies them to its navigation, its motors and its motion; the radio channel, to the range
between two drones; `FaultyNode`, to clock and packets of a node. Each looks them up by the time of
the flight, so that on the real clock all processes let a fault begin at the same time.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

from airflock.core import Fault, State, call_rule
from airflock.scenarios import Scenario, draw_onsets
from airflock.support import ScenarioError, as_error, read_toml, suggest

WHOLE_FLIGHT_TEXT = "from the start of the flight on"
INJECTED_KINDS = {
    "outage": "nobody hears these drones, and they hear nobody",
    "partition": "these drones and all others do not hear each other",
    "loss": "packets to these drones are lost with probability `amount`",
    "jitter": "packets to these drones are late by up to `amount` s more",
    "duplicate": "packets to these drones arrive twice with probability `amount`",
    "corrupt": "packets to these drones arrive with a wrong bit with probability `amount`",
    "rogue": "somebody without the key sends packets as these drones, `amount` m east of them",
    "impostor": "somebody with the key sends packets as these drones, `amount` m east of them",
    "node": "the node is dead: it hears and says nothing",
    "motor": "the motors are off: the vehicle falls",
    "gnss": "the position that the autopilot tells is frozen",
    "battery": "the battery is at `amount` %",
    "pilot": "the pilot takes over at the beginning",
    "clock": f"the node's clock is ahead by `amount` s {WHOLE_FLIGHT_TEXT}",
    "reboot": "the autopilot reboots at the beginning and forgets all streams; in the air its motors stop",
    "streams": "a ground station sets all streams of the autopilot to a rate (1/s), and again every 15 s",
    "uplink": "nothing that the node sends reaches its autopilot",
    "throttle": "the throttle stick is not neutral, and ArduPilot refuses to arm",
    "no_gnss": "the GNSS receiver has no fix: the position drifts, and ArduPilot lands after 8 s",
    "voltage": "the battery has a voltage (V) of its own, whatever charge is counted",
    "capacity": f"the battery holds a charge (mAh) {WHOLE_FLIGHT_TEXT}; others never get empty",
    "autopilot_clock": f"the autopilot's clock is ahead (s) {WHOLE_FLIGHT_TEXT}",
    "clock_drift": f"the autopilot's clock gains (µs each second) {WHOLE_FLIGHT_TEXT}",
}
WHOLE_FLIGHT_KINDS = frozenset({"clock", "capacity", "autopilot_clock", "clock_drift"})
AMOUNT_RANGES = {
    "loss": (0.0, 1.0), "duplicate": (0.0, 1.0), "corrupt": (0.0, 1.0), "jitter": (0.0, 30.0), "battery": (0.0, 100.0),
    "clock": (-3600.0, 3600.0), "rogue": (-1e4, 1e4), "impostor": (-1e4, 1e4), "streams": (0.0, 50.0),
    "voltage": (0.0, 100.0), "capacity": (1.0, 1e6), "autopilot_clock": (-3600.0, 3600.0), "clock_drift": (-1e3, 1e3),
}  # fmt: skip


@dataclass(frozen=True)
class InjectedFault:
    """One fault.

    kind       : one of INJECTED_KINDS
    who        : system ids; empty: all
    begin, end : s
    amount     : number whose meaning depends on the kind
    """

    kind: str
    who: tuple[int, ...] = ()
    begin: float = 0.0
    end: float = 1e9
    amount: float = 0.0

    def holds(self, system: int, now: float) -> bool:
        """Return True if it holds for a drone at a time, s."""
        return self.affects(system) and self.begin - 1e-9 <= now < self.end - 1e-9

    def affects(self, system: int) -> bool:
        """Return True if it holds for a drone at some time."""
        return not self.who or system in self.who


def whole_flight_amount(faults: Sequence[InjectedFault], kind: str, system: int) -> float:
    """Return the sum of the amounts of one kind of fault of a drone, from the start of the flight on."""
    return sum(fault.amount for fault in faults if fault.kind == kind and fault.affects(system))


def read_injected_faults(path: Path, members: tuple[int, ...]) -> tuple[InjectedFault, ...]:
    """Read faults from a TOML file of tables [[fault]]; ScenarioError has one line per error."""
    with as_error(path):
        document = read_toml(path)
    faults, mistakes = [], [f"{path}: {key} is not known; write [[fault]]" for key in document if key != "fault"]
    tables = document.get("fault", [])
    for number, table in enumerate(tables if isinstance(tables, list) else [tables]):
        made, wrong_ = _fault(table, members)
        faults += made
        mistakes += [f"{path}: fault {number + 1}: {line}" for line in wrong_]
    if mistakes:
        raise ScenarioError(mistakes)
    return tuple(faults)


def _fault(table: Any, members: tuple[int, ...]) -> tuple[list[InjectedFault], list[str]]:
    known = [item.name for item in fields(InjectedFault)]
    if not isinstance(table, dict):
        return [], ["write [[fault]] and keys below it"]
    wrong = [f"{key} is not known; known: {', '.join(known)}" for key in table if key not in known]
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in INJECTED_KINDS:
        wrong.append(
            f"kind = {kind!r} is none of {', '.join(INJECTED_KINDS)}"
            f"{suggest(kind, INJECTED_KINDS, lead='; ', cutoff=0.6)}"
        )
    who = table.get("who", [])
    if not isinstance(who, list) or not all(w in members for w in who):
        wrong.append(f"who = {who!r}: give a list of members of {members[0]}-{members[-1]}")
    numbers = {key: table[key] for key in ("begin", "end", "amount") if key in table}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            wrong.append(f"{key} = {value!r} is not a number")
    if not wrong and kind in AMOUNT_RANGES:
        low, high = AMOUNT_RANGES[kind]
        if "amount" not in numbers:
            wrong.append(f"amount is missing: {INJECTED_KINDS[kind]}; give it within [{low:g}, {high:g}]")
        elif not low <= numbers["amount"] <= high:
            wrong.append(f"amount = {numbers['amount']:g} lies outside [{low:g}, {high:g}]")
    if not wrong and kind in WHOLE_FLIGHT_KINDS and not numbers.keys() <= {"amount"}:
        wrong.append(f"{kind} holds {WHOLE_FLIGHT_TEXT}: leave out begin and end")
    if not wrong and numbers.get("begin", 0.0) >= numbers.get("end", 1e9):
        wrong.append("begin is not before end")
    return ([] if wrong else [InjectedFault(str(kind), tuple(who), **numbers)]), wrong


Velocity = tuple[float, float, float]


class ActiveFault(NamedTuple):
    """A fault of one drone: begin and duration (s), its numbers, and state and command at its begin."""

    begin: float
    lasts: float
    numbers: Any
    start_values: dict[str, float]


class DroneFaults:
    """Faults of the scenario that affect the drones of a fleet, at the times of the simulation of the same seed.

    only        : index of the one drone whose faults count; None: all
    dropped_out : indices of drones that have left the flight: the node is dead, the motors are off
    """

    def __init__(self, scenario: Scenario, seed: int, only: int | None = None):
        self._kinds = {kind.name: kind for kind in scenario.fault_kinds}
        due = draw_onsets(scenario, seed) if self._kinds else ()
        self._onsets = [onset for onset in due if only is None or onset.agent == only]
        self.dropped_out: set[int] = set()
        self._dt = scenario.flight.dt
        self._active: dict[tuple[int, str], ActiveFault] = {}
        self._last_states: dict[tuple[int, str, str], State] = {}  # what a rule was last given before its fault
        self._default_range: float = min(scenario.radio.range, 1e8)

    def __bool__(self) -> bool:
        return bool(self._kinds)

    def until(self, now: float) -> None:
        """Begin the faults that are due by a time of the flight, s; their rules see no start values."""
        self.begin_due(math.floor(now / self._dt + 1e-6))

    def begin_due(self, step: int, state_and_command: Callable[[int], tuple[State, Velocity]] | None = None) -> None:
        """Begin the faults that are due before a motion step.

        state_and_command : function from a drone to its true state (m, m/s) and its last motor
                            command (m/s); None: no rule needs them
        """
        while self._onsets and self._onsets[0].step <= step:
            onset = self._onsets.pop(0)
            if onset.leaves:
                self.dropped_out.add(onset.agent)
            # A drone that has left the flight has no further faults.
            if onset.agent in self.dropped_out:
                continue
            began: dict[str, float] = {}
            # Names as in the rules: at_x is x at the begin of the fault, at_cx the command then.
            if state_and_command is not None:
                state, command = state_and_command(onset.agent)
                began = {f"at_{name}": value for name, value in state._asdict().items()}
                began |= dict(zip(("at_cx", "at_cy", "at_cz"), command, strict=True))
            numbers = self._kinds[onset.kind].record(*onset.numbers)
            self._active[onset.agent, onset.kind] = ActiveFault(onset.step * self._dt, onset.lasts, numbers, began)

    def _active_with(self, drone: int, rule: str, now: float) -> list[tuple[Fault, ActiveFault]]:
        cases = [(kind, self._active.get((drone, kind.name))) for kind in self._kinds.values() if rule in kind.rules]
        return [(kind, case) for kind, case in cases if case and self._is_active(case, now)]

    def _is_active(self, case: ActiveFault, now: float) -> bool:
        # Half a step of tolerance: times are multiples of a step up to rounding, and a fault must
        # begin and end at the step of the simulation.
        half = 0.5 * self._dt
        return case.begin - half <= now < case.begin + case.lasts - half

    def _call_rule(self, kind: Fault, rule: str, case: ActiveFault, now: float, **arguments: float) -> Any:
        values = {**case.start_values, "since": max(now - case.begin, 0.0), "f": case.numbers, **arguments}
        return call_rule(kind.rules[rule], rule, values, kind.name)

    def measured_state(self, drone: int, now: float, state: State) -> State:
        """Return the own state as the navigation of a drone measures it."""
        return self._state_after_rule("sense", drone, now, state)

    @property
    def can_falsify(self) -> bool:
        """Return True if a drone may send another state than the one that it flies by."""
        return any("tell" in kind.rules for kind in self._kinds.values())

    def sent_state(self, drone: int, now: float, state: State) -> State:
        """Return the state that a drone sends."""
        return self._state_after_rule("tell", drone, now, state)

    def _state_after_rule(self, rule: str, drone: int, now: float, state: State) -> State:
        """Return a state after a rule, which may repeat the last state before its fault."""
        lasting = dict(self._active_with(drone, rule, now))
        for kind in self._kinds.values():
            if kind in lasting:
                # A frozen sensor repeats the last state before its fault, so the latest one is kept
                # for each rule.
                last = self._last_states.setdefault((drone, kind.name, rule), state)
                values = {f"at_{name}": value for name, value in last._asdict().items()} | state._asdict()
                state = State(*self._call_rule(kind, rule, lasting[kind], now, **values))
            elif rule in kind.rules:
                self._last_states[drone, kind.name, rule] = state
        return state

    def ahead(self, drone: int, now: float) -> float:
        """Return how far the clock of a drone is ahead, s."""
        return float(
            sum(self._call_rule(kind, "clock", case, now) for kind, case in self._active_with(drone, "clock", now))
        )

    def active_kinds(self, now: float) -> dict[str, set[int]]:
        """Return the kinds of fault that hold, each with the indices of the affected drones."""
        affected: dict[str, set[int]] = {}
        for drone, kind in self._active:
            if self._is_active(self._active[drone, kind], now):
                affected.setdefault(kind, set()).add(drone)
        return affected

    def motor_command(self, drone: int, now: float, command: Sequence[float]) -> Velocity:
        """Return the velocity (m/s) that reaches the motors."""
        x, y, z = command
        for kind, case in self._active_with(drone, "overrule", now):
            x, y, z = self._call_rule(kind, "overrule", case, now, cx=x, cy=y, cz=z)
        return x, y, z

    def velocity_after_step(
        self, drone: int, now: float, state: State, command: Sequence[float], velocity: Any, dt: float
    ) -> Any:
        """Return the velocity after a motion step, m/s."""
        for kind, case in self._active_with(drone, "motion", now):
            values = dict(zip(("vx", "vy", "vz"), state[3:], strict=True))
            values |= dict(zip(("cx", "cy", "cz", "nx", "ny", "nz"), (*command, *velocity), strict=True))
            velocity = self._call_rule(kind, "motion", case, now, dt=dt, **values)
        return velocity

    def reach(self, sender: int, receiver: int, now: float) -> float:
        """Return the distance (m) up to which a drone hears another one; negative: it does not."""
        far = self._default_range
        # A radio rule returns two ranges, as a sender and as a receiver; the shortest counts.
        for drone, side in ((sender, 0), (receiver, 1)):
            for kind, case in self._active_with(drone, "radio", now):
                far = min(far, self._call_rule(kind, "radio", case, now, reach=self._default_range)[side])
        return far
