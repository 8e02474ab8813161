"""The faults of a scenario file: the entries of [[faults]], each checked as a whole."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airflock.core import ENTRY_KEYS, Fault, Parameters as Record, fault, quantity
from airflock.parts.faults import KINDS
from airflock.scenarios import schema, units
from airflock.scenarios.groups import Group, read_members
from airflock.scenarios.own_code import build_from_file
from airflock.support import AirflockError, suggest

PERCEPTION = {"sense", "tell", "radio", "clock"}  # rules that disturb what agents know of each other
MOST = 255  # entries of a file: each draws by a number of its own


@dataclass(frozen=True, kw_only=True)
class FaultTiming(Record):
    """When a fault begins and ends, and how many it hits; beside the numbers of its kind."""

    at: float | None = quantity(None, "s", low=0.0, high=1e6, meaning="when it begins")
    until: float | None = quantity(None, "s", low=0.0, high=1e6, meaning="when it ends; after that no new one begins")
    lasts: float | None = quantity(None, "s", low=0.0, high=1e6, meaning="how long it lasts; by default until the end")
    per_hour: float | None = quantity(
        None, "1", low=0.0, high=1e6, meaning="how often per hour it hits the flock, at random times; give this or at"
    )
    number: float | None = quantity(
        None,
        "1",
        low=1.0,
        high=1e7,
        meaning="how many agents it hits at once, drawn at random; by default all, or one with per_hour",
    )


@dataclass(frozen=True)
class FaultEntry:
    """One entry of [[faults]].

    fault    : its kind; numbers : the kind's parameters
    agents   : whom it may hit; number : how many of them at once, drawn; None for all
    at       : when it begins, s; None where it comes at random
    per_hour : how often it hits the flock in an hour, at random
    until, lasts : when and after how long it ends, s; inf for never
    """

    fault: Fault
    numbers: Any
    agents: tuple[int, ...]
    number: int | None
    at: float | None
    per_hour: float
    until: float = math.inf
    lasts: float = math.inf

    def can_occur(self, duration: float) -> bool:
        """Whether it may occur in a flight of this duration, s."""
        begin = 0.0 if self.at is None else self.at
        due = self.per_hour > 0.0 if self.at is None else self.at < duration
        return due and self.lasts > 0.0 and self.until > begin and bool(self.agents)


def read_fault_entries(
    tables: Any, agents: int, groups: Sequence[Group], sequential: bool, folder: Path | None = None, *,
    user_kinds: Mapping[str, Fault] | None = None, trust: bool = False,
) -> tuple[tuple[FaultEntry, ...], list[str], list[str]]:  # fmt: skip
    """Entries of [[faults]], notes of converted units, and everything that is wrong with them, one line each.

    own : kinds that the caller gives, by name
    """
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(e, Mapping) for e in tables):
        return (), [], ["faults is not a list of tables; write [[faults]]"]
    if len(tables) > MOST:
        return (), [], [f"faults: {len(tables)} entries are more than {MOST}"]
    found: list[FaultEntry] = []
    notes: list[str] = []
    faults: list[str] = []
    kinds = {**KINDS, **(user_kinds or {})}
    for number, table in enumerate(tables):
        entry, told, wrong = _entry(f"faults[{number}]", table, agents, groups, sequential, folder, kinds, trust)
        notes += told
        faults += wrong
        found += [entry] if entry and not wrong else []
        if entry is not None:
            if kinds.get(entry.fault.name, entry.fault) != entry.fault:
                faults.append(f"faults[{number}].kind: {entry.fault.name} is the name of another kind already")
            kinds[entry.fault.name] = entry.fault
    return tuple(found), notes, faults


def _entry(
    where: str, table: Mapping[str, Any], agents: int, groups: Sequence[Group], sequential: bool, folder: Path | None,
    kinds: Mapping[str, Fault], trust: bool,
) -> tuple[FaultEntry | None, list[str], list[str]]:  # fmt: skip
    kind, faults = _kind(where, table.get("kind"), folder, kinds, trust)
    names = ("kind", "agents", "group")
    timing = {key: value for key, value in table.items() if key in ENTRY_KEYS and key not in names}
    when, notes, wrong = _record(where, timing, FaultTiming)
    faults += wrong
    numbers = None
    if kind is not None:  # else nobody can judge its numbers
        rest = {key: value for key, value in table.items() if key not in ENTRY_KEYS}
        numbers, told, wrong = _record(where, rest, kind.Parameters, ENTRY_KEYS)
        notes, faults = notes + told, faults + wrong
    who, wrong = _who(where, table, agents, groups)
    faults += wrong
    if when is not None:
        faults += _when_faults(where, when, agents if who is None else len(who))
    if kind is None:
        return None, notes, faults
    if sequential and PERCEPTION & set(kind.rules):
        faults.append(
            f"{where}.kind = {kind.name!r} disturbs what agents know of each other; update = 'sequential' is for agents"
            " that see each other as they are"
        )
    if when is None or numbers is None or who is None:
        return None, notes, faults
    faults += _end_faults(where, when, kind, numbers)
    count = 1 if when.number is None and when.per_hour is not None else when.number
    entry = FaultEntry(
        kind, numbers, who, None if count is None else int(count), when.at, when.per_hour or 0.0,
        math.inf if when.until is None else when.until, math.inf if when.lasts is None else when.lasts,
    )  # fmt: skip
    return entry, notes, faults


def _record(
    where: str, table: Mapping[str, Any], record: type, beside: Sequence[str] = ()
) -> tuple[Any, list[str], list[str]]:
    """A record made from keys of an entry, in SI units, or None; notes; what is wrong."""
    document, notes, faults = units.convert_units({where: table}, {where: record})
    made, wrong = schema.read_section(where, document[where], record, beside)
    return (None if faults else made), notes, faults + wrong


def _kind(
    where: str, name: Any, folder: Path | None, kinds: Mapping[str, Fault], trust: bool
) -> tuple[Fault | None, list[str]]:
    """A kind by its name, or from a user's own file, which runs only with `trust`."""
    if isinstance(name, str) and name in kinds:
        return kinds[name], []
    if isinstance(name, str) and name.endswith(".py"):
        try:
            return build_from_file(fault, f"{where}.kind", name, folder, trust=trust), []
        except AirflockError as wrong:
            return None, str(wrong).splitlines()
    hint = suggest(name, kinds, f"known: {', '.join(kinds)}, or a file that ends in .py")
    return None, [f"{where}.kind = {name!r}: unknown kind of fault; {hint}"]


