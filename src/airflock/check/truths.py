"""The runner of standing lists: truths with their report, random cases of a part, other units, single precision."""

import copy
import math
import re
from collections import namedtuple
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from airflock.core import (
    Kind,
    Points,
    Quantity,
    argument_names,
    choices,
    column_places,
    component_names,
    declarations,
    law,
    number_names,
)
from airflock.engine import DriverSource
from airflock.scenarios import Scenario, schema, settings_dict
from airflock.support import AirflockError, ErrorCollector, RuleError

# name → what it says, and a check that returns what is wrong, empty if nothing is
TruthTable = dict[str, tuple[str, Callable[[], str]]]
Array = NDArray[np.float64]
Check = TypeVar("Check", bound=Callable[..., Any])
CLOSE = 1e-9  # more than rounding
MIRROR: Array = np.diag([1.0, -1.0, 1.0])


class CheckError(AirflockError, AssertionError):
    """A law, an order parameter, a body, a sensor or a radio breaks a truth that it does not declare (VIOLATES)."""


@dataclass(frozen=True)
class Truth:
    """One truth: its name, what it says, what was found against it (empty: it holds), and the declared reason why."""

    name: str
    statement: str
    mismatch: str = ""
    reason: str = ""

    def __str__(self) -> str:
        """One line for a person."""
        if not self.mismatch:
            return f"holds   {self.name}: {self.statement}"
        if self.reason:
            return f"breaks  {self.name}, as declared: {self.reason}"
        return f"BREAKS  {self.name}: {self.statement}; {self.mismatch}"


@dataclass(frozen=True)
class Report:
    """Report of the checks of one law, order parameter, body, sensor or radio."""

    name: str
    truths: tuple[Truth, ...]

    def __str__(self) -> str:
        """One line a truth."""
        return "\n".join([f"{self.name}:", *(f"  {truth}" for truth in self.truths)])

    @property
    def broken(self) -> tuple[str, ...]:
        """Names of the truths that do not hold, declared or not."""
        return tuple(truth.name for truth in self.truths if truth.mismatch)


SHARED_SECTIONS = """Parameters
    ----------
    {noun} : {member}, module, class, mapping or str
        A {noun}: a {member}, a namespace such as globals(), a name of ours, or a file that ends in .py.
    parameters : mapping, optional
        Values that differ from the defaults, by name.
    seed : int
        Of the random cases; it stands in every mismatch.

    Returns
    -------
    Report
        Printed, one line a truth; `broken` are the names of those that do not hold, declared or not.

    Raises
    ------
    CheckError
        If a truth does not hold that the {noun} does not declare.
    RuleError, ScenarioError, ParameterError
        If what is checked cannot be read, or a value is none of its numbers.

    """


def standing_list(kind: Kind[Any]) -> Callable[[Check], Check]:
    """Return a decorator that adds to the docstring of a check what all share: arguments, result and errors."""

    def add(check: Check) -> Check:
        noun = kind.noun.rpartition(" ")[2]  # a kind of fault is checked as a fault
        sections = SHARED_SECTIONS.format(noun=noun, member=kind.member.__name__)
        check.__doc__ = (check.__doc__ or "").replace("Examples\n", f"{sections}Examples\n", 1)
        return check

    return add


def parameters_with_values(record: type, values: Any, section: str) -> Any:
    """A record of parameters with the values that a caller gives by name; the others keep their defaults."""
    errors = ErrorCollector()
    made, _ = schema.read_section(section, settings_dict(values, f"check of {section}"), record, errors)
    errors.raise_errors()
    return made


class UnitScale(NamedTuple):
    """Factors by which numbers of metres and of seconds grow."""

    metre: float
    second: float


# Powers of two round nothing, so only guards such as TINY and numbers with hidden units can tell
# the flights apart.
UNIT_SCALES = (UnitScale(2.0, 4.0), UnitScale(0.5, 0.25))
HIDDEN = "a unit is declared wrongly, or a rule contains a number that has a unit"
DIMENSIONS = {
    "": (0, 0), "1": (0, 0), "dB": (0, 0), "rad": (0, 0), "deg": (0, 0), "kg": (0, 0), "m": (1, 0), "cm": (1, 0),
    "km": (1, 0), "s": (0, 1), "Hz": (0, -1), "N": (1, -2), "Pa": (-1, -2), "J": (2, -2), "W": (2, -3),
}  # fmt: skip


def unit_factor(unit: str, units: UnitScale) -> float:
    """By how much a number in this unit grows: "m/s^2" → metre / second². Raises RuleError for an unknown unit."""
    text = unit.replace("²", "^2").replace("³", "^3").replace("·", " ").strip()
    over, _, under = re.sub(r"\((\d+)/(\d+)\)", r"\1:\2", text).partition("/")
    return _product(over, unit, units) / _product(under, unit, units)


