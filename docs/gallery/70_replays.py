"""
Replays to play with
====================

A replay is one piece of HTML that plays in any browser, without a network: drag to turn, click an agent, choose what
the colours mean. `airflock replay flight.nc --html show.html` writes one.
"""

import airflock

# %%
# A mill: the group turns about its own centre (Couzin et al. 2002).
mill = airflock.simulate(airflock.load("couzin_2002/torus", {"duration": 60.0}), seed=1)
airflock.replay(mill, rate=2.0, colour="heading")

# %%
# A predator chases prey (Chen and Kolokolnikov 2014).
hunt = airflock.simulate(airflock.load("chen_2014/hunt", {"duration": 20.0}), seed=1)
airflock.replay(hunt, rate=5.0, colour="group")

# %%
# Drones among obstacles (Vásárhelyi et al. 2018).
drones = airflock.simulate(airflock.load("vasarhelyi_2018/obstacles", {"duration": 60.0}), seed=1)
airflock.replay(drones, rate=2.0)

# %%
# From above, the mill at the end.
figure = airflock.plots.trajectories(mill, stop=60.0)
figure
