"""
How few neighbours suffice
==========================

Starlings interact with six or seven neighbours, however far away (Ballerini et al. 2008). Here each drone meets only
the k nearest of those that it hears, or those whose Voronoi cells border its own. The law was tuned for all in range:
with fewer it aligns less. Each point is the mean of two flights.
"""

import matplotlib.pyplot as plt

import airflock

name, settings = "vasarhelyi_2018/4ms", {"agents": 40, "duration": 120.0}
over = {"topology.k": [1, 2, 3, 5, 7, 10, 15, 39]}
table = airflock.sweep(name, over, seeds=2, settings={**settings, "topology.kind": "nearest"})
aligned = table.groupby("topology.k")["phi_corr"].mean()
cells = airflock.score(airflock.load(name, {**settings, "topology.kind": "voronoi"}), seeds=2)

figure = plt.figure(figsize=(7, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(aligned.index, aligned, "o-", label="k nearest")
axes.axhline(cells["phi_corr"].mean(), color="grey", label="Voronoi cells")
axes.set_xscale("log")
axes.set_xticks(aligned.index, [f"{k:g}" for k in aligned.index])
axes.minorticks_off()
axes.set_ylim(0, 1)
axes.set_xlabel("neighbours that a drone meets, k")
axes.set_ylabel("alignment, phi_corr")
axes.legend(frameon=False)
