"""Replays: a recording as one HTML file that plays in any browser, from disk and in notebooks, without network."""

from airflock.view.replays.build import Replay, check_colour, replay

__all__ = ["Replay", "check_colour", "replay"]
