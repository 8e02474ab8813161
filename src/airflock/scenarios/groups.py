"""The groups of a scenario file: agents that share numbers or a law, and how far each agent is off these numbers.

`read_groups` checks the entries of [[groups]]; `flown_laws` and `agent_values` say by which law and
with which numbers each agent flies.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple

from airflock.core import Body, Choice, Model, Quantity, Sensor, argument_names, choices, declarations, random
from airflock.parts.steering import law_for_command
from airflock.scenarios import schema
from airflock.scenarios.named_code import find_law
from airflock.scenarios.scenario_checks import body_errors, sensor_errors, silence_errors
from airflock.scenarios.schema import read_spread, standard_deviation
from airflock.support import INVALID, ErrorCollector

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
    numbers : (letter, name) → value in place of the flock's
    spread  : (letter, name) → standard deviation of the agents' values about it, absolute or a
              share of the value
    law     : model and parameters, if the group flies by another law, or by the flock's law with
              other choices
    """

    name: str
    agents: Sequence[int]
    numbers: dict[tuple[str, str], float] = field(default_factory=dict)
    spread: dict[tuple[str, str], float] = field(default_factory=dict)
    law: tuple[Model, Any] | None = None

    def without(self, letter: str) -> "Group":
        """Return the group without numbers of its own in one record."""
        rest = [{key: v for key, v in part.items() if key[0] != letter} for part in (self.numbers, self.spread)]
        return replace(self, numbers=rest[0], spread=rest[1])


class FlownLaw(NamedTuple):
    """A law that agents of a flock fly by.

    parameters : its record; numbers that differ among its agents are those of the first group that
                 flies by it
    agents     : numbers of the agents that fly by it
    varied     : its numbers that differ among them, as ("p", name)
    """

    model: Model
    parameters: Any
    agents: Sequence[int]
    varied: tuple[tuple[str, str], ...] = ()

    @property
    def uses_groups(self) -> bool:
        """True if its rule for neighbours reads their groups."""
        rule = self.model.neighbour
        return rule is not None and bool({"kin", "group"} & set(argument_names(rule, "neighbour", self.model.name)))


@dataclass
class GroupLawReader:
    """Reads the section `model` of a group.

    model, kind, parameters : law of the flock, as its file names it, and its numbers
    own    : laws that the caller gives, by name
    folder : of the scenario file; trust : True if a file of the user's own may run
    walls  : True if the world has polygons, which are shapes for a law that casts rays and surfaces
             for any other
    """

    model: Model
    kind: Any
    parameters: Any
    own: Mapping[str, Model] = field(default_factory=dict)
    folder: Path | None = None
    trust: bool = False
    walls: bool = False
    _read: dict[str, Model] = field(default_factory=dict)

    def named(self, where: str, table: Any, errors: ErrorCollector) -> Any:
        """Return the law of a group, None for that of the flock; INVALID where it has errors."""
        if not isinstance(table, Mapping):
            return None  # reported where its numbers are read
        kind = table.get("kind", self.kind)
        wrong = ErrorCollector()
        if (law := wrong.read(self._found, where, kind)) is not INVALID:
            wrong.add(*self._misfits(where, kind, law))
            record = self._chosen(where, table, law, wrong)
        if errors.merge(wrong):
            return INVALID
        same = law == self.model and choices(record) == choices(self.parameters)
        return None if same else (law, record)

    def _found(self, where: str, kind: Any) -> Model:
        known = {**self._read, **self.own, self.model.name: self.model}
        if kind == self.kind:
            return self.model
        if isinstance(kind, str) and kind in known:
            return law_for_command(known[kind], self.model.command)
        self._read[kind] = find_law(kind, self.folder, where=f"{where}.kind", trust=self.trust)
        # One body carries all agents, and a body takes one kind of command.
        return law_for_command(self._read[kind], self.model.command)

    def _misfits(self, where: str, kind: Any, found: Model) -> list[str]:
        """Return why a law cannot fly beside that of the flock."""
        errors, key, base = [], f"{where}.kind = {kind!r}", self.model
        if found is base:
            return []
        for law in (base, found):
            if law.flock is not None:
                errors.append(f"{key}: model {law.name} solves for the whole flock, so all fly by it")
        # A driver keeps polygons either as shapes or as surfaces, never as both.
        if self.walls and (found.sight is None) != (base.sight is None):
            casts, other = (base, found) if found.sight is None else (found, base)
            errors.append(
                f"{key}: model {casts.name} casts rays at polygons and model {other.name} feels them as surfaces; "
                "give a world without polygons"
            )
        return errors

    def _chosen(self, where: str, table: Mapping[str, Any], found: Model, errors: ErrorCollector) -> Any:
        """Return the parameters of a group's law with its own choices; its numbers come later."""
        known = {name for name, declared, _ in declarations(found.Parameters) if isinstance(declared, Choice)}
        own = {key: schema.value_of(value) for key, value in table.items() if key in known}
        made, _ = schema.read_section(where, own, found.Parameters, errors)
        if made is None:
            return None
        # Choices select the text of a driver, so they are part of the law; numbers are columns of
        # its row and stay apart.
        base = self.parameters if found == self.model else found.Parameters()
        record = replace(base, **{key: getattr(made, key) for key in own})
        if found == self.model and found.flock is not None and choices(record) != choices(base):
            errors.add(f"{where}: model {found.name} solves for the whole flock, with one set of choices")
        return record


