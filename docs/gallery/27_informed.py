"""
The few who know
================

Some of 100 animals prefer a direction, east; nobody knows who they are (Couzin et al. 2005). Lines are the paths of
the group's centre from its start, in four flights for each share of animals that know.
"""

import matplotlib.pyplot as plt

import airflock

figure = plt.figure(figsize=(8, 3.4), layout="constrained")
axes = figure.subplots()
for share, colour in ((2, "0.7"), (10, "tab:blue"), (20, "tab:red")):
    knowing = {"name": "informed", "agents": f"{share} %", "model": {"omega": 0.5, "direction": 0.0}}
    scenario = airflock.load("couzin_2005/informed", {"duration": 300.0, "groups": [knowing, {"name": "others"}]})
    for seed in range(4):
        centre = airflock.simulate(scenario, seed=seed).position.isel(keypoint=0).mean("individual").values
        axes.plot(*centre.T, color=colour, lw=1.0, label=f"{share} % know" if seed == 0 else None)
axes.set_aspect("equal")
axes.set_xlabel("east, m")
axes.set_ylabel("north, m")
legend = axes.legend(frameon=False)
