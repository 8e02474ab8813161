"""Expressions of column names: + - * / and parentheses, parsed and never evaluated as Python."""

import ast
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.support import RecordingError, suggest

LONGEST = 300  # characters; nothing that a column needs is longer
OPERATIONS = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}
ALLOWED = "column names, numbers, + - * / and parentheses; a name with blanks stands in quotes"


def parse_expression(text: str, target: str) -> ast.expr:
    """Tree of an expression; raises RecordingError for anything but arithmetic of columns."""
    if len(text) > LONGEST:
        raise RecordingError(f"--map {target}:=...: has {len(text)} characters, more than {LONGEST}")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as fault:
        raise RecordingError(f"--map {target}:={text}: cannot be read; it may hold {ALLOWED}") from fault
    for node in ast.walk(tree):
        number = isinstance(node, ast.Constant) and type(node.value) in (int, float, str)
        sign = isinstance(node, (ast.UnaryOp, ast.USub, ast.UAdd))
        word = isinstance(node, (ast.Name, ast.Load, ast.BinOp, *OPERATIONS))
        if not (number or sign or word):
            raise RecordingError(f"--map {target}:={text}: {type(node).__name__} is not allowed; it may hold {ALLOWED}")
    return tree


def column_names(tree: ast.expr) -> list[str]:
    """Columns that an expression asks for."""
    found = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name)]
    return found + [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def single_column(tree: ast.expr) -> str:
    """The column, if an expression is nothing but one; else empty."""
    return column_names(tree)[0] if isinstance(tree, ast.Name) or _text(tree) else ""


def _text(tree: ast.expr) -> bool:
    return isinstance(tree, ast.Constant) and isinstance(tree.value, str)


def check_columns(tree: ast.expr, columns: Any, where: str, target: str) -> None:
    """Raise a RecordingError if an expression asks for a column that is not there."""
    for name in column_names(tree):
        if name not in columns:
            shown = ", ".join(str(c) for c in list(columns)[:12])
            hint = suggest(name, map(str, columns), f"it has {shown}", cutoff=0.4)
            raise RecordingError(f"{where}: --map {target}: no column {name}; {hint}")


def evaluate(tree: ast.expr, columns: Mapping[str, NDArray[np.float64]]) -> Any:
    """An expression with arrays in the place of names."""
    if isinstance(tree, ast.BinOp):
        with np.errstate(divide="ignore", invalid="ignore"):
            return OPERATIONS[type(tree.op)](evaluate(tree.left, columns), evaluate(tree.right, columns))
    if isinstance(tree, ast.UnaryOp):
        inner = evaluate(tree.operand, columns)
        return -inner if isinstance(tree.op, ast.USub) else inner
    if isinstance(tree, ast.Name):
        return columns[tree.id]
    assert isinstance(tree, ast.Constant)
    return columns[tree.value] if isinstance(tree.value, str) else float(tree.value)  # type: ignore[arg-type]


def quote_column(column: str) -> str:
    """A column as it stands in an expression of --map."""
    return column if column.isidentifier() else f"'{column}'"
