"""Bounds: the condition under which a claim holds, written as a comparison of its measured fields.

A bound is data, `low > 0` or `abs(ours - published) <= 0.02`, so that a verdict follows from what stands in the file.
"""

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

from airflock.support import AirflockError

NAMES = ("ours", "sd", "low", "high", "p", "runs", "published", "published_sd", "reference", "reference_sd")
COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
}
ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
EXTREMES = (-1e30, 0.0, 1.0, 1e30)  # values of every field that a bound is tried on by `refutable`


def holds(bound: str, fields: Mapping[str, float | None]) -> bool:
    """Whether a bound holds for measured fields.

    Raises AirflockError if it is no comparison, or asks for a field that was not measured.
    """
    try:
        return bool(_value(ast.parse(bound, mode="eval").body, fields))
    except (SyntaxError, TypeError, ZeroDivisionError, _NotABound) as fault:
        raise AirflockError(f"bound {bound!r}: {fault}; it may compare {', '.join(NAMES)} and abs(...)") from fault


def names(bound: str) -> set[str]:
    """Fields that a bound asks for."""
    return {node.id for node in ast.walk(ast.parse(bound, mode="eval")) if isinstance(node, ast.Name)} & set(NAMES)


def refutable(bound: str, published: Mapping[str, float | None]) -> bool:
    """Whether some measurement would break a bound; published: what is printed, which does not change."""
    fixed = dict.fromkeys(("published", "published_sd", "reference", "reference_sd"), 0.5)
    fixed |= {name: value for name, value in published.items() if value is not None}
    free = sorted(names(bound) - set(fixed))
    return any(not holds(bound, {**fixed, **dict.fromkeys(free, value)}) for value in EXTREMES)


class _NotABound(Exception):
    """What stands in a bound besides comparisons and arithmetic."""


def _value(node: ast.expr, fields: Mapping[str, float | None]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name(id=name) if name in NAMES:
            found = fields.get(name)
            if found is None:
                raise _NotABound(f"{name} was not measured")
            return found
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_value(inner, fields)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
            return ARITHMETIC[type(op)](_value(left, fields), _value(right, fields))
        case ast.Call(func=ast.Name(id="abs"), args=[inner], keywords=[]):
            return abs(_value(inner, fields))
        case ast.BoolOp(op=ast.And(), values=parts):
            return all([_value(part, fields) for part in parts])
        case ast.BoolOp(op=ast.Or(), values=parts):
            return any([_value(part, fields) for part in parts])
        case ast.Compare(left=left, ops=ops, comparators=rights) if all(type(op) in COMPARISONS for op in ops):
            terms = [_value(term, fields) for term in (left, *rights)]
            pairs = zip(ops, terms, terms[1:], strict=False)
            return all(COMPARISONS[type(op)](a, b) for op, a, b in pairs)
    raise _NotABound(f"{ast.unparse(node)} is neither a field, a number nor a comparison")
