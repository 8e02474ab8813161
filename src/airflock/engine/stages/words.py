"""Words that stages are written with, as they mean in plain Python. `engine.specialise` knows the same words.

A stage is a plain function. It may use what is known when a driver is made (`plan`, `model`: tests
of them choose what stays), the rows of a flock, numbers, and these words. A local that is bound in
one place, to something known, does not appear in the driver; one that is bound in several is a
variable there.
"""

import inspect
from collections.abc import Callable
from typing import Any

X, Y, Z = 0, 1, 2
HALF_SIZES = ("half_x", "half_y", "half_z")
BLOCK = 8  # numbers that are copied at once, candidates that are looked at at once


class NamedConstant(float):
    """A number that a driver calls by a name, in its own precision."""

    spelled: str

    def __new__(cls, value: float, spelled: str) -> "NamedConstant":
        """A number and its name."""
        made = super().__new__(cls, value)
        made.spelled = spelled
        return made


ZERO, HALF, ONE = NamedConstant(0.0, "ZERO"), NamedConstant(0.5, "HALF"), NamedConstant(1.0, "ONE")
TINY, FAR, LIMIT = NamedConstant(1e-12, "TINY"), NamedConstant(1e30, "FAR"), NamedConstant(1e8, "LIMIT")
AWAY = NamedConstant(1e9, "AWAY")  # m, along each axis: where agents are that only fill up vectors
CONSTANTS = (ZERO, HALF, ONE, TINY, FAR, LIMIT, AWAY)  # of every driver
GONE = NamedConstant(-1.0, "-ONE")  # a time, or a square: not there
REDUCTION_START = {"sum": ZERO, "min": FAR, "max": NamedConstant(-1e30, "-FAR")}  # a total before its first term


class ZeroRow:
    """A row along an axis that is not flown: zero for every agent."""

    def __getitem__(self, i: Any) -> NamedConstant:
        return ZERO


class IdentityRow:
    """The number of an agent, where agents lie in the order of their numbers."""

    def __getitem__(self, i: Any) -> Any:
        return i


ZERO_ROW = ZeroRow()


def real(value: Any) -> Any:
    """A number in the precision of the driver."""
    return float(value)


def integer(value: Any) -> Any:
    """A whole number as wide as the driver's real numbers."""
    return int(value)


def row_index(value: Any) -> Any:
    """A whole number that is a place in a row: a driver need not test whether it counts from the row's end."""
    # Numba tests for every signed index whether it counts from the row's end; leaving the test out
    # took 1 % off a flight.
    return int(value)


def least(a: Any, b: Any) -> Any:
    """The lesser of two numbers; of a number and nan the number."""
    # Compiled to llvm.minnum and maxnum: Numba's own min of floats is a comparison without
    # fast-math flags, and a reduction over it stays scalar (25 µs instead of 10.5 µs for the
    # nearest neighbours of 100).
    return b if a != a or b < a else a


def most(a: Any, b: Any) -> Any:
    """The greater of two numbers; of a number and nan the number."""
    return b if a != a or b > a else a


def choose(test: Any, a: Any, b: Any) -> Any:
    """`a` where the test holds, else `b`; both are computed, there is no branch."""
    # Of two conditional expressions on one test LLVM makes two ways through the loop, which is then
    # not vectorised; the select instruction keeps it: 1.9 ns a pair before, 0.22 after.
    return a if test else b


def repeat(count: int) -> range:
    """Turns of a loop that a driver keeps as a loop, though their number is known."""
    return range(count)


def parallel(count: int) -> range:
    """Turns of a loop that threads share; each writes for itself."""
    return range(count)


def copy_block(to: Any, row: int, at: int, source: Any, first: int, shift: Any) -> None:
    """Copy BLOCK numbers of a row of a table to another one, plus a shift, as one vector."""
    to[row][at : at + BLOCK] = source[row][first : first + BLOCK] + shift


def lanes_between(lanes: Any, first: Any, end: Any) -> Any:
    """Those of the lanes from `first` up to `end`, without it."""
    return [i for i in lanes if first <= i < end]


def vector() -> Any:
    """A local vector, zero along each axis that is not set; in a driver one variable for each that is."""
    return [ZERO, ZERO, ZERO]


def totals() -> Any:
    """Local totals by field; in a driver one variable for each."""
    return {}


def aliases() -> Any:
    """Rows under another name, by axis; zero along each axis that is not set."""
    return [ZERO_ROW, ZERO_ROW, ZERO_ROW]


def call_rule(rule: Callable[..., Any] | None, **offered: Any) -> Any:
    """Call a rule with the arguments that it takes, by name. A driver computes only those."""
    assert rule is not None
    return rule(*(offered[name] for name in inspect.signature(rule).parameters))


def components(name: str, vector: Any) -> dict[str, Any]:
    """Return the components of a vector as arguments of a rule, such as dx, dy and dz."""
    return {name + axis: vector[a] for a, axis in enumerate("xyz")}


def row_components(name: str, rows: Any, i: Any) -> dict[str, Any]:
    """Return the components of a vector of agent i as arguments of a rule, such as vx, vy and vz."""
    return {name + axis: rows[a][i] for a, axis in enumerate("xyz")}


def rule_asks(rule: Callable[..., Any] | None, *names: str) -> bool:
    """Return True if a rule takes an argument of any of these names."""
    return rule is not None and bool(set(names) & set(inspect.signature(rule).parameters))


def reduce_term(how: str, total: Any, term: Any) -> Any:
    """A total with one more term: their sum, the lesser or the greater."""
    return total + term if how == "sum" else least(total, term) if how == "min" else most(total, term)


def field_indices(record: Any) -> range:
    """Numbers of the fields of a record; none where there is no record."""
    return range(len(getattr(record, "_fields", ())))


def nonzero_fields(record: Any, dimensions: int) -> list[int]:
    """Fields of a record that can differ from zero: in a plane, a field that ends in z cannot."""
    return [c for c, name in enumerate(getattr(record, "_fields", ())) if dimensions == 3 or not name.endswith("z")]
