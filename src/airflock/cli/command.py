"""Commands that report every error of a command line at once, and their messages."""

import inspect
import math
import os
import re
from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.core import TyperCommand

from airflock.support import INVALID, AirflockError, suggest

OUTPUT_OPTIONS = ("--out", "--save", "--html")  # where what came out goes: a folder or table, a recording, a page
SIMILARITY_CUTOFF = 0.75  # of options, as in `spelling.suggest`: both begin with --, and --budget is not --quiet
_EVOLVE_AGAIN = "was removed; airflock evolve with --set metrics.r_coll=M or --set radio.delay=S evolves for more of it"
REMOVED_OPTIONS = {  # verb, option → what to do instead
    **dict.fromkeys(
        [("harden", "--margin"), ("tune", "--margin")],
        "was removed; give the distance itself: --limit 'r_min<3 at 0.01/h'",
    ),
    **dict.fromkeys([("harden", name) for name in ("--delay", "--r-coll", "--generations")], _EVOLVE_AGAIN),
}
SEED_OPTION = "--seed"  # written for the seed of a flight, one letter from --seeds, which says how many fly


def expand_home(word: str) -> str:
    """Expand ~ in a word of a command line, also where a shell leaves it in: --save=~/flight.nc."""
    option, equals, value = word.partition("=")
    return f"{option}={os.path.expanduser(value)}" if equals else os.path.expanduser(word)


def usage_error(error: Any, words: Sequence[str]) -> str:
    """Return one line for an error of typer; `words` are those of the command line.

    Typer's error classes have moved between its versions, so they are recognised by their attributes.
    """
    context = getattr(error, "ctx", None)
    verb = _command_path(context).partition(" ")[2]
    return f"{verb}: {_message(error, context, words)}" if verb else _message(error, context, words)


def non_finite_errors(context: Any) -> list[tuple[str, str]]:
    """Return, for options with a range that are nan or inf, the parameter's name and one line."""
    errors = []
    for parameter in context.command.params:
        value, ends = context.params.get(parameter.name), _range_ends(parameter)
        if isinstance(value, float) and not math.isfinite(value) and ends != (None, None):
            verb = _command_path(context).partition(" ")[2]
            said = f"{verb}: {_parameter_name(parameter)} {value:g} is not a finite number; give {_range_text(*ends)}"
            errors.append((str(parameter.name), said))
    return errors


def _message(error: Any, context: Any, words: Sequence[str]) -> str:
    kind, message = type(error).__name__, str(getattr(error, "message", "") or error.format_message())
    parameter = getattr(error, "param", None)
    if kind == "NoSuchOption":
        if instead := REMOVED_OPTIONS.get((_command_path(context).partition(" ")[2], error.option_name)):
            return f"{error.option_name} {instead}"
        known = [name for one in context.command.params for name in one.opts] if context is not None else []
        same = [name for name in OUTPUT_OPTIONS if name in known and error.option_name in (*OUTPUT_OPTIONS, "--output")]
        hint = (
            f"; did you mean {same[0]}?"
            if same
            else _suggestion(error.option_name, [*known, "--help"], context, SIMILARITY_CUTOFF)
        )
        if error.option_name == SEED_OPTION and "--first-seed" in known:
            hint = "; did you mean --first-seed (of one flight), or --seeds (how many flights)?"
        return f"{error.option_name}: unknown option{hint}"
    unknown = re.match(r"No such command '(.*?)'", message)
    if unknown is not None:
        return f"{unknown[1]}: unknown command{_suggestion(unknown[1], list(context.command.commands), context)}"
    if kind == "MissingParameter" and parameter is not None:
        return f"{_parameter_name(parameter)} is missing{_example_text(context)}"
    if kind == "BadParameter" and parameter is not None:
        return _value_error_text(parameter, words, message)
    if kind == "BadOptionUsage":
        if "does not take a value" in message:
            return f"{error.option_name} takes no value; write it alone"
        return f"{error.option_name} needs a value"
    extra = re.match(r"Got unexpected extra argument(?:s|\(s\))? \((.*)\)", message)
    if extra is not None:
        takes = [_parameter_name(one) for one in context.command.params if one.param_type_name == "argument"]
        more = f"; it takes {' '.join(takes)} and options" if takes else "; it takes options alone"
        return f"unexpected {extra[1]}{more}{_example_text(context)}"
    return str(error.format_message()).strip().rstrip(".") + _example_text(context)


def _command_path(context: Any) -> str:
    """Return the command as a person writes it, however Python was started."""
    names = []
    while context is not None and context.parent is not None:
        names.append(context.info_name)
        context = context.parent
    return " ".join(["airflock", *reversed(names)])


def _suggestion(name: str, known: Sequence[str], context: Any, cutoff: float = 0.5) -> str:
    return suggest(name, known, f"; {_command_path(context)} --help lists them", lead="; ", cutoff=cutoff)


def _example_text(context: Any) -> str:
    """Return the example in a verb's help."""
    text = getattr(getattr(context, "command", None), "help", None) or ""
    match = re.search(r"Example: (.+)", text)
    return f"; for instance: {match[1].strip()}" if match else ""


