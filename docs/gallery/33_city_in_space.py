"""
A city in space
===============

The same flight, seen obliquely instead of from above. Buildings are outlines with pale roofs; stars are goals.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 60.0}), seed=1)
figure = airflock.plot(recording, "space")
figure
