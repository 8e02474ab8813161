"""
Around obstacles
================

Walls and obstacles act as agents that fly inwards. The flock splits at an obstacle and rejoins behind it.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/obstacles", {"duration": 180.0})
figure = airflock.plots.trajectories(airflock.simulate(scenario, seed=1))
figure
