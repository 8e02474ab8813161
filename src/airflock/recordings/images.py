"""Nearest images: in a periodic world the way between two places may lead across its border."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.world import arena, half_sizes

Array = NDArray[Any]


def box_sides(world: arena.Parameters, dimensions: int) -> Array | None:
    """Sides of a periodic world, (axis,) m; None of any other."""
    return 2.0 * np.array(half_sizes(world)[:dimensions]) if world.edges == "periodic" else None


def nearest_image(offset: Array, box: Array | None, axis: int = 0) -> Array:
    """Offsets (m) to the nearest images; `axis` is that of coordinates, `box` what `box_sides` returns."""
    if box is None:
        return offset
    side = box.reshape([-1 if a == axis else 1 for a in range(offset.ndim)])
    found: Array = offset - side * np.round(offset / side)
    return found
