"""
Are all together?
=================

Share of agents near the flock's centre over time, among trees.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/forest", {"duration": 60.0}), seed=1)
figure = airflock.plots.flocked(recording)
figure
