"""Who flies to which point: the assignment with the least sum of squared ways."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from airflock.support import AirflockError

BLOCKED = 1e9  # m²; the cost of a point that nobody shall fly to while others are free

Positions = NDArray[np.float64]  # (drone, 3) or (point, 3), m
ExtraLengths = NDArray[np.float64] | float  # (drone, point), m


def assign_points(
    drones: Positions, points: Positions, blocked: NDArray[np.bool_], extra_lengths: ExtraLengths = 0.0
) -> NDArray[np.int64]:
    """Number of the point of each drone: positions (drone, 3) and points (point, 3) in m; optimal (scipy).

    blocked : of each point, whether something stands in its place
    longer  : how much longer (drone, point) a way is than the straight one, m

    With squared ways no two straight ways come nearer than the drones and the points are apart, divided by the root of
    2, if all take the same time (Turpin, Michael and Kumar 2014). Raises AirflockError for more drones than points.
    """
    if len(drones) > len(points):
        raise AirflockError(f"{len(drones)} drones are more than {len(points)} points")
    return np.asarray(linear_sum_assignment(_squares(drones, points, extra_lengths) + BLOCKED * blocked[None, :])[1])


def is_better_assignment(
    drones: Positions,
    points: Positions,
    current: NDArray[np.int64],
    proposed: NDArray[np.int64],
    extra_lengths: ExtraLengths = 0.0,
) -> bool:
    """Whether another assignment saves more than a tenth, and more than 1 m², of the squared ways of what is flown."""
    squares, who = _squares(drones, points, extra_lengths), np.arange(len(drones))
    old, new = (float(squares[who, each].sum()) for each in (current, proposed))
    return new < 0.9 * old and old - new > 1.0


def _squares(drones: Positions, points: Positions, longer: ExtraLengths) -> Positions:
    """Squares (drone, point) of the lengths of all ways, m²."""
    straight = ((drones[:, None, :] - points[None, :, :]) ** 2).sum(axis=2)
    return straight if isinstance(longer, float) else np.asarray((np.sqrt(straight) + longer) ** 2)
