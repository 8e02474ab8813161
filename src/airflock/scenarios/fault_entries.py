"""The faults of a scenario: the entries of [[faults]], each checked as a whole, and their onsets in one flight.

An onset is drawn before the flight, from seed, world and the number of its entry: when the fault
begins, of which agent, and for how long.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from airflock.core import ENTRY_KEYS, Fault, Parameters as Record, fault, quantity, random
from airflock.parts import FAULTS as KINDS
from airflock.scenarios import schema
from airflock.scenarios.groups import Group, read_members
from airflock.scenarios.named_code import build_from_file
from airflock.scenarios.sections import Flight
from airflock.support import INVALID, ErrorCollector, suggest

if TYPE_CHECKING:
    from airflock.scenarios.scenario import Scenario

# Refused where agents update in turn: they see each other as they are, so no message exists that a
# fault could disturb.
PERCEPTION = {"sense", "tell", "radio", "clock"}  # rules that disturb what agents know of each other
MOST_AFFECTED = 10_000_000  # agents of all entries that list none: 3 GB of onsets, drawn in half a minute
HOUR = 3600.0  # s
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
    agents   : agents that it may affect; number : how many of them at once, drawn; None for all
    at       : when it begins, s; None where it comes at random
    per_hour : how often it hits the flock in an hour, at random
    until, lasts : time at which it ends, and how long it lasts, s; inf without an end
    """

    fault: Fault
    numbers: Any
    agents: Sequence[int]
    number: int | None
    at: float | None
    per_hour: float
    until: float = math.inf
    lasts: float = math.inf

    def can_occur(self, duration: float) -> bool:
        """Return True if the fault may occur in a flight of this duration, s."""
        begin = 0.0 if self.at is None else self.at
        due = self.per_hour > 0.0 if self.at is None else self.at < duration
        return due and self.lasts > 0.0 and self.until > begin and bool(self.agents)

    def expected_onsets(self, duration: float) -> float:
        """Return how many agents it is expected to hit in a flight of this duration, s."""
        times = 1.0 if self.at is not None else self.per_hour * min(duration, self.until) / HOUR
        return times * min(len(self.agents), self.number or len(self.agents))


def read_fault_entries(
    tables: Any, flight: Flight, groups: Sequence[Group], errors: ErrorCollector, folder: Path | None = None, *,
    user_kinds: Mapping[str, Fault] | None = None, trust: bool = False,
) -> tuple[FaultEntry, ...]:  # fmt: skip
    """Read the entries of [[faults]]; notes on converted units and all errors are collected.

    user_kinds : kinds that the caller gives, by name
    """
    agents, duration = int(flight.agents), flight.duration
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(e, Mapping) for e in tables):
        errors.add("faults is not a list of tables; write [[faults]]")
        return ()
    if len(tables) > MOST:
        errors.add(f"faults: {len(tables)} entries are more than {MOST}")
        return ()
    sizes = {group.name: len(group.agents) for group in groups}
    wide = [sizes.get(str(e["group"]), 0) if "group" in e else agents for e in tables if "agents" not in e]
    if sum(wide) > MOST_AFFECTED:  # before their onsets are drawn, one by one
        of = f"all {agents} agents" if set(wide) == {agents} else f"groups or all of {agents} agents"
        errors.add(
            f"faults: {len(wide)} entries of {of} are {sum(wide):,} agents to look at, more than {MOST_AFFECTED:,}; "
            "write which agents each may hit (agents or group), or fewer entries"
        )
        return ()
    entries: list[FaultEntry] = []
    kinds = {**KINDS, **(user_kinds or {})}
    for number, table in enumerate(tables):
        where, wrong = f"faults[{number}]", ErrorCollector()
        kind = _kind(where, table.get("kind"), folder, kinds, wrong, trust)
        entry = _entry(where, table, kind, flight, groups, wrong)
        # A kind from a file keeps its name for the entries behind it; another kind of this name is
        # an error, as drivers tell kinds apart by their names.
        if entry is not None and kinds.setdefault(kind.name, kind) != kind:
            wrong.add(f"{where}.kind: {kind.name} is the name of another kind already")
        if not errors.merge(wrong) and entry is not None:
            entries.append(entry)
    if (onsets := sum(entry.expected_onsets(duration) for entry in entries)) > MOST_AFFECTED:
        errors.add(
            f"faults: about {onsets:,.0f} agents to hit within duration = {duration:g} s are more than "
            f"{MOST_AFFECTED:,}; lower per_hour, number or duration"
        )
    return tuple(entries)


