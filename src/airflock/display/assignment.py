"""Who flies to which point: the assignment with the least sum of squared ways."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from airflock.errors import AirflockError

BLOCKED = 1e9  # m²; the cost of a point that nobody shall fly to while others are free


def assign(drones: NDArray[np.float64], points: NDArray[np.float64], blocked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of the point of each drone: positions (drone, 3) and points (point, 3) in m; optimal (scipy).

    blocked : of each point, whether something stands in its place

    With squared ways no two straight ways come nearer than the drones and the points are apart, divided by the root of
    2, if all take the same time (Turpin, Michael and Kumar 2014). Raises AirflockError for more drones than points.
    """
    if len(drones) > len(points):
        raise AirflockError(f"{len(drones)} drones are more than {len(points)} points")
    cost = ((drones[:, None, :] - points[None, :, :]) ** 2).sum(axis=2) + BLOCKED * blocked[None, :]
    return np.asarray(linear_sum_assignment(cost)[1])


def better(
    drones: NDArray[np.float64], points: NDArray[np.float64], mine: NDArray[np.int64], now: NDArray[np.int64]
) -> bool:
    """Whether another assignment saves more than a tenth, and more than 1 m², of the squared ways of what is flown."""
    old, new = (float(((drones - points[each]) ** 2).sum()) for each in (mine, now))
    return new < 0.9 * old and old - new > 1.0