def group_errors(
    groups: Sequence[Group], parts: Mapping[str, Any], model: Model, body: Body, sensor: Sensor
) -> list[str]:
    """Return why groups cannot fly with their own numbers or law, one line each."""
    errors: list[str] = []
    # An error of the whole flock would otherwise be repeated for each group.
    of_all = {*body_errors(body, parts, model), *sensor_errors(sensor, parts)}  # reported already
    for number, group in enumerate(groups):
        law, base = group.law or (model, parts["parameters"])
        own = {letter: {key: v for (of, key), v in group.numbers.items() if of == letter} for letter in "pbs"}
        if group.law is None and not any(own.values()):
            continue
        own_parts: dict[str, Any] = {**parts, "parameters": base and replace(base, **own["p"])}
        own_parts["body"] = parts["body"] and replace(parts["body"], **own["b"])
        own_parts["sensors"] = parts["sensors"] and replace(parts["sensors"], **own["s"])
        more = body_errors(body, own_parts, law) + (sensor_errors(sensor, own_parts) if own["s"] else [])
        if group.law is not None and parts["silence"] is not None and parts["flight"] is not None:
            more += silence_errors(parts["silence"].rule, parts["flight"], law)
        errors += [f"groups[{number}]: {error}" for error in more if error not in of_all]
    return errors


def flown_laws(model: Model, parameters: Any, groups: Sequence[Group], agents: int) -> tuple[FlownLaw, ...]:
    """Return the laws of a flock: that of all agents without their own, then those of groups, one for each text."""
    # Groups with one law and one set of choices share a text, whatever their numbers: each further
    # law costs a compilation.
    by_law: dict[Any, list[Group]] = {}
    for group in groups:
        if group.law is not None and group.agents:
            by_law.setdefault((group.law[0], tuple(choices(group.law[1]).items())), []).append(group)
    apart = {agent for members in by_law.values() for group in members for agent in group.agents}
    rest = _without(agents, apart)
    base = [group for group in groups if group.law is None]
    laws = [FlownLaw(model, parameters, rest, varied_numbers(base, {"p": parameters}))]
    for (law, _), members in by_law.items():
        first = members[0]
        assert first.law is not None
        # Any agent's numbers would do here: what differs among them is read from columns.
        record = replace(
            first.law[1], **{name: value for (letter, name), value in first.numbers.items() if letter == "p"}
        )
        who = tuple(sorted(agent for group in members for agent in group.agents))
        laws.append(FlownLaw(law, record, who, varied_numbers(members, {"p": record})))
    return tuple(laws)


def _without(agents: int, taken: Collection[int]) -> Sequence[int]:
    """Return the numbers of agents that are not taken; a range where all are left, as a list of them may be large."""
    return tuple(agent for agent in range(agents) if agent not in taken) if taken else range(agents)


