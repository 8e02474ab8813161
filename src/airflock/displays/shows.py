"""Plan displays and fly them: from shapes to a show, and from a show to a flight."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.displays.show_control import FrameArray, ShapeReport, ShowControl
from airflock.engine import Flight
from airflock.recordings import recording_of as recorded
from airflock.scenarios import Scenario, load
from airflock.support import AirflockError, ScenarioError, SceneError, collect_errors, expand_path

# Shapes of a display are points at even distances from an image, a text or a mesh.
# Images and texts face south and lean back, so that nobody flies right above somebody else, who might be struck if it
# fell; what is dark or opaque is filled. Points lie at the centres of equal shares of the area (Lloyd 1982) or far from
# each other on the surface of a mesh (farthest points first). The shape is as large as their distance requires, so that
# drones have room.

Points = NDArray[np.float64]
IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".gif")
MESHES = (".stl", ".obj", ".glb", ".gltf", ".ply", ".off")
FILE_NAME = re.compile(r".*\.[A-Za-z][A-Za-z0-9]{1,4}")  # what ends so is meant as a file, not as a text
MOST_BYTES = 50_000_000
MOST_PIXELS = 25_000_000
LEAN = 0.5  # m back for each m up
ROUNDS = 40  # of Lloyd's iteration


def shape_points(shape: str, count: int, spacing: float = 3.0, height: float = 15.0, seed: int = 0) -> Points:
    """Return points (count, 3) of a shape, m: at least spacing (m) apart, all above height (m), centred over the
    origin.

    shape : the path of an image or mesh, or any other text, which is written

    Raises AirflockError where the file is missing, of another kind, too large, damaged or empty.
    """
    path = expand_path(shape)
    rng = np.random.default_rng(seed)
    kind = path.suffix.lower()
    if kind in IMAGES or kind in MESHES:
        if not path.is_file():
            raise AirflockError(f"{shape}: no such file")
        if path.stat().st_size > MOST_BYTES:
            raise AirflockError(f"{shape}: {path.stat().st_size / 1e6:.0f} MB is more than {MOST_BYTES / 1e6:.0f} MB")
    elif FILE_NAME.fullmatch(shape) or (kind and os.path.isfile(shape)):
        problem = f"ending {path.suffix}: neither a picture nor a mesh" if os.path.isfile(shape) else "no such file"
        raise AirflockError(
            f"{shape}: {problem}; give {', '.join(IMAGES + MESHES)}, or for a text add a space at its end"
        )
    if kind in MESHES:
        found = _spread_over_mesh(path, count, rng)
    else:
        filled = _pixels_of_image(path) if kind in IMAGES else _pixels_of_text(shape)
        if not filled.any():
            raise AirflockError(f"{shape}: nothing in it to fill: no letter that can be drawn, and no dark pixel")
        flat = _evenly(filled, count, rng)
        found = np.column_stack([flat[:, 0], LEAN * flat[:, 1], flat[:, 1]])
    found = found - 0.5 * (found.min(axis=0) + found.max(axis=0))
    if count > 1:
        nearest = cKDTree(found).query(found, k=2)[0][:, 1]
        if nearest.min() <= 0.0:
            raise AirflockError(f"{shape}: too small for {count} points; give a larger picture or fewer drones")
        found *= spacing / nearest.min()
    found[:, 2] += height - found[:, 2].min()
    return np.asarray(found)


def _pixels_of_text(text: str) -> NDArray[np.bool_]:
    """Return the pixels of a text, upright."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(2.0, 1.2 * len(text)), 2.0), dpi=100)
    canvas: Any = FigureCanvasAgg(figure)
    figure.text(0.5, 0.5, text, ha="center", va="center", fontsize=90, weight="bold", parse_math=False)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, 0] < 128


