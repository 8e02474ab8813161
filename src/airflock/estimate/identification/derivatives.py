"""Second derivatives of a likelihood by central differences, for intervals."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def second_derivative(loss: Callable[[Any], float], z: NDArray[np.float64], i: int, j: int, step: float) -> float:
    """Derivative of a loss by its numbers i and j at z (number,)."""
    one, other = step * np.eye(len(z))[[i, j]]
    differences = loss(z + one + other) - loss(z + one - other) - loss(z - one + other) + loss(z - one - other)
    return differences / (4.0 * step * step)


def hessian(loss: Callable[[Any], float], z: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """All second derivatives of a loss at z, (row, column)."""
    n = len(z)
    return np.array([[second_derivative(loss, z, i, j, step) for j in range(n)] for i in range(n)])
