"""
Circling or crossing
====================

The flock's rotation about the arena's centre: near 1 or -1 if it circles, near 0 if it crosses. Three seeds.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": 300.0})
flights = {f"seed {seed}": airflock.simulate(scenario, seed) for seed in (1, 2, 3)}
figure = airflock.plots.rotations(flights)
figure
