"""The vocabularies of the rule contract: what each kind of rule may ask for, by name; each owner's in a file.

All quantities are in SI; a difference is always neighbour minus own. Own, Percept and Mean are
the records behind some of the names.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

from airflock.core.vocabulary import bodies, faults, laws, metrics, radios, sensors, topologies
from airflock.support import RuleError, suggest

VOCABULARY: dict[str, dict[str, str]] = {
    **laws.RULES,
    **bodies.RULES,
    **sensors.RULES,
    **radios.RULES,
    **topologies.RULES,
    **faults.RULES,
    **metrics.METRIC,
    **metrics.METRIC_SET,
}


class Own(NamedTuple):
    """An agent's own state as it measures it: velocity (m/s) and heading (unit vector)."""

    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float


class Percept(NamedTuple):
    """What else an agent perceives: time (s), offsets to the arena's centre and to the goal (m), rays, noise.

    Without a goal its offset is zero. An engine binds the methods to its world and its streams; a drone passes a
    Percept of its own with a real range finder. As they stand here the world is empty and quiet.
    """

    time: float
    centre_x: float
    centre_y: float
    centre_z: float
    goal_x: float = 0.0
    goal_y: float = 0.0
    goal_z: float = 0.0

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance (m) along the unit vector u to walls, obstacles and the scene, at most `length` (m)."""
        return length

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance (m) for a sphere of this radius (m) along the unit vector u, at most `length` (m).

        It ends at the arena's walls, its obstacles and what stands in the scene; a radius of 0 is a thin ray. A model
        that casts declares `sight(p)`, the largest length + radius (m).
        """
        return length

    def normal(self, draw: int) -> float:
        """Normal random number N(0, 1) of this agent and decision; `draw` from 0 to 255 tells several apart."""
        return 0.0

    def uniform(self, draw: int) -> float:
        """Uniform random number between 0 and 1; it shares its words with normal(draw), so use different draws."""
        return 0.5


PERCEPT_METHODS = ("ray", "cast", "normal", "uniform")  # methods of Percept that an engine binds


class Mean(NamedTuple):
    """Means over a flock or a cluster of n agents: position (m), velocity (m/s), heading."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float
    n: float


@cache
def argument_names(rule: Callable[..., Any], kind: str, owner: str = "") -> tuple[str, ...]:
    """Names that a rule asks for, checked against the vocabulary of its kind."""
    asked = inspect.signature(rule).parameters
    names = tuple(asked)
    known = VOCABULARY[kind]
    for name in names:
        if name not in known:
            hint = suggest(name, known, ".", lead="; ", cutoff=0.6)
            if asked[name].default is not inspect.Parameter.empty:
                hint = f"; a number of the rule's own is declared in Parameters, and read as p.{name}."
            elif name == "self":
                hint = "; a rule is a plain function."
            where = f"{owner}.{kind}" if owner else kind
            raise RuleError(f"{where}({', '.join(names)}) asks for {name!r}{hint} Known: {', '.join(known)}")
    return names


def call_rule(rule: Callable[..., Any], kind: str, arguments: Mapping[str, Any], owner: str = "") -> Any:
    """Call a rule with what it asks for by name."""
    names = argument_names(rule, kind, owner)
    values = [arguments.get(name) for name in names]
    for place, value in enumerate(values):
        if value is None:
            raise RuleError(f"{owner}.{kind} asks for {names[place]}, which {owner} does not provide".lstrip("."))
    return rule(*values)
