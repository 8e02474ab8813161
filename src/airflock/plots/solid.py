"""Solids in parallel projection: lit faces, the nearest at each pixel, and whether a point is hidden by them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.plots.flight import View
from airflock.stage.scene import Solid

Array = NDArray[Any]
PIXELS = 1400  # along the longer side
FINER = 2  # pixels are drawn so many times smaller, then averaged
LIGHT = np.array([-0.35, -0.55, 0.76])  # towards the sun, unit vector
SHADE = 0.66  # brightness of a face that the sun only grazes
GROUND = (240, 241, 243)
NEAR = 1e-3  # of the depth of a scene: what is no farther behind a face lies on it


class Rendering(NamedTuple):
    """A picture of solids.

    colour : (row, column, red green blue alpha), 0 to 1, from the top
    depth  : (row, column) towards the viewer, m, at the finer pixels; -inf where nothing is
    box    : left, right, bottom, top, m; toward : unit vector to the viewer; view : projection
    """

    colour: Array
    depth: Array
    box: tuple[float, float, float, float]
    toward: Array
    view: View

    def hides(self, points: Array) -> NDArray[np.bool_]:
        """Whether a solid is in front of points (point, 3), m."""
        x, y = self.view(points)
        left, right, bottom, top = self.box
        rows, columns = self.depth.shape
        column = np.clip(((x - left) / (right - left) * columns).astype(int), 0, columns - 1)
        row = np.clip(((top - y) / (top - bottom) * rows).astype(int), 0, rows - 1)
        front = self.depth[row, column]
        finite = self.depth[np.isfinite(self.depth)]
        slack = NEAR * float(np.ptp(finite)) if finite.size else 0.0
        return np.asarray(points @ self.toward < front - slack)


def toward(view: View) -> Array:
    """Unit vector to the viewer."""
    return np.cross(view.right, view.up)


def render(
    solids: Sequence[Solid], view: View, box: tuple[float, float, float, float], pixels: int = PIXELS
) -> Rendering:
    """Draw solids onto a picture of a box of the projection: left, right, bottom, top, m."""
    left, right, bottom, top = box
    scale = FINER * pixels / max(right - left, top - bottom)
    rows, columns = (FINER * max(1, round(span * scale / FINER)) for span in (top - bottom, right - left))
    depth, colour = np.full((rows, columns), -np.inf), np.zeros((rows, columns, 4), np.float32)
    eye = toward(view)
    for solid in solids:
        corners = np.asarray(solid.vertices, float)[np.asarray(solid.faces, int)]  # (face, corner, axis)
        tones = _lit(corners, solid.colour)
        x, y = view(corners, axis=2)
        px, py, far = (x - left) * scale, (top - y) * scale, corners @ eye
        for number in range(len(corners)):
            _fill(depth, colour, px[number], py[number], far[number], tones[number])
    small = colour.reshape(rows // FINER, FINER, columns // FINER, FINER, 4).mean(axis=(1, 3))
    alpha = np.maximum(small[..., 3:], 1e-6)
    small[..., :3] = np.clip(small[..., :3] / alpha, 0.0, 1.0)
    return Rendering(small, depth, box, eye, view)


def ground(low: Array, high: Array) -> Solid:
    """The floor under a box of the plan, at height 0, m."""
    (x0, y0), (x1, y1) = low[:2], high[:2]
    corners = np.array([[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]])
    return Solid("ground", corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), GROUND)


def _lit(corners: Array, colour: tuple[int, int, int]) -> Array:
    """Colour of each face (face, 3), 0 to 1: the brighter the more it faces the sun (Lambert)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    normal *= np.where(normal[:, 2] < -1e-9, -1.0, 1.0)[:, None]  # floors are seen from above
    bright = SHADE + (1.0 - SHADE) * np.clip(normal @ LIGHT, -0.5, 1.0)
    return np.asarray(np.clip(bright[:, None] * np.array(colour) / 255.0 * 1.12, 0.0, 1.0))


def _fill(depth: Array, colour: Array, x: Array, y: Array, far: Array, tone: Array) -> None:
    """Draw one triangle where it is in front; corners x, y in pixels and their depths, m."""
    rows, columns = depth.shape
    c0, c1 = max(int(np.floor(x.min())), 0), min(int(np.ceil(x.max())) + 1, columns)
    r0, r1 = max(int(np.floor(y.min())), 0), min(int(np.ceil(y.max())) + 1, rows)
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    if c0 >= c1 or r0 >= r1 or abs(area) < 1e-9:
        return
    u, v = np.arange(c0, c1)[None, :] + 0.5, np.arange(r0, r1)[:, None] + 0.5
    b = ((u - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (v - y[0])) / area
    c = ((x[1] - x[0]) * (v - y[0]) - (u - x[0]) * (y[1] - y[0])) / area
    here = far[0] + b * (far[1] - far[0]) + c * (far[2] - far[0])
    before = depth[r0:r1, c0:c1]
    front = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1.0 + 1e-9) & (here > before)
    before[front] = here[front]
    colour[r0:r1, c0:c1][front] = (*tone, 1.0)
