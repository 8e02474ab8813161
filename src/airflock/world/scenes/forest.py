"""A forest: trunks that bear crowns, both upright cylinders, at places that a seed draws. Open air above."""

import numpy as np
from numpy.typing import NDArray

from airflock.support import SceneError
from airflock.world import scenery
from airflock.world.scenes.tree import cylinder_rows

# Our choice: a stand of grown broad-leaved trees; the thesis's scene is not available
MOST = 200_000  # trees, of two shapes each: their tree of boxes takes some 10 s to build
HEIGHT = (8.0, 20.0)  # m, tree
TRUNK = (0.15, 0.40)  # m, radius
CROWN = (1.0, 2.5)  # m, radius
CLEAR = (0.35, 0.55)  # share of the height below the crown


def trees(p: scenery.Parameters) -> NDArray[np.float64]:
    """Rows of cylinders: trunks, then crowns."""
    rng = np.random.default_rng(int(p.seed))
    n = round(p.trees * p.density)
    if n > MOST:
        raise SceneError(
            f"scene.trees = {p.trees:g} at scene.density = {p.density:g} are {n} trees; at most {MOST} fit, "
            f"for instance scene.trees = {int(MOST / p.density)}"
        )
    x, y = rng.uniform(-0.5 * p.side, 0.5 * p.side, (2, n))
    height, trunk, crown, clear = (rng.uniform(*span, n) for span in (HEIGHT, TRUNK, CROWN, CLEAR))
    ground = np.zeros(n)
    stems = np.stack([x, y, trunk, ground, clear * height], axis=1)
    crowns = np.stack([x, y, crown, clear * height, height], axis=1)
    return cylinder_rows(np.concatenate([stems, crowns]))
