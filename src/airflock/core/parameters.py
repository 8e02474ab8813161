"""Parameters: declared once, with unit, range, meaning and source.

Help texts, validation, sliders, search bounds and the kernels' table rows all come from these
declarations. A record is a frozen dataclass derived from `Parameters`; its numbers are floats, its
choices strings that are compile-time constants in a kernel.
"""

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import cache
from math import isfinite
from typing import Any, NamedTuple

from airflock.support import ParameterError, is_number, suggest

MAX_COMPONENTS = 64  # components of one vector; a driver's text holds a line for each


class VectorFields(NamedTuple):
    """Declared fields of the components of a vector, as `quantity(size=n)` leaves them in the body of a class."""

    fields: tuple[Any, ...]


def component_names(name: str, size: int) -> tuple[str, ...]:
    """Names of the components of a vector."""
    return tuple(f"{name}_{k}" for k in range(size))


def vector_sizes(numbers: Iterable[str]) -> dict[str, int]:
    """Vectors among the names of the numbers of a record, and how many components each has."""
    known = set(numbers)
    found = {}
    for first in known:
        name, _, number = first.rpartition("_")
        if name and number == "0" and name not in known:
            size = 1
            while f"{name}_{size}" in known:
                size += 1
            found[name] = size
    return found


def vector_properties(vectors: Mapping[str, int]) -> dict[str, Any]:
    """Properties of a class of records by which its vectors are read as tuples."""

    def read(names: tuple[str, ...]) -> property:
        return property(lambda record: tuple(getattr(record, name) for name in names))

    return {name: read(component_names(name, size)) for name, size in vectors.items()}


class VectorMeta(type):
    """Class of records whose vectors are declared in one line: each becomes its components before it is a dataclass."""

    VECTORS: dict[str, int]

    def __init__(cls, name: str, bases: tuple[type, ...], space: dict[str, Any], **options: Any):
        super().__init__(name, bases, space, **options)
        declared = {key: value.fields for key, value in space.items() if isinstance(value, VectorFields)}
        known: dict[str, int] = {key: size for base in bases for key, size in getattr(base, "VECTORS", {}).items()}
        cls.VECTORS = known | {key: len(fields) for key, fields in declared.items()}
        if not declared:
            return
        # Components take the place of the vector before the record becomes a dataclass, so that
        # units, ranges, keys, searches, columns and GPU registers know scalars only.
        notes: dict[str, Any] = {}
        for key, note in inspect.get_annotations(cls).items():
            parts = component_names(key, len(declared[key])) if key in declared else (key,)
            twice = [part for part in parts if part in notes or (part in space and key in declared)]
            if twice:
                raise ParameterError(f"{name}.{twice[0]} is declared twice, once as a component of a vector")
            notes |= dict.fromkeys(parts, float if key in declared else note)
        cls.__annotations__ = notes
        for key, components in declared.items():
            for part, component in zip(component_names(key, len(components)), components, strict=True):
                setattr(cls, part, component)
        for key, value in vector_properties({key: len(components) for key, components in declared.items()}).items():
            setattr(cls, key, value)

    def __call__(cls, *given: Any, **named: Any) -> Any:
        """A record; a vector may be given whole, or by its components."""
        for key in cls.VECTORS.keys() & named.keys():
            value, size = named.pop(key), cls.VECTORS[key]
            error = vector_error(value, size)
            if error:
                raise ParameterError(f"{cls.__name__}.{key} {error}")
            named |= dict(zip(component_names(key, size), value, strict=True))
        return super().__call__(*given, **named)


def vector_error(value: Any, size: int) -> str:
    """Return the error of the components of a vector together, as the rest of a sentence; empty if valid."""
    if isinstance(value, str) or not isinstance(value, Sequence):
        return f"= {value!r} is not a list; give {size} numbers"
    count = len(value)
    return "" if count == size else f"has {count} number{'' if count == 1 else 's'}; give {size}"


def expand_vectors(section: str, table: Mapping[str, Any], record: Any) -> tuple[dict[str, Any], list[str]]:
    """A table of a scenario with the components of its vectors, and the errors; explicit components take precedence."""
    found, errors = dict(table), []
    for key, size in getattr(record, "VECTORS", {}).items():
        if key not in found:
            continue
        given = found.pop(key)
        long = dict(given) if isinstance(given, Mapping) and "value" in given else None
        value = given if long is None else long["value"]
        error = vector_error(value, size)
        if error:
            errors.append(f"{section}.{key} {error}")
            continue
        for name, number in zip(component_names(key, size), value, strict=True):
            found.setdefault(name, number if long is None else long | {"value": number})
    return found, errors