def _pixels_of_image(path: Path) -> NDArray[np.bool_]:
    """Return opaque or, without transparency, dark pixels."""
    import imageio.v3 as iio

    try:
        about = iio.improps(path)
        if np.prod(about.shape) > 4 * MOST_PIXELS:
            raise AirflockError(f"{path}: {about.shape} pixels are more than {MOST_PIXELS}; make the picture smaller")
        image = np.asarray(iio.imread(path, index=0) if path.suffix.lower() == ".gif" else iio.imread(path))
    except AirflockError:
        raise
    except Exception as error:  # any decoder may fail in any way on a damaged file
        raise AirflockError(f"{path}: is not an image, damaged or cut short: {str(error).splitlines()[0]}") from error
    if image.ndim == 2:
        return image < 128
    if image.shape[2] in (2, 4) and image[:, :, -1].min() < 250:
        return np.asarray(image[:, :, -1] > 127)
    return np.asarray(image[:, :, :3].mean(axis=2) < 128)


def _evenly(filled: NDArray[np.bool_], count: int, rng: np.random.Generator) -> Points:
    """Return points (count, 2) right and up, at the centres of equal shares of the filled pixels."""
    rows, columns = np.nonzero(filled)
    pixels = np.column_stack([columns, -rows]).astype(float)
    if len(pixels) < count:
        raise AirflockError(f"{len(pixels)} filled pixels are fewer than {count} points; give a larger picture")
    # Every round visits all pixels: a sample bounds the time.
    if len(pixels) > 40_000:
        pixels = pixels[rng.choice(len(pixels), 40_000, replace=False)]
    centres = pixels[rng.choice(len(pixels), count, replace=False)]
    # Lloyd (1982): each centre moves to the mean of its pixels; one without pixels is drawn again.
    for _ in range(ROUNDS):
        owner = cKDTree(centres).query(pixels)[1]
        share = np.bincount(owner, minlength=count)[:, None]
        sums = np.column_stack([np.bincount(owner, pixels[:, axis], count) for axis in range(2)])
        centres = np.where(share > 0, sums / np.maximum(share, 1), pixels[rng.choice(len(pixels), count)])
    return centres


def _spread_over_mesh(path: Path, count: int, rng: np.random.Generator) -> Points:
    """Return points on the surface, each as far as possible from those before."""
    from airflock.world import read_mesh

    try:
        mesh: Any = read_mesh(path)
    except SceneError as error:  # there is no scene.file here
        raise AirflockError(str(error).replace("scene.file = ", "")) from error
    corners = np.asarray(mesh.vertices, float)[np.asarray(mesh.faces)]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if area.sum() <= 0.0:
        raise AirflockError(f"{path}: the mesh has no area")
    # Uniform on the surface: faces by area, then points in a triangle by the root of a uniform
    # number.
    face = rng.choice(len(corners), 40 * count, p=area / area.sum())
    u, v = np.sqrt(rng.uniform(size=(1, len(face), 1))), rng.uniform(size=(1, len(face), 1))
    a, b, c = corners[face].transpose(1, 0, 2)
    cloud = ((1.0 - u) * a + u * (1.0 - v) * b + u * v * c)[0]
    chosen, gap = [0], np.linalg.norm(cloud - cloud[0], axis=1)
    # Farthest points first: greedy, at most a factor of two worse than the best spacing.
    while len(chosen) < count:
        chosen.append(int(gap.argmax()))
        gap = np.minimum(gap, np.linalg.norm(cloud - cloud[chosen[-1]], axis=1))
    return np.asarray(cloud[chosen])


FILE = Path(__file__).parent / "display.toml"
FAILURE_KINDS = ("fall", "hover", "both")


@dataclass
class Show:
    """What was flown: each shape's figures; frames (time, 6, drone; nan once failed), the time between them, s, and the
    last frame of each shape; the scenario, the seed, and the flight, which is one from the first
    shape to the last.
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

    shapes  : points (point, 3) of each, m; failing : share of the drones that fail on the way,
              evenly over the shapes
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
    shapes : sequence of str (SHAPE...)
        Images, meshes (stl, obj, glb) or texts, shown one after another.
    drones : int in [2, 2000]
        Number of drones.
    failing : float
        Share of the drones that fail on the way, 0 to 0.9.
    failure : {"both", "fall", "hover"}
        What a drone that fails does: "fall", "hover", or "both" in turns.
    points : int in [2, inf], optional
        Points of a shape; by default one per drone.
    spacing : float in [2.5, 100]
        Smallest distance between two points, m.
    seed : int in [0, inf]
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
