"""The contract that all kinds of part share: where members are found, and how their rules are gathered and called.

A rule is a plain function of floats. The names of its arguments are its declaration: a driver
computes and passes only what the rule requests, in any order. `core.vocabulary` lists the names. A
file of rules may bring records of its own (Parameters, and a Memory that a rule keeps from call to
call); they are checked when the file is gathered.
"""

import inspect
import sys
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, make_dataclass, replace
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, NamedTuple, TypeVar

from airflock.core.parameters import Parameters, number_names
from airflock.support import AirflockError, RuleError, describe_error, shortened, suggest

Part = TypeVar("Part", covariant=True)
COMMANDS = {"velocity": "m/s", "acceleration": "m/s^2", "heading": "1"}  # and their units
REDUCTIONS = ("sum", "min", "max")
OVER_TIME = ("mean", *REDUCTIONS)  # how the samples of a flight combine
CLOCKS = ("sample", "collision")  # metrics.period and metrics.collision_period


class State(NamedTuple):
    """Position (m) and velocity (m/s), as the holder of the record knows them; local east-north-up."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float


def along_axes(name: str, text: str, unit: str = "") -> dict[str, str]:
    """Return the words of a vector in a vocabulary, east, north and up: "vx": "wind, east, m/s", and so on."""
    axes = zip("xyz", ("east", "north", "up"), strict=True)
    return {f"{name}{axis}": f"{text}, {way}{unit and f', {unit}'}" for axis, way in axes}


def namespace_names(namespace: Any, name: str = "") -> tuple[dict[str, Any], str]:
    """Return the names in a module, a class or a mapping, and its own name: `name`, its NAME, or that of its module.

    A static method is the function inside, so that the check of rules can name it and its
    decorator.
    """
    if not isinstance(namespace, Mapping) and not hasattr(namespace, "__dict__"):
        text = shortened(repr(namespace), 80)
        raise RuleError(f"{text} holds no rules; give a module, a class, or names such as globals()")
    found = dict(namespace) if isinstance(namespace, Mapping) else dict(vars(namespace))
    found = {key: value.__func__ if isinstance(value, staticmethod) else value for key, value in found.items()}
    return found, name or str(found.get("NAME") or found.get("__name__", "own")).rpartition(".")[2].strip("_")


@dataclass(frozen=True, eq=False)
class Kind(Mapping[str, Part]):
    """A kind of part: its members by name, and where a scenario names one.

    Members are the files and folders of one folder of the package, and of the folder of the same
    name in every installed package that declares the entry point `airflock.parts`. No list names
    them: a file that is laid there is a member. One that cannot be used is left out with a warning
    of one line; the others go on working.

    folder  : dotted name of the folder; its last part names the kind ("topologies")
    noun    : what messages call a member
    make    : makes a member from a module and a name, such as `airflock.body`
    member  : class of a member
    rules   : a file that defines one of them is a member, others are helpers; none: every one is a
              member
    section : table of a scenario file, and field of a Scenario; empty where no section names one
    default : name of the member where a scenario names none
    fixed   : members that are no file; they come first
    shared  : keys of the section that mean the same for every member, so that they stay when it
              changes; None: all
    shares  : a member of the folder without numbers of its own has those of the section: its
              Parameters are None
    take    : makes a member from other objects of the caller, if more than a member or a namespace
              is accepted
    check   : name of the public function that runs the standing list of truths on a member
    """

    folder: str
    noun: str
    make: Callable[..., Part]
    member: type[Part]
    rules: Collection[str]
    section: str = ""
    default: str = ""
    fixed: Mapping[str, Any] = field(default_factory=dict)
    shared: tuple[str, ...] | None = ()
    shares: bool = False
    take: Callable[[Any], Part] | None = None
    check: str = ""

    __hash__ = object.__hash__

    def __getitem__(self, name: str) -> Part:
        return self._members[0][name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._members[0]

    def __iter__(self) -> Iterator[str]:
        return iter(self._members[0])

    def __len__(self) -> int:
        return len(self._members[0])

    @property
    def errors(self) -> Mapping[str, str]:
        """Name → why the file or folder of this name is no member, one line."""
        return self._members[1]

    @cached_property
    def _members(self) -> tuple[dict[str, Part], dict[str, str]]:
        """Gather the members by name, and the errors of those that are left out."""
        members: dict[str, Part] = {}
        errors: dict[str, str] = {}
        own = self.folder.rpartition(".")[2]
        # The package comes first, so that no installed one can put another rule behind a known name.
        for owner, folder in (("airflock", self.folder), *((owner, f"{top}.{own}") for owner, top in installed())):
            for path, module in _modules(folder, owner):
                name = path.stem
                try:
                    found = import_module(module)
                    if self.rules and not any(rule in vars(found) for rule in self.rules):
                        errors[name] = f"{owner}: {path} is no {self.noun}: it has none of {', '.join(self.rules)}"
                        continue
                    name, own_record = namespace_names(found)[1], "Parameters" in vars(found)
                    if name in members or name in self.fixed:
                        raise RuleError(f"another {self.noun} is named {name!r}; that one is used")
                    made: Any = self.make(found, name)
                    members[name] = replace(made, Parameters=None) if self.shares and not own_record else made
                except Exception as error:  # a file may fail in any way, and the others must still fly
                    errors[name] = _left_out(f"{owner}: {path}", error)
        return {**self.fixed, **dict(sorted(members.items()))}, errors

    @property
    def records(self) -> dict[str, type]:
        """Records of parameters by name, of those members that have their own."""
        return {name: record for name, one in self.items() if (record := getattr(one, "Parameters", None)) is not None}

    def unknown(self, name: Any, more: str = "") -> str:
        """Return what is wrong with a name that is none of a member, and the nearest right one."""
        if isinstance(name, str) and name in self.errors:
            return self.errors[name]
        known = f"known: {', '.join(self)}{more}"
        return f"unknown {self.noun}; {suggest(name, self, known, cutoff=0.4)}"


@cache
def installed() -> tuple[tuple[str, str], ...]:
    """Return name and module of every installed package that brings parts: its entry point `airflock.parts`."""
    # Most often nobody brings any, and to import `importlib.metadata` takes a tenth of the time of a scenario.
    files = (file for place in sys.path for file in Path(place).glob("*.dist-info/entry_points.txt"))
    if not any(b"[airflock.parts]" in file.read_bytes() for file in files):
        return ()
    from importlib.metadata import entry_points

    found = []
    for point in entry_points(group="airflock.parts"):
        owner = point.dist.name if point.dist else point.name
        try:
            found.append((owner, point.load().__name__))
        except Exception as error:  # a package of somebody else may fail in any way
            _left_out(f"{owner}: {point.value}", error)
    return tuple(sorted(found))


def _modules(folder: str, owner: str) -> list[tuple[Path, str]]:
    """Return path and dotted name of the files and folders in a folder; none where a package has no such folder."""
    try:
        places = import_module(folder).__path__
    except Exception as error:  # a package of somebody else may fail in any way
        if getattr(error, "name", "") != folder:
            _left_out(f"{owner}: {folder}", error)
        return []
    found = ((entry, Path(getattr(entry.module_finder, "path", "")) / entry.name) for entry in iter_modules(places))
    return [(path if entry.ispkg else path.with_suffix(".py"), f"{folder}.{entry.name}") for entry, path in found]


def _left_out(where: str, error: Exception) -> str:
    """Return the line of a file that cannot be used, after a warning of it."""
    text = str(error).splitlines()[0] if isinstance(error, AirflockError) else describe_error(error)
    line = f"{where}: {shortened(text)}; it is left out"
    warnings.warn(line, stacklevel=2)
    return line


def gather(member: Callable[..., Part], found: Mapping[str, Any], **given: Any) -> Part:
    """Make a member of a kind from names: what is not given stands in the name of its field, values in capitals.

    A rule or a record (a field without a default, or None by default) has the name of its field:
    `neighbour`, `Sums`. A value has that name in capitals: VIOLATES, RATES.
    """
    values = dict(given)
    for item in fields(member):  # type: ignore[arg-type]
        is_rule = item.default in (None, MISSING) and item.default_factory is MISSING
        key = item.name if is_rule else item.name.upper()
        if item.name not in given and key in found:
            values[item.name] = dict(found[key]) if item.default_factory is dict else found[key]
    return member(**values)


def merge_parameters(common: type, record: Any, owner: str) -> type:
    """Merge the Parameters of a file with the numbers that all parts of its kind have.

    common : record of those numbers; record : the file's, None where it has none; owner : such as
             "radio mine"
    """
    if record is None:
        return common
    if not (isinstance(record, type) and issubclass(record, Parameters)):
        raise RuleError(f"{owner}: Parameters is not a frozen dataclass derived from airflock.Parameters")
    if set(number_names(common)) <= set(number_names(record)):
        return record
    made = make_dataclass("Parameters", [], bases=(record, common), frozen=True, kw_only=True)
    made.__doc__, made.__module__ = record.__doc__, record.__module__
    return made


def check_memory_record(
    owner: str, rule: str, argument_names: Collection[str], record: Any, name: str = "Memory"
) -> None:
    """Check the record that a rule keeps from call to call: a NamedTuple with start values, which the rule requests.

    argument_names : names that the rule requests; record : what the file defines under `name`, if
                     anything
    """
    word = name.lower()
    # Without a start value the first call of a rule would read scratch of the driver, so every
    # field needs one.
    if (word in argument_names) is (record is None):
        raise RuleError(f"{owner}: a rule {rule} that asks for {word} and a NamedTuple {name} come together")
    if record is not None and set(getattr(record, "_field_defaults", {})) != set(getattr(record, "_fields", "-")):
        raise RuleError(f"{owner}: {name} is a NamedTuple whose fields all have a value for the start")


def initial_values(record: type | None) -> tuple[float, ...]:
    """Return the value of each field of a record at the start of a flight; nothing without a record."""
    return tuple(getattr(record, "_field_defaults", {}).values())


@cache
def argument_names(rule: Callable[..., Any], kind: str, owner: str = "") -> tuple[str, ...]:
    """Return the argument names of a rule, checked against the vocabulary of its kind."""
    arguments = inspect.signature(rule).parameters
    names = tuple(arguments)
    # Signatures are cheap to check once; the cache keeps this off the path of a flight in plain
    # Python.
    from airflock.core.vocabulary import VOCABULARY  # here, because the chapters of the kinds import this one

    known = VOCABULARY[kind]
    for name in names:
        if name not in known:
            hint = suggest(name, known, ".", lead="; ", cutoff=0.6)
            if arguments[name].default is not inspect.Parameter.empty:
                hint = f"; a number of the rule's own is declared in Parameters, and read as p.{name}."
            elif name == "self":
                hint = "; a rule is a plain function."
            where = f"{owner}.{kind}" if owner else kind
            raise RuleError(f"{where}({', '.join(names)}) asks for {name!r}{hint} Known: {', '.join(known)}")
    return names


def call_rule(rule: Callable[..., Any], kind: str, arguments: Mapping[str, Any], owner: str = "") -> Any:
    """Call a rule with the arguments that it requests by name; raise RuleError where one is missing."""
    names = argument_names(rule, kind, owner)
    values = [arguments.get(name) for name in names]
    for place, value in enumerate(values):
        if value is None:
            raise RuleError(f"{owner}.{kind} asks for {names[place]}, which {owner} does not provide".lstrip("."))
    return rule(*values)


def __getattr__(name: str) -> Any:
    """Return a name that files of users import from here since before 0.1.0; the door of this room has it."""
    if name.startswith("__"):  # or this module would look like a package, by the path of the door
        raise AttributeError(name)
    return getattr(import_module("airflock.core"), name)
