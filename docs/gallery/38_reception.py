"""
Time since the last packet
==========================

How old what a drone knows of another one is, by the distance between the two (Fig. 8 of the paper): up to the range
of the radio the delay, beyond it the time since the two were last near each other.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/real_6ms", {"duration": 60.0})
figure = airflock.plot(scenario, "reception", seed=1)
