"""
Two laws side by side
=====================

Which law is better, on equal terms: the same robots, radio, arena, order parameters and seeds? Only the law differs,
so the flights of one seed are a pair, and the luck of the start cancels.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import airflock

# %%
# The scenario, and the law as an argument
# ----------------------------------------
# Fifty drones at 4 m/s with a second of delay. `law=` replaces the law of the preset; the other law's parameters take
# the values of its publication.
settings = {"agents": 50, "duration": "5 min"}
laws = {name: airflock.load("vasarhelyi_2018/4ms", settings, law=name) for name in ("vasarhelyi_2018", "viragh_2014")}
tables = {name: airflock.score(scenario, seeds=12) for name, scenario in laws.items()}
shown = ["phi_vel", "phi_corr", "r_min", "phi_wall", "fitness"]
pd.DataFrame({name: table[shown].mean() for name, table in tables.items()}).round(3)

# %%
# Look before you count
# ---------------------
# The last half minute of one flight of each law, on the same axes.
figure = plt.figure(figsize=(9, 4.5), layout="constrained")
panels = figure.subplots(1, 2, sharex=True, sharey=True)
for axes, (name, scenario) in zip(panels, laws.items(), strict=True):
    paths = airflock.simulate(scenario, seed=0).sel(time=slice(270.0, None)).position.isel(keypoint=0)
    axes.plot(paths.sel(space="x"), paths.sel(space="y"), lw=0.6)
    axes.set(title=name, aspect="equal", xlabel="east, m")
panels[0].set_ylabel("north, m")

# %%
# Pairs
# -----
# The difference seed by seed, with its standard error. A difference of twice that is worth mentioning.
new, old = tables["vasarhelyi_2018"], tables["viragh_2014"]
parts = ["f_speed", "f_corr", "f_wall", "f_coll", "f_disc", "f_cluster", "fitness"]
change = (new - old)[parts]
spread = change.std() / np.sqrt(len(change))
pd.DataFrame({"mean difference": change.mean(), "standard error": spread, "seeds won": (change > 0).sum()}).round(3)

# %%
# Is the comparison fair?
# -----------------------
# Each law has its own numbers, and perhaps only one law was tuned for such robots. So give the other a chance: search
# its gains, then fly the best on seeds that the search has not seen.
gains = {"model.p_rep": [0.1, 0.3, 1.0], "model.c_frict": [10.0, 30.0, 100.0]}
found = airflock.sweep("vasarhelyi_2018/4ms", gains, range(100, 104), settings=settings, law="viragh_2014")
fitness = found.groupby(list(gains))["fitness"].mean()
fitness.unstack().round(4)

# %%
best = dict(zip(gains, fitness.idxmax(), strict=True))
better = airflock.load("vasarhelyi_2018/4ms", settings | best, law="viragh_2014")
fresh = range(200, 212)
pd.DataFrame(
    {
        "vasarhelyi_2018": airflock.score(laws["vasarhelyi_2018"], fresh)[parts].mean(),
        "viragh_2014": airflock.score(laws["viragh_2014"], fresh)[parts].mean(),
        "viragh_2014, searched": airflock.score(better, fresh)[parts].mean(),
    }
).round(3)

# %%
# Nine points are hardly a search; `airflock.evolve(better, "study")` is one.

# %%
# Where does each law break down?
# -------------------------------
# Fly the same two laws over the delay of the radio. A law that is better at one delay need not be at another.
delays = {"radio.delay": [0.0, 0.5, 1.0, 2.0]}
curves = plt.figure(figsize=(6, 3.5), layout="constrained")
axes = curves.subplots()
for name in laws:
    course = airflock.sweep("vasarhelyi_2018/4ms", delays, 6, settings=settings, law=name)
    course = course.groupby("radio.delay")["phi_corr"].agg(["mean", "std"])
    axes.errorbar(course.index, course["mean"], course["std"], marker="o", capsize=3, label=name)
axes.set(xlabel="delay, s", ylabel="velocity correlation in clusters", ylim=(0, 1.05))
axes.legend(frameon=False)
