"""Options of verbs: read from signatures and docstrings of functions, shared by several, or spelled otherwise.

Functions are read from their text, so that no room is imported before a verb is called.
"""

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import airflock
from airflock import core, engine, runs, scenarios, support
from airflock.cli import terminal
from airflock.support import (
    ErrorCollector,
    ScenarioError,
    as_error,
    collect_errors,
    invalid_if,
    is_file,
    parse_toml_value,
    suffix_error,
    value_or_default,
)

REQUIRED = ...  # default of an option or argument that must be there
Kind = type | Any  # type that typer reads: int, float, str, bool, Path, one of them in a list, or a Literal


class Option(NamedTuple):
    """One option or argument of a verb.

    spelled  : as a person writes it, such as ("--out", "-o"); empty: "--" and the name
    metavar  : of its value in the help; low, high : ends of its range, None if it has none
    is_negatable : of a flag: `--no-` and its name are there, too
    shown    : what the help shows as its default, where the default itself says nothing
    origin   : where it is declared, such as `airflock.sweep: over`
    """

    name: str
    kind: Kind
    help: str
    default: Any = None
    spelled: tuple[str, ...] = ()
    metavar: str | None = None
    low: float | None = None
    high: float | None = None
    shown: str = ""
    is_argument: bool = False
    is_negatable: bool = False
    origin: str = ""


class Declaration(NamedTuple):
    """What the text of a function says.

    help : before its parameters; options : by name; arguments : names of all; required : of those without a default
    """

    help: str
    options: Mapping[str, Option]
    arguments: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
    has_result: bool = False


def read_declaration(function: str | Callable[..., Any]) -> Declaration:
    """Read a function or class by its dotted public name, such as `airflock.sweep`, or one that is there already.

    Of a class of `quantity` and `choice` fields, each field is an option that is left out by default.
    """
    if isinstance(function, str):
        return _read(*_place(function), function, 1)
    file = inspect.getsourcefile(function)
    assert file is not None
    return _read(Path(file), function.__qualname__, f"{function.__module__}.{function.__qualname__}", None)


def _place(dotted: str) -> tuple[Path, str]:
    """Return the file of a public name and its name there; doors are followed by their `__init__.pyi`."""
    folder, parts = Path(airflock.__file__).parent, dotted.split(".")[1:]
    while parts:
        head, *rest = parts
        if (folder / head).is_dir():
            folder, parts = folder / head, rest
        elif (folder / f"{head}.py").is_file():
            return folder / f"{head}.py", ".".join(rest)
        else:
            names = (folder / "__init__.pyi").read_text(encoding="utf-8").partition(f"{head} as {head}")[0]
            home = re.findall(r"^from \.(\S*) import", names, re.M)[-1]
            parts = [*filter(None, home.split(".")), *parts]
    raise LookupError(dotted)


@cache
def _read(file: Path, name: str, origin: str, positions: int | None) -> Declaration:
    source = file.read_text(encoding="utf-8")
    node = _definition(source, name)
    text = ast.get_docstring(node) or ""
    if isinstance(node, ast.ClassDef):
        fields = (each for each in node.body if isinstance(each, ast.AnnAssign))
        return Declaration(text, {each.name: each for each in (_field_option(f, source, origin) for f in fields)})
    about, _, rest = text.partition("\nParameters\n----------\n")
    entries = _entries(re.split(r"\n\w+\n-{3,}\n", rest)[0])
    options: dict[str, Option] = {}
    plain = [each.arg for each in node.args.args if each.arg != "self"]
    defaults = dict(zip(reversed(plain), reversed(node.args.defaults), strict=False))
    defaults |= zip((each.arg for each in node.args.kwonlyargs), node.args.kw_defaults, strict=True)
    names = [*plain, *(each.arg for each in node.args.kwonlyargs)]
    for argument in names:
        default = REQUIRED if defaults.get(argument) is None else _value(defaults[argument], source)
        kind, meaning = entries.get(argument, ("", ""))
        option = _option(argument, default, kind, help_text(meaning, names))
        if option is not None:
            options[argument] = option._replace(
                origin=f"{origin}: {argument}", is_argument=argument in plain[:positions]
            )
    result = ast.unparse(node.returns) if node.returns is not None else "None"
    required = [name for name in names if defaults.get(name) is None]
    return Declaration(about.strip(), options, tuple(names), tuple(required), result != "None")


