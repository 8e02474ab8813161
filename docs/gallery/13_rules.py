"""
What a neighbour does at each distance
======================================

The rules of a model, drawn from the functions that fly: repulsion, alignment, and the push of a wall.
"""

import airflock

figure = airflock.plots.rules(airflock.load("vasarhelyi_2018/4ms"))
figure
