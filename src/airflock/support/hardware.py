"""Hardware by name: on what a flight can be asked to fly, and with how many bits."""

from airflock.support.errors import ScenarioError

DEVICES = ("auto", "cpu", "cuda", "python")


def check_device(device: str) -> None:
    """Refuse a device that nobody knows. Raises ScenarioError."""
    if device not in DEVICES:
        raise ScenarioError([f"device = {device!r} is none of {', '.join(DEVICES)}"])


def check_precision(precision: int) -> None:
    """Refuse a number of bits that is none. Raises ScenarioError."""
    if precision not in (32, 64):
        raise ScenarioError([f"precision = {precision} is neither 32 nor 64"])
