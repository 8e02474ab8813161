"""Plan displays and fly them: from shapes to a show, and from a show to a flight."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.displays.display_shapes import shape_points
from airflock.displays.show_control import FrameArray, ShapeReport, ShowControl
from airflock.engine import Flight
from airflock.recordings import recording_of as recorded
from airflock.scenarios import Scenario, load
from airflock.support import AirflockError, ScenarioError, collect_errors

FILE = Path(__file__).parent / "display.toml"
FAILURE_KINDS = ("fall", "hover", "both")


@dataclass
class Show:
    """What was flown: each shape's figures; frames (time, 6, drone; nan once failed), the time between them, s, and the
    last frame of each shape; the scenario, the seed, and the flight, which is one from the first shape to the last.
    """

    shape_reports: list[ShapeReport]
    frames: FrameArray
    period: float
    ends: list[int]
    scenario: Scenario
    seed: int
    flight: Flight


def recording_of(show: Show) -> xr.Dataset:
    """Make a recording of a show with its events; failed drones are missing from then on."""
    return recorded(show.flight)


def display_scenario(drones: int, settings: dict[str, Any] | None = None) -> Scenario:
    """Return the scenario of a display, with keys changed."""
    there = [[3.0 * i, 0.0, 10.0] for i in range(drones)]
    return load(FILE, {"agents": drones, "goals.points": there, **(settings or {})})


def waiting_points(count: int, spacing: float = 3.0, height: float = 10.0) -> FrameArray:
    """Return the points (count, 3) of a level square where drones wait before the first shape, m."""
    side = int(np.ceil(np.sqrt(count)))
    number = np.arange(count)
    x, y = (number % side - 0.5 * (side - 1)) * spacing, (number // side - 0.5 * (side - 1)) * spacing
    return np.column_stack([x, y, np.full(count, height)])


def fly_show(
    shapes: list[NDArray[np.float64]],
    drones: int,
    failing: float = 0.0,
    failure: str = "both",
    seed: int = 0,
    settings: dict[str, Any] | None = None,
) -> Show:
    """Fly a display and measure it.

    shapes  : points (point, 3) of each, m; failing : share of the drones that fail on the way, evenly over the shapes
    failure : "fall" out of the sky, "hover" where it is and hear nothing more, or "both" in turns
    settings : keys of the scenario, for instance {"wind.gust": 2.0}

    Raises AirflockError where a shape has fewer points than there are drones.
    """
    if failure not in FAILURE_KINDS:
        raise AirflockError(f"failure = {failure!r} is none of {', '.join(FAILURE_KINDS)}")
    if not 0.0 <= failing < 1.0:
        raise AirflockError(f"failing = {failing:g} lies outside [0, 1)")
    for number, points in enumerate(shapes):
        if len(points) < drones:
            raise AirflockError(f"shape {number + 1} has {len(points)} points, fewer than {drones} drones")
    rng = np.random.default_rng([seed, 3])
    doomed = rng.permutation(drones)[: round(failing * drones)]
    legs = np.array_split(doomed, len(shapes))
    kinds = {int(who): FAILURE_KINDS[i % 2] if failure == "both" else failure for i, who in enumerate(doomed)}
    scenario = display_scenario(drones, settings)
    show = ShowControl(scenario, waiting_points(drones), shapes[0], seed, failing=bool(len(doomed)))
    ends = []
    for points, failures in zip(shapes, legs, strict=True):
        show.form(points, [(int(who), kinds[int(who)], float(rng.uniform())) for who in failures])
        ends.append(round(show.flight.time / show.period))
    return Show(show.finish(), show.flight.frames[:, :6], show.period, ends, show.scenario, seed, show.flight)


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
        With one line for each error of the shapes, shares, numbers and keys.
    AirflockError
        If the display cannot be flown.

    Notes
    -----
    Points are assigned by the least total squared way. Turpin et al. (2014) show that straight ways then never cross.

    Examples
    --------
    >>> import airflock
    >>> show = airflock.display(["I "], 4, spacing=5.0)
    >>> show.shape_reports[0].drones, show.shape_reports[0].collisions
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
    """Return the points (point, 3) of each shape, m; raise ScenarioError with all errors. `dash` goes before names in
    errors.
    """
    errors = []
    if not 0.0 <= failing <= 0.9:
        errors.append(f"{name_prefix}failing = {failing:g} lies outside [0, 0.9]")
    if not 0.0 < spacing < math.inf:
        errors.append(f"{name_prefix}spacing = {spacing:g} m is not above 0")
        spacing = 3.0  # by which the rest is judged
    if failure not in FAILURE_KINDS:
        errors.append(f"{name_prefix}failure = {failure!r} is none of {', '.join(FAILURE_KINDS)}")
    count = drones if points is None else points
    if drones > count:
        errors.append(
            f"{name_prefix}drones = {drones} are more than {name_prefix}points = {count}; "
            "give each drone a point, or fly fewer"
        )
    with collect_errors(errors):
        display_scenario(drones, dict(settings or {}))
    found = []
    for number, shape in enumerate(shapes):
        with collect_errors(errors):
            found.append(shape_points(shape, count, spacing, seed=number))
    if errors:
        raise ScenarioError(errors)
    return found
