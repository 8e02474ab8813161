"""Drone displays: the points of shapes assigned to drones, flown by rules, and mended when drones fail."""

from airflock.display.shapes import points_of
from airflock.display.show import Show, fly_show

__all__ = ["Show", "fly_show", "points_of"]
