"""Families: what a section of a scenario names by its key `kind`, a body, a sensor, a radio: ours, or one of a file.

Also what a caller gives in place of that: which is consent to run it.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from airflock.core.contract import Body, MetricSet, Model, body
from airflock.core.fault import Fault
from airflock.core.parameters import number_names
from airflock.core.radio import Packets, Radio, radio
from airflock.core.sensor import Sensor, sensor
from airflock.core.topology import Topology, topology
from airflock.parts.bodies.registry import BODIES
from airflock.parts.metrics.registry import SETS, as_set, metric_set
from airflock.parts.metrics.registry import USUAL as USUAL_SET
from airflock.parts.radios.registry import RADIOS
from airflock.parts.radios.registry import USUAL as USUAL_RADIO
from airflock.parts.sensors.registry import SENSORS
from airflock.parts.sensors.registry import USUAL as USUAL_SENSOR
from airflock.parts.topologies.registry import TOPOLOGIES
from airflock.parts.topologies.registry import USUAL as USUAL_TOPOLOGY
from airflock.scenarios.own_code import made_of
from airflock.scenarios.schema import value_of
from airflock.support.errors import AirflockError
from airflock.support.spelling import meant

T = TypeVar("T")


@dataclass(frozen=True)
class Family(Generic[T]):
    """What a section may name.

    section : of a document; field: of a Scenario and of `Given`; noun: in messages
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
    known: Mapping[str, T | None]
    member: type[T]
    gather: Callable[[Any, str], T]
    usual: str
    shared: tuple[str, ...] | None = ()
    take: Callable[[Any], T] | None = None

    @property
    def records(self) -> dict[str, type]:
        """Records of parameters of ours that have one of their own, by the kind."""
        own = {name: getattr(one, "Parameters", None) for name, one in self.known.items()}
        return {name: record for name, record in own.items() if record is not None}

    def named(self, kind: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[T | None, list[str]]:
        """One of ours by its name, or one of a file, which runs only with trust; and why it cannot be had."""
        if isinstance(kind, str) and kind in self.known:
            return self.known[kind], []
        key = f"{self.section}.kind"
        if isinstance(kind, str) and kind.endswith(".py"):
            try:
                return made_of(self.gather, key, kind, folder, trust=trust), []
            except AirflockError as fault:
                return None, str(fault).splitlines()
        hint = meant(kind, self.known, f"known: {', '.join(self.known)}, or a file that ends in .py", cutoff=0.4)
        return None, [f"{key} = {kind!r}: unknown {self.noun}; {hint}"]

    def given(self, what: Any) -> tuple[T | None, list[str]]:
        """What a caller gives: a member, a namespace, or a name or file; and why it cannot be had."""
        if isinstance(what, (str, os.PathLike)):
            return self.named(str(what), trust=True)
        if self.take is not None:
            return self.take(what), []
        return what if isinstance(what, self.member) else self.gather(what, ""), []

    def kind(self, document: Mapping[str, Any], usual: str = "") -> Any:
        """The kind that a document names, which may be written as a table with value and source."""
        table = document.get(self.section, {})
        usual = usual or self.usual
        return value_of(table.get("kind", usual)) if isinstance(table, Mapping) else usual

    def kept(self, table: Mapping[str, Any], other: str) -> dict[str, Any]:
        """The keys of a section that stay when its kind becomes another: all where both have the same numbers."""
        before = self.kind({self.section: table})
        ours = [self.known[kind] for kind in (before, other) if isinstance(kind, str) and kind in self.known]
        alike = len(ours) == 2 and len({getattr(one, "Parameters", None) for one in ours}) == 1
        every = self.shared is None or alike or other == before
        return {key: value for key, value in table.items() if key != "kind" and (every or key in (self.shared or ()))}


BODY = Family("body", "vehicle", "body", BODIES, Body, body, "multirotor")
METRICS = Family("metrics", "measures", "set of order parameters", SETS, MetricSet, metric_set, USUAL_SET, None, as_set)
SENSOR = Family("sensors", "sensor", "sensor", SENSORS, Sensor, sensor, USUAL_SENSOR, ("period",))
RADIO = Family("radio", "transceiver", "radio", RADIOS, Radio, radio, USUAL_RADIO, number_names(Packets))
TOPOLOGY = Family("topology", "own_topology", "topology", TOPOLOGIES, Topology, topology, USUAL_TOPOLOGY)
FAMILIES: tuple[Family[Any], ...] = (METRICS, BODY, SENSOR, RADIO, TOPOLOGY)


@dataclass(frozen=True)
class Given:
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
    kinds: Mapping[str, Fault] = field(default_factory=dict)
    laws: Mapping[str, Model] = field(default_factory=dict)


NOTHING = Given()
