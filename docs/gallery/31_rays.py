"""
The rays of one agent
=====================

Red rays met something, the green one was the first that was free, black is what was flown.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 20.0}), seed=1)
figure = airflock.plots.rays(recording)
