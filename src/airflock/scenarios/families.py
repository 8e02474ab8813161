"""Families: what a section of a scenario names by its key `kind`, a body, a sensor, a radio: ours, or one of a file.

Also what a caller gives in place of that: which is consent to run it.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from airflock.core import (
    Body,
    Fault,
    MetricSet,
    Model,
    PacketParameters,
    Radio,
    Sensor,
    Topology,
    body,
    number_names,
    radio,
    sensor,
    topology,
)
from airflock.parts.bodies import BODIES
from airflock.parts.metrics import DEFAULT_SET as USUAL_SET, SETS, metric_set, to_metric_set
from airflock.parts.radios import DEFAULT_RADIO as USUAL_RADIO, RADIOS
from airflock.parts.sensors import DEFAULT_SENSOR as USUAL_SENSOR, SENSORS
from airflock.parts.topologies import DEFAULT_TOPOLOGY as USUAL_TOPOLOGY, TOPOLOGIES
from airflock.scenarios.own_code import build_from_file
from airflock.scenarios.schema import value_of
from airflock.support import AirflockError, suggest

T = TypeVar("T")


@dataclass(frozen=True)
class PartKind(Generic[T]):
    """What a section may name.

    section : of a document; field: of a Scenario and of `CallerParts`; noun: in messages
    known   : ours by name; None is one that asks for nothing
    member  : class of what is found
    gather  : from a namespace and a name
    usual   : name of the one where nothing is said; of bodies, for a law that commands a velocity
    shared  : keys that mean the same for every kind, so that they stay when the kind changes; None: all of them
    take    : from what a caller gives, if that is more than a member or a namespace
    """

    section: str
    field: str
    noun: str
    shipped: Mapping[str, T | None]
    member: type[T]
    gather: Callable[[Any, str], T]
    default: str
    shared: tuple[str, ...] | None = ()
    take: Callable[[Any], T] | None = None

    @property
    def records(self) -> dict[str, type]:
        """Records of parameters of ours that have one of their own, by the kind."""
        own = {name: getattr(one, "Parameters", None) for name, one in self.shipped.items()}
        return {name: record for name, record in own.items() if record is not None}

    def named(self, kind: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[T | None, list[str]]:
        """One of ours by its name, or one of a file, which runs only with trust; and why it cannot be had."""
        if isinstance(kind, str) and kind in self.shipped:
            return self.shipped[kind], []
        key = f"{self.section}.kind"
        if isinstance(kind, str) and kind.endswith(".py"):
            try:
                return build_from_file(self.gather, key, kind, folder, trust=trust), []
            except AirflockError as fault:
                return None, str(fault).splitlines()
        hint = suggest(kind, self.shipped, f"known: {', '.join(self.shipped)}, or a file that ends in .py", cutoff=0.4)
        return None, [f"{key} = {kind!r}: unknown {self.noun}; {hint}"]

    def from_caller(self, part: Any) -> tuple[T | None, list[str]]:
        """What a caller gives: a member, a namespace, or a name or file; and why it cannot be had."""
        if isinstance(part, (str, os.PathLike)):
            return self.named(str(part), trust=True)
        if self.take is not None:
            return self.take(part), []
        return part if isinstance(part, self.member) else self.gather(part, ""), []

    def kind(self, document: Mapping[str, Any], default: str = "") -> Any:
        """The kind that a document names, which may be written as a table with value and source."""
        table = document.get(self.section, {})
        default = default or self.default
        return value_of(table.get("kind", default)) if isinstance(table, Mapping) else default

    def kept(self, table: Mapping[str, Any], new_kind: str) -> dict[str, Any]:
        """The keys of a section that stay when its kind becomes another: all where both have the same numbers."""
        before = self.kind({self.section: table})
        ours = [self.shipped[kind] for kind in (before, new_kind) if isinstance(kind, str) and kind in self.shipped]
        alike = len(ours) == 2 and len({getattr(one, "Parameters", None) for one in ours}) == 1
        every = self.shared is None or alike or new_kind == before
        return {key: value for key, value in table.items() if key != "kind" and (every or key in (self.shared or ()))}


BODY_KIND = PartKind("body", "vehicle", "body", BODIES, Body, body, "multirotor")
METRIC_SET_KIND = PartKind(
    "metrics", "measures", "set of order parameters", SETS, MetricSet, metric_set, USUAL_SET, None, to_metric_set
)
SENSOR_KIND = PartKind("sensors", "sensor", "sensor", SENSORS, Sensor, sensor, USUAL_SENSOR, ("period",))
RADIO_KIND = PartKind(
    "radio", "transceiver", "radio", RADIOS, Radio, radio.radio, USUAL_RADIO, number_names(PacketParameters)
)
TOPOLOGY_KIND = PartKind("topology", "own_topology", "topology", TOPOLOGIES, Topology, topology, USUAL_TOPOLOGY)
PART_KINDS: tuple[PartKind[Any], ...] = (METRIC_SET_KIND, BODY_KIND, SENSOR_KIND, RADIO_KIND, TOPOLOGY_KIND)


@dataclass(frozen=True)
class CallerParts:
    """What a caller gives in place of what a document names; None and empty where it gives nothing.

    own_topology : one that is none of ours
    kinds : kinds of fault that [[faults]] may name; laws : laws that [[groups]] may name
    """

    law: Model | None = None
    vehicle: Body | None = None
    measures: MetricSet | None = None
    sensor: Sensor | None = None
    transceiver: Radio | None = None
    own_topology: Topology | None = None
    fault_kinds: Mapping[str, Fault] = field(default_factory=dict)
    laws: Mapping[str, Model] = field(default_factory=dict)


NO_CALLER_PARTS = CallerParts()
