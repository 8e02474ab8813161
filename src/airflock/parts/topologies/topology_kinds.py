"""The topologies that a scenario can name: the key topology.kind. An agent that meets all it hears has none."""

from dataclasses import replace
from typing import Any

from airflock.core import Topology, find_members, topology


def _with_shared_numbers(namespace: Any) -> Topology:
    """Gather a topology of the package, whose numbers are those of the section [topology]."""
    return replace(topology(namespace), Parameters=None)


DEFAULT_TOPOLOGY = "range"  # the topology of a scenario without topology.kind
TOPOLOGIES: dict[str, Topology | None] = {
    DEFAULT_TOPOLOGY: None,
    **find_members("airflock.parts.topologies", ["meet"], _with_shared_numbers),
}
