"""A city of square blocks: one building each, as high as a seed says, with streets between."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.world import scenery
from airflock.world.scenes.tree import box_rows


def buildings(p: scenery.Parameters) -> NDArray[np.float64]:
    """Rows of boxes. Blocks are numbered from the south-west; a lower density leaves some of them empty."""
    rng = np.random.default_rng(int(p.seed))
    n, pitch = int(p.blocks), p.block + p.street
    west = (np.arange(n) - 0.5 * n) * pitch + 0.5 * p.street
    x, y = (axis.ravel() for axis in np.meshgrid(west, west, indexing="ij"))
    height = rng.uniform(min(p.low, p.high), max(p.low, p.high), n * n)
    stands = rng.uniform(0.0, 1.0, n * n) < p.density
    flat = np.zeros(n * n)
    return box_rows(np.stack([x, y, flat, x + p.block, y + p.block, height], axis=1)[stands])


def extent(p: scenery.Parameters) -> float:
    """Half side of the city with the street around it, m."""
    return 0.5 * int(p.blocks) * (p.block + p.street)


def forest_extent(p: scenery.Parameters) -> float:
    """Half side of the forest, m."""
    return 0.5 * p.side


def half_side(p: scenery.Parameters, shapes: Any) -> float:
    """Half side (m) of the square that a scene stands on."""
    if p.kind == "city":
        return extent(p)
    if p.kind == "forest":
        return forest_extent(p)
    return float(np.abs(shapes[:, [0, 1, 3, 4]]).max()) if len(shapes) else 0.0
