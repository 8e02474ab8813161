"""
The last minute of a flock
==========================

One hundred drones at 4 m/s in a square arena, with a second of delay, noisy sensors and limited acceleration.
The colour is the speed; one drone is drawn in grey.
"""

import airflock

recording = airflock.simulate("vasarhelyi_2018/4ms", seed=1)
figure = airflock.plots.trajectories(recording)
figure
