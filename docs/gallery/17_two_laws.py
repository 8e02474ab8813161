"""
Two laws on the same robots
===========================

The law of Virágh et al. (2014) and that of Vásárhelyi et al. (2018), with the same drones, radio, arena and seeds.
Each partial fitness shows what a law does well.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

parts = ["f_speed", "f_corr", "f_wall", "f_coll", "f_disc", "f_cluster"]
new = airflock.load("vasarhelyi_2018/4ms", {"duration": 300.0})
old = airflock.load("vasarhelyi_2018/4ms", {"duration": 300.0}, law="viragh_2014")

figure = plt.figure(figsize=(7, 3.5), layout="constrained")
axes = figure.subplots()
for shift, scenario in ((-0.2, old), (0.2, new)):
    table = airflock.score(scenario, seeds=5)[parts]
    axes.bar(np.arange(len(parts)) + shift, table.mean(), 0.4, yerr=table.std(), capsize=3, label=scenario.model.name)
axes.set_xticks(range(len(parts)), parts)
axes.set_ylim(0, 1.15)
axes.legend(frameon=False, ncols=2)
