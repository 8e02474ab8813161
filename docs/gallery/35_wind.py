"""
How much wind a flock can take
==============================

Gusts push all drones; beyond some strength they push them over the walls.
"""

import matplotlib.pyplot as plt

import airflock

gusts = [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]
settings = {"agents": 40, "duration": 200.0}
table = airflock.sweep("vasarhelyi_2018/4ms", {"wind.gust": gusts}, seeds=4, settings=settings)
mean = table.groupby("wind.gust")[["phi_corr", "f_wall"]].mean()

figure = plt.figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
for name, marker in (("phi_corr", "o"), ("f_wall", "s")):
    axes.plot(mean.index, mean[name], marker=marker, label=name)
axes.set(xlabel="standard deviation of the gusts, m/s", ylim=(0, 1.05))
axes.legend(frameon=False)