def _definition(text: str, name: str) -> Any:
    """Return the node of a function or class; only its own lines are parsed, which takes a millisecond."""
    start = 0
    for part in name.split("."):
        found = re.compile(rf"^ *(?:def|class) {part}\b", re.M).search(text, start)
        assert found is not None, f"{name} is not defined where its door says"
        start = found.start()
    indent = re.match(" *", text[start:])[0]  # type: ignore[index]
    end = re.compile(rf"^ {{0,{len(indent)}}}[^\s)]", re.M).search(text, text.index("\n", start))
    lines = text[start : end.start() if end else len(text)].splitlines()
    return ast.parse("\n".join(line.removeprefix(indent) for line in lines)).body[0]


def _value(node: ast.expr | None, source: str) -> Any:
    """Return a literal default, also of a constant's name, a path, or the stop of a range; None if it is computed."""
    if isinstance(node, ast.Name) and (found := re.search(rf"^{node.id} = (.+?)(?:  #.*)?$", source, re.M)):
        return _literal(found[1])
    if isinstance(node, ast.Call) and ast.unparse(node.func) in ("range", "Path"):
        node = node.args[-1]
    return _literal(ast.unparse(node)) if node is not None else None


def _literal(text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return None


def _entries(text: str) -> dict[str, tuple[str, str]]:
    """Return type and meaning of each argument in a docstring's list of parameters."""
    entries = {}
    for names, kind, meaning in re.findall(r"^(\S.*?) : (.*)\n((?:(?: .*)?\n)*)", f"{text}\n", re.M):
        for name in names.split(","):
            entries[name.strip(" *")] = kind, " ".join(meaning.split())
    return entries


METAVAR = re.compile(r" \(([A-Z1][^()]*)\)")  # in a docstring's type, of an option's value: `path (FILE.csv)`
RANGE = re.compile(r" in \[(\S+), (\S+)\]")  # `int in [1, 120]`
CHOICES = re.compile(r"^\{(.*?)\}")  # `{"px4", "ardupilot"}`


def _option(name: str, default: Any, kind: str, meaning: str) -> Option | None:
    """Return the option that stands for an argument; None where only Python can give it: a mapping, a function."""
    metavar = found[1] if (found := METAVAR.search(kind)) else None
    span = RANGE.search(kind)
    choices = ast.literal_eval(f"[{found[1]}]") if (found := CHOICES.match(kind)) else ()
    read: Kind | None = Literal[tuple(choices)] if choices else _kind(kind, metavar)
    if read is None:
        return None
    low, high = (float(end) if end != "inf" else None for end in span.groups()) if span else (None, None)
    meaning, _, shown = meaning.partition("; by default ") if default in (None, "") else (meaning, "", "")
    spelled = ("--out", "-o") if name == "out" else ()
    text = f"{meaning}." if shown else meaning
    negatable = read is bool and default is None
    return Option(name, read, text, default, spelled, metavar, low, high, shown.rstrip("."), is_negatable=negatable)


def _kind(kind: str, metavar: str | None) -> Kind | None:
    """Return the type of an option from the type in a docstring, which says first what a command can give."""
    several = bool(metavar and metavar.endswith("...")) or kind.startswith(("sequence of str", "iterable of str"))
    word = re.match(r"\w+", kind)
    known = {"int": int, "float": float, "bool": bool, "str": str, "path": Path}
    one: Kind | None = known.get(word[0]) if word else None
    if metavar is not None and one not in (int, float):
        one = Path if re.match("FILE|DIR|FOLDER|CARD|LOG|TRACKS", metavar) and "PRESET" not in metavar else str
    if several:
        return list[Path] if one is Path else list[str]
    return one


def _field_option(node: ast.AnnAssign, source: str, origin: str) -> Option:
    """Return the option of a field such as `population: float = quantity(100, "1", low=2, high=1e6, meaning=...)`."""
    call: Any = node.value
    name, words = ast.unparse(node.target), {each.arg: _value(each.value, source) for each in call.keywords}
    default, meaning = _value(call.args[0], source), words["meaning"]
    text = help_text(f"{meaning[:1].upper()}{meaning[1:]}.")
    return Option(name, type(default), text, shown=str(default), origin=f"{origin}: {name}")


def help_text(text: str, names: Sequence[str] = ()) -> str:
    """Return the text of a docstring for the help of a command: `name` of an argument is --name, brackets stay."""
    text = re.sub(r"`(\w+)`", lambda word: f"--{word[1].replace('_', '-')}" if word[1] in names else word[1], text)
    return text.replace("`", "").replace("[", r"\[")


# A verb has a whole group by its name in capitals, or single ones by their own. The default is that of the verb's
# function where it has such an argument.
SHARED: Mapping[str, tuple[Option, ...]] = {
    "SCENARIO": (
        Option("scenario", str, "A preset's name or a scenario file.", ..., (), "PRESET|FILE", is_argument=True),
        Option(
            "settings", list[str], "Change any key, such as model.p_rep=0.14; repeatable.", (), ("--set",), "KEY=VALUE"
        ),
        Option("law", str, "Fly this law instead of the scenario's.", metavar="NAME|FILE.py"),
        Option("trust", bool, "Allow the Python code that a file names to run: a law, fitness functions.", False),
        Option("agents", int, "Number of agents.", shown="the scenario's"),
        Option(
            "duration", str, "Length of a flight, such as 10min; a plain number is in s.", metavar="TIME",
            shown="the scenario's",
        ),
    ),
    "SEEDS": (
        Option("seeds", int, "Number of flights, with seeds 0, 1, 2, ...", 1, low=1, high=1_000_000),
        Option("first_seed", int, "Seed of the first flight.", 0, low=0),
    ),
    "FLYING": (
        Option("threads", int, "Number of flights flown at the same time.", low=1, shown="one per core"),
        Option("precision", int, "Bits per number: 32 or 64."),
        Option("device", str, "auto, cpu, cuda (an NVIDIA GPU) or python (not compiled, for debugging)."),
        Option("scheduler", str, "Fly on the workers of this dask scheduler.", metavar="ADDRESS"),
    ),
    "OUTPUT": (
        Option("json", bool, "Print JSON instead of tables.", False),
        Option("save", Path, "Save the recordings as netCDF.", metavar="FILE.nc"),
        Option("plot", Path, "Draw the result as a picture.", metavar="FILE.png"),
        Option("show", str, "Order parameter to show.", metavar="NAME", shown="fitness, quality or polarisation"),
        Option("table", Path, "Write one row per flight.", metavar="FILE.csv"),
        Option("out", Path, "File to write; its ending sets the format.", spelled=("--out", "-o"), metavar="FILE"),
        Option("breaks", bool, "For each claim, make the change that must turn it red, and judge it again.", False),
        Option("keep", Path, "For all papers: folder for finished work.", metavar="DIR", shown="the cache"),
        Option("quiet", bool, "Show no progress.", False),
    ),
    "LIMITS": (
        Option(
            "limit", list[str], "Such as 'r_min<1 at 1e-3/h' (per flock hour), '.../drone-h', 'clearance<0 at 1%' (of "
            "flights: a contact), 'phi_vel>=3 in 99%'. Repeatable; all hold together.", (), ("--limit", "-l"), "LIMIT",
        ),
    ),
}  # fmt: skip


def shared_options(names: Sequence[str]) -> dict[str, Option]:
    """Return shared options by name; `names` are theirs, or those of groups."""
    chosen = [each for group, members in SHARED.items() for each in members if {group, each.name} & {*names}]
    return {each.name: each._replace(origin=f"airflock.cli.options: {each.name}") for each in chosen}


class Alias(NamedTuple):
    """Options of verbs that differ from an argument of their function.

    names  : of the options; origin : function whose arguments they are, or that an option calls, instead of the
    verb's own; changes : fields of the options that differ, never their help
    """

    verbs: str
    names: str
    origin: str = ""
    changes: Mapping[str, Any] = {}

    def options(self, own: Mapping[str, Option]) -> Iterator[Option]:
        """Yield the options, from those of the verb's function or from the origin."""
        declared = read_declaration(self.origin) if self.origin else None
        for name in self.names.split():
            if declared is None:
                option = own[name]
            elif name in declared.options:
                option = declared.options[name]
            else:  # the option calls the function: its summary is the help
                text = re.split(r"\n\n|(?<=\.) ", declared.help)[0]
                option = Option(name, Path, help_text(" ".join(text.split())), metavar="FILE.png", origin=self.origin)
            changed = option._replace(**self.changes)
            changed = changed._replace(is_argument=changed.is_argument and (not self.origin or changed.default is ...))
            if changed.kind is str and isinstance(changed.default, tuple):  # as a person writes it
                changed = changed._replace(default=",".join(changed.default))
            elif changed.metavar == "TIME" and isinstance(changed.default, float):
                changed = changed._replace(default=f"{changed.default / SECONDS_PER_UNIT['min']:g}min")
            yield changed


FLAG = {"kind": bool, "default": False, "metavar": None}
SEVERAL = {"kind": list[str], "default": ()}
SEARCH_KEYS = "algorithm population generations seeds seed restarts flights start averages"
READ_OPTIONS = "unit time_unit axes decimal delimiter"
ALIASES = (
    Alias("score", "path", "airflock.load_recording"),
    Alias("score", "series", "airflock.over_time", {"metavar": "FILE.csv"}),
    Alias("sweep certify", "over", "", {"kind": list[str]}),
    Alias("certify", "over", "", {"spelled": ("--map",)}),
    Alias("video replay", "source seed", "airflock.plot"),
    Alias("plot video", "start", "", {"spelled": ("--begin",)}),
    Alias("plot video", "stop", "", {"spelled": ("--end",)}),
    Alias("video", "space", "", {"spelled": ("--space", "--above")}),
    Alias("plot", "out", "", {"default": "flight.png"}),
    Alias("video", "out", "", {"default": "flight.mp4"}),
    Alias("replay", "out", "", {"default": "flight.html", "spelled": ("--html", "--out", "-o")}),
    Alias("watch", "against", "", {"kind": list[str]}),
    Alias("watch", "radios", "", {"spelled": ("--radio",)}),
    Alias("evolve", SEARCH_KEYS, "airflock.search.SearchSettings", {"default": None}),
    Alias("harden export", "out", "", {"default": ...}),
    Alias("certify tune why attack", "budget", "", {"kind": str, "metavar": "TIME"}),
    Alias("certify", "tolerance_of", "airflock.certificates.tolerance_keys", SEVERAL),
    Alias("certify", "check", "airflock.certificates.check_certificate", FLAG),
    Alias("why", "interventions", "", {"spelled": ("--without",)}),
    Alias("import", "save", "", {"default": "tracks.nc", "spelled": ("--save", "-o")}),
    Alias("import identify", "map", "airflock.load_tracks", SEVERAL),
    Alias("identify", READ_OPTIONS, "airflock.load_tracks"),
    Alias("identify", "flights", "airflock.estimate.check_against_logs", {"spelled": ("--check",), "default": 100}),
    Alias("identify", "conservative uncertain", "airflock.estimate.IdentifyResult.document"),
    Alias("identify", "plan", "airflock.estimate.flight_card", FLAG),
    Alias("infer", "models topologies", "", {"kind": str}),
    Alias("fleet", "beside", "", {"kind": str, "default": None, "spelled": ("--against",), "metavar": "simulator"}),
    Alias("paper", "quick breaks", "", {"is_negatable": True}),
    Alias("keys", "schema", "airflock.scenarios.keys.json_schema", FLAG),
    Alias("doctor", "clear", "airflock.support.clear_cache", FLAG | {"spelled": ("--clear-cache",)}),
)


def completion_of(option: Option) -> Callable[[str], list[str]] | None:
    """Return a function that lists the values of an option that begin so; None where a shell completes files."""
    words = re.split(r"[|,]", option.metavar or "")
    chosen: list[Callable[[str], Iterable[str]]] = [_presets] if "PRESET" in words else []
    chosen += [_laws] if "LAW" in words or option.name == "law" else []
    chosen += [_sections] if "SECTION" in words else []
    chosen += [_keys] if "KEY" in words else []
    chosen += [partial(_keys, after="=")] if any(word.startswith("KEY=") for word in words) else []

    def complete(incomplete: str) -> list[str]:
        return sorted(word for read in chosen for word in read(incomplete) if word.startswith(incomplete))

    return complete if chosen else None


def _presets(_: str) -> Iterable[str]:

    return scenarios.files.presets()


def _laws(_: str) -> Iterable[str]:

    return scenarios.MODELS


def _sections(_: str) -> Iterable[str]:

    return scenarios.keys.sections()


def _keys(incomplete: str, after: str = "") -> Iterable[str]:
    """Yield every key, with `after` behind it; behind KEY= each choice of this key."""
    chosen = incomplete.partition("=")[0] if "=" in incomplete else None
    for key in scenarios.keys.keys(None):
        yield from (f"{key.name}={word}" for word in key.options) if key.name == chosen else (f"{key.name}{after}",)


SECONDS_PER_UNIT = {"s": 1.0, "min": 60.0, "h": 3600.0}


def parse_settings(
    pairs: list[str] | None, agents: int | None = None, duration: str | None = None, option: str = "--set"
) -> dict[str, Any]:
    """Return keys and values of --set (or another option) and its short forms; values are read as TOML, or else as
    text.
    """
    values: dict[str, Any] = {}
    errors = []
    for pair in pairs or []:
        key, equals, text = pair.partition("=")
        if not equals or not key.strip():
            errors.append(f"{option} {pair}: write KEY=VALUE, for instance {option} model.p_rep=0.14")
            continue
        with collect_errors(errors):
            values[key.strip()] = parse_option_value(text, f"{option} {key.strip()}")
    short: dict[str, tuple[str, float]] = {}
    if agents is not None:
        short["agents"] = (str(agents), agents)
    if duration is not None:
        with collect_errors(errors):
            short["duration"] = (duration, parse_seconds(duration, "--duration"))
    errors += _range_errors(short)
    raise_errors(errors)
    return values | {key: number for key, (_, number) in short.items()}


def _range_errors(short_options: Mapping[str, tuple[str, float]]) -> list[str]:
    """Return range errors of --agents and --duration, each as it is written and as a number."""
    if not short_options:
        return []

    declared = core.declarations(scenarios.Flight)
    known = {name: number for name, number, _ in declared if isinstance(number, core.Quantity)}
    return [
        f"--{key} {written} lies outside {known[key].span}"
        for key, (written, number) in short_options.items()
        if core.quantity_error(float(number), known[key])
    ]


def parse_seconds(text: str, option: str = "--budget") -> float:
    """Return the seconds of a time such as 90s, 10min or 2h; ScenarioError for anything else."""
    match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)\s*(s|min|h)?\s*", text)
    if match is None or not 0.0 < float(match[1]) < math.inf:
        raise ScenarioError([f"{option} {text}: write a time above 0 such as 90s, 10min or 2h"])
    return float(match[1]) * SECONDS_PER_UNIT[match[2] or "s"]


