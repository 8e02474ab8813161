"""Numbers that a caller gives: Python's own and NumPy's, and nothing that only looks like one."""

from numbers import Real
from typing import Any


def is_number(value: Any) -> bool:
    """Whether a value is a number: no truth value, no text, no missing value of pandas, no array."""
    return isinstance(value, Real) and not isinstance(value, bool)
