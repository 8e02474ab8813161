"""
Order parameters over time
==========================

From a random start to a flock: speed, correlation and distances.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": "2 min"})
figure = airflock.plots.series(airflock.simulate(scenario, seed=2))
figure
