"""The contract of a body: its vocabulary, and the rules that turn a command into a motion."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from airflock.core.contract import (
    COMMANDS,
    along_axes,
    argument_names,
    call_rule,
    check_memory_record,
    gather,
    initial_values,
    merge_parameters,
    namespace_names,
)
from airflock.core.maths import norm
from airflock.core.parameters import Parameters, quantity
from airflock.support import RuleError

STATE = {
    **along_axes("", "position", "m"),
    **along_axes("v", "velocity", "m/s"),
}
COMMAND = {
    "cx": "command, east; m/s or m/s² as the model's COMMAND says",
    "cy": "command, north; m/s or m/s² as the model's COMMAND says",
    "cz": "command, up; m/s or m/s² as the model's COMMAND says",
}
MOTION = {
    **along_axes("v", "true velocity", "m/s"),
    **along_axes("m", "own velocity as measured", "m/s"),
    **COMMAND,
    **along_axes("g", "normal random number"),
    **along_axes("w", "wind", "m/s"),
    "dt": "time step, s",
    "memory": "the body's Memory of this agent",
    "wing": "parameters of the wing (aero.wing)",
}
RULES = {
    "move": {**MOTION, "b": "the body's parameters"},
    "limits": {
        "b": "the body's parameters",
        "dt": "time step, s",
        "speed": "preferred speed of the law, m/s; 0.0 if it has none",
        "start": "speed at the start, m/s",
        "wing": "parameters of the wing (aero.wing)",
    },
    "endures": {
        "memory": "the body's Memory of this agent",
        "b": "the body's parameters",
        "wing": "parameters of the wing (aero.wing)",
    },
}


@dataclass(frozen=True, kw_only=True)
class BodyParameters(Parameters):
    """Parameters of every body: the dead time before it, which a flight keeps; no rule reads it."""

    delay: float = quantity(
        0.0, "s", low=0.0, high=10.0, usual=(0.0, 1.0), source="no body of a paper has one",
        meaning="dead time between a command and the body that follows it; the same for all agents",
    )  # fmt: skip


@dataclass(frozen=True)
class Body:
    """Rules that turn a command into a motion, gathered from a module.

    accepts     : the COMMAND of the models that it can carry
    integration : "old" if a position moves by the velocity before `move`, "new" if by the one after
                  it
    Memory      : NamedTuple of what a body keeps from step to step, each field with its value at
                  the start; `move` takes it as `memory` and returns it behind the velocity
    limits      : `limits` of any of b, dt, speed, start, wing → what of a scenario the body cannot
                  fly, one line each
    endures     : `endures` of any of memory, b, wing → how long (s) a battery lasts at least, 0
                  once it is empty; then an agent that comes to the ground is absent
    violates    : truths of `airflock.check_body` that do not hold for it, and why (VIOLATES)
    """

    name: str
    Parameters: type
    accepts: str
    integration: str
    move: Callable[..., Any]
    violates: Mapping[str, str] = field(default_factory=dict)
    Memory: type | None = None
    limits: Callable[..., list[str]] | None = None
    endures: Callable[..., float] | None = None

    def __hash__(self) -> int:
        return hash((self.name, self.move))

    @property
    def initial_memory(self) -> tuple[float, ...]:
        """Return the value of each field of Memory at the start of a flight."""
        return initial_values(self.Memory)

    def lasts(self, **arguments: Any) -> float:
        """Return how long the battery lasts at least, s; 0 once it is empty."""
        if self.endures is None:
            return math.inf
        return float(call_rule(self.endures, "endures", arguments, self.name))

    def limit_errors(self, **arguments: Any) -> list[str]:
        """Return what this body cannot fly, one line each, from the arguments that `limits` may request."""
        return [] if self.limits is None else list(call_rule(self.limits, "limits", arguments, self.name))


def first_command(command: str, velocity: Sequence[float]) -> tuple[float, ...]:
    """Return the command that a body follows until the first one is due: to fly on at a velocity (m/s).

    command : what its law commands: velocity, acceleration or heading
    """
    scale = {"velocity": 1.0, "acceleration": 0.0, "heading": 1.0 / norm(*velocity, *(0.0,) * (3 - len(velocity)))}
    return tuple(scale[command] * v for v in velocity)


def body(namespace: Any, name: str = "") -> Body:
    """Gather a body from a module, a class or a mapping of names; refuse what the contract does not know.

    Parameters
    ----------
    namespace : module, class or mapping
        Holds ACCEPTS (the command that it takes: velocity, acceleration or heading), INTEGRATION (whether positions
        move with the "old" or the "new" velocity) and the rule move; if it likes, Parameters, and Memory (a NamedTuple
        whose fields have the values of the start), which move takes as `memory` and returns as x, y, z, Memory(...).
    name : str, optional
        How the body is called; by default the namespace's.

    Returns
    -------
    Body
        To be given to `airflock.load(..., body=...)`.

    Raises
    ------
    RuleError
        If something is missing, or the rule requests an unknown argument.

    Examples
    --------
    >>> import airflock
    >>> class Obedient:
    ...     ACCEPTS, INTEGRATION = "velocity", "new"
    ...     def move(cx, cy, cz):
    ...         return cx, cy, cz
    >>> airflock.body(Obedient).accepts
    'velocity'
    """
    found, name = namespace_names(namespace, name)
    for needed in ("ACCEPTS", "INTEGRATION", "move"):
        if needed not in found:
            raise RuleError(f"body {name} lacks {needed}")
    arguments = argument_names(found["move"], "move", name)
    if found["ACCEPTS"] not in COMMANDS or found["INTEGRATION"] not in ("old", "new"):
        raise RuleError(f"body {name}: ACCEPTS is one of {', '.join(COMMANDS)}; INTEGRATION is old or new")
    check_memory_record(f"body {name}", "move", arguments, found.get("Memory"))
    for optional in ("limits", "endures"):
        if found.get(optional) is not None:
            argument_names(found[optional], optional, name)
    parameters = merge_parameters(BodyParameters, found.get("Parameters"), f"body {name}")
    if not issubclass(parameters, BodyParameters):
        raise RuleError(f"body {name}: delay is the dead time before every body; call its own number otherwise")
    how = {"accepts": found["ACCEPTS"], "integration": found["INTEGRATION"]}
    return gather(Body, found, name=name, Parameters=parameters, **how)
