"""Gathering: the law, the body, the sensor, the radio, the topology and the order parameters that a document names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from airflock.core.contract import Body, MetricSet, Model
from airflock.core.radio import Packets, Radio
from airflock.core.sensor import Sensor
from airflock.core.topology import Topology
from airflock.parts.bodies.registry import BODIES, body_for
from airflock.scenarios import wings
from airflock.scenarios.document import model_table, understood
from airflock.scenarios.families import BODY, METRICS, RADIO, SENSOR, TOPOLOGY, Family, Given
from airflock.scenarios.laws import find_model
from airflock.scenarios.sections import SECTIONS
from airflock.support.errors import AirflockError

T = TypeVar("T")


class Gathered(NamedTuple):
    """What flies a scenario; the law is None where it cannot be had, own_topology where it is one of ours."""

    law: Model | None
    vehicle: Body
    measures: MetricSet
    sensor: Sensor
    transceiver: Radio
    own_topology: Topology | None

    @property
    def records(self) -> dict[str, type]:
        """Section → the record of parameters that judges it, but for the law's."""
        own = {
            "body": self.vehicle.Parameters, "sensors": self.sensor.Parameters, "radio": self.transceiver.Parameters,
            "metrics": self.measures.Parameters,
        }  # fmt: skip
        topology = self.own_topology.Parameters if self.own_topology else None
        return SECTIONS | own | ({"topology": topology} if topology else {})


def gathered(
    document: dict[str, Any], given: Given, folder: Path | None, *, trust: bool
) -> tuple[Gathered, dict[str, Any], list[str]]:
    """What flies a document; the document without numbers that nobody can judge; and what is wrong with it.

    given : what the caller gives in place of what the document names
    trust : whether code that the document names may run
    """

    def one(family: Family[T], mine: T | None, usual: str) -> tuple[T, list[str]]:
        """What the caller gives or the document names; in place of what cannot be had the usual one."""
        if mine is not None:
            return mine, []
        found, faults = family.named(family.kind(document, usual), folder, trust=trust)
        found = family.known[usual] if found is None else found
        assert found is not None, "the usual one is one of ours"
        return found, faults

    law, faults = _law(document, given, folder, trust)
    usual = body_for(law.command if law else "velocity")
    vehicle, of_body = one(BODY, given.vehicle, usual)
    of_body = of_body or carries(vehicle, law, given.vehicle.name if given.vehicle else BODY.kind(document, usual))
    if of_body and given.vehicle is None:
        vehicle = BODIES[usual]
    measures, of_metrics = one(METRICS, given.measures, METRICS.usual)
    sensor, of_sensor = one(SENSOR, given.sensor, SENSOR.usual)
    transceiver, of_radio = one(RADIO, given.transceiver, RADIO.usual)
    if of_radio:
        transceiver = Radio(str(RADIO.kind(document)), Packets)  # the common numbers are judged
    own_topology, of_topology = given.own_topology, list[str]()
    if own_topology is None and str(kind := TOPOLOGY.kind(document)).endswith(".py"):
        own_topology, of_topology = TOPOLOGY.named(kind, folder, trust=trust)  # ours are judged as a choice
    found = Gathered(law, vehicle, measures, sensor, transceiver, own_topology)
    told = {"body": of_body, "metrics": of_metrics, "sensors": of_sensor, "radio": of_radio, "topology": of_topology}
    for section, more in told.items():
        faults += more
        if more and section == "topology":
            document = {**document, section: {}}
        elif more:
            document = understood(document, section, found.records[section])
    return found, document, faults


def _law(document: Mapping[str, Any], given: Given, folder: Path | None, trust: bool) -> tuple[Model | None, list[str]]:
    """The law, with drag descent added where the document has a section for it; and what is wrong with it."""
    table, faults = model_table(document)
    found = given.law
    if found is None and not faults:
        try:
            found = find_model(table.get("kind"), folder, trust=trust)
        except AirflockError as fault:
            faults += str(fault).splitlines()
    if found is None or "aero" not in document:
        return found, faults
    more = wings.descent_faults(found)
    return found if more else wings.descending(found), faults + more


def carries(carried: Body, found: Model | None, kind: str) -> list[str]:
    """Why a body cannot fly what a model commands, one line."""
    if found is None or carried.accepts == found.command:
        return []
    taken = f"{'an' if carried.accepts[0] in 'aeiou' else 'a'} {carried.accepts}"
    return [
        f"body.kind = {kind!r} takes {taken}, but model {found.name} commands {found.command}; "
        f"body.kind = {body_for(found.command)!r} takes it"
    ]
