"""The command line: verbs only; everything heavy is imported when a verb needs it."""

from airflock.cli.main import main

__all__ = ["main"]