def _product(text: str, unit: str, units: UnitScale) -> float:
    result = 1.0
    for name, power, over in re.findall(r"([A-Za-z]+|\b1\b)(?:\^(\d+)(?::(\d+))?)?", text):
        if name not in DIMENSIONS:
            raise RuleError(f"the unit {unit!r} has a part {name!r} that is none of {', '.join(DIMENSIONS)}")
        metres, seconds = DIMENSIONS[name]
        result *= (units.metre**metres * units.second**seconds) ** (int(power or 1) / int(over or 1))
    return result


def rescaled(record: Any, units: UnitScale) -> Any:
    """A record of parameters in the other units; ranges, which are about sense and not about units, are left out."""
    made = copy.copy(record)
    for name, declared, _ in declarations(record):
        value = getattr(record, name)
        # A number at the upper end of its range stands for no limit, in any unit.
        if isinstance(declared, Quantity) and value is not None and value != declared.high:
            object.__setattr__(made, name, value * unit_factor(declared.unit, units))
        elif isinstance(declared, Points):
            object.__setattr__(made, name, _points(value, declared.unit, units))
    return made


def _points(value: Any, unit: str, units: UnitScale) -> Any:
    """Points, or rows whose last number has another unit ("m and s")."""
    if value and not isinstance(value[0], tuple):
        first, _, last = unit.partition(" and ")
        return tuple(x * unit_factor(first, units) for x in value[:-1]) + (
            value[-1] * unit_factor(last or first, units),
        )
    return tuple(_points(each, unit, units) for each in value)


def rescaled_scenario(scenario: Scenario, units: UnitScale) -> Scenario:
    """Return a scenario in the other units."""
    return scenario.with_records({key: rescaled(record, units) for key, record in scenario.records.items()})


@dataclass(frozen=True)
class Trials:
    """A part with its numbers, tried on random cases: what must hold of each answer.

    part    : with its name and the truths that it VIOLATES
    rules   : its rules by kind; letter : by which they read the numbers; numbers : record of its
              parameters
    answer  : numbers and a case → what the part makes of it, in SI units
    cases   : random cases; seed : of these
    scale   : a unit scale and a case → the case in other units, and the factors by which its answer
              grows
    givens  : arguments of rules by name, on which they are tried in single precision
    constants : choices by record name, as a plan has them, beside its own
    floor   : size below which a difference of answers counts as one of this size; close : what is
              equal in other units
    separate : True if each number of an answer has a size of its own
    """

    part: Any
    rules: Mapping[str, Callable[..., Any]]
    letter: str
    numbers: Any
    answer: Callable[[Any, Any], Array]
    cases: Sequence[Any]
    seed: int
    scale: Callable[["UnitScale", Any], tuple[Any, Any]]
    givens: Iterable[Mapping[str, Any]] = ()
    constants: Mapping[str, Any] = field(default_factory=dict)
    floor: float = 1.0
    close: float = CLOSE
    separate: bool = False

    def report(self, noun: str, truths: TruthTable) -> Report:
        """Run the truths of a kind and those of all kinds; raises CheckError where one breaks that is not declared."""
        table = {**truths, "rule": ("every rule can be compiled", self.compiles)}
        table.setdefault("units", ("in other units of length and time it is the same", self.units))
        if self.givens:
            table["single precision"] = ("no rule turns float32 into doubles", self.single)
        name, violates = f"{noun} {self.part.name}", self.part.violates
        # A name that no list knows is an error, so that none is misspelt.
        if unknown := sorted(set(violates) - set(table)):
            raise RuleError(f"{name}: VIOLATES names {', '.join(unknown)}; known: {', '.join(table)}")
        made = tuple(Truth(key, says, _mismatch(check), violates.get(key, "")) for key, (says, check) in table.items())
        if broken := [f"{name}: {truth}" for truth in made if truth.mismatch and not truth.reason]:
            raise CheckError("\n".join(broken))
        return Report(name, made)

    def compiles(self) -> str:
        """Return why a rule cannot be compiled."""
        return next((error for rule in self.rules.values() for error in law.rule_errors(rule)), "")

    def same(
        self,
        change: Callable[[Any], Any],
        back: Callable[[Array], Array] = lambda answer: answer,
        cases: Sequence[Any] | None = None,
    ) -> str:
        """Return where the answer to a changed case is not the answer to the case, changed by `back`."""
        cases = self.cases if cases is None else cases
        pairs = ((self.answer(self.numbers, change(c)), back(self.answer(self.numbers, c))) for c in cases)
        return self.first_mismatch(pairs)

    def units(self) -> str:
        """Return where the part answers otherwise in other units of length and time."""
        for units in UNIT_SCALES:
            other = rescaled(self.numbers, units)
            scaled = ((case, *self.scale(units, case)) for case in self.cases)
            pairs = ((self.answer(other, new) / by, self.answer(self.numbers, case)) for case, new, by in scaled)
            if mismatch := self.first_mismatch(pairs, self.close):
                return f"{mismatch}: {HIDDEN}"
        return ""

    def first_mismatch(self, pairs: Iterable[tuple[Array, Array]], close: float = CLOSE) -> str:
        """Return the first case in which two answers differ by more than rounding; nan is like nan."""
        for number, (answer, expected) in enumerate(pairs):
            sizes = np.abs(np.nan_to_num(expected))
            size = np.maximum(sizes if self.separate else sizes.max(initial=0.0), self.floor)
            apart = np.where(np.isnan(answer) & np.isnan(expected), 0.0, np.abs(answer - expected)) / size
            if not (apart <= close).all():
                was, off = numbers_text(expected), numbers_text(answer)
                return f"case {number} of seed {self.seed}: off by {apart.max():.2g}, ({off}) instead of ({was})"
        return ""

    def single(self) -> str:
        """Return nothing if all rules stay in single precision; raise RuleError where one does not."""
        constants = {self.letter: choices(self.numbers), **self.constants}
        for given in self.givens:
            for kind, rule in self.rules.items():
                names = argument_names(rule, kind, self.part.name)
                run_in_single_precision(rule, constants, {**given, self.letter: self.numbers}, names)
        return ""


