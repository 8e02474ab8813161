"""Faults of a fleet: what goes wrong, for whom, and when; read from TOML, checked at once."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

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
}
AMOUNT_RANGES = {
    "loss": (0.0, 1.0), "duplicate": (0.0, 1.0), "corrupt": (0.0, 1.0), "jitter": (0.0, 30.0), "battery": (0.0, 100.0),
    "clock": (-3600.0, 3600.0), "rogue": (-1e4, 1e4), "impostor": (-1e4, 1e4),
}  # fmt: skip


@dataclass(frozen=True)
class InjectedFault:
    """One fault.

    kind   : one of KINDS; who: system ids, empty: all; begin, end: when it holds, s; amount: as its kind says
    """

    kind: str
    who: tuple[int, ...] = ()
    begin: float = 0.0
    end: float = 1e9
    amount: float = 0.0

    def holds(self, system: int, now: float) -> bool:
        """Whether it holds for a drone at a time, s."""
        return self.affects(system) and self.begin - 1e-9 <= now < self.end - 1e-9

    def affects(self, system: int) -> bool:
        """Whether it holds for a drone at some time."""
        return not self.who or system in self.who


def initial_clock_offset(faults: Sequence[InjectedFault], system: int) -> int:
    """By how much the clock of a node is ahead from the start of the flight on, µs."""
    return sum(round(fault.amount * 1e6) for fault in faults if fault.kind == "clock" and fault.affects(system))


def read_injected_faults(path: Path, members: tuple[int, ...]) -> tuple[InjectedFault, ...]:
    """Faults from a TOML file of tables [[fault]]; ScenarioError with one line per mistake."""
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
    if kind == "clock" and not numbers.keys() <= {"amount"}:
        wrong.append(f"a clock is wrong {WHOLE_FLIGHT_TEXT}: leave out begin and end")
    if not wrong and numbers.get("begin", 0.0) >= numbers.get("end", 1e9):
        wrong.append("begin is not before end")
    return ([] if wrong else [InjectedFault(str(kind), tuple(who), **numbers)]), wrong
