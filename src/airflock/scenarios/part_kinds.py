"""Kinds of parts: the law, body, sensor, radio, topology and metric set that a document names or a caller gives.

A section names its part by the key `kind`: one of the package, or a Python file of the user's own,
which runs only with trust. A part that the caller gives replaces that of the document; giving it is
consent to run it.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from airflock.core import (
    Fault,
    Kind,
    Model,
    PacketParameters,
    Radio,
    Topology,
    add_laws,
    composition_errors,
    declarations,
    model,
)
from airflock.parts import BODIES, RADIOS, SENSORS, SETS, TOPOLOGIES, default_body
from airflock.parts.aero import descent
from airflock.parts.steering import law_for_command
from airflock.scenarios.named_code import build_from_file, find_law
from airflock.scenarios.schema import value_of
from airflock.scenarios.sections import SECTIONS
from airflock.support import INVALID, ErrorCollector

T = TypeVar("T")
PART_KINDS: tuple[Kind[Any], ...] = (SETS, BODIES, SENSORS, RADIOS, TOPOLOGIES)  # those that a section names


def part_by_name(
    kind: Kind[T], name: Any, errors: ErrorCollector, folder: Path | None = None, *, trust: bool = False
) -> T:
    """Find a part by its name, or in a file, which runs only with trust; INVALID where there is none."""
    if name in kind:
        return kind[name]
    key = f"{kind.section}.kind".lstrip(".")
    # Only the ending makes a name a file: a misspelt name must never run code.
    if isinstance(name, str) and name.endswith(".py"):
        return errors.read(build_from_file, kind.make, key, name, folder, trust=trust)
    errors.add(f"{key} = {name!r}: {kind.unknown(name, ', or a file that ends in .py')}")
    return INVALID  # type: ignore[no-any-return]


def part_from_caller(kind: Kind[T], part: Any) -> tuple[T | None, list[str]]:
    """Make a part from a member, a namespace, a name or a file of the caller; return it, or None, with errors."""
    if isinstance(part, (str, os.PathLike)):
        errors = ErrorCollector()
        named = part_by_name(kind, str(part), errors, trust=True)
        return (None if named is INVALID else named), errors.errors
    if kind.take is not None:
        return kind.take(part), []
    return part if isinstance(part, kind.member) else kind.make(part, ""), []


def named_kind(kind: Kind[Any], document: Mapping[str, Any], default: str = "") -> Any:
    """Return the part that a document names, also if it is a table with value and source."""
    table = document.get(kind.section, {})
    default = default or kind.default
    return value_of(table.get("kind", default)) if isinstance(table, Mapping) else default


def kept_keys(kind: Kind[Any], table: Mapping[str, Any], new: str) -> dict[str, Any]:
    """Return the keys of a section that stay with another part: all where both have the same numbers."""
    before = named_kind(kind, {kind.section: table})
    ours = [kind[name] for name in (before, new) if name in kind]
    same_numbers = len(ours) == 2 and len({getattr(one, "Parameters", None) for one in ours}) == 1
    # Two parts with one record (two bodies of the same numbers) keep all keys; else only the shared
    # ones have a meaning.
    every = kind.shared is None or same_numbers or new == before
    return {key: value for key, value in table.items() if key != "kind" and (every or key in (kind.shared or ()))}


@dataclass(frozen=True)
class CallerParts:
    """The parts of a scenario that a caller gives in place of those of its document; `collect_parts` finds the others.

    topology : a topology that is not of the package
    fault_kinds : kinds of fault that [[faults]] may name; laws : laws that [[groups]] may name
    """

    law: Model | None = None
    body: Any = None  # a Body, MetricSet, Sensor and Radio; None until they are collected
    metrics: Any = None
    sensors: Any = None
    radio: Any = None
    topology: Topology | None = None
    fault_kinds: Mapping[str, Fault] = field(default_factory=dict)
    laws: Mapping[str, Model] = field(default_factory=dict)

    @property
    def records(self) -> dict[str, type]:
        """Section → the record of parameters that checks it, without the law's."""
        own = {kind.section: getattr(self, kind.section) for kind in PART_KINDS}
        return SECTIONS | {section: part.Parameters for section, part in own.items() if part and part.Parameters}