def without_replaced(table: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A table without the components of those vectors that `overrides` sets as a whole."""
    whole = {key for key, value in overrides.items() if isinstance(value, (list, tuple, Mapping))}

    def goes(key: str) -> bool:
        name, _, number = key.rpartition("_")
        return name in whole and number.isdigit()

    return {key: value for key, value in table.items() if not goes(key)}


def format_with_unit(text: str, unit: str) -> str:
    """A number or a range followed by its unit; a plain number, of unit 1, by nothing."""
    return text if unit in ("", "1") else f"{text} {unit}"


class Quantity(NamedTuple):
    """Declaration of one number: SI unit, allowed range (both ends included), meaning and source."""

    unit: str
    low: float
    high: float
    meaning: str
    source: str
    optional: bool  # None is allowed and means "derived from the rest of the scenario"
    whole: bool = False  # only whole numbers make sense
    usual: tuple[float, float] | None = None  # span that a slider shows; None: around the value

    @property
    def span(self) -> str:
        """The allowed range with its unit, for people to read."""
        return format_with_unit(f"[{self.low:g}, {self.high:g}]", self.unit)


class Choice(NamedTuple):
    """Declaration of one enumerated choice."""

    options: tuple[str, ...]
    meaning: str
    source: str


class Points(NamedTuple):
    """Declaration of a list, `depth` brackets deep (2: points, 3: polygons), or of a column (1: numbers)."""

    unit: str
    depth: int
    meaning: str
    source: str
    axes: int = 2  # coordinates of a point; of a column how many numbers it has at most


class Text(NamedTuple):
    """Declaration of a text, such as the name of a file."""

    meaning: str
    source: str


Declaration = Quantity | Choice | Points | Text


def quantity(
    default: float | tuple[float, ...] | None, unit: str, *, low: float, high: float, meaning: str, source: str = "",
    whole: bool = False, usual: tuple[float, float] | None = None, size: int | None = None,
) -> Any:  # fmt: skip
    """Declare a number of a record of parameters, or several of one meaning.

    Parameters
    ----------
    default : float, tuple of float or None
        In `unit`. None makes it optional: it then comes from the rest of the scenario. Of a vector one number for all
        components, or one for each.
    unit : str
        SI unit, "1" for a plain number.
    low, high : float
        Allowed range in `unit`, both ends included.
    meaning : str
        What it is, for help texts and error messages.
    source : str
        Where the default comes from.
    whole : bool
        Only whole numbers make sense; searches take no others.
    usual : (float, float), optional
        The span in `unit` of usual values, inside the allowed range: the ends of its slider on a live page. Without
        it a slider takes the bounds of a study of the same law, or else reaches from 0 to 4 times the value.
    size : int, optional
        How many components a vector has. A rule reads it as a tuple, `p.weights[k]`; loops over it are unrolled. In a
        scenario file it is a list, `model.weights = [0.2, 0.1]`, and `model.weights_0` is its first component, with a
        slider and bounds of a search of its own.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a frozen dataclass derived from `airflock.Parameters`.

    Raises
    ------
    ParameterError
        By the record, when it is made with a value outside the range, or with what is not a number. At once, where
        the declaration itself is faulty.

    Examples
    --------
    >>> import airflock
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Gains(airflock.Parameters):
    ...     push: float = airflock.quantity(0.2, "1/s", low=0.0, high=5.0, meaning="repulsion gain")
    >>> Gains().push
    0.2
    >>> Gains(push=9.0)
    Traceback (most recent call last):
    airflock.support.errors.ParameterError: Gains.push = 9 1/s lies outside [0, 5] 1/s
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Weights(airflock.Parameters):
    ...     w: tuple[float, ...] = airflock.quantity(0.5, "1", size=3, low=0.0, high=1.0, meaning="weights")
    >>> Weights(w=(0.1, 0.2, 0.3)).w, Weights(w_1=0.9).w
    ((0.1, 0.2, 0.3), (0.5, 0.9, 0.5))
    """
    if size is not None:
        parts = default if isinstance(default, tuple) else (default,) * size
        if not 1 <= size <= MAX_COMPONENTS or len(parts) != size or None in parts:
            raise ParameterError(
                f"size = {size}: give 1 to {MAX_COMPONENTS} components and a default for each ({meaning})"
            )
        words = [f"{meaning}, {k + 1} of {size}" for k in range(size)]
        rest: dict[str, Any] = {"low": low, "high": high, "source": source, "whole": whole, "usual": usual}
        return VectorFields(
            tuple(quantity(part, unit, meaning=of, **rest) for part, of in zip(parts, words, strict=True))
        )
    if isinstance(default, tuple):
        raise ParameterError(f"default = {default} of several numbers needs their size ({meaning})")
    if usual is not None and not low <= usual[0] < usual[1] <= high:
        raise ParameterError(f"usual = {usual} is no span inside [{low:g}, {high:g}] ({meaning})")
    for name, end in (("low", low), ("high", high)):
        if not is_number(end):
            raise ParameterError(f"{name} = {end!r} is not a number ({meaning})")
    record = Quantity(unit, float(low), float(high), meaning, source, default is None, whole, usual)
    return field(default=default, metadata={"airflock": record})


def choice(default: str, options: tuple[str, ...], *, meaning: str, source: str = "") -> Any:
    """Declare an enumerated choice of a record of parameters.

    Parameters
    ----------
    default : str
        One of the options.
    options : tuple of str
        What it may be. A choice is a constant in a compiled flight, so a rule may branch on it for free.
    meaning : str
        What it decides.
    source : str
        Where the default comes from.

    Returns
    -------
    dataclasses.Field
        To be assigned in the body of a frozen dataclass derived from `airflock.Parameters`.

    Raises
    ------
    ParameterError
        By the record, when it is made with a word that is none of the options.

    Examples
    --------
    >>> import airflock
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Form(airflock.Parameters):
    ...     limit: str = airflock.choice("cap", ("cap", "rescale"), meaning="how a wish is limited")
    >>> Form().limit
    'cap'
    """
    return field(default=default, metadata={"airflock": Choice(options, meaning, source)})


def points(unit: str, depth: int, *, meaning: str, source: str = "", axes: int = 2) -> Any:
    """Declare a list of points (empty by default)."""
    return field(default=(), metadata={"airflock": Points(unit, depth, meaning, source, axes)})


def column(default: tuple[float, ...], unit: str, *, most: int, meaning: str, source: str = "") -> Any:
    """Declare a column of at most so many numbers, which rules of a law read one by one, `p.name[k]`.

    It may have any length. Unlike a vector it is not written out in a driver, and its numbers have
    no names.
    """
    return field(default=default, metadata={"airflock": Points(unit, 1, meaning, source, most)})


def text(default: str = "", *, meaning: str, source: str = "") -> Any:
    """Declare a text."""
    return field(default=default, metadata={"airflock": Text(meaning, source)})


def declarations(record: Any) -> Iterator[tuple[str, Declaration, Any]]:
    """Name, declaration and default of each parameter of a record or of its class."""
    return iter(_declarations(record if isinstance(record, type) else type(record)))


@cache
def _declarations(kind: type) -> tuple[tuple[str, Declaration, Any], ...]:
    # Without its decorator a class keeps the fields themselves, and each default would be one.
    left = [name for name, value in vars(kind).items() if isinstance(value, Field)]
    if left:
        where = "@dataclass(frozen=True, kw_only=True) above the class"
        raise ParameterError(f"{kind.__name__} declares {', '.join(left)}, but is not a dataclass; write {where}")
    return tuple(
        (item.name, _declared(item), None if item.default is MISSING else item.default) for item in fields(kind)
    )


def _declared(item: Field[Any]) -> Declaration:
    found = item.metadata.get("airflock")
    if found is None:
        raise ParameterError(f"parameter {item.name} is not declared by quantity(), choice(), points() or text()")
    return found  # type: ignore[no-any-return]


@dataclass(frozen=True, kw_only=True)
class Parameters(metaclass=VectorMeta):
    """Base of every record of parameters: numbers become floats, and all faults are reported together.

    A record is a frozen dataclass whose fields are declared by `quantity` and `choice`. Raises ParameterError.

    Examples
    --------
    >>> import airflock
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Two(airflock.Parameters):
    ...     speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
    >>> Two(speed=5)
    Two(speed=5.0)
    """

    def __post_init__(self) -> None:
        errors = []
        for name, declared, _ in declarations(self):
            value = getattr(self, name)
            if not isinstance(value, float) and isinstance(declared, Quantity) and is_number(value):
                with suppress(OverflowError):  # which no range holds
                    object.__setattr__(self, name, value := float(value))  # 1 and 1.0 must not compile two kernels
            if error := value_error(value, declared):
                errors.append(f"{type(self).__name__}.{name} {error}")
            elif isinstance(declared, Points):
                object.__setattr__(self, name, _frozen(value))
        if errors:
            raise ParameterError("\n".join(errors))


def value_error(value: Any, declared: Declaration) -> str:
    """Return the error of a value, as the rest of a sentence that begins with its key; empty if valid."""
    if isinstance(declared, Quantity):
        return quantity_error(value, declared)
    if isinstance(declared, Choice):
        if isinstance(value, str) and value in declared.options:
            return ""
        hint = suggest(value, declared.options, lead="; ", cutoff=0.6)
        return f"= {value!r} is none of {', '.join(declared.options)}{hint}"
    if isinstance(declared, Text):
        return "" if isinstance(value, str) else f"= {value!r} is not text"
    return points_error(value, declared)


def quantity_error(value: Any, declared: Quantity) -> str:
    """Return the error of a number, as the rest of a sentence; empty if valid."""
    if value is None and declared.optional:
        return ""
    if not isinstance(value, float) and not is_number(value):
        return f"= {value!r} is not a number; give {declared.span}"
    try:
        value = float(value)
    except OverflowError:
        return f"= {format_with_unit('a whole number beyond 1e308', declared.unit)} lies outside {declared.span}"
    if declared.whole and isfinite(value) and not value.is_integer():
        digits = telling_digits(value, lambda v: v != int(v))
        return f"= {digits} is not a whole number; give one in {declared.span}"
    if declared.low <= value <= declared.high:
        return ""
    digits = telling_digits(value, lambda v: not declared.low <= v <= declared.high)
    return f"= {format_with_unit(digits, declared.unit)} lies outside {declared.span}"


def telling_digits(value: float, is_wrong: Callable[[float], bool]) -> str:
    """Format a number with as many digits as show what is wrong with it, six at least."""
    # Six digits may round what is just outside of a range to its end, and the line would deny
    # itself.
    texts = (f"{value:.{digits}g}" for digits in (6, 9, 12, 15))
    return next((text for text in texts if is_wrong(float(text))), repr(value))


def points_error(value: Any, declared: Points) -> str:
    """Return the error of a list of points or polygons, as the rest of a sentence; empty if valid."""
    with suppress(TypeError, ValueError, OverflowError, RecursionError):
        if _are_points(_frozen(value), declared):
            return ""
    if declared.depth == 1:
        return f"is not a list of at most {declared.axes} finite numbers; it holds {declared.meaning}"
    if declared.axes > 3:
        rows = f"rows of {declared.axes} numbers in {declared.unit}"
        return f"is not a list of {rows}; it holds {declared.meaning}"
    point = f"[east, north{', up' if declared.axes == 3 else ''}]"
    what = f"points {point}" if declared.depth == 2 else f"polygons [{point}, ...]"
    return f"is not a list of {what} in {declared.unit}"


def _are_points(value: Any, declared: Points, level: int = 1) -> bool:
    if not isinstance(value, tuple):
        return False
    if level < declared.depth:
        return all(_are_points(entry, declared, level + 1) for entry in value)
    fits = len(value) <= declared.axes if declared.depth == 1 else len(value) == declared.axes
    return fits and all(isinstance(number, float) and isfinite(number) for number in value)


def _frozen(value: Any) -> Any:
    # float() would take "1" and True, which no file means as numbers.
    if isinstance(value, (str, bool)):
        raise TypeError(f"{value!r} is not a number")
    return tuple(_frozen(v) for v in value) if isinstance(value, (list, tuple)) else float(value)


def number_names(record: Any) -> tuple[str, ...]:
    """Names of the numbers of a record or its class, in declared order: the columns of its table."""
    return _number_names(record if isinstance(record, type) else type(record))


@cache
def _number_names(kind: type) -> tuple[str, ...]:
    return tuple(name for name, declared, _ in declarations(kind) if isinstance(declared, Quantity))


def column_places(record: Any) -> tuple[str, ...]:
    """Return "name[k]" of each number of the columns of a record: its places in the row of a driver."""
    columns = (
        name for name, declared, _ in declarations(record) if isinstance(declared, Points) and declared.depth == 1
    )
    return tuple(f"{name}[{k}]" for name in columns for k in range(len(getattr(record, name))))


def choices(record: Any) -> dict[str, str]:
    """The enumerated choices of a record: compile-time constants of a kernel."""
    return {name: getattr(record, name) for name, declared, _ in declarations(record) if isinstance(declared, Choice)}
