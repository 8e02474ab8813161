"""
The rays of one agent
=====================

Red rays hit something, the green ray was the first free one, and black is the direction flown.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 20.0}), seed=1)
figure = airflock.plots.rays(recording)
figure
