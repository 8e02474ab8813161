"""The groups of a scenario file: agents that share numbers or a law, and how far each agent is off these numbers."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from typing import Any

from airflock.core import Choice, Model, Quantity, declarations, random
from airflock.scenarios import schema, units
from airflock.scenarios.group_laws import GroupLawReader
from airflock.scenarios.spreads import check_spreads, relative_spread, standard_deviation, with_share_hint

LETTERS = {
    "model": "p",
    "body": "b",
    "sensors": "s",
}  # sections of which numbers may differ, and what drivers call them
KEYS = ("name", "agents", *LETTERS)
SHARE = re.compile(r"\s*([0-9]{1,3}(?:\.[0-9]{1,6})?)\s*%\s*")  # of a flock
ONE = {"body": "one body carries all", "sensors": "all measure by one sensor"}


@dataclass(frozen=True)
class Group:
    """One entry of [[groups]].

    agents  : their numbers, in order
    numbers : (letter, name) → value that they have instead of the flock's
    spread  : (letter, name) → standard deviation by which each agent differs from it, or what share of it that is
    law     : model and parameters that they fly by, where these are not the flock's but for numbers
    """

    name: str
    agents: tuple[int, ...]
    numbers: Mapping[tuple[str, str], float] = field(default_factory=dict)
    spread: Mapping[tuple[str, str], float] = field(default_factory=dict)
    law: tuple[Model, Any] | None = None

    def without(self, letter: str) -> "Group":
        """The same group without numbers of its own in one record."""
        rest = [{key: v for key, v in part.items() if key[0] != letter} for part in (self.numbers, self.spread)]
        return replace(self, numbers=rest[0], spread=rest[1])


def read_members(where: str, value: Any, agents: int) -> tuple[tuple[int, ...] | None, list[str]]:
    """Numbers of agents from a list of them; and what is wrong with it, one line."""
    whole = isinstance(value, Sequence) and not isinstance(value, str)
    if not whole or not value or not all(isinstance(k, int) and not isinstance(k, bool) for k in value):
        return None, [f"{where} = {value!r} is not a list of numbers of agents, 0 to {agents - 1}"]
    wrong = [k for k in value if not 0 <= k < agents]
    if wrong:
        return None, [f"{where}: there is no agent {wrong[0]}; this flock has the agents 0 to {agents - 1}"]
    return tuple(sorted(set(value))), []


def group_names(groups: Sequence[Group], agents: int) -> tuple[str, ...]:
    """Name of the group of each agent, "" in none; nothing where there are no groups."""
    named = {agent: group.name for group in groups for agent in group.agents}
    return tuple(named.get(agent, "") for agent in range(agents)) if named else ()


def count_of_share(value: Any, agents: int) -> Any:
    """A number of agents out of a share of the flock such as "20 %", at least one; anything else as it is."""
    share = SHARE.fullmatch(value) if isinstance(value, str) else None
    if share is None or not 0.0 < float(share[1]) <= 100.0:
        return value
    return max(1, round(float(share[1]) / 100.0 * agents))


def read_groups(
    tables: Any, agents: int, records: Mapping[str, type], laws: GroupLawReader | None = None
) -> tuple[tuple[Group, ...], list[str], list[str]]:
    """Groups, notes of converted units, and everything that is wrong with them, one line each.

    records : "model", "body" and "sensors" → record of their parameters
    laws    : finds the law that a group's section model names
    """
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(g, Mapping) for g in tables):
        return (), [], ["groups is not a list of tables; write [[groups]]"]
    who, faults = _agents(tables, agents)
    found: list[Group] = []
    notes: list[str] = []
    for number, table in enumerate(tables):
        where = f"groups[{number}]"
        faults += [f"{where}.{key}: unknown key; known: {', '.join(KEYS)}" for key in table if key not in KEYS]
        name = table.get("name", f"group_{number}")
        if not isinstance(name, str) or not name or name in {group.name for group in found}:
            faults.append(f"{where}.name = {name!r} is not a name of its own")
            name = where
        numbers: dict[tuple[str, str], float] = {}
        spread: dict[tuple[str, str], float] = {}
        law, own = (None, []) if laws is None else laws.named(f"{where}.model", table.get("model", {}))
        faults += own
        for section, letter in LETTERS.items():
            if section in records and not (section == "model" and own):
                record = type(law[1]) if law and section == "model" else records[section]
                values, spreads, told, wrong = _section(f"{where}.{section}", table.get(section, {}), record)
                numbers |= {(letter, key): value for key, value in values.items()}
                spread |= {(letter, key): value for key, value in spreads.items()}
                notes += told
                faults += wrong
        found.append(Group(name, who[number], numbers, spread, law))
    return tuple(found), notes, faults


def _agents(given: Sequence[Mapping[str, Any]], agents: int) -> tuple[list[tuple[int, ...]], list[str]]:
    """Members of each group: those that are listed, so many of the next ones, or all that are left."""
    faults: list[str] = []
    found: list[tuple[int, ...]] = [()] * len(given)
    taken: set[int] = set()
    for number, table in enumerate(given):
        if isinstance(table.get("agents"), (list, tuple)):
            listed, wrong = read_members(f"groups[{number}].agents", table["agents"], agents)
            faults += wrong
            twice = sorted(taken & set(listed or ()))
            if twice:
                faults.append(f"groups[{number}].agents: agent {twice[0]} is in another group already")
            found[number] = listed or ()
            taken |= set(listed or ())
    left = [agent for agent in range(agents) if agent not in taken]
    rest = []
    for number, table in enumerate(given):
        count = count_of_share(table.get("agents"), agents)
        if count is None:
            rest.append(number)
        elif not isinstance(count, (list, tuple)):
            whole = isinstance(count, (int, float)) and not isinstance(count, bool) and count % 1 == 0
            if not whole or not 1 <= count <= len(left):
                faults.append(
                    f"groups[{number}].agents = {count!r} is neither a list of agents, a share such as '20 %', nor a "
                    f"number of them up to {len(left)}, as many as are left of {agents}"
                )
                continue
            found[number], left = tuple(left[: int(count)]), left[int(count) :]
    for number in rest[:1]:
        found[number] = tuple(left)
        if not left:
            faults.append(f"groups[{number}] has no agents, and no agent is left for it")
    faults += [
        f"groups[{number}].agents is missing; only one group may take the agents that are left" for number in rest[1:]
    ]
    return found, faults


def _section(where: str, table: Any, record: type) -> tuple[dict[str, float], dict[str, float], list[str], list[str]]:
    """Numbers and spreads of one section of a group."""
    if not isinstance(table, Mapping):
        return {}, {}, [], [f"{where} = {table!r} is not a table of numbers"]
    known = {name: declared for name, declared, _ in declarations(record)}
    values: dict[str, Any] = {}
    spreads: dict[str, Any] = {}
    faults: list[str] = []
    for key, value in table.items():
        if where.endswith("model") and (key == "kind" or isinstance(known.get(key), Choice)):
            continue
        if key == "kind" or isinstance(known.get(key), Choice):
            faults.append(f"{where}.{key}: {ONE[where.rpartition('.')[2]]}; only numbers differ from group to group")
        elif key == "period" and where.endswith("sensors"):
            faults.append(f"{where}.{key}: all measure and decide at the same times; set sensors.period")
        elif isinstance(value, Mapping) and "spread" in value:
            unit = {"unit": value["unit"]} if "unit" in value else {}
            share = relative_spread(value["spread"], known.get(key))
            absolute = {"value": value["spread"], **unit} if unit else value["spread"]
            spreads[key] = absolute if share is None else share
            rest = {name: entry for name, entry in value.items() if name != "spread"}
            inner = rest.get("value")  # set anew beside a spread that has a unit, it may be a table of its own
            values |= {key: inner if isinstance(inner, Mapping) else rest} if "value" in rest else {}
        else:
            values[key] = value
    apart = f"{where}.spread"
    converted, told, unfit = units.convert_units({where: values, apart: spreads}, {where: record, apart: record})
    notes = [_as_written(line, where, apart) for line in told]
    wrong = [f"{_as_written(line, where, apart)}{with_share_hint(line, apart, known)}" for line in unfit]
    made, more = schema.read_section(where, converted[where], record)
    faults += wrong + more
    off, more = check_spreads(where, converted[apart], known)
    numbers = {key: float(getattr(made, key)) for key in converted[where]} if made is not None and not more else {}
    return numbers, off, notes, faults + more


def _as_written(line: str, where: str, apart: str) -> str:
    """A line about a spread under the key that a file has for it."""
    if not line.startswith(f"{apart}."):
        return line
    key, _, rest = line.removeprefix(f"{apart}.").partition(" ")
    return f"{where}.{key}.spread {rest}"


def varied_numbers(groups: Sequence[Group], base: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Numbers that differ among agents, as (letter, name), in declared order; base : letter → record of the flock.

    Those of laws: `group_laws.Law.varied`.
    """
    found = []
    for letter, record in base.items() if groups else ():
        for name, declared, _ in declarations(record):
            if isinstance(declared, Quantity):
                usual = float(getattr(record, name) or 0.0)
                others = any(group.numbers.get((letter, name), usual) != usual for group in groups)
                if others or any(group.spread.get((letter, name), 0.0) > 0.0 for group in groups):
                    found.append((letter, name))
    return tuple(found)


