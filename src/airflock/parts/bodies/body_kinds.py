"""The bodies that a scenario can name: the key body.kind."""

from airflock.core import Body, body
from airflock.parts.bodies import direct, fixed_wing, jostled, motion, quadrotor, steered, turning

BODIES: dict[str, Body] = {
    "multirotor": body(motion, "multirotor"),
    "quadrotor": body(quadrotor, "quadrotor"),
    "fixed_wing": body(fixed_wing, "fixed_wing"),
    "direct": body(direct, "direct"),
    "jostled": body(jostled, "jostled"),
    "steered": body(steered, "steered"),
    "heading": body(turning, "heading"),
}


def default_body(command: str) -> str:
    """Name of the first body that accepts a COMMAND: what a scenario without body.kind flies."""
    return next(name for name, found in BODIES.items() if found.accepts == command)