def read_members(where: str, value: Any, agents: int, errors: ErrorCollector) -> Sequence[int]:
    """Read a list of numbers of agents; INVALID where it is none."""
    whole = isinstance(value, Sequence) and not isinstance(value, str)
    if not whole or not value or not all(isinstance(k, int) and not isinstance(k, bool) for k in value):
        errors.add(f"{where} = {value!r} is not a list of numbers of agents, 0 to {agents - 1}")
        return INVALID  # type: ignore[no-any-return]
    members = tuple(sorted(set(value)))
    if wrong := [k for k in (members[0], members[-1]) if not 0 <= k < agents]:
        errors.add(f"{where}: there is no agent {wrong[0]}; this flock has the agents 0 to {agents - 1}")
        return INVALID  # type: ignore[no-any-return]
    return range(agents) if len(members) == agents else members


def group_names(groups: Sequence[Group], agents: int) -> tuple[str, ...]:
    """Return the name of the group of each agent, "" in none; empty where there are no groups."""
    named = {agent: group.name for group in groups for agent in group.agents}
    return tuple(named.get(agent, "") for agent in range(agents)) if named else ()


def count_of_share(value: Any, agents: int) -> Any:
    """Convert a share of the flock such as "20 %" to a number of agents, at least one; return anything else as is."""
    share = SHARE.fullmatch(value) if isinstance(value, str) else None
    if share is None or not 0.0 < float(share[1]) <= 100.0:
        return value
    return max(1, round(float(share[1]) / 100.0 * agents))


def read_groups(
    tables: Any,
    agents: int,
    records: Mapping[str, type],
    errors: ErrorCollector,
    laws: GroupLawReader | None = None,
) -> tuple[Group, ...]:
    """Read groups; notes on converted units and all errors are collected.

    records : "model", "body" and "sensors" → record of their parameters
    laws    : finds the law that a group's section model names
    """
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(g, Mapping) for g in tables):
        errors.add("groups is not a list of tables; write [[groups]]")
        return ()
    who = _agents(tables, agents, errors)
    groups: list[Group] = []
    for number, table in enumerate(tables):
        where = f"groups[{number}]"
        errors.add(*(f"{where}.{key}: unknown key; known: {', '.join(KEYS)}" for key in table if key not in KEYS))
        name = table.get("name", f"group_{number}")
        if not isinstance(name, str) or not name or name in {group.name for group in groups}:
            errors.add(f"{where}.name = {name!r} is not a name of its own")
            name = where
        group = Group(name, who[number], {}, {})
        law = None if laws is None else laws.named(f"{where}.model", table.get("model", {}), errors)
        for section in LETTERS:
            if section in records and not (section == "model" and law is INVALID):
                record = type(law[1]) if law and section == "model" else records[section]
                _read_numbers(where, section, table.get(section, {}), record, group, errors)
        groups.append(replace(group, law=None if law is INVALID else law))
    return tuple(groups)


def _agents(tables: Sequence[Mapping[str, Any]], agents: int, errors: ErrorCollector) -> list[Sequence[int]]:
    """Return the members of each group: a list, so many of the next ones, or all that are left."""
    members: list[Sequence[int]] = [()] * len(tables)
    taken: set[int] = set()
    # Lists are read first, then counts, then the one group that takes the rest: so the order of
    # groups does not change who is listed.
    for number, table in enumerate(tables):
        if isinstance(table.get("agents"), (list, tuple)):
            listed = read_members(f"groups[{number}].agents", table["agents"], agents, errors)
            members[number] = () if listed is INVALID else listed
            if twice := sorted(taken & set(members[number])):
                errors.add(f"groups[{number}].agents: agent {twice[0]} is in another group already")
            taken |= set(members[number])
    left = _without(agents, taken)
    rest = []
    for number, table in enumerate(tables):
        count = count_of_share(table.get("agents"), agents)
        if count is None:
            rest.append(number)
        elif not isinstance(count, (list, tuple)):
            whole = isinstance(count, (int, float)) and not isinstance(count, bool) and count % 1 == 0
            if not whole or not 1 <= count <= len(left):
                errors.add(
                    f"groups[{number}].agents = {count!r} is neither a list of agents, a share such as '20 %', nor a "
                    f"number of them up to {len(left)}, as many as are left of {agents}"
                )
                continue
            members[number], left = left[: int(count)], left[int(count) :]
    for number in rest[:1]:
        members[number] = left
        if not left:
            errors.add(f"groups[{number}] has no agents, and no agent is left for it")
    for number in rest[1:]:
        errors.add(f"groups[{number}].agents is missing; only one group may take the agents that are left")
    return members


