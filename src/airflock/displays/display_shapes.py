"""Shapes of a display: points at even distances from an image, a text or a mesh.

Images and texts face south and lean back, so that nobody flies right above somebody else, who might be struck if it
fell; what is dark or opaque is filled. Points lie at the centres of equal
shares of the area (Lloyd 1982) or far from each other on the surface of a mesh (farthest points first). The shape is as
large as their distance asks for, so that drones have room.
"""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.support import AirflockError, SceneError, expand_path

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