def agent_values(groups: Sequence[Group], agents: int, letter: str, name: str, record: Any, seed: int) -> list[float]:
    """One number of every agent: its group's, and off it by a normal number of its own, within the allowed range.

    It is 0 of agents whose law has no such number.
    """
    values = [float(getattr(record, name, None) or 0.0)] * agents
    for group in groups:
        own_record = group.law[1] if group.law and letter == "p" else record
        known = {key: declared for key, declared, _ in declarations(own_record)}
        declared = known.get(name)
        if not isinstance(declared, Quantity):
            values = [0.0 if agent in group.agents else value for agent, value in enumerate(values)]
            continue
        usual = float(getattr(own_record, name) or 0.0)
        own = group.numbers.get((letter, name), usual)
        spread = standard_deviation(group.spread.get((letter, name), 0.0), own)
        for agent in group.agents:
            value = own
            if spread > 0.0:
                draw = list(LETTERS.values()).index(letter)
                w0, w1, _, _ = random.random_words(seed, random.SPREAD, 0, list(known).index(name), agent, draw)
                value += spread * random.normal_pair(w0, w1)[0]
            values[agent] = min(max(value, declared.low), declared.high)
    return values


def group_number_errors(groups: Sequence[Group], model: Model | None) -> list[str]:
    """Why numbers of groups cannot be flown by a law, one line."""
    if model is None or model.flock is None or model.workspace is None:
        return []
    if "p" not in {*signature(model.flock).parameters, *signature(model.workspace).parameters}:
        return []
    number = next((k for k, group in enumerate(groups) for of, _ in (*group.numbers, *group.spread) if of == "p"), None)
    if number is None or groups[number].law is not None:
        return []
    return [f"groups[{number}].model: model {model.name} solves for the whole flock, with one set of numbers"]
