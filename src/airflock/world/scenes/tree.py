"""Scene: rows of shapes and the flat tree over them, as arrays for the kernels."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.world.shapes import APPEARS, BOX, CLOSED, COLUMNS, CYLINDER, GROUND, SEGMENT, TRIANGLE

FAR_AWAY = 1e9  # m; where the bounds of a shape lie that is not there yet
LEAF = 4  # shapes of a leaf
TALL_HEIGHT = 1e6  # m; half height of what has no end in height


@dataclass(frozen=True)
class Scene:
    """What stands in a world.

    shapes : (shape, 18) rows as in `world.shapes`, in the order of the tree's leaves
    nodes  : (node, 6) bounds, m; links : (node, 3) skip, first, last as in `world.bvh`
    notes  : what was adjusted while it was made, for a person to read
    """

    shapes: NDArray[np.float64]
    nodes: NDArray[np.float64]
    links: NDArray[np.int64]
    notes: tuple[str, ...] = field(default=())

    @cached_property
    def as_lists(self) -> tuple[list[list[float]], list[list[float]], list[list[int]]]:
        """Shapes, nodes and links as plain lists, for plain Python."""
        return self.shapes.tolist(), self.nodes.tolist(), self.links.tolist()

    @cached_property
    def has_closed_surface(self) -> bool:
        """Whether any surface closes around a position."""
        return bool((self.shapes[:, CLOSED] > 0.0).any())

    @property
    def later(self) -> NDArray[np.int64]:
        """Numbers of the shapes that appear while flying."""
        return np.flatnonzero(self.shapes[:, APPEARS] > 0.0)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest corner (2, 3), m; zeros if empty."""
        if not len(self.shapes):
            return np.zeros((2, 3))
        return np.array([self.shapes[:, :3].min(axis=0), self.shapes[:, 3:6].max(axis=0)])


def box_rows(corners: Any) -> NDArray[np.float64]:
    """Rows of boxes from (box, 6) lowest and highest corners, m."""
    given = np.asarray(corners, float).reshape(-1, 6)
    return _rows(BOX, given, given[:, :0])


def ground_row(corners: Any) -> NDArray[np.float64]:
    """Row of the ground from its (6,) lowest and highest corner, m."""
    given = np.asarray(corners, float).reshape(-1, 6)
    return _rows(GROUND, given, given[:, :0])


def cylinder_rows(values: Any) -> NDArray[np.float64]:
    """Rows of upright cylinders from (cylinder, 5) x y radius z0 z1, m."""
    x, y, r, low, high = np.asarray(values, float).reshape(-1, 5).T
    bounds = np.stack([x - r, y - r, low, x + r, y + r, high], axis=1)
    return _rows(CYLINDER, bounds, np.stack([x, y, r], axis=1))


def triangle_rows(corners: Any) -> NDArray[np.float64]:
    """Rows of triangles from (triangle, 3, 3) corners, m."""
    given = np.asarray(corners, float).reshape(-1, 3, 3)
    bounds = np.concatenate([given.min(axis=1), given.max(axis=1)], axis=1)
    return _rows(TRIANGLE, bounds, given.reshape(-1, 9))


def segment_rows(ends: Any) -> NDArray[np.float64]:
    """Rows of upright walls without end in height from (segment, 4) ax ay bx by, m."""
    given = np.asarray(ends, float).reshape(-1, 4)
    tall = np.full(len(given), TALL_HEIGHT)
    low = np.minimum(given[:, :2], given[:, 2:])
    high = np.maximum(given[:, :2], given[:, 2:])
    bounds = np.column_stack([low, -tall, high, tall])
    return _rows(SEGMENT, bounds, given)


def make_scene(rows: Sequence[NDArray[np.float64]], notes: tuple[str, ...] = ()) -> Scene:
    """Scene of these rows of shapes."""
    shapes = np.concatenate([np.zeros((0, COLUMNS)), *rows])
    order, nodes, links = _tree(shapes)
    return Scene(shapes[order], nodes, links, notes)


def _rows(kind: float, bounds: NDArray[np.float64], numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    rows = np.zeros((len(bounds), COLUMNS))
    rows[:, :6], rows[:, 6], rows[:, 7 : 7 + numbers.shape[1]] = bounds, kind, numbers
    return rows


def _tree(shapes: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Order of the shapes, nodes and links: split at the median of the longest axis until leaves are small."""
    if not len(shapes):
        return np.zeros(0, np.int64), np.zeros((0, 6)), np.zeros((0, 3), np.int64)
    low, high = shapes[:, :3], shapes[:, 3:6]
    middle = np.clip(0.5 * (low + high), -TALL_HEIGHT, TALL_HEIGHT)
    order: list[int] = []
    nodes: list[Any] = []
    links: list[list[int]] = []
    pending = [(np.arange(len(shapes)), -1)]  # members, or the node whose walk ends here
    while pending:
        members, closes = pending.pop()
        if closes >= 0:
            links[closes][0] = len(nodes)
            continue
        number = len(nodes)
        nodes.append(np.concatenate([low[members].min(axis=0), high[members].max(axis=0)]))
        links.append([0, len(order), len(order)])
        pending.append((members[:0], number))
        if len(members) <= LEAF:
            order.extend(members.tolist())
            links[number][2] = len(order)
            continue
        axis = int(np.ptp(middle[members], axis=0).argmax())
        half = len(members) // 2
        sides = np.argpartition(middle[members, axis], half)
        pending.append((members[sides[half:]], -1))
        pending.append((members[sides[:half]], -1))
    return np.array(order), np.array(nodes), np.array(links, np.int64)


def without_appearing(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shapes as they stand at the start, and what appears later: its bounds (m), time (s) and number."""
    if not len(scene.later):
        return scene.shapes, np.zeros((0, 8))
    shapes, k = scene.shapes.copy(), scene.later
    later = np.column_stack([shapes[k, :6], shapes[k, APPEARS], k])
    shapes[k, :6] = FAR_AWAY
    return shapes, later
