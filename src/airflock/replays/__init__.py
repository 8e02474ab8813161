"""Replays: a recording as one HTML file that plays in any browser, from disk and in notebooks, without network."""

from airflock.replays.build import Replay, replay

__all__ = ["Replay", "replay"]
