"""What a picture of a page shows."""

import io

import imageio.v3 as imageio
import numpy as np


def shot(tab):
    """Screenshot as (row, column, 3) bytes."""
    return imageio.imread(io.BytesIO(tab.screenshot(timeout=120_000)))[..., :3].astype(int)


def coloured(picture, left=0, right=None):
    """Where a picture has colour, as of agents; greys and white have none."""
    part = picture[:, left:right]
    return part.max(axis=2) - part.min(axis=2) > 60


def places(mask, cell=20):
    """Number of square cells of a mask with anything in them."""
    rows, columns = (n // cell * cell for n in mask.shape)
    cells = mask[:rows, :columns].reshape(rows // cell, cell, columns // cell, cell)
    return int(np.any(cells, axis=(1, 3)).sum())


def chart(tab, number=0):
    """Picture of one chart of a live page; nothing while it is being made anew."""
    box = tab.locator(".uplot canvas").nth(number).bounding_box(timeout=120_000)
    if box is None:
        return np.zeros((20, 20, 3), int)
    left, top = int(box["x"]), int(box["y"])
    return shot(tab)[top : top + int(box["height"]), left : left + int(box["width"])]
