"""The contract of a topology: the rule that selects, among the heard neighbours of an agent, those that it meets."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from airflock.core.contract import argument_names, gather, namespace_names
from airflock.core.parameters import Choice, Parameters, declarations
from airflock.support import RuleError

RULES = {
    "meet": {
        "n": "number of others",
        "dx": "offsets to the others as believed, east, m; dx[j] is that to number j",
        "dy": "offsets to the others as believed, north, m; dy[j] is that to number j",
        "dz": "offsets to the others as believed, up, m; dz[j] is that to number j",
        "r2": "squares of their lengths, m²; 1e30 of whom is not heard",
        "hidden": "1.0 of whom something hides that stands in the world, else 0.0",
        "fade": "normal random numbers of the signals",
        "met": "to fill: 1.0 for whom the agent meets, else 0.0",
        "heap": "scratch of n numbers",
        "weak": "scratch of n further numbers",
        "t": "the topology's parameters",
    },
}


@dataclass(frozen=True)
class Topology:
    """A kind of topology: one plain function over rows, whose argument names are its requests (`core.vocabulary`).

    name : how scenarios refer to it
    meet : fills the row `met` with 1.0 for each neighbour that the agent meets
    flat : it is defined in a plane only
    near : its choice within any distance depends on no agent farther away: then cells as wide as
           the reach of a law do
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
        """Return True if the rule requests an argument of this name."""
        return name in argument_names(self.meet, "meet", self.name)


def topology(namespace: Any, name: str = "") -> Topology:
    """Gather a topology of a user's own from a module, a class or a mapping of names.

    namespace : holds the rule meet, and if it likes Parameters (numbers only), FLAT, NEAR and
                VIOLATES

    Raises RuleError if it has no such rule, or one that asks for what there is not.
    """
    found, name = namespace_names(namespace, name)
    rule, record = found.get("meet"), found.get("Parameters", Parameters)
    if not callable(rule):
        raise RuleError(f"topology {name} has no rule; give meet(n, r2, met), which fills met")
    if "met" not in argument_names(rule, "meet", name):
        raise RuleError(f"topology {name}: meet does not ask for met, the row that it fills")
    if not (isinstance(record, type) and issubclass(record, Parameters)):
        raise RuleError(f"topology {name}: Parameters is not a frozen dataclass derived from airflock.Parameters")
    # The table of a driver holds numbers only.
    words = [word for word, declared, _ in declarations(record) if isinstance(declared, Choice)]
    if words:
        raise RuleError(f"topology {name}: Parameters.{words[0]} is a choice; a topology has numbers only")
    return gather(Topology, found, name=name, Parameters=record)
