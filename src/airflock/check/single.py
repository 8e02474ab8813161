"""Single precision: a rule's generated text run on numbers that complain where a kernel would fall into doubles.

A float32 kernel becomes double where a float32 meets an integer or a literal that was not cast. Here every number of a
rule is a `SinglePrecision`, which refuses both.
"""

import math
from collections import namedtuple
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from airflock.core import choices, component_names, number_names
from airflock.engine import DriverSource
from airflock.support import RuleError


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
        for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "pow", "fabs", "fmod")
    },
    floor=math.floor,
    ceil=math.ceil,
)


def run_in_single_precision(
    rule: Callable[..., Any], constants: Mapping[str, Any], arguments: Mapping[str, Any], names: Any
) -> Any:
    """What a rule's generated text gives on `given`, by names; raises RuleError where it would leave single precision.

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
        return SimpleNamespace(**choices(value), **numbers, **whole)
    return value