def _who(
    where: str, table: Mapping[str, Any], agents: int, groups: Sequence[Group]
) -> tuple[tuple[int, ...] | None, list[str]]:
    """Whom an entry may hit."""
    if "agents" in table and "group" in table:
        return None, [f"{where} names agents and a group; give one of them"]
    if "agents" in table:
        return read_members(f"{where}.agents", table["agents"], agents)
    if "group" not in table:
        return tuple(range(agents)), []
    named = {group.name: group.agents for group in groups}
    if table["group"] in named:
        return named[table["group"]], []
    known = f"known: {', '.join(named)}" if named else "the scenario has none; write [[groups]]"
    return None, [f"{where}.group = {table['group']!r}: unknown group; {known}"]


def _when_faults(where: str, when: FaultTiming, may: int) -> list[str]:
    """What is wrong with times that are sound alone; may : how many agents may be hit."""
    faults = []
    if (when.at is None) == (when.per_hour is None):
        faults.append(f"{where}: give at, when it begins, or per_hour, how often it comes")
    if when.until is not None and when.lasts is not None and when.at is not None:
        faults.append(f"{where} says twice when it ends; give until or lasts")
    if when.at is not None and when.until is not None and when.until <= when.at:
        faults.append(f"{where}.until = {when.until:g} s is not after at = {when.at:g} s")
    if when.number is not None and (when.number != int(when.number) or when.number > may):
        faults.append(f"{where}.number = {when.number:g} is not a whole number up to {may}, the agents that it may hit")
    return faults


def _end_faults(where: str, when: FaultTiming, kind: Fault, numbers: Any) -> list[str]:
    """Why a fault cannot end."""
    faults = []
    ends = when.lasts is not None or (when.at is not None and when.until is not None)
    if ends and kind.time_to_absence(numbers) <= 0.0:
        faults.append(
            f"{where}: {kind.name} does not end, as an agent that drops out stays out; leave out until and lasts"
        )
    return faults
