"""
Through a city
==============

Ten agents steer by rays through a city made from a seed; stars mark the goals.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 60.0}), seed=1)
figure = airflock.plots.through(recording)
figure
