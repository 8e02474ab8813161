"""
Delay against range
===================

How much delay a flock tolerates depends on how far it hears. Each cell of the map is the mean of two flights.
"""

import airflock

over = {"radio.delay": [0.0, 0.5, 1.0, 1.5, 2.0], "radio.range": [40.0, 80.0, 160.0]}
settings = {"agents": 40, "duration": 120.0}
scenario = airflock.load("vasarhelyi_2018/8ms", settings)
table = airflock.sweep(scenario, over, seeds=2)
figure = airflock.plots.heatmap(table, list(over), "phi_corr", scenario=scenario)
figure
