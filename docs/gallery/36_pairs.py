"""
Paired flights
==============

The same seeds with and without loss of packets. Each line is one seed: pairs show what a change does, because the
luck of the start cancels.
"""

import matplotlib.pyplot as plt

import airflock

over = {"radio.loss": [0.0, 0.25, 0.5]}
settings = {"agents": 40, "duration": 200.0, "radio.delay": 1.0}
table = airflock.sweep("vasarhelyi_2018/8ms", over, seeds=12, settings=settings)
pairs = table.pivot(index="radio.loss", columns="seed", values="phi_corr")

figure = plt.figure(figsize=(5, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(pairs.index, pairs, color="0.7", lw=1)
axes.plot(pairs.index, pairs.mean(axis=1), color="C3", marker="o", lw=2, label="mean")
axes.set(xlabel="loss at 80 m", ylabel="velocity correlation")
axes.legend(frameon=False)
