"""
Long exposure
=============

As a camera would see lights on the drones: light adds up where they linger or meet.
"""

import airflock

recording = airflock.simulate("vasarhelyi_2018/8ms", seed=3)
figure = airflock.plots.exposure(recording)
figure
