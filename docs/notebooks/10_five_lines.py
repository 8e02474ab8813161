"""
Five lines to a flock
=====================

Load a published scenario, change what you like, fly it, score it, look at it.
"""

import airflock

scenario = airflock.load("vasarhelyi_2018/4ms", {"duration": "2 min", "agents": 50})
recording = airflock.simulate(scenario, seed=7)
figure = airflock.plot(recording, "trajectories")
figure

# %%
# Watch it
# --------
# A replay plays in place: drag to turn, click a drone, change the meaning of the colours. It is one piece of HTML that
# needs no network. Two frames per second of flight keep it small.
airflock.replay(recording, rate=2.0)

# %%
# What was loaded
# ---------------
# A scenario is everything about a flight except the seed. In a notebook it shows all keys that differ from their
# defaults.
scenario

# %%
# The score of several flights
# ----------------------------
# One row per flight, one column per order parameter. The table's attributes hold units and meanings.
table = airflock.score(scenario, seeds=4)
table[["phi_vel", "phi_corr", "r_min", "n_coll", "fitness"]].round(3)

# %%
for name in ("phi_vel", "phi_corr", "r_min"):
    print(f"{name}: {table.attrs['meanings'][name]}, {table.attrs['units'][name] or 'no unit'}")

# %%
# The recording
# -------------
# An xarray Dataset with named dimensions: positions in m, velocities in m/s. The same seed gives the same bits.
recording

# %%
# What if?
# --------
# The same seeds with half the delay, so each pair of flights gives one difference.
quick = airflock.score(airflock.load(scenario.name, {"duration": 120.0, "agents": 50, "delay": "500 ms"}), seeds=4)
(quick["phi_corr"] - table["phi_corr"]).round(3)