NO_CALLER_PARTS = CallerParts()


def without_unknown_numbers(document: dict[str, Any], section: str, record: type) -> dict[str, Any]:
    """Return a document without those numbers of a section that the stand-in for a missing kind does not know."""
    known = {name for name, _, _ in declarations(record)} | {"kind"}
    given = document.get(section, {})
    if not isinstance(given, Mapping):
        return document
    return {**document, section: {key: value for key, value in given.items() if key in known}}


DESCENT = model(descent, "drag_descent")


def drag_descent_errors(model: Model) -> list[str]:
    """Return why drag descent cannot be added to a model, one line."""
    if model.flock is not None:
        return [f"aero: model {model.name} goes down the gradient of the drag by itself; leave the section [aero] out"]
    return [f"aero: {error}" for error in composition_errors(model, DESCENT)]


def collect_parts(
    document: dict[str, Any], caller_parts: CallerParts, folder: Path | None, errors: ErrorCollector, *, trust: bool
) -> tuple[CallerParts, dict[str, Any]]:
    """Find all parts that a document names.

    Parameters
    ----------
    caller_parts : parts of the caller in place of those that the document names
    folder : of the scenario file, where files of code are looked for
    trust : True if code that the document names may run

    Returns
    -------
    All parts, with a stand-in for each missing one; the document without numbers that no stand-in knows.
    """
    missing: list[str] = []

    def one(kind: Kind[T], mine: T | None, usual: str = "") -> T:
        """Return the caller's part or the document's; the default one if it is missing."""
        if mine is not None:
            return mine
        part = part_by_name(kind, named_kind(kind, document, usual), errors, folder, trust=trust)
        if part is INVALID:
            missing.append(kind.section)
            return kind[usual or kind.default]
        return part

    law = _law(document, caller_parts, folder, errors, trust)
    # A law that commands an acceleration needs another default body than one that commands a
    # velocity.
    usual = default_body(law.command if law else "velocity")
    body = one(BODIES, caller_parts.body, usual)
    if law is not None and "body" not in missing:
        with errors.collecting():
            law = law_for_command(law, body.accepts)
    if law is not None and "aero" in document:
        # The section [aero] alone adds drag descent: no preset needs a second law for it. It adds to
        # what the body takes, so the law's command is converted before.
        more = drag_descent_errors(law)
        errors.add(*more)
        law = law if more else add_laws(law, DESCENT)
    metrics = one(SETS, caller_parts.metrics)
    sensors = one(SENSORS, caller_parts.sensors)
    transmission = one(RADIOS, caller_parts.radio)
    if "radio" in missing:
        transmission = Radio(str(named_kind(RADIOS, document)), PacketParameters)  # the common numbers are judged
    topology = caller_parts.topology
    # Topologies without numbers of their own share one record, in which the kind is a choice, and
    # are judged as that.
    name = named_kind(TOPOLOGIES, document)
    own = getattr(TOPOLOGIES.get(str(name)), "Parameters", None)
    if topology is None and (own is not None or str(name).endswith(".py")):
        topology = part_by_name(TOPOLOGIES, name, errors, folder, trust=trust)
        if topology is INVALID:
            topology, document = None, {**document, "topology": {}}
    parts = replace(
        caller_parts, law=law, body=body, metrics=metrics, sensors=sensors, radio=transmission, topology=topology
    )
    # A stand-in knows other numbers than the part that is missing, so only the numbers of both are
    # checked.
    for section in missing:
        document = without_unknown_numbers(document, section, parts.records[section])
    return parts, document


def _law(
    document: Mapping[str, Any], given: CallerParts, folder: Path | None, errors: ErrorCollector, trust: bool
) -> Model | None:
    """Find the law; None where it is missing."""
    table, law = document.get("model", {}), given.law
    if not isinstance(table, Mapping):
        errors.add(f"model = {table!r} is not a table; write model.kind = {table!r}")
    elif law is None:
        with errors.collecting():
            law = find_law(table.get("kind"), folder, trust=trust)
    return law