def _mismatch(check: Callable[[], str]) -> str:
    """Return what a check finds against a truth, also where the rule fails."""
    try:
        return check()
    except RuleError as error:
        return str(error).splitlines()[0]
    except (ArithmeticError, ValueError) as error:  # of the rule itself: a division by zero, a root of -1
        return f"{type(error).__name__}: {error}"


def numbers_text(values: Array) -> str:
    """Return the first numbers of an answer as text."""
    flat = np.ravel(values)
    return ", ".join(f"{value:.6g}" for value in flat[:6]) + (", ..." if len(flat) > 6 else "")


def rotation_about_vertical(angle: float) -> Array:
    """Return a turn about the vertical by an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


# The generated text runs on numbers that refuse integers and uncast literals: `2 * k` is detected
# by running, not guessed from the text.
class SinglePrecision(float):
    """A number that only meets its like."""


def _refusing(name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def operator(self: SinglePrecision, *other: Any) -> Any:
        for each in other:
            if type(each) is not SinglePrecision and not (name.endswith("pow__") and type(each) is int):
                raise RuleError(f"float32 meets {each!r} of type {type(each).__name__}: a kernel would turn to doubles")
        result = plain(self, *other)
        return SinglePrecision(result) if type(result) is float else result

    return operator


for _name in ("add", "sub", "mul", "truediv", "mod", "pow", "floordiv"):
    setattr(SinglePrecision, f"__{_name}__", _refusing(f"__{_name}__"))
    setattr(SinglePrecision, f"__r{_name}__", _refusing(f"__r{_name}__"))
for _name in ("neg", "abs", "pos"):
    setattr(SinglePrecision, f"__{_name}__", _refusing(f"__{_name}__"))

MATHS = SimpleNamespace(
    **{
        name: (lambda function: lambda *numbers: SinglePrecision(function(*numbers)))(getattr(math, name))
        for name in (
            "sqrt",
            "sin",
            "cos",
            "tan",
            "asin",
            "acos",
            "atan",
            "atan2",
            "exp",
            "log",
            "pow",
            "fabs",
            "fmod",
            "tanh",
        )
    },
    floor=math.floor,
    ceil=math.ceil,
)


def run_in_single_precision(
    rule: Callable[..., Any], constants: Mapping[str, Any], arguments: Mapping[str, Any], names: Any
) -> Any:
    """Run the generated text of a rule, arguments by name; raise RuleError where it would leave single precision.

    constants : choices by record name, as a plan has them
    """
    source = DriverSource("", constants)
    name = source.name(rule)
    space: dict[str, Any] = {
        "real": SinglePrecision, "math": MATHS, "namedtuple": namedtuple, "least": min, "most": max,
        "percept_cast": lambda percept, ux, uy, uz, length, radius: to_single_precision(length),
        "percept_ray": lambda percept, ux, uy, uz, length: to_single_precision(length),
        "percept_normal": lambda percept, draw: SinglePrecision(0.3),
        "percept_uniform": lambda percept, draw: SinglePrecision(0.4),
    }  # fmt: skip
    exec(compile("\n".join(source.blocks), f"<single precision: {name}>", "exec"), space)
    answer = space[name](*(to_single_precision(arguments[each]) for each in names))
    for value in answer if isinstance(answer, tuple) else (answer,):
        if isinstance(value, float) and type(value) is not SinglePrecision:
            raise RuleError(f"rule {rule.__name__} answers {value!r}, which a kernel would hold as a double")
    return answer


def to_single_precision(value: Any) -> Any:
    """A float, a record of parameters or a NamedTuple of floats as `SinglePrecision`s."""
    if type(value) is float:
        return SinglePrecision(value)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return value._replace(**{name: to_single_precision(getattr(value, name)) for name in value._fields})  # type: ignore[attr-defined]
    if hasattr(value, "__dataclass_fields__"):
        numbers = {name: SinglePrecision(getattr(value, name) or 0.0) for name in number_names(value)}
        whole = {
            key: tuple(numbers[part] for part in component_names(key, n)) for key, n in type(value).VECTORS.items()
        }
        columns = {place.partition("[")[0] for place in column_places(value)}
        whole |= {name: tuple(map(SinglePrecision, getattr(value, name))) for name in columns}
        return SimpleNamespace(**choices(value), **numbers, **whole)
    return value