def parse_option_value(text: str, option: str) -> Any:
    """Return a TOML value, or the text itself if it is none; `where` names the option in errors."""
    with as_error(option):
        return parse_toml_value(text)


def raise_errors(errors: list[str]) -> None:
    """Raise all collected errors, if there are any."""
    if errors:
        raise ScenarioError(errors)


def check_writable(*outputs: tuple[Path | None, tuple[str, ...]], reads: Sequence[str | Path | None] = ()) -> None:
    """Refuse output files that cannot be written, each with its possible endings, before any work is done.

    reads : what the command reads, names of presets among it: none of these files is written over
    """
    import os

    errors = []
    for path, endings in outputs:
        if path is None:
            continue
        folder, error = path.parent, suffix_error(path, endings)
        if error:
            errors.append(error)
        if not folder.is_dir():
            errors.append(f"{path}: the folder {folder} does not exist")
        elif path.is_dir() or not os.access(folder, os.W_OK):
            errors.append(f"{path}: cannot be written")
        elif path.exists() and any(is_file(read) and path.samefile(read) for read in reads if read is not None):
            errors.append(f"{path}: is an input and would be overwritten; give another file to write")
    raise_errors(errors)


def announce_run_time(flown: Sequence[Any], threads: int | None, device: str) -> None:
    """Print how long flights on the processor will take, if that is more than a minute."""
    cores = support.available_cores()
    note = scenarios.run_time_note(flown, threads or cores) if device == "cpu" else ""
    if note:
        terminal.print_message(f"note: {note} on {min(threads or cores, cores)} cores")


