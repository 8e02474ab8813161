"""
Order and disorder
==================

The model of Vicsek et al. (1995) passes from order to disorder as the noise grows. The dashed line is what
chance alone gives: one over the root of the number of agents.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

scenario = airflock.load("vicsek_1995/transition", {"duration": 300.0})
noise = [float(x) for x in np.linspace(0.2, 6.2, 9)]
table = airflock.sweep(scenario, {"model.eta": noise}, seeds=3, settings={"metrics.kind": "order"})
mean = table.groupby("model.eta")["polarisation"].agg(["mean", "std"])

figure = plt.figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
axes.errorbar(mean.index, mean["mean"], mean["std"], marker="o", capsize=3)
axes.axhline(1.0 / np.sqrt(scenario.agents), ls="--", color="grey")
axes.set(xlabel="noise $\\eta$, rad", ylabel="polarisation", ylim=(0, 1))
