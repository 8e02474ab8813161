"""Verb: a command that tells all that is wrong with its options at once."""

import inspect
from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand

from airflock.cli.usage import non_finite_errors, usage_error
from airflock.support import INVALID, AirflockError

ERRORS_KEY = "airflock.parts.faults"  # of a command line, in the context of its verb
VALUE_ERROR_NAMES = ("BadParameter", "MissingParameter")  # faults of one option alone
NUMBER_TYPE_NAMES = ("IntParamType", "FloatParamType", "IntRange", "FloatRange")  # kinds of options


class VerbCommand(TyperCommand):
    """A command whose options are judged one by one; nan and inf are refused where an option has a range.

    A verb that takes its context goes on with numbers that are `WRONG`, and refuses them with all else that it finds
    wrong (`options.collect_option_errors`); any other ends before it begins.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line."""
        faults: list[str] = []
        carried = True  # whether everything that is wrong is a number
        try:
            rest = super().parse_args(ctx, list(args))
        except Exception as fault:
            if type(fault).__name__ not in VALUE_ERROR_NAMES:
                raise
            rest, faults, carried = self._one_by_one(ctx, args)
        for name, line in non_finite_errors(ctx):
            ctx.params[name] = INVALID
            faults.append(line)
        ctx.meta[ERRORS_KEY] = faults
        if faults and not (carried and _takes_context(self.callback)):
            raise AirflockError("\n".join(faults))
        return rest

    def _one_by_one(self, ctx: Any, args: list[str]) -> tuple[list[str], list[str], bool]:
        """What is left of the words, the faults of all options, and whether each is a number's."""
        given, rest, _ = self.make_parser(ctx).parse_args(args=list(args))
        faults, carried = [], True
        for parameter in self.get_params(ctx):
            try:
                _, rest = parameter.handle_parse_result(ctx, given, rest)
            except Exception as fault:
                if type(fault).__name__ not in VALUE_ERROR_NAMES:
                    raise
                faults.append(usage_error(fault, args))
                number = (
                    type(fault).__name__ == VALUE_ERROR_NAMES[0] and type(parameter.type).__name__ in NUMBER_TYPE_NAMES
                )
                carried = carried and number and not parameter.multiple
                ctx.params[parameter.name] = INVALID
        if rest and not ctx.allow_extra_args:
            carried = False
            try:
                ctx.begin_fault(f"Got unexpected extra argument(s) ({' '.join(rest)})")
            except Exception as fault:
                faults.append(usage_error(fault, args))
        return rest, faults, carried


def _takes_context(callback: Callable[..., Any] | None) -> bool:
    """Whether a verb asks for its context, with which it refuses what is wrong with its numbers."""
    wanted = () if callback is None else inspect.signature(callback).parameters.values()
    return any(each.annotation is typer.Context for each in wanted)
