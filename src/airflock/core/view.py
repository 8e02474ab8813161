"""View: what one agent perceived, and what came of it."""

from dataclasses import dataclass
from typing import Any

from airflock.core.agent import HeardNeighbour, State


@dataclass(frozen=True)
class AgentView:
    """What one agent perceived at a decision, and what came of it.

    agent, time : its number; time of the decision, s
    true, own   : its state, and its state as it measured it: position (m) and velocity (m/s)
    heard       : neighbours in range whose packets it has: who, state as heard (m, m/s), age (s)
    met         : of each of them, in the same order, whether the topology lets it meet that one
    terms       : of each of them what the neighbour rule made of it; 0 of whom it does not meet or beyond its reach
    alike       : of each of them what the rule would have made of it, had it flown as the agent does
    sums, walls : what the law was given of all neighbours, and of all surfaces
    memory      : the law's memory after the decision
    command     : in the unit of the law's command
    body        : what the body remembers, such as its thrust or the energy that it used; None if nothing
    """

    agent: int
    time: float
    true: State
    own: State
    heard: tuple[HeardNeighbour, ...]
    met: tuple[bool, ...]
    terms: tuple[Any, ...]
    alike: tuple[Any, ...]
    sums: Any
    walls: Any
    memory: Any
    command: tuple[float, ...]
    body: Any = None
