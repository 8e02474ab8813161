"""The laws of groups: which law a group names, and which laws fly in a flock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from airflock.core import Body, Choice, Model, Quantity, Sensor, argument_names, choices, declarations
from airflock.scenarios import checks, schema
from airflock.scenarios.laws import find_law
from airflock.support import AirflockError

if TYPE_CHECKING:
    from airflock.scenarios.groups import Group


class FlownLaw(NamedTuple):
    """A law that agents of a flock fly by.

    parameters : its record; numbers that differ among its agents are those of the first group that flies by it
    agents     : who flies by it
    varied     : its numbers that differ among them, as ("p", name)
    """

    model: Model
    parameters: Any
    agents: tuple[int, ...]
    varied: tuple[tuple[str, str], ...] = ()

    @property
    def uses_groups(self) -> bool:
        """Whether its rule for neighbours asks for their groups."""
        rule = self.model.neighbour
        return rule is not None and bool({"kin", "group"} & set(argument_names(rule, "neighbour", self.model.name)))


@dataclass
class GroupLawReader:
    """What a group's section `model` may name.

    model, kind, parameters : law of the flock, as its file names it, and its numbers
    own    : laws that the caller gives, by name
    folder : of the scenario file; trust : whether a file of the user's own may run
    walls  : the world has polygons, which are shapes for a law that casts and surfaces for any other
    """

    model: Model
    kind: Any
    parameters: Any
    own: Mapping[str, Model] = field(default_factory=dict)
    folder: Path | None = None
    trust: bool = False
    walls: bool = False
    _read: dict[str, Model] = field(default_factory=dict)

    def named(self, where: str, table: Any) -> tuple[tuple[Model, Any] | None, list[str]]:
        """Law of a group, None for that of the flock, and what is wrong with it, one line each."""
        if not isinstance(table, Mapping):
            return None, []  # said where its numbers are read
        kind = table.get("kind", self.kind)
        try:
            found = self._found(where, kind)
        except AirflockError as fault:
            return None, str(fault).splitlines()
        faults = self._misfits(where, kind, found)
        record, more = self._chosen(where, table, found)
        if faults or more:
            return None, faults + more
        same = found == self.model and choices(record) == choices(self.parameters)
        return (None if same else (found, record)), []

    def _found(self, where: str, kind: Any) -> Model:
        known = {**self._read, **self.own, self.model.name: self.model}
        if kind == self.kind:
            return self.model
        if isinstance(kind, str) and kind in known:
            return known[kind]
        self._read[kind] = found = find_law(kind, self.folder, where=f"{where}.kind", trust=self.trust)
        return found

    def _misfits(self, where: str, kind: Any, found: Model) -> list[str]:
        """Why a law cannot fly beside that of the flock."""
        faults, told, base = [], f"{where}.kind = {kind!r}", self.model
        if found is base:
            return []
        if found.command != base.command:
            faults.append(
                f"{told}: model {found.name} commands {found.command}, and model {base.name} of the flock "
                f"{base.command}; one body carries all"
            )
        for law in (base, found):
            if law.flock is not None:
                faults.append(f"{told}: model {law.name} solves for the whole flock, so all fly by it")
        if self.walls and (found.sight is None) != (base.sight is None):
            casts, other = (base, found) if found.sight is None else (found, base)
            faults.append(
                f"{told}: model {casts.name} casts rays at polygons and model {other.name} feels them as surfaces; "
                "give a world without polygons"
            )
        return faults

    def _chosen(self, where: str, table: Mapping[str, Any], found: Model) -> tuple[Any, list[str]]:
        """Parameters of a group's law with its own choices; its numbers come later."""
        known = {name for name, declared, _ in declarations(found.Parameters) if isinstance(declared, Choice)}
        own = {key: schema.value_of(value) for key, value in table.items() if key in known}
        made, faults = schema.read_section(where, own, found.Parameters)
        if faults or made is None:
            return None, faults
        base = self.parameters if found == self.model else found.Parameters()
        record = replace(base, **{key: getattr(made, key) for key in own})
        if found == self.model and found.flock is not None and choices(record) != choices(base):
            return None, [f"{where}: model {found.name} solves for the whole flock, with one set of choices"]
        return record, []


def group_errors(
    groups: Sequence["Group"], parts: Mapping[str, Any], model: Model, body: Body, sensor: Sensor
) -> list[str]:
    """What of a scenario its groups cannot fly with their own numbers or law, one line each."""
    faults: list[str] = []
    of_all = {*checks.body_errors(body, parts, model), *checks.sensor_errors(sensor, parts)}  # told already
    for number, group in enumerate(groups):
        law, base = group.law or (model, parts["parameters"])
        own = {letter: {key: v for (of, key), v in group.numbers.items() if of == letter} for letter in "pbs"}
        if group.law is None and not any(own.values()):
            continue
        told: dict[str, Any] = {**parts, "parameters": base and replace(base, **own["p"])}
        told["body"] = parts["body"] and replace(parts["body"], **own["b"])
        told["sensors"] = parts["sensors"] and replace(parts["sensors"], **own["s"])
        more = checks.body_errors(body, told, law) + (checks.sensor_errors(sensor, told) if own["s"] else [])
        if group.law is not None and parts["silence"] is not None and parts["flight"] is not None:
            more += checks.silence_errors(parts["silence"].rule, parts["flight"], law)
        faults += [f"groups[{number}]: {fault}" for fault in more if fault not in of_all]
    return faults


def flown_laws(model: Model, parameters: Any, groups: Sequence["Group"], agents: int) -> tuple[FlownLaw, ...]:
    """Laws of a flock: that of all who have none of their own, then those of groups, one for each text."""
    found: dict[Any, list[Group]] = {}
    for group in groups:
        if group.law is not None and group.agents:
            found.setdefault((group.law[0], tuple(choices(group.law[1]).items())), []).append(group)
    apart = {agent for members in found.values() for group in members for agent in group.agents}
    rest = tuple(agent for agent in range(agents) if agent not in apart)
    base = [group for group in groups if group.law is None]
    made = [FlownLaw(model, parameters, rest, _varied(base, parameters))]
    for (law, _), members in found.items():
        first = members[0]
        assert first.law is not None
        record = replace(
            first.law[1], **{name: value for (letter, name), value in first.numbers.items() if letter == "p"}
        )
        who = tuple(sorted(agent for group in members for agent in group.agents))
        made.append(FlownLaw(law, record, who, _varied(members, record)))
    return tuple(made)


def _varied(groups: Sequence["Group"], record: Any) -> tuple[tuple[str, str], ...]:
    """Numbers of a law that differ among the agents of these groups, as ("p", name), in declared order."""
    found = []
    for name, declared, _ in declarations(record):
        usual, key = float(getattr(record, name) or 0.0) if isinstance(declared, Quantity) else 0.0, ("p", name)
        values = {
            group.numbers.get(key, float(getattr(group.law[1] if group.law else record, name) or 0.0))
            for group in groups
            if isinstance(declared, Quantity)
        }
        if values - {usual} or any(group.spread.get(key, 0.0) > 0.0 for group in groups):
            found.append(key)
    return tuple(found)
