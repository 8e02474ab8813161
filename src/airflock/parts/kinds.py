"""The kinds of parts that fly: each finds its members in its folder and in installed packages.

Those that measure are beside the metrics, which are not on board.
"""

from airflock.core import (
    FAULT_RULES,
    Body,
    Fault,
    Kind,
    Model,
    PacketParameters,
    Radio,
    Sensor,
    Topology,
    body,
    fault,
    model,
    number_names,
    radio,
    sensor,
    topology,
)
from airflock.parts.radios.constant import CONSTANT

PARTS = "airflock.parts."


LAWS = Kind(f"{PARTS}laws", "model", model, Model, (), "model", "vasarhelyi_2018", check="check_model")
BODIES = Kind(f"{PARTS}bodies", "body", body, Body, ("ACCEPTS",), "body", "multirotor", check="check_body")
SENSORS = Kind(
    f"{PARTS}sensors", "sensor", sensor, Sensor, ("measure", "error"), "sensors", "langevin",
    shared=("period",), check="check_sensor",
)  # fmt: skip
RADIOS = Kind(
    f"{PARTS}radios", "radio", radio.radio, Radio, ("missed", "receive", "late", "see"), "radio", "constant",
    fixed={"constant": CONSTANT}, shared=number_names(PacketParameters), check="check_radio",
)  # fmt: skip
TOPOLOGIES = Kind(
    f"{PARTS}topologies", "topology", topology, Topology, ("meet",), "topology", "range",
    fixed={"range": None}, shares=True, check="check_topology",
)  # fmt: skip
FAULTS = Kind(f"{PARTS}faults", "kind of fault", fault, Fault, FAULT_RULES, check="check_fault")

# A law that commands an acceleration needs another body than one that commands a velocity.
DEFAULT_BODIES = {"velocity": BODIES.default, "acceleration": "steered", "heading": "heading"}


def default_body(command: str) -> str:
    """Return the name of the body that a scenario without body.kind flies, for a law that gives this command."""
    return DEFAULT_BODIES[command]
