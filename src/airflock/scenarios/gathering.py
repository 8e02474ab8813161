"""Gathering: the law, the body, the sensor, the radio, the topology and the order parameters that a document names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from airflock.core import Body, MetricSet, Model, PacketParameters, Radio, Sensor, Topology
from airflock.parts.bodies import BODIES, default_body
from airflock.scenarios import wings
from airflock.scenarios.document import model_table, without_unknown_numbers
from airflock.scenarios.families import (
    BODY_KIND,
    METRIC_SET_KIND,
    RADIO_KIND,
    SENSOR_KIND,
    TOPOLOGY_KIND,
    CallerParts,
    PartKind,
)
from airflock.scenarios.laws import find_law
from airflock.scenarios.sections import SECTIONS
from airflock.support import AirflockError

T = TypeVar("T")


class ScenarioParts(NamedTuple):
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


def collect_parts(
    document: dict[str, Any], caller_parts: CallerParts, folder: Path | None, *, trust: bool
) -> tuple[ScenarioParts, dict[str, Any], list[str]]:
    """What flies a document; the document without numbers that nobody can judge; and what is wrong with it.

    given : what the caller gives in place of what the document names
    trust : whether code that the document names may run
    """

    def one(family: PartKind[T], mine: T | None, usual: str) -> tuple[T, list[str]]:
        """What the caller gives or the document names; in place of what cannot be had the usual one."""
        if mine is not None:
            return mine, []
        found, faults = family.named(family.kind(document, usual), folder, trust=trust)
        found = family.shipped[usual] if found is None else found
        assert found is not None, "the usual one is one of ours"
        return found, faults

    law, faults = _law(document, caller_parts, folder, trust)
    usual = default_body(law.command if law else "velocity")
    vehicle, of_body = one(BODY_KIND, caller_parts.vehicle, usual)
    of_body = of_body or body_law_errors(
        vehicle, law, caller_parts.vehicle.name if caller_parts.vehicle else BODY_KIND.kind(document, usual)
    )
    if of_body and caller_parts.vehicle is None:
        vehicle = BODIES[usual]
    measures, of_metrics = one(METRIC_SET_KIND, caller_parts.measures, METRIC_SET_KIND.default)
    sensor, of_sensor = one(SENSOR_KIND, caller_parts.sensor, SENSOR_KIND.default)
    transceiver, of_radio = one(RADIO_KIND, caller_parts.transceiver, RADIO_KIND.default)
    if of_radio:
        transceiver = Radio(str(RADIO_KIND.kind(document)), PacketParameters)  # the common numbers are judged
    own_topology, of_topology = caller_parts.own_topology, list[str]()
    if own_topology is None and str(kind := TOPOLOGY_KIND.kind(document)).endswith(".py"):
        own_topology, of_topology = TOPOLOGY_KIND.named(kind, folder, trust=trust)  # ours are judged as a choice
    found = ScenarioParts(law, vehicle, measures, sensor, transceiver, own_topology)
    told = {"body": of_body, "metrics": of_metrics, "sensors": of_sensor, "radio": of_radio, "topology": of_topology}
    for section, more in told.items():
        faults += more
        if more and section == "topology":
            document = {**document, section: {}}
        elif more:
            document = without_unknown_numbers(document, section, found.records[section])
    return found, document, faults


def _law(
    document: Mapping[str, Any], given: CallerParts, folder: Path | None, trust: bool
) -> tuple[Model | None, list[str]]:
    """The law, with drag descent added where the document has a section for it; and what is wrong with it."""
    table, faults = model_table(document)
    found = given.law
    if found is None and not faults:
        try:
            found = find_law(table.get("kind"), folder, trust=trust)
        except AirflockError as fault:
            faults += str(fault).splitlines()
    if found is None or "aero" not in document:
        return found, faults
    more = wings.drag_descent_errors(found)
    return found if more else wings.with_drag_descent(found), faults + more


def body_law_errors(body: Body, model: Model | None, kind: str) -> list[str]:
    """Why a body cannot fly what a model commands, one line."""
    if model is None or body.accepts == model.command:
        return []
    taken = f"{'an' if body.accepts[0] in 'aeiou' else 'a'} {body.accepts}"
    return [
        f"body.kind = {kind!r} takes {taken}, but model {model.name} commands {model.command}; "
        f"body.kind = {default_body(model.command)!r} takes it"
    ]