def _parameter_name(parameter: Any) -> str:
    """Return the name that a person writes: the longest of an option, or the metavar of an argument."""
    options = [name for name in parameter.opts if name.startswith("-")]
    if options:
        return str(max(options, key=len))
    return str(parameter.metavar or parameter.name.upper())


def _value_error_text(parameter: Any, words: Sequence[str], message: str) -> str:
    """Return the message for a value of the wrong type, out of range, or not among the choices."""
    name, value = _parameter_name(parameter), _given_value(parameter, words)
    choices = _choices(parameter)
    if value is not None and choices:
        return f"{name} {value} is none of {', '.join(choices)}{suggest(value, choices, lead='; ')}"
    low, high = _range_ends(parameter)
    if value is None or (low is None and high is None and "valid" not in message):
        return f"{name}: {message.strip().rstrip('.')}"
    span = _range_text(low, high)
    give = "" if low is None and high is None else f"; give {span}"
    try:
        number = float(value)
    except ValueError:
        return f"{name} {value} is not a number{give}"
    outside = (low is not None and number < low) or (high is not None and number > high)
    return f"{name} {value} lies outside {span}" if outside else f"{name} {value} is not a whole number{give}"


def _given_value(parameter: Any, words: Sequence[str]) -> str | None:
    """Return the last value that a command line holds for an option; None if it cannot be determined."""
    last = None
    for word, after in zip(words, [*words[1:], None], strict=True):
        name, equals, value = word.partition("=")
        if name in parameter.opts:
            last = value if equals else after
    return last


def _range_ends(parameter: Any) -> tuple[float | None, float | None]:
    """Return the lowest and the highest allowed number of an option."""
    ends = []
    for name in ("min", "max"):
        end = getattr(parameter, name, getattr(getattr(parameter, "type", None), name, None))
        ends.append(None if end is None else float(end))
    return ends[0], ends[1]


def _range_text(low: float | None, high: float | None) -> str:
    """Return a range as text."""
    return f"[{'-inf' if low is None else f'{low:.10g}'}, {'inf' if high is None else f'{high:.10g}'}]"


def _choices(parameter: Any) -> list[str]:
    """Return the allowed words of an option."""
    kind = getattr(parameter, "type_descriptor", None) or getattr(parameter, "type", None)
    return [str(getattr(choice, "value", choice)) for choice in getattr(kind, "choices", None) or ()]


ERRORS_KEY = "airflock.errors"  # of a command line, in the context of its verb
VALUE_ERROR_NAMES = ("BadParameter", "MissingParameter")  # errors of one option alone
NUMBER_TYPE_NAMES = ("IntParamType", "FloatParamType", "IntRange", "FloatRange")  # kinds of options


FORMATS = "the formats that airflock import --help lists"  # in a help text, which is printed with their names


class VerbCommand(TyperCommand):
    """Command that checks its options one by one; nan and inf are refused where an option has a range.

    A verb that takes its context goes on with numbers that are `WRONG`, and refuses them with all else that it finds
    wrong (`options.collect_option_errors`); any other ends before it begins.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help, with the formats of files that can be read now."""
        for parameter in self.params:
            if FORMATS in (getattr(parameter, "help", None) or ""):
                from airflock.recordings import format_words

                parameter.help = parameter.help.replace(FORMATS, format_words())  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line."""
        errors: list[str] = []
        carried = True  # whether everything that is wrong is a number
        try:
            rest = super().parse_args(ctx, list(args))
        except Exception as error:
            if type(error).__name__ not in VALUE_ERROR_NAMES:
                raise
            # typer stops at the first bad value; parsing again option by option finds the others as
            # well.
            rest, errors, carried = self._one_by_one(ctx, args)
        for name, line in non_finite_errors(ctx):
            ctx.params[name] = INVALID
            errors.append(line)
        ctx.meta[ERRORS_KEY] = errors
        if errors and not (carried and _takes_context(self.callback)):
            raise AirflockError("\n".join(errors))
        return rest

    def _one_by_one(self, ctx: Any, args: list[str]) -> tuple[list[str], list[str], bool]:
        """Return the unread words, the errors of all options, and for each whether it is a number's."""
        given, rest, _ = self.make_parser(ctx).parse_args(args=list(args))
        errors, carried = [], True
        for parameter in self.get_params(ctx):
            try:
                _, rest = parameter.handle_parse_result(ctx, given, rest)
            except Exception as error:
                if type(error).__name__ not in VALUE_ERROR_NAMES:
                    raise
                errors.append(usage_error(error, args))
                number = (
                    type(error).__name__ == VALUE_ERROR_NAMES[0] and type(parameter.type).__name__ in NUMBER_TYPE_NAMES
                )
                carried = carried and number and not parameter.multiple
                ctx.params[parameter.name] = INVALID
        if rest and not ctx.allow_extra_args:
            carried = False
            try:
                ctx.fail(f"Got unexpected extra argument(s) ({' '.join(rest)})")
            except Exception as error:
                errors.append(usage_error(error, args))
        return rest, errors, carried


def _takes_context(callback: Callable[..., Any] | None) -> bool:
    """Return True if a verb takes its context, with which it reports errors of its numbers."""
    wanted = () if callback is None else inspect.signature(callback).parameters.values()
    return any(each.annotation is typer.Context for each in wanted)
