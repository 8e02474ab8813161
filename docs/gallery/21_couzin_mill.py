"""
A swarm, a mill, a school
=========================

As the zone of orientation widens, a group passes from a swarm to a mill and to parallel motion (Couzin et al. 2002).
Polarisation reveals schools, milling reveals mills.
"""

import matplotlib.pyplot as plt

import airflock

names = ["swarm", "torus", "dynamic_parallel", "highly_parallel"]
scores = {name: airflock.score(f"couzin_2002/{name}", seeds=2).mean() for name in names}

figure = plt.figure(figsize=(7, 3.5), layout="constrained")
axes = figure.subplots()
for shift, what in ((-0.2, "polarisation"), (0.2, "milling")):
    axes.bar([i + shift for i in range(len(names))], [scores[name][what] for name in names], 0.4, label=what)
axes.set_xticks(range(len(names)), [name.replace("_", " ") for name in names])
axes.set_ylim(0, 1)
axes.legend(frameon=False)
