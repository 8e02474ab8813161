"""The contract of a topology, and its use on board: which of those whom an agent hears it meets."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from airflock.core.agent import Heard, State
from airflock.core.maths import FAR, TINY
from airflock.core.vocabulary import asks


class Seen(Protocol):
    """A world that hides agents from each other."""

    def blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float, /) -> bool:
        """Whether something stands between two places, m."""


@dataclass(frozen=True)
class Topology:
    """A kind of topology: one plain function over rows, that asks by name (`core.vocabulary`).

    name : how scenarios refer to it
    meet : fills the row `met` with 1.0 for whom the agent meets
    flat : it is defined in a plane only
    near : whom it lets through within any distance depends on nobody farther: then cells as wide as a law's reach do
    """

    name: str
    meet: Callable[..., None]
    flat: bool = False
    near: bool = False

    def __hash__(self) -> int:
        return hash((self.name, self.meet))

    def asks(self, name: str) -> bool:
        """Whether the rule asks for something by this name."""
        return name in asks(self.meet, "meet", self.name)


def met_of(
    topology: Topology | None,
    t: Any,
    own: State,
    heard: Iterable[Heard],
    place: Seen | None = None,
) -> list[Heard]:
    """Those among the heard whom an agent meets, in their order.

    topology, t : kind and its parameters; None: all
    own         : own state as measured
    heard       : everybody whom it hears, at the image that it is met at
    place       : the world, asked whether something stands in between; None: nothing stands anywhere
    """
    found = list(heard)
    if topology is None or not found:
        return found
    x, y, z = own.x, own.y, own.z
    offsets = [(h.state.x - x, h.state.y - y, h.state.z - z) for h in found]
    count = len(found)
    squares = [dx * dx + dy * dy + dz * dz + TINY for dx, dy, dz in offsets]
    hidden = [0.0] * count
    if place is not None and topology.asks("hidden"):
        hidden = [1.0 if place.blocked(x, y, z, h.state.x, h.state.y, h.state.z) else 0.0 for h in found]
    met = [0.0] * count
    given = {
        "n": count, "r2": squares, "hidden": hidden, "fade": [h.fade for h in found], "met": met, "t": t,
        "dx": [d[0] for d in offsets], "dy": [d[1] for d in offsets], "dz": [d[2] for d in offsets],
        "heap": [FAR] * count, "weak": [FAR] * count,
    }  # fmt: skip
    topology.meet(*(given[name] for name in asks(topology.meet, "meet", topology.name)))
    return [h for h, taken in zip(found, met, strict=True) if taken > 0.5]
