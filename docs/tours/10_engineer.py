"""
The engineer's tour: will my drones flock?
==========================================

Twelve quadrotors at 6 m/s, 400 ms of delay, 150 m of radio range, a field with a building in it. How safe is the
published set, what does the delay cost, and which seed should be looked at?
"""

from pathlib import Path

import airflock

Path("field.toml").write_text("""
extends = "vasarhelyi_2018/6ms"
agents = 12
duration = "5 min"

[radio]
delay = "400 ms"
range = "150 m"

[world]
arena = "polygon"
walls = "every_edge"
corners = [[-150, -120], [150, -120], [150, 120], [-150, 120]]
obstacles = [[[-25, -20], [25, -20], [25, 20], [-25, 20]]]
""")
print(*airflock.validate("field.toml"), sep="\n")

# %%
# Thirty flights. The number of collisions is one thing, what it allows to say another.
from airflock.recordings.rare import upper_bound

table = airflock.score("field.toml", seeds=30)
print(table[["phi_vel", "phi_corr", "r_min", "phi_wall", "n_coll", "fitness"]].agg(["mean", "min", "max"]).round(3))
hit = int((table["n_coll"] > 0).sum())
print(f"{hit} of 30 flights with a collision: at most {upper_bound(hit, 30):.0%} of such flights, at 95 % confidence")

# %%
# Look at the worst one.
worst = int(table["fitness"].idxmin())
figure = airflock.plot("field.toml", seed=worst)

# %%
# What does more delay cost?
delays = airflock.sweep("field.toml", {"radio.delay": ["200 ms", "400 ms", "800 ms", "1600 ms"]}, seeds=10)
delays.groupby("radio.delay", sort=False)[["fitness", "r_min", "n_coll"]].mean().round(3)
