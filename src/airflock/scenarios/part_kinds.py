"""Kinds of parts: the law, body, sensor, radio, topology and metric set that a document names or a caller gives.

A section names its part by the key `kind`: one of the package, or a Python file of the user's own,
which runs only with trust. A part that the caller gives replaces that of the document; giving it is
consent to run it.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from airflock.core import (
    Body,
    Fault,
    MetricSet,
    Model,
    PacketParameters,
    Radio,
    Sensor,
    Topology,
    add_laws,
    body,
    composition_errors,
    declarations,
    model,
    number_names,
    radio,
    sensor,
    topology,
)
from airflock.parts.aero import descent
from airflock.parts.bodies import BODIES, default_body
from airflock.parts.metrics import DEFAULT_SET, SETS, metric_set, to_metric_set
from airflock.parts.radios import DEFAULT_RADIO, RADIOS
from airflock.parts.sensors import DEFAULT_SENSOR, SENSORS
from airflock.parts.topologies import DEFAULT_TOPOLOGY, TOPOLOGIES
from airflock.scenarios.named_code import build_from_file, find_law
from airflock.scenarios.schema import value_of
from airflock.scenarios.sections import SECTIONS
from airflock.support import AirflockError, suggest

T = TypeVar("T")


@dataclass(frozen=True)
class PartKind(Generic[T]):
    """A kind of part that a section may name.

    section : of a document, and field of a Scenario and of `CallerParts`; noun: in messages
    shipped : parts of the package by name; None stands for a part that needs nothing
    member  : class of such a part
    gather  : makes a part from a namespace and a name
    default : name of the part where the document names none; of bodies, for a law that commands a velocity
    shared  : keys that mean the same for every kind, so that they stay when the kind changes; None: all of them
    take    : makes a part from other objects of the caller, if more than a member or a namespace is accepted
    """

    section: str
    noun: str
    shipped: Mapping[str, T | None]
    member: type[T]
    gather: Callable[[Any, str], T]
    default: str
    shared: tuple[str, ...] | None = ()
    take: Callable[[Any], T] | None = None

    @property
    def records(self) -> dict[str, type]:
        """Records of parameters by name, of those parts of the package that have their own."""
        own = {name: getattr(one, "Parameters", None) for name, one in self.shipped.items()}
        return {name: record for name, record in own.items() if record is not None}

    def named(self, kind: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[T | None, list[str]]:
        """Find a part by its name, or in a file, which runs only with trust; return it, or None, with the errors."""
        if isinstance(kind, str) and kind in self.shipped:
            return self.shipped[kind], []
        key = f"{self.section}.kind"
        # Only the ending makes a name a file: a misspelt name must never run code.
        if isinstance(kind, str) and kind.endswith(".py"):
            try:
                return build_from_file(self.gather, key, kind, folder, trust=trust), []
            except AirflockError as error:
                return None, str(error).splitlines()
        hint = suggest(kind, self.shipped, f"known: {', '.join(self.shipped)}, or a file that ends in .py", cutoff=0.4)
        return None, [f"{key} = {kind!r}: unknown {self.noun}; {hint}"]

    def from_caller(self, part: Any) -> tuple[T | None, list[str]]:
        """Make a part from a member, a namespace, a name or a file of the caller; return it, or None, with errors."""
        if isinstance(part, (str, os.PathLike)):
            return self.named(str(part), trust=True)
        if self.take is not None:
            return self.take(part), []
        return part if isinstance(part, self.member) else self.gather(part, ""), []

    def kind(self, document: Mapping[str, Any], default: str = "") -> Any:
        """Return the kind that a document names, also if it is a table with value and source."""
        table = document.get(self.section, {})
        default = default or self.default
        return value_of(table.get("kind", default)) if isinstance(table, Mapping) else default

    def kept(self, table: Mapping[str, Any], new_kind: str) -> dict[str, Any]:
        """Return the keys of a section that stay with another kind: all where both kinds have the same numbers."""
        before = self.kind({self.section: table})
        ours = [self.shipped[kind] for kind in (before, new_kind) if isinstance(kind, str) and kind in self.shipped]
        same_numbers = len(ours) == 2 and len({getattr(one, "Parameters", None) for one in ours}) == 1
        # Two kinds with one record (two bodies of the same numbers) keep all keys; else only the
        # shared ones have a meaning.
        every = self.shared is None or same_numbers or new_kind == before
        return {key: value for key, value in table.items() if key != "kind" and (every or key in (self.shared or ()))}


BODY_KIND = PartKind("body", "body", BODIES, Body, body, "multirotor")
METRIC_SET_KIND = PartKind(
    "metrics", "set of order parameters", SETS, MetricSet, metric_set, DEFAULT_SET, None, to_metric_set
)
SENSOR_KIND = PartKind("sensors", "sensor", SENSORS, Sensor, sensor, DEFAULT_SENSOR, ("period",))
RADIO_KIND = PartKind("radio", "radio", RADIOS, Radio, radio.radio, DEFAULT_RADIO, number_names(PacketParameters))
TOPOLOGY_KIND = PartKind("topology", "topology", TOPOLOGIES, Topology, topology, DEFAULT_TOPOLOGY)
PART_KINDS: tuple[PartKind[Any], ...] = (METRIC_SET_KIND, BODY_KIND, SENSOR_KIND, RADIO_KIND, TOPOLOGY_KIND)


@dataclass(frozen=True)
class CallerParts:
    """The parts that a caller gives in place of those that a document names; None and empty where it gives nothing.

    topology : a topology that is not of the package
    fault_kinds : kinds of fault that [[faults]] may name; laws : laws that [[groups]] may name
    """

    law: Model | None = None
    body: Body | None = None
    metrics: MetricSet | None = None
    sensors: Sensor | None = None
    radio: Radio | None = None
    topology: Topology | None = None
    fault_kinds: Mapping[str, Fault] = field(default_factory=dict)
    laws: Mapping[str, Model] = field(default_factory=dict)


NO_CALLER_PARTS = CallerParts()


def without_unknown_numbers(document: dict[str, Any], section: str, record: type) -> dict[str, Any]:
    """Return a document without those numbers of a section that the stand-in for a missing kind does not know."""
    known = {name for name, _, _ in declarations(record)} | {"kind"}
    given = document.get(section, {})
    if not isinstance(given, Mapping):
        return document
    return {**document, section: {key: value for key, value in given.items() if key in known}}


def model_table(document: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[str]]:
    """Return the section of the law; an empty one and an error where it is no table."""
    table = document.get("model", {})
    if isinstance(table, Mapping):
        return table, []
    return {}, [f"model = {table!r} is not a table; write model.kind = {table!r}"]


DESCENT = model(descent, "drag_descent")


def with_drag_descent(model: Model) -> Model:
    """Return a model with drag descent added to its command."""
    return add_laws(model, DESCENT)


def drag_descent_errors(model: Model) -> list[str]:
    """Return why drag descent cannot be added to a model, one line."""
    if model.flock is not None:
        return [f"aero: model {model.name} goes down the gradient of the drag by itself; leave the section [aero] out"]
    return [f"aero: {error}" for error in composition_errors(model, DESCENT)]


class ScenarioParts(NamedTuple):
    """The parts that fly a scenario; law is None where it is missing, topology where it is one of the package."""

    law: Model | None
    body: Body
    metrics: MetricSet
    sensors: Sensor
    radio: Radio
    topology: Topology | None

    @property
    def records(self) -> dict[str, type]:
        """Section → the record of parameters that checks it, without the law's."""
        own = {
            "body": self.body.Parameters, "sensors": self.sensors.Parameters, "radio": self.radio.Parameters,
            "metrics": self.metrics.Parameters,
        }  # fmt: skip
        topology = self.topology.Parameters if self.topology else None
        return SECTIONS | own | ({"topology": topology} if topology else {})


