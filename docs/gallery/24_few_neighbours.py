"""
How few neighbours suffice
==========================

Starlings interact with six or seven neighbours, however far these are (Ballerini et al. 2008). Here each drone of a
flock meets but the k nearest of those whom it hears. Each point is the mean of two flights.
"""

from matplotlib.figure import Figure

import airflock

settings = {"agents": 40, "duration": 120.0, "topology.kind": "nearest"}
over = {"topology.k": [1, 2, 3, 5, 7, 10, 15, 39]}
table = airflock.sweep("vasarhelyi_2018/4ms", over, seeds=2, settings=settings)
mean = table.groupby("topology.k").mean()

figure = Figure(figsize=(7, 3.5), layout="constrained")
axes = figure.subplots()
for what, label in (("phi_corr", "alignment in clusters"), ("phi_vel", "speed"), ("f_clust", "clusters, as fitness")):
    if what in mean:
        axes.plot(mean.index, mean[what], "o-", label=label)
axes.set_xscale("log")
axes.set_xticks(mean.index, [f"{k:g}" for k in mean.index], minor=False)
axes.set_xlabel("neighbours that a drone meets, k")
axes.legend(frameon=False)
