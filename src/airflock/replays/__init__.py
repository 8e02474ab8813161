"""Replays: a recording as one HTML file that plays in any browser, from disk and in notebooks, without network."""

from airflock.replays.build import Replay, check_colour, replay

__all__ = ["Replay", "check_colour", "replay"]
