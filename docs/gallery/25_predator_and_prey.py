"""
Predator and prey
=================

A group with its own role: one predator among a hundred prey (Chen and Kolokolnikov 2014). A weak one stops in the
middle of a ring of prey, which draw it equally to all sides; the circles are the radii from theory. A stronger one
chases through the swarm. Lines are the last two seconds of its path.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

figure = plt.figure(figsize=(8, 4), layout="constrained")
for axes, name in zip(figure.subplots(1, 2), ("ring", "hunt"), strict=True):
    scenario = airflock.load(f"chen_2014/{name}", {"duration": 30.0})
    x = airflock.simulate(scenario, seed=1).position.isel(keypoint=0).values
    prey, hunter = x[-1, :, 1:], x[-21:, :, 0]
    axes.plot(*prey, "o", color="tab:blue", ms=4, label="prey")
    axes.plot(*hunter.T, "-", color="tab:red", lw=1)
    axes.plot(*hunter[-1], "o", color="tab:red", ms=7, label="predator")
    if name == "ring":
        p, turn = scenario.parameters, np.linspace(0.0, 2.0 * np.pi, 200)
        for square in (p.k_flee / p.k_att, (p.k_rep + p.k_flee) / p.k_att):
            circle = hunter[-1][:, None] + np.sqrt(square) * np.array([np.cos(turn), np.sin(turn)])
            axes.plot(*circle, color="grey", lw=0.8)
    axes.set_aspect("equal")
    axes.set_title(f"v_hunt = {scenario.laws[1].parameters.v_hunt:g} m/s")
    axes.set_xlabel("east, m")
figure.axes[0].set_ylabel("north, m")
figure.legend(*figure.axes[0].get_legend_handles_labels(), frameon=False, loc="outside lower center", ncols=2)
