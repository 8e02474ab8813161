"""
Birds in each other's upwash
============================

Every bird feels its induced drag and moves down its gradient (Dimock and Selig 2003). From above, the flock flies up
the picture: black lines are wings, orange air rises, violet air sinks. The numbers say how much less induced drag each
bird has than a lone one.
"""

import airflock

scenario = airflock.load("dimock_2003/physical", {"agents": 7, "duration": 30.0})
figure = airflock.plot(airflock.simulate(scenario, seed=2), "wash")
figure
