"""
The teacher's tour: one question, one picture
=============================================

Does a flock need a leader, or good radio? Ten minutes before the lesson: fly, score, draw. A whole lesson with
exercises is :doc:`/generated/notebooks/30_lesson`.
"""

import matplotlib.pyplot as plt

import airflock

small = {"duration": 120.0, "agents": 30}
ranges = {"radio.range": [10.0, 20.0, 40.0, 80.0]}
table = airflock.sweep("vasarhelyi_2018/4ms", ranges, seeds=4, settings=small)
mean = table.groupby("radio.range")[["phi_corr", "n_disc"]].mean()

# %%
# Nobody leads. Whether they flock depends on whom they hear.
figure = plt.figure(figsize=(6, 3.5), layout="constrained")
axes = figure.subplots()
axes.plot(mean.index, mean["phi_corr"], marker="o", label="velocity correlation in clusters")
axes.plot(mean.index, mean["n_disc"] / 30, marker="s", label="share that hears nobody")
axes.set(xlabel="radio range, m", ylim=(0, 1))
axes.legend(frameon=False)

# %%
# You can look at every flight.
paths = airflock.plot("vasarhelyi_2018/4ms", settings=small | {"radio.range": 80.0}, seed=1)
paths
