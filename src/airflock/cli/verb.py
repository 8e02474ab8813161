"""Verb: a command whose numbers lie in the ranges of its options; nan passes every comparison with their ends."""

from typing import Any

from typer.core import TyperCommand

from airflock.cli.usage import infinite
from airflock.errors import AirflockError


class Verb(TyperCommand):
    """A command that refuses nan and inf where an option has a range."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line."""
        rest = super().parse_args(ctx, args)
        faults = infinite(ctx)
        if faults:
            raise AirflockError("\n".join(faults))
        return rest