def collect_parts(
    document: dict[str, Any], caller_parts: CallerParts, folder: Path | None, *, trust: bool
) -> tuple[ScenarioParts, dict[str, Any], list[str]]:
    """Find all parts that a document names.

    Parameters
    ----------
    caller_parts : parts of the caller in place of those that the document names
    folder : of the scenario file, where files of code are looked for
    trust : True if code that the document names may run

    Returns
    -------
    The parts, with a stand-in for each missing one; the document without numbers that no stand-in knows; the errors.
    """

    def one(family: PartKind[T], mine: T | None, usual: str) -> tuple[T, list[str]]:
        """Return the caller's part or the document's; the default one, with errors, if it is missing."""
        if mine is not None:
            return mine, []
        parts, errors = family.named(family.kind(document, usual), folder, trust=trust)
        parts = family.shipped[usual] if parts is None else parts
        assert parts is not None, "the usual one is one of ours"
        return parts, errors

    law, errors = _law(document, caller_parts, folder, trust)
    # A law that commands an acceleration needs another default body than one that commands a
    # velocity.
    usual = default_body(law.command if law else "velocity")
    body, of_body = one(BODY_KIND, caller_parts.body, usual)
    of_body = of_body or body_law_errors(
        body, law, caller_parts.body.name if caller_parts.body else BODY_KIND.kind(document, usual)
    )
    # Check the rest of the document with a body that fits, so that one wrong name does not cause
    # ten more errors.
    if of_body and caller_parts.body is None:
        body = BODIES[usual]
    metrics, of_metrics = one(METRIC_SET_KIND, caller_parts.metrics, METRIC_SET_KIND.default)
    sensors, of_sensor = one(SENSOR_KIND, caller_parts.sensors, SENSOR_KIND.default)
    transmission, of_radio = one(RADIO_KIND, caller_parts.radio, RADIO_KIND.default)
    if of_radio:
        transmission = Radio(str(RADIO_KIND.kind(document)), PacketParameters)  # the common numbers are judged
    topology, of_topology = caller_parts.topology, list[str]()
    # Topologies of the package share one record, in which the kind is a choice; a file brings its
    # own record.
    if topology is None and str(kind := TOPOLOGY_KIND.kind(document)).endswith(".py"):
        topology, of_topology = TOPOLOGY_KIND.named(kind, folder, trust=trust)  # ours are judged as a choice
    parts = ScenarioParts(law, body, metrics, sensors, transmission, topology)
    errors_of = {
        "body": of_body,
        "metrics": of_metrics,
        "sensors": of_sensor,
        "radio": of_radio,
        "topology": of_topology,
    }
    # A stand-in knows other numbers than the part that is missing, so only the numbers of both are
    # checked.
    for section, more in errors_of.items():
        errors += more
        if more and section == "topology":
            document = {**document, section: {}}
        elif more:
            document = without_unknown_numbers(document, section, parts.records[section])
    return parts, document, errors


def _law(
    document: Mapping[str, Any], given: CallerParts, folder: Path | None, trust: bool
) -> tuple[Model | None, list[str]]:
    """Find the law, and add drag descent for a section [aero]; return it with the errors."""
    table, errors = model_table(document)
    law = given.law
    if law is None and not errors:
        try:
            law = find_law(table.get("kind"), folder, trust=trust)
        except AirflockError as error:
            errors += str(error).splitlines()
    if law is None or "aero" not in document:
        return law, errors
    # The section [aero] alone adds drag descent: no preset needs a second law for it.
    more = drag_descent_errors(law)
    return law if more else with_drag_descent(law), errors + more


def body_law_errors(body: Body, model: Model | None, kind: str) -> list[str]:
    """Return why a body cannot fly the command of a model, one line."""
    if model is None or body.accepts == model.command:
        return []
    taken = f"{'an' if body.accepts[0] in 'aeiou' else 'a'} {body.accepts}"
    return [
        f"body.kind = {kind!r} takes {taken}, but model {model.name} commands {model.command}; "
        f"body.kind = {default_body(model.command)!r} takes it"
    ]
