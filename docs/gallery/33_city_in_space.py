"""
A city in space
===============

The same flight as from above, seen from the side.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 60.0}), seed=1)
figure = airflock.plot(recording, "space")
