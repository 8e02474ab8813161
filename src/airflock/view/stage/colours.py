"""Colours: scales, a wheel and names, safe for colour-blind readers, scales even in lightness."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# viridis of matplotlib (van der Walt and Smith 2015, CC0), nine of its colours, without the yellow end
RAMP_STOPS = np.array(
    [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121],
     [109, 205, 89], [180, 222, 44]], float,
)  # fmt: skip
# round the compass: blue north, orange south, with the lightness of a cyclic map
WHEEL_STOPS = np.array(
    [[213, 94, 0], [230, 159, 0], [86, 180, 233], [0, 114, 178], [120, 94, 240], [204, 121, 167]], float
)
COLLISION_COLOUR = (213, 0, 50)
SELECTED_COLOUR = (255, 140, 0)
AXIS_COLOUR = "#555555"
BLUE, RED, GREEN = (0, 114, 178), (213, 94, 0), (0, 158, 115)
ORANGE, PURPLE, SKY = (230, 159, 0), (204, 121, 167), (86, 180, 233)  # Okabe and Ito 2008
CATEGORY_COLOURS = (BLUE, GREEN, PURPLE, SKY, (120, 94, 240), RED, ORANGE)  # of names, in this order
TERM_COLOURS = (GREEN, SKY, PURPLE, BLUE, (120, 94, 240), (120, 120, 120))
LINE_STYLES = {
    "links": ((170, 180, 195), 1.0),
    "heard": (ORANGE, 2.0),
    "ghosts": (PURPLE, 3.0),
    "measured": (BLUE, 3.0),
    "command": (RED, 4.0),
    "terms": (GREEN, 3.0),
    "rays": ((150, 150, 150), 1.0),
    "wake": (SKY, 1.5),
}  # kinds of lines about agents: colour, width in pixels


def ramp_colours(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) of shares from 0 to 1."""
    return _interpolated(RAMP_STOPS, np.clip(share, 0.0, 1.0) * (len(RAMP_STOPS) - 1))


def wheel_colours(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) of shares of a full turn."""
    closed = np.vstack([WHEEL_STOPS, WHEEL_STOPS[:1]])
    return _interpolated(closed, np.mod(share, 1.0) * len(WHEEL_STOPS))


def _interpolated(table: NDArray[Any], position: NDArray[Any]) -> NDArray[np.uint8]:
    first = np.minimum(position.astype(int), len(table) - 2)
    part = (position - first)[:, None]
    return np.asarray(np.round(table[first] * (1.0 - part) + table[first + 1] * part), np.uint8)
