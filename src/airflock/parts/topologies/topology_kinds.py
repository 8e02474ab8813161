"""The topologies that a scenario can name: the key topology.kind. An agent that meets all it hears has none."""

from airflock.core import Topology
from airflock.parts.topologies import nearest, strongest, visible, voronoi

TOPOLOGIES: dict[str, Topology | None] = {
    "range": None,
    "nearest": Topology("nearest", nearest.meet, near=True),
    "voronoi": Topology("voronoi", voronoi.meet, flat=True),
    "visible": Topology("visible", visible.meet, near=True),
    "strongest": Topology("strongest", strongest.meet),
}
DEFAULT_TOPOLOGY = "range"  # the topology of a scenario without topology.kind
