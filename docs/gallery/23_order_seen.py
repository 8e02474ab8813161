"""
What a polarisation looks like
==============================

Headings of the same particles at four levels of noise; the number is the polarisation at that instant.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

figure = plt.figure(figsize=(10, 3), layout="constrained")
for axes, noise in zip(figure.subplots(1, 4), (0.2, 2.0, 3.5, 6.0), strict=True):
    scenario = airflock.load("vicsek_1995/transition", {"duration": 300.0, "eta": noise})
    last = airflock.simulate(scenario, seed=1).isel(time=-1, keypoint=0)
    headings = last.velocity.values / np.linalg.norm(last.velocity.values, axis=0)
    axes.quiver(*last.position.values, *headings, scale=25, width=0.006)
    axes.set(title=f"{np.linalg.norm(headings.mean(axis=1)):.2f}", xticks=[], yticks=[], aspect="equal")
