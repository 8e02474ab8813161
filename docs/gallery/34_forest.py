"""
Among trees
===========

A forest is made from its seed; each tree is a cylinder that the agents' rays can hit.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/forest", {"duration": 60.0}), seed=1)
figure = airflock.plot(recording, "scene")
figure