def _entry(
    where: str, table: Mapping[str, Any], kind: Any, flight: Flight, groups: Sequence[Group], errors: ErrorCollector
) -> FaultEntry | None:
    """Read one entry; None where it has errors. Its kind is INVALID where nobody can judge its numbers."""
    apart = ("kind", "agents", "group")
    timing = {key: value for key, value in table.items() if key in ENTRY_KEYS and key not in apart}
    when: Any = _record(where, timing, FaultTiming, errors)
    numbers = None
    if kind is not INVALID:
        rest = {key: value for key, value in table.items() if key not in ENTRY_KEYS}
        numbers = _record(where, rest, kind.Parameters, errors, ENTRY_KEYS)
    who = _read_agents(where, table, int(flight.agents), groups, errors)
    if when is not None:
        errors.add(*_time_errors(where, when, int(flight.agents) if who is INVALID else len(who)))
    if kind is INVALID:
        return None
    if flight.update == "sequential" and PERCEPTION & set(kind.rules):
        errors.add(
            f"{where}.kind = {kind.name!r} disturbs what agents know of each other; update = 'sequential' is for agents"
            " that see each other as they are"
        )
    if when is None or numbers is None or who is INVALID:
        return None
    ends = when.lasts is not None or (when.at is not None and when.until is not None)
    if ends and kind.time_to_absence(numbers) <= 0.0:
        errors.add(
            f"{where}: {kind.name} does not end, as an agent that drops out stays out; leave out until and lasts"
        )
    count = 1 if when.number is None and when.per_hour is not None else when.number
    return FaultEntry(
        kind, numbers, who, None if count is None else int(count), when.at, when.per_hour or 0.0,
        math.inf if when.until is None else when.until, math.inf if when.lasts is None else when.lasts,
    )  # fmt: skip


def _record(
    where: str, table: Mapping[str, Any], record: type, errors: ErrorCollector, beside: Sequence[str] = ()
) -> Any:
    """Make a record from keys of an entry; None where one has an error, as its default would seem to be missing."""
    wrong = ErrorCollector()
    result, _ = schema.read_section(where, table, record, wrong, beside=beside)
    return None if errors.merge(wrong) else result


def _kind(
    where: str, name: Any, folder: Path | None, kinds: Mapping[str, Fault], errors: ErrorCollector, trust: bool
) -> Fault:
    """Find a kind by its name, or in a user's own file, which runs only with `trust`; INVALID where there is none."""
    if isinstance(name, str) and name in kinds:
        return kinds[name]
    if isinstance(name, str) and name.endswith(".py"):
        return errors.read(build_from_file, fault, f"{where}.kind", name, folder, trust=trust)
    hint = suggest(name, kinds, f"known: {', '.join(kinds)}, or a file that ends in .py")
    errors.add(f"{where}.kind = {name!r}: unknown kind of fault; {hint}")
    return INVALID  # type: ignore[no-any-return]


def _read_agents(
    where: str, table: Mapping[str, Any], agents: int, groups: Sequence[Group], errors: ErrorCollector
) -> Sequence[int]:
    """Return the agents that an entry may affect; INVALID where nobody can say which."""
    if "agents" in table and "group" in table:
        errors.add(f"{where} names agents and a group; give one of them")
        return INVALID  # type: ignore[no-any-return]
    if "agents" in table:
        return read_members(f"{where}.agents", table["agents"], agents, errors)
    if "group" not in table:
        return range(agents)
    named = {group.name: group.agents for group in groups}
    if table["group"] in named:
        return named[table["group"]]
    known = f"known: {', '.join(named)}" if named else "the scenario has none; write [[groups]]"
    errors.add(f"{where}.group = {table['group']!r}: unknown group; {known}")
    return INVALID  # type: ignore[no-any-return]


def _time_errors(where: str, when: FaultTiming, may: int) -> list[str]:
    """Return the errors of times that are valid alone; may : how many agents may be affected."""
    errors = []
    if (when.at is None) == (when.per_hour is None):
        errors.append(f"{where}: give at, when it begins, or per_hour, how often it comes")
    if when.until is not None and when.lasts is not None and when.at is not None:
        errors.append(f"{where} says twice when it ends; give until or lasts")
    if when.at is not None and when.until is not None and when.until <= when.at:
        errors.append(f"{where}.until = {when.until:g} s is not after at = {when.at:g} s")
    if when.number is not None and (when.number != int(when.number) or when.number > may):
        errors.append(f"{where}.number = {when.number:g} is not a whole number up to {may}, the agents that it may hit")
    return errors


# Rates count for the flock and not for each agent: "a motor fails once an hour" is what people know
# of a fleet.
ENDLESS = 1e9  # s; how long a fault lasts that does not end


class FaultOnset(NamedTuple):
    """A fault of one agent that begins, or an agent that drops out.

    step  : step before which it begins
    kind  : of the fault; agent : the affected one
    lasts : s; ENDLESS without an end
    numbers : of the kind, by name
    leaves  : the agent is absent from now on, by a fault that has begun earlier
    entry   : number of its entry in [[faults]]; begin : step before which that fault begins
    """

    step: int
    kind: str
    agent: int
    lasts: float
    numbers: tuple[float, ...]
    leaves: bool = False
    entry: int = 0
    begin: int = 0


def draw_onsets(scenario: "Scenario", seed: int, world: int = 0) -> tuple[FaultOnset, ...]:
    """Draw all fault onsets of a flight, in the order of their steps."""
    entries = enumerate(scenario.faults)
    return _in_order([o for number, entry in entries for o in _onsets_of_entry(scenario, entry, number, seed, world)])


