"""Arrays as values: what an index needs of an array is taken out of its record while a driver is compiled.

Numba writes the record of an array (data, shape, strides, ...) to memory wherever it is indexed, and reads each part of
it back; LLVM then takes all that out again. A driver has hundreds of indices. Same machine code.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite.ir import Constant, Undefined
from numba.core import cgutils, types

from airflock.engine.compile_shortcuts import Spared


class Record:
    """The record of an array as a value. Whoever writes to it, or asks where it lies, gets Numba's own in memory."""

    _memory: Any = None

    def __init__(self, usual: Callable[..., Any], kind: types.Array, context: Any, builder: Any, value: Any):
        """By what makes Numba's class of such records, `usual`: anew each time, so only where it is needed."""
        vars(self).update(
            _usual=usual, _kind=kind, _context=context, _builder=builder, _value=value,
            _datamodel=context.data_model_manager[kind],
        )  # fmt: skip

    def __getattr__(self, name: str) -> Any:
        if self._memory is not None or name.startswith("_"):
            return getattr(self._in_memory(), name)
        return self._builder.extract_value(self._value, self._datamodel.get_field_position(name))

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._in_memory(), name, value)

    def _in_memory(self) -> Any:
        if self._memory is None:
            vars(self)["_memory"] = self._usual(self._kind)(self._context, self._builder, value=self._value)
        return self._memory

    def _getvalue(self) -> Any:
        return self._value if self._memory is None else self._memory._getvalue()


def _record(usual: Callable[..., Any], kind: Any) -> Callable[..., Any]:
    """What makes records of arrays of a type."""
    if type(kind) is not types.Array:
        return usual(kind)  # type: ignore[no-any-return]

    def made(context: Any, builder: Any, value: Any = None, ref: Any = None) -> Any:
        if value is None or ref is not None:
            return usual(kind)(context, builder, value=value, ref=ref)
        return Record(usual, kind, context, builder, value)

    return made


def _view(
    usual: Callable[..., Any], context: Any, builder: Any, array: Any, of: Any, kind: Any, data: Any, shape: Any,
    strides: Any,
) -> Any:  # fmt: skip
    """Record of a part of an array."""
    if not isinstance(of, Record) or type(kind) is not types.Array:
        return usual(context, builder, array, of, kind, data, shape, strides)
    model = context.data_model_manager[kind]
    count = context.get_constant(types.intp, 1)
    for length in shape:
        count = builder.mul(count, length, flags=["nsw"])
    packed = [cgutils.pack_array(builder, each, count.type) for each in (shape, strides)]
    given = {
        "meminfo": of.meminfo, "parent": of.parent, "nitems": count, "itemsize": of.itemsize, "data": data,
        "shape": packed[0], "strides": packed[1],
    }  # fmt: skip
    value = Constant(model.get_value_type(), Undefined)
    for name, part in given.items():
        value = builder.insert_value(value, part, model.get_field_position(name))
    return Record(of._usual, kind, context, builder, value)


@cache
def as_values() -> tuple[Spared, ...]:
    """What is exchanged of Numba's."""
    from numba.np import arrayobj

    return (arrayobj, "make_array", _record), (arrayobj, "make_view", _view)
