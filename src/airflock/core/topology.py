"""The contract of a topology, and its use on board: which of those whom an agent hears it meets."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from airflock.core.agent import HeardNeighbour, State
from airflock.core.contract import namespace_names
from airflock.core.maths import FAR, TINY
from airflock.core.parameters import Choice, Parameters, declarations
from airflock.core.vocabulary import argument_names, call_rule
from airflock.support import RuleError


@dataclass(frozen=True, kw_only=True)
class NoParameters(Parameters):
    """No number."""


class SightProtocol(Protocol):
    """A world that hides agents from each other."""

    def is_blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float, /) -> bool:
        """Whether something stands between two places, m."""


@dataclass(frozen=True)
class Topology:
    """A kind of topology: one plain function over rows, that asks by name (`core.vocabulary`).

    name : how scenarios refer to it
    meet : fills the row `met` with 1.0 for whom the agent meets
    flat : it is defined in a plane only
    near : whom it lets through within any distance depends on nobody farther: then cells as wide as a law's reach do
    Parameters : record of its numbers; those that a scenario can name share one
    violates   : truths of `airflock.check_topology` that do not hold for it, and why (VIOLATES)
    """

    name: str
    meet: Callable[..., None]
    flat: bool = False
    near: bool = False
    Parameters: type | None = None
    violates: Mapping[str, str] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.name, self.meet))

    def asks_for(self, name: str) -> bool:
        """Whether the rule asks for something by this name."""
        return name in argument_names(self.meet, "meet", self.name)


def topology(namespace: Any, name: str = "") -> Topology:
    """Gather a topology of a user's own from a module, a class or a mapping of names.

    namespace : holds the rule meet, and if it likes Parameters (numbers only), FLAT, NEAR and VIOLATES

    Raises RuleError if it has no such rule, or one that asks for what there is not.
    """
    found, name = namespace_names(namespace, name)
    rule, record = found.get("meet"), found.get("Parameters", NoParameters)
    if not callable(rule):
        raise RuleError(f"topology {name} has no rule; give meet(n, r2, met), which fills met")
    if "met" not in argument_names(rule, "meet", name):
        raise RuleError(f"topology {name}: meet does not ask for met, the row that it fills")
    if not (isinstance(record, type) and issubclass(record, Parameters)):
        raise RuleError(f"topology {name}: Parameters is not a frozen dataclass derived from airflock.Parameters")
    words = [word for word, declared, _ in declarations(record) if isinstance(declared, Choice)]
    if words:
        raise RuleError(f"topology {name}: Parameters.{words[0]} is a choice; a topology has numbers only")
    near, flat = bool(found.get("NEAR", False)), bool(found.get("FLAT", False))
    return Topology(name, rule, flat, near, record, dict(found.get("VIOLATES", {})))


def met_neighbours(
    topology: Topology | None,
    t: Any,
    own: State,
    heard: Iterable[HeardNeighbour],
    place: SightProtocol | None = None,
) -> list[HeardNeighbour]:
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
    if place is not None and topology.asks_for("hidden"):
        hidden = [1.0 if place.is_blocked(x, y, z, h.state.x, h.state.y, h.state.z) else 0.0 for h in found]
    met = [0.0] * count
    given = {
        "n": count, "r2": squares, "hidden": hidden, "fade": [h.fade for h in found], "met": met, "t": t,
        "dx": [d[0] for d in offsets], "dy": [d[1] for d in offsets], "dz": [d[2] for d in offsets],
        "heap": [FAR] * count, "weak": [FAR] * count,
    }  # fmt: skip
    call_rule(topology.meet, "meet", given, topology.name)
    return [h for h, taken in zip(found, met, strict=True) if taken > 0.5]
