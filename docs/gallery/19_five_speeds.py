"""
Five speeds, five sets
======================

The optimised sets of Vásárhelyi et al. (2018, Table S1) and the partial fitnesses that they reach.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

speeds = [4, 6, 8, 16, 32]
parts = ["f_speed", "f_corr", "f_wall", "f_coll", "f_disc", "f_cluster", "fitness"]
table = np.array([airflock.score(f"vasarhelyi_2018/{v}ms", seeds=3)[parts].mean() for v in speeds])

figure = plt.figure(figsize=(6.5, 3.5), layout="constrained")
axes = figure.subplots()
shown = axes.imshow(table, vmin=0, vmax=1, aspect="auto")
axes.set_xticks(range(len(parts)), parts)
axes.set_yticks(range(len(speeds)), [f"{v} m/s" for v in speeds])
for (row, column), value in np.ndenumerate(table):
    axes.text(column, row, f"{value:.2f}", ha="center", va="center", color="black" if value > 0.5 else "white")
figure.colorbar(shown)