def merge_onsets(
    before: Sequence[FaultOnset], after: Sequence[FaultOnset], now: int, lasting: Collection[int]
) -> tuple[FaultOnset, ...]:  # fmt: skip
    """Merge the onsets of a flight with those of new entries that come into force before step `now`.

    A fault that has begun goes on if the new entries name it as well, with their numbers, or if its
    entry stays. A fault that the new entries would have begun earlier does not begin.

    lasting : numbers of the entries before that stay as they are
    """
    # Numbers are left out of the comparison, so that a slider can change a fault that is already
    # under way.
    named = {_identity(onset): onset for onset in after}
    begun = [
        named.get(_identity(o), o) for o in before if o.begin < now and (_identity(o) in named or o.entry in lasting)
    ]
    kept = {_identity(onset)[:3] for onset in begun}
    gone = [o for o in after if o.begin < now <= o.step and _identity(o)[:3] in kept and o not in begun]
    return _in_order([*begun, *gone, *(o for o in after if o.begin >= now)])


def _in_order(found: Sequence[FaultOnset]) -> tuple[FaultOnset, ...]:
    """Sort onsets by their steps; drop agents that leave by a fault which another of its kind has replaced."""
    kept: list[FaultOnset] = []
    last: dict[tuple[str, int], FaultOnset] = {}
    # A later fault of the same kind replaces an earlier one in the driver's columns, so the earlier
    # one must not make its agent leave. Of two in one step the later entry wins.
    for onset in sorted(found, key=lambda onset: onset.step):
        other = last.get((onset.kind, onset.agent), onset)
        if not onset.leaves:
            last[onset.kind, onset.agent] = onset
        elif other.step < onset.step and (other.step, other.entry) > (onset.begin, onset.entry):
            continue
        kept.append(onset)
    return tuple(kept)


def _identity(onset: FaultOnset) -> tuple[str, int, int, bool]:
    """Return the identity of a fault, whatever its numbers: kind, agent, begin, and if the agent leaves."""
    return onset.kind, onset.agent, onset.begin, onset.leaves


def _onsets_of_entry(
    scenario: "Scenario", entry: FaultEntry, number: int, seed: int, world: int
) -> Iterator[FaultOnset]:
    """Yield the onsets of one entry, whose number in [[faults]] selects its random numbers."""
    dt, kind = scenario.flight.dt, entry.fault
    numbers = tuple(float(getattr(entry.numbers, name)) for name in kind.fields)
    for occurrence, at in enumerate(_occurrence_times(scenario, entry, number, seed, world)):
        ends = min(entry.lasts, entry.until - at, ENDLESS)
        # Rounded to steps, as the driver counts them; an endless fault keeps its mark.
        lasts = ends if ends >= ENDLESS else round(ends / dt) * dt
        if lasts <= 0.0:
            continue
        step = round(at / dt)
        gone = kind.time_to_absence(entry.numbers)
        for agent in _affected_agents(entry, number, occurrence, seed, world):
            yield FaultOnset(step, kind.name, agent, lasts, numbers, entry=number, begin=step)
            if gone < lasts:
                yield FaultOnset(step + round(gone / dt), kind.name, agent, lasts, numbers, True, number, step)


def _occurrence_times(scenario: "Scenario", entry: FaultEntry, number: int, seed: int, world: int) -> Iterator[float]:
    """Yield the times at which a fault begins, s: once, or with exponential waiting times."""
    if entry.at is not None:
        if entry.at < scenario.flight.duration:
            yield entry.at
        return
    time, occurrence = 0.0, 0
    while entry.per_hour > 0.0:
        # Waiting times of a Poisson process by inversion; occurrence and entry number select the
        # random number.
        word = random.random_words(seed, random.FAULT, world, occurrence, number)[0]
        time -= HOUR / entry.per_hour * math.log(random.uniform(word))
        occurrence += 1
        if time >= min(scenario.flight.duration, entry.until):
            return
        yield time


def _affected_agents(entry: FaultEntry, number: int, occurrence: int, seed: int, world: int) -> list[int]:
    """Return the agents of an occurrence: all that may be affected, or some drawn without replacement."""
    may = entry.agents
    if entry.number is None or entry.number >= len(may):
        return list(may)
    # Sorting by one random number per agent draws without replacement, and independently of the
    # order of agents.
    draw = {agent: random.random_words(seed, random.FAULT, world, occurrence, agent, 1 + number)[0] for agent in may}
    return sorted(sorted(may, key=lambda agent: (draw[agent], agent))[: entry.number])


def begun_faults(due: tuple[FaultOnset, ...], step: int, dt: float) -> list[dict[str, Any]]:
    """Return the faults that began before a step, as dicts of kind, agent, begin and end (s; None without an end)."""
    return [
        {
            "kind": onset.kind,
            "agent": onset.agent,
            "begin": onset.step * dt,
            "end": None if onset.lasts >= ENDLESS else onset.step * dt + onset.lasts,
        }
        for onset in due
        if onset.step < step and not onset.leaves
    ]