def compile_before_bar(scenario: Any, precision: int, device: str) -> None:
    """Compile the driver of a scenario before a bar on the terminal begins, so that its rate is of flights."""
    import sys

    if device == "cpu" and sys.stderr.isatty():
        engine.compile_for(scenario, precision=precision)


def collect_settings(errors: ErrorCollector, o: Any) -> dict[str, Any]:
    """Return the settings of --set and its short forms; if the number of agents is invalid, still check the others."""
    agents, duration = getattr(o, "agents", None), getattr(o, "duration", None)
    return invalid_if(agents, errors.read(parse_settings, o.settings, value_or_default(agents, None), duration))


def flying(o: Any) -> dict[str, Any]:
    """Return the values of the options of flying, as functions take them."""
    return {each.name: getattr(o, each.name) for each in SHARED["FLYING"]}


def file_of_seed(path: Path, seed: int, seeds: Sequence[int]) -> Path:
    """Return the file of one flight: `path`, with the seed in its name where there are several."""
    return path.with_name(f"{path.stem}-seed{seed}{path.suffix}") if len(seeds) > 1 else path


def collect_scenario(
    errors: ErrorCollector, name: str, settings: Mapping[str, Any], law: str | None = None, *, trust: bool
) -> Any:
    """Return the named scenario with its changes; if a change is invalid, still check the name and its file."""
    return invalid_if(settings, errors.read(scenarios.load, name, value_or_default(settings, {}), law, trust=trust))


def seeds_from(first: int, count: int) -> list[int]:
    """Return the seeds of --first-seed and --seeds."""
    return scenarios.check_seeds(range(first, first + count))


def check_flight_options(device: str, precision: int, scheduler: str | None = None) -> None:
    """Refuse an unknown device, a wrong number of bits, and workers on another device than a cpu."""
    together = ErrorCollector()
    together.read(support.check_device, device)
    together.read(support.check_precision, precision)
    together.read(runs.check_worker_device, scheduler, device)
    together.raise_errors()


def parse_position(option: str, text: str) -> tuple[float, float, float]:
    """Parse latitude and longitude (degrees) and altitude (m)."""
    numbers = parse_numbers(text)
    if len(numbers) != 3 or not math.isfinite(sum(numbers)):
        raise ScenarioError([f"{option} {text}: is not LAT,LON,ALT, for instance 47.50,19.04,120"])
    return numbers[0], numbers[1], numbers[2]


def parse_numbers(text: str, separator: str = ",") -> list[float]:
    """Parse numbers; return none at all where one of them is not a number."""
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        return []
