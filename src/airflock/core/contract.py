"""The contract that all kinds of rule share: where rules are gathered from, and how they are called.

A rule is a plain function of floats. The names of its arguments are its declaration: a driver computes and passes only
what the rule requests, in any order. `core.vocabulary` lists the names. A file of rules may bring records of its own
(Parameters, and a Memory that a rule keeps from call to call); they are checked when the file is gathered.
"""

import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import make_dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, NamedTuple, TypeVar

from airflock.core.parameters import Parameters, number_names
from airflock.support import RuleError, shortened, suggest

T = TypeVar("T")
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


def namespace_names(namespace: Any, name: str = "") -> tuple[dict[str, Any], str]:
    """Return the names in a module, a class or a mapping, and its own name: `name`, its NAME, or that of its module.

    A static method is the function inside, so that the check of rules can name it and its decorator.
    """
    if not isinstance(namespace, Mapping) and not hasattr(namespace, "__dict__"):
        text = shortened(repr(namespace), 80)
        raise RuleError(f"{text} holds no rules; give a module, a class, or names such as globals()")
    found = dict(namespace) if isinstance(namespace, Mapping) else dict(vars(namespace))
    found = {key: value.__func__ if isinstance(value, staticmethod) else value for key, value in found.items()}
    return found, name or str(found.get("NAME") or found.get("__name__", "own")).rpartition(".")[2].strip("_")


def find_members(package: str, rules: Collection[str], gather: Callable[[Any], T]) -> dict[str, T]:
    """Gather the parts of one kind from the modules of a folder, by name in alphabetical order.

    A file that is laid into the folder is a member; no list names it.

    package : dotted name of the folder; rules: a module that defines one of them is a part, others are helpers
    gather  : makes a part from a module, such as `airflock.body`

    Raises RuleError if two modules have one name.
    """
    members: dict[str, T] = {}
    folder = import_module(package)
    for entry in iter_modules(folder.__path__, f"{package}."):
        module = import_module(entry.name)
        if any(rule in vars(module) for rule in rules):
            name = namespace_names(module)[1]
            if name in members:
                raise RuleError(f"{entry.name}: another file of {package} is named {name!r}, too")
            members[name] = gather(module)
    return dict(sorted(members.items()))


def merge_parameters(common: type, record: Any, owner: str) -> type:
    """Merge the Parameters of a file with the numbers that all parts of its kind have.

    common : record of those numbers; record : the file's, None where it has none; owner : such as "radio mine"
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

    argument_names : names that the rule requests; record : what the file defines under `name`, if anything
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
