"""Drone displays: the points of shapes assigned to drones, flown by rules, and mended when drones fail.

The package can be called: `airflock.display(["AIR", "heart.png"], 200)`.
"""

from airflock.callable_module import make_callable
from airflock.display.shapes import points_of
from airflock.display.show import Show, fly_show

__all__ = ["Show", "fly_show", "points_of"]

make_callable(__name__, "airflock.display.displays", "display")
