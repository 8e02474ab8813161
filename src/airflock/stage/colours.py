"""Colours of agents by what they do: safe for colour-blind readers, even in lightness."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# viridis of matplotlib (van der Walt and Smith 2015, CC0), nine of its colours, without the yellow end
RAMP = np.array(
    [[68, 1, 84], [72, 40, 120], [62, 74, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137], [53, 183, 121],
     [109, 205, 89], [180, 222, 44]], float,
)  # fmt: skip
# round the compass: blue north, orange south, with the lightness of a cyclic map
WHEEL = np.array([[213, 94, 0], [230, 159, 0], [86, 180, 233], [0, 114, 178], [120, 94, 240], [204, 121, 167]], float)
ALERT = (213, 0, 50)
CHOSEN = (255, 140, 0)
INK = "#555555"
BLUE, RED, GREEN = (0, 114, 178), (213, 94, 0), (0, 158, 115)
ORANGE, PURPLE, SKY = (230, 159, 0), (204, 121, 167), (86, 180, 233)  # Okabe and Ito 2008
TERMS = (GREEN, SKY, PURPLE, BLUE, (120, 94, 240), (120, 120, 120))
LINES = {
    "links": ((170, 180, 195), 1.0),
    "heard": (ORANGE, 2.0),
    "ghosts": (PURPLE, 3.0),
    "measured": (BLUE, 3.0),
    "command": (RED, 4.0),
    "terms": (GREEN, 3.0),
    "rays": ((150, 150, 150), 1.0),
    "wake": (SKY, 1.5),
}  # kinds of lines about agents: colour, width in pixels

WAYS = ("speed", "heading", "height", "agent")


def ramp(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) of shares from 0 to 1."""
    return _between(RAMP, np.clip(share, 0.0, 1.0) * (len(RAMP) - 1))


def wheel(share: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) of shares of a full turn."""
    closed = np.vstack([WHEEL, WHEEL[:1]])
    return _between(closed, np.mod(share, 1.0) * len(WHEEL))


def _between(table: NDArray[Any], place: NDArray[Any]) -> NDArray[np.uint8]:
    first = np.minimum(place.astype(int), len(table) - 2)
    part = (place - first)[:, None]
    return np.asarray(np.round(table[first] * (1.0 - part) + table[first + 1] * part), np.uint8)


def colours(
    way: str, position: NDArray[Any], velocity: NDArray[Any], top: float, height: tuple[float, float]
) -> NDArray[np.uint8]:
    """Colours (agent, 3) by speed (0 to `top` m/s), heading, height (between two, m) or number."""
    if way == "heading":
        return wheel(np.arctan2(velocity[:, 1], velocity[:, 0]) / (2.0 * np.pi))
    if way == "height":
        low, high = height
        return ramp((position[:, 2] - low) / max(high - low, 1e-9))
    if way == "agent":
        return wheel(np.arange(len(position)) * 0.6180339887)
    return ramp(np.sqrt((velocity**2).sum(1)) / max(top, 1e-9))


def key(way: str, top: float, height: tuple[float, float]) -> str:
    """The key to the colours, as HTML."""
    if way == "agent":
        return "<small>each agent has a colour of its own</small>"
    if way == "heading":
        sample, left, right = wheel(np.linspace(0.0, 1.0, 25)), "east", "north, west, south, east"
    else:
        sample = ramp(np.linspace(0.0, 1.0, 17))
        low, high = (0.0, top) if way == "speed" else height
        unit = "m/s" if way == "speed" else "m"
        left, right = f"{low:.3g}", f"{high:.3g} {unit}"
    bands = ", ".join("#{:02x}{:02x}{:02x}".format(*c) for c in sample.tolist())
    return (
        f'<div style="padding:0 0.75em"><div style="height:0.7em;border-radius:3px;'
        f'background:linear-gradient(to right, {bands})"></div><div '
        'style="display:flex;justify-content:space-between;font-size:0.75em">'
        f"<span>{left}</span><span>{way}</span><span>{right}</span></div></div>"
    )
