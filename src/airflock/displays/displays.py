"""The public door to displays: shapes by their names, flown one after another."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.displays.shapes import shape_points
from airflock.displays.show import FAILURE_KINDS, Show, display_scenario, fly_show
from airflock.support import ScenarioError, collect_errors


def display(
    shapes: Sequence[str],
    drones: int = 200,
    *,
    failing: float = 0.0,
    failure: str = "both",
    points: int | None = None,
    spacing: float = 3.0,
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
) -> Show:
    """Fly a drone display: points assigned to drones, and again when some fail.

    Parameters
    ----------
    shapes : sequence of str
        Images, meshes (stl, obj, glb) or texts, shown one after another.
    drones : int
        Number of drones.
    failing : float
        Share of the drones that fail on the way, 0 to 0.9.
    failure : str
        What a drone that fails does: "fall", "hover", or "both" in turns.
    points : int, optional
        Points of a shape; by default one per drone.
    spacing : float
        Smallest distance between two points, m.
    seed : int
        Seed of failures and noise.
    settings : mapping, optional
        Keys of the scenario, such as {"wind.gust": 2.0}.

    Returns
    -------
    Show
        `formed`, how well each shape stood (times in s, distances in m), and the frames of all drones.

    Raises
    ------
    ScenarioError
        With one line for each fault of the shapes, shares, numbers and keys.
    AirflockError
        If the display cannot be flown.

    Notes
    -----
    Points are assigned by the least total squared way. Turpin et al. (2014) show that straight ways then never cross.

    Examples
    --------
    >>> import airflock
    >>> show = airflock.display(["I "], 4, spacing=5.0)
    >>> show.formed[0].drones, show.formed[0].collisions
    (4, 0)
    """
    planned = plan_shapes(shapes, drones, failing, failure, points, spacing, settings)
    return fly_show(planned, drones, failing, failure, seed, dict(settings or {}))


def plan_shapes(
    shapes: Sequence[str],
    drones: int,
    failing: float,
    failure: str,
    points: int | None,
    spacing: float,
    settings: Mapping[str, Any] | None,
    name_prefix: str = "",
) -> list[NDArray[np.float64]]:
    """Points (point, 3) of each shape, m; raises ScenarioError with all faults. `dash` goes before names in faults."""
    faults = []
    if not 0.0 <= failing <= 0.9:
        faults.append(f"{name_prefix}failing = {failing:g} lies outside [0, 0.9]")
    if not 0.0 < spacing < math.inf:
        faults.append(f"{name_prefix}spacing = {spacing:g} m is not above 0")
        spacing = 3.0  # by which the rest is judged
    if failure not in FAILURE_KINDS:
        faults.append(f"{name_prefix}failure = {failure!r} is none of {', '.join(FAILURE_KINDS)}")
    count = drones if points is None else points
    if drones > count:
        faults.append(
            f"{name_prefix}drones = {drones} are more than {name_prefix}points = {count}; "
            "give each drone a point, or fly fewer"
        )
    with collect_errors(faults):
        display_scenario(drones, dict(settings or {}))
    found = []
    for number, shape in enumerate(shapes):
        with collect_errors(faults):
            found.append(shape_points(shape, count, spacing, seed=number))
    if faults:
        raise ScenarioError(faults)
    return found
