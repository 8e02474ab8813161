"""
Time since the last packet
==========================

The age of what a drone knows of another one, by their distance (Fig. 8 of the paper): within radio range it is the
delay, beyond it the time since the two were last in range.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/real_6ms", {"duration": 60.0})
figure = airflock.plot(scenario, "reception", seed=1)
figure