# keys that all agents share, and why
SHARED = {
    ("sensors", "period"): "all measure and decide at the same times; set sensors.period",
    ("body", "delay"): "all bodies follow their commands after one dead time; set body.delay",
}


def _read_numbers(of: str, section: str, table: Any, record: type, group: Group, errors: ErrorCollector) -> None:
    """Read one section of a group into its numbers and their spreads."""
    where, letter = f"{of}.{section}", LETTERS[section]
    if not isinstance(table, Mapping):
        errors.add(f"{where} = {table!r} is not a table of numbers")
        return
    known = {name: declared for name, declared, _ in declarations(record)}
    values: dict[str, Any] = {}
    for key, entry in table.items():
        declared = known.get(key)
        if key == "kind" or isinstance(declared, Choice):
            if section != "model":  # its choices are those of its law
                errors.add(f"{where}.{key}: {ONE[section]}; only numbers differ from group to group")
        elif (section, key) in SHARED:
            errors.add(f"{where}.{key}: {SHARED[section, key]}")
        elif isinstance(entry, Mapping) and "spread" in entry and isinstance(declared, Quantity):
            rest = {name: part for name, part in entry.items() if name != "spread"}
            spread = read_spread(f"{where}.{key}.spread", entry["spread"], rest.get("unit", ""), declared, errors)
            group.spread[letter, key] = 0.0 if spread is None else spread
            if "value" in rest:  # a setting beside a spread with a unit may be a table
                values[key] = rest["value"] if isinstance(rest["value"], Mapping) else rest
        else:
            values[key] = entry
    made, values = schema.read_section(where, values, record, errors)
    if made is not None:
        group.numbers.update({(letter, key): float(getattr(made, key)) for key in values})


def varied_numbers(groups: Sequence[Group], base: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return the numbers that differ among agents, as (letter, name), in declared order.

    base : letter → record of those that are in no group; a group with a law of its own has the
           numbers of that
    """
    names = []
    for letter, record in base.items() if groups else ():
        for name, declared, _ in declarations(record):
            if isinstance(declared, Quantity):
                key, usual = (letter, name), float(getattr(record, name) or 0.0)
                records = ((g, g.law[1] if g.law and letter == "p" else record) for g in groups)
                own = (group.numbers.get(key, getattr(of, name) or 0.0) for group, of in records)
                if any(value != usual for value in own) or any(group.spread.get(key, 0.0) > 0.0 for group in groups):
                    names.append(key)
    return tuple(names)


def agent_values(groups: Sequence[Group], agents: int, letter: str, name: str, record: Any, seed: int) -> list[float]:
    """Return one number of every agent: its group's, plus a normal deviation of its own, clipped to the allowed range.

    It is 0 for agents whose law has no such number.
    """
    values = [float(getattr(record, name, None) or 0.0)] * agents
    for group in groups:
        own_record = group.law[1] if group.law and letter == "p" else record
        # Without the dead time, which is one for all: the place of a number among the others decides its draw.
        known = {key: declared for key, declared, _ in declarations(own_record) if (letter, key) != ("b", "delay")}
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
                # Agent, number and record select the random number: a further group changes no
                # agent's draw.
                draw = list(LETTERS.values()).index(letter)
                w0, w1, _, _ = random.random_words(seed, random.SPREAD, 0, list(known).index(name), agent, draw)
                value += spread * random.normal_pair(w0, w1)[0]
            # Clipped, not drawn again: a second draw would depend on how often the first one
            # failed.
            values[agent] = min(max(value, declared.low), declared.high)
    return values


def group_number_errors(groups: Sequence[Group], model: Model | None) -> list[str]:
    """Return why a law of the whole flock cannot fly the numbers of groups, one line."""
    if model is None or model.flock is None or model.workspace is None:
        return []
    if "p" not in {*signature(model.flock).parameters, *signature(model.workspace).parameters}:
        return []
    number = next((k for k, group in enumerate(groups) for of, _ in (*group.numbers, *group.spread) if of == "p"), None)
    if number is None or groups[number].law is not None:
        return []
    return [f"groups[{number}].model: model {model.name} solves for the whole flock, with one set of numbers"]
