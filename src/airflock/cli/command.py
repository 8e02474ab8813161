"""Verbs from functions, which report every error of a command line at once, and their messages."""

import inspect
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import Annotated, Any

import typer
import typer.main
from typer.core import TyperCommand, TyperGroup

from airflock import recordings
from airflock.cli.options import ALIASES, Option, completion_of, read_declaration, shared_options
from airflock.support import INVALID, AirflockError, ErrorCollector, suggest

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
CARRIED_TYPE_NAMES = ("IntParamType", "FloatParamType", "IntRange", "FloatRange", "TyperChoice")  # kinds of options
FORMATS = "the formats that airflock import --help lists"  # in a docstring; a help is printed with their names
VERBS: dict[str, "VerbCommand"] = {}  # by full name, such as `fly prepare`


def verb(
    panel: str, function: str = "", shared: str = "", *, name: str = "", without: str = ""
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a verb of a function: its options are the arguments of a public function, or its own.

    panel     : heading in the list of commands
    function  : public name such as `airflock.sweep`; empty: the decorated function itself, which takes the values
    shared    : options and groups of `options.SHARED` that the verb has, too
    name      : of the verb, if the decorated function has another
    without   : arguments that only Python takes, or another verb

    A decorated function with `function` takes one namespace of all values, and a collector of errors if it goes on
    with invalid numbers to report all errors at once. What it returns is printed, or shown as JSON.
    """

    def register(body: Callable[..., Any]) -> Callable[..., Any]:
        full = name or body.__name__
        VERBS[full] = VerbCommand(full, panel, body, function, shared.split(), without.split())
        return body

    return register


class VerbCommand(TyperCommand):
    """Command that checks its options one by one; nan and inf are refused where an option has a range.

    A verb that takes a collector of errors goes on with numbers that are `INVALID`, and reports them with all else
    that it finds wrong; any other ends before it begins. Options are read when the verb is called or listed.
    """

    def __init__(
        self, full: str, panel: str, body: Callable[..., Any], function: str, shared: Sequence[str],
        without: Sequence[str],
    ):  # fmt: skip
        self.full, self.body, self.function = full, body, function
        self._shared, self.without = shared, without
        about = inspect.getdoc(body) or read_declaration(function).help
        about = about.partition("\nParameters\n---")[0].strip()
        super().__init__(full.rpartition(" ")[2], help=about, rich_help_panel=panel or None, rich_markup_mode="rich")
        del self.params, self.callback  # read when they are first used

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help, with the formats of files that can be read now."""
        for parameter in self.params:
            text = self.options[parameter.name].help
            if FORMATS in text:  # each time anew: a format may have joined since the last help
                parameter.help = text.replace(FORMATS, recordings.format_words())
        super().format_help(ctx, formatter)

    @cached_property
    def options(self) -> Mapping[str, Option]:
        """Options by name: arguments of the function, shared options, then what the table of aliases changes."""
        declared = read_declaration(self.function or self.body)
        options = {name: each for name, each in declared.options.items() if name not in self.without}
        for name, each in shared_options(self._shared).items():
            own = declared.options.get(name, each).default
            options[name] = each if own in (None, ...) or each.is_argument else each._replace(default=own)
        if declared.has_result and not self.function:
            options |= shared_options(["json"])
        for alias in ALIASES:
            if self.full in alias.verbs.split():
                options |= {each.name: each for each in alias.options(options)}
        return options

    @cached_property
    def _built(self) -> Any:
        """Return the command that typer makes of the options."""
        ctx = inspect.Parameter("ctx", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)
        options = sorted(self.options.values(), key=lambda each: not each.is_argument)

        def call(ctx: typer.Context, **values: Any) -> None:
            self._call(ctx, values)

        call.__signature__ = inspect.Signature([ctx, *map(_typer_parameter, options)])  # type: ignore[attr-defined]
        one = typer.Typer(add_completion=False)
        one.command()(call)
        return typer.main.get_command(one)

    def _call(self, ctx: typer.Context, values: dict[str, Any]) -> None:
        """Call the verb with the values of its options, and print the result."""
        from airflock.cli.terminal import print_result

        as_json = bool(values.get("json"))
        wanted = inspect.signature(self.body).parameters
        errors = {"errors": ErrorCollector(ctx.meta.get(ERRORS_KEY, ()))} if "errors" in wanted else {}
        if self.function:
            result = self.body(SimpleNamespace(**values), **errors)
        else:
            result = self.body(**{key: value for key, value in values.items() if key in wanted}, **errors)
        if result is not None:
            print_result(result, as_json)

    @cached_property
    def params(self) -> list[Any]:  # type: ignore[override]
        """Options and arguments, as typer has them."""
        return self._built.params  # type: ignore[no-any-return]

    @cached_property
    def callback(self) -> Callable[..., Any]:  # type: ignore[override]
        """Function that typer calls with what it has read."""
        return self._built.callback  # type: ignore[no-any-return]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line."""
        errors: list[str] = []
        carried = True  # True while everything that is wrong is a number or a choice
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
        if errors and not (carried and "errors" in inspect.signature(self.body).parameters):
            raise AirflockError("\n".join(errors))
        return rest

    def _one_by_one(self, ctx: Any, args: list[str]) -> tuple[list[str], list[str], bool]:
        """Return the unread words, the errors of all options, and True if all are of numbers or choices."""
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
                    type(error).__name__ == VALUE_ERROR_NAMES[0] and type(parameter.type).__name__ in CARRIED_TYPE_NAMES
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


def _typer_parameter(option: Option) -> inspect.Parameter:
    """Return an option as typer reads it in the signature of a function."""
    kind, default = option.kind, option.default
    if default is None or (isinstance(default, tuple) and not default):
        kind, default = kind | None, None
    how: dict[str, Any] = {"help": option.help, "metavar": option.metavar, "autocompletion": completion_of(option)}
    how["show_default"] = option.shown or default not in (None, "", ...)
    if option.kind in (int, float):
        how |= {"min": option.low, "max": option.high}
        how |= {end: int(how[end]) for end in ("min", "max") if option.kind is int and how[end] is not None}
    if option.is_argument:
        info = typer.Argument(**how)
    else:
        flag = f"--{option.name.strip('_').replace('_', '-')}"
        spelled = option.spelled or ((flag, f"--no-{flag[2:]}") if option.is_negatable else (flag,))
        pair = option.kind is bool and len(spelled) > 1
        info = typer.Option("/".join(spelled), **how) if pair else typer.Option(*spelled, **how)
    empty = inspect.Parameter.empty if default is ... else default
    keyword = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(option.name, keyword, default=empty, annotation=Annotated[kind, info])


PANELS = (
    "Fly, measure, look", "Search and make safe", "Recordings of others", "Towards real drones", "Look something up",
)  # fmt: skip


class GroupOfVerbs(TyperGroup):
    """Group of the verbs whose full names begin with `prefix`, by their headings."""

    prefix = ""

    def __init__(self, **how: Any):
        super().__init__(**how)
        own = [each for full, each in VERBS.items() if full.rpartition(" ")[0] == self.prefix]
        known = {each: place for place, each in enumerate(PANELS)}
        own.sort(key=lambda each: known.get(each.rich_help_panel or "", len(PANELS)))
        self.commands = {**{str(each.name): each for each in own}, **self.commands}
