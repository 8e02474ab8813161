"""
From order parameters to a fitness
==================================

The three transfer functions that turn an order parameter into a number between 0 and 1.
"""

import airflock

figure = airflock.plots.transfer(airflock.load("vasarhelyi_2018/4ms"))
figure
