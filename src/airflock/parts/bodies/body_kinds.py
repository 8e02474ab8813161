"""The bodies that a scenario can name: the key body.kind."""

from airflock.core import Body, body, find_members

BODIES: dict[str, Body] = find_members("airflock.parts.bodies", ["ACCEPTS"], body)
DEFAULT_BODIES = {"velocity": "multirotor", "acceleration": "steered", "heading": "heading"}


def default_body(command: str) -> str:
    """Return the name of the body that a scenario without body.kind flies, for a law that gives this command."""
    return DEFAULT_BODIES[command]
