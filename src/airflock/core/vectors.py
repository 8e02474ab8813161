"""Vectors: parameters of several numbers. To all that looks at declarations, each component is a number of its own.

`weights: tuple[float, ...] = quantity((0.5, 0.3), "1", size=2, ...)` declares the numbers `weights_0` and `weights_1`:
they have keys, sliders, bounds of searches and columns like all others. A rule reads `p.weights`, a tuple.
"""

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from airflock.support import ParameterError

MAX_COMPONENTS = 64  # components of one vector; a driver's text holds a line for each


class VectorFields(NamedTuple):
    """What `quantity(size=n)` leaves in the body of a class: the declared fields of its components."""

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
        notes: dict[str, Any] = {}
        for key, note in inspect.get_annotations(cls).items():
            parts = component_names(key, len(declared[key])) if key in declared else (key,)
            twice = [part for part in parts if part in notes or (part in space and key in declared)]
            if twice:
                raise ParameterError(f"{name}.{twice[0]} is declared twice, once as a component of a vector")
            notes |= dict.fromkeys(parts, float if key in declared else note)
        cls.__annotations__ = notes
        for key, fields in declared.items():
            for part, field in zip(component_names(key, len(fields)), fields, strict=True):
                setattr(cls, part, field)
        for key, value in vector_properties({key: len(fields) for key, fields in declared.items()}).items():
            setattr(cls, key, value)

    def __call__(cls, *given: Any, **named: Any) -> Any:
        """A record; a vector may be given whole, or by its components."""
        for key in cls.VECTORS.keys() & named.keys():
            value, size = named.pop(key), cls.VECTORS[key]
            fault = vector_error(value, size)
            if fault:
                raise ParameterError(f"{cls.__name__}.{key} {fault}")
            named |= dict(zip(component_names(key, size), value, strict=True))
        return super().__call__(*given, **named)


def vector_error(value: Any, size: int) -> str:
    """What is wrong with the components of a vector together, as the rest of a sentence; empty if nothing is."""
    if isinstance(value, str) or not isinstance(value, Sequence):
        return f"= {value!r} is not a list; give {size} numbers"
    count = len(value)
    return "" if count == size else f"has {count} number{'' if count == 1 else 's'}; give {size}"


def expand_vectors(section: str, table: Mapping[str, Any], record: Any) -> tuple[dict[str, Any], list[str]]:
    """A table of a scenario with the components of its vectors, and faults; a component that is given goes before."""
    found, faults = dict(table), []
    for key, size in getattr(record, "VECTORS", {}).items():
        if key not in found:
            continue
        given = found.pop(key)
        long = dict(given) if isinstance(given, Mapping) and "value" in given else None
        value = given if long is None else long["value"]
        fault = vector_error(value, size)
        if fault:
            faults.append(f"{section}.{key} {fault}")
            continue
        for name, number in zip(component_names(key, size), value, strict=True):
            found.setdefault(name, number if long is None else long | {"value": number})
    return found, faults


def without_replaced(table: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A table without the components of those vectors that `own` gives as a whole."""
    whole = {key for key, value in overrides.items() if isinstance(value, (list, tuple, Mapping))}

    def goes(key: str) -> bool:
        name, _, number = key.rpartition("_")
        return name in whole and number.isdigit()

    return {key: value for key, value in table.items() if not goes(key)}
