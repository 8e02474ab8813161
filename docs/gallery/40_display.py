"""
A drone display
===============

Points of a shape are assigned to drones so that the sum of squared paths is least, and again when drones fail.
"""

import airflock

show = airflock.display(["AIR", "FLY"], 60, failing=0.05, seed=1)
figure = airflock.plots.stood(show, ["AIR", "FLY"])
figure
