"""
A city in space
===============

The same flight, seen obliquely instead of from above. Paths behind a building are drawn faintly; stars are goals.
"""

import airflock

recording = airflock.simulate(airflock.load("kidger/city", {"duration": 60.0}), seed=1)
figure = airflock.plot(recording, "space")
figure
