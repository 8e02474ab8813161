"""
A lesson of 90 minutes: collective motion
=========================================

For a class that can read a few lines of Python. Each part has a question, an experiment and an exercise; the answers
are at the end.

* 0 to 15 min: what is order?
* 15 to 35 min: noise against order
* 35 to 50 min: more neighbours, more order?
* 50 to 65 min: mills and schools
* 65 to 80 min: a flock of machines
* 80 to 90 min: answers

Run the notebook once before the lesson: the first flight of each law takes some seconds to compile, later ones begin
at once. Words for the board: agent, heading, neighbour, polarisation, milling, delay.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

# %%
# 1. What is order?
# -----------------
# Each particle takes the mean direction of all within 1 m, plus a random angle (Vicsek et al. 1995). The polarisation
# is the length of the mean heading: 1 if all fly alike.
ordered = airflock.load("vicsek_1995/ordered", {"duration": 200.0, "metrics.kind": "order"})
noisy = airflock.load("vicsek_1995/ordered", {"duration": 200.0, "metrics.kind": "order", "eta": 6.0})
figure = plt.figure(figsize=(8, 4), layout="constrained")
for axes, scenario, title in zip(figure.subplots(1, 2), (ordered, noisy), ("little noise", "much noise"), strict=True):
    last = airflock.simulate(scenario, seed=1).isel(time=-1, keypoint=0)
    axes.quiver(*last.position.values, *last.velocity.values, width=0.004)
    axes.set(title=title, aspect="equal", xlabel="m", ylabel="m")

# %%
# **Exercise 1.** What is the polarisation of 100 particles with random directions? Guess first.
angles = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (1000, 100))
by_lot = np.abs(np.exp(1j * angles).mean(axis=1)).mean()
print(f"random directions: {by_lot:.3f}")

# %%
# 2. Noise against order
# ----------------------
noise = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]
table = airflock.sweep("vicsek_1995/transition", {"model.eta": noise}, 3, settings={"duration": 300.0})
line = table.groupby("model.eta")["polarisation"].mean()
curve = plt.figure(figsize=(6, 3.5), layout="constrained")
axes = curve.subplots()
axes.plot(line.index, line, marker="o")
axes.set(xlabel="noise, rad", ylabel="polarisation", ylim=(0, 1))

# %%
# **Exercise 2.** At which noise is the polarisation half of its largest value? Does the answer depend on the number of
# particles? Fly a quarter of them in a box with half the side:
# `settings={"duration": 300.0, "agents": 100, "world.side": 5.0}`.

# %%
# 3. More neighbours, more order?
# -------------------------------
radii = [0.25, 0.5, 1.0, 2.0]
table = airflock.sweep("vicsek_1995/transition", {"model.r": radii}, 3, settings={"duration": 300.0, "model.eta": 2.5})
print(table.groupby("model.r")["polarisation"].mean().round(2))

# %%
# **Exercise 3.** Why does a small radius not order the flock, although the noise is the same?

# %%
# 4. Mills and schools
# --------------------
# With zones of repulsion, orientation and attraction (Couzin et al. 2002), a group can turn about its own centre.
for name in ("swarm", "torus", "highly_parallel"):
    score = airflock.score(f"couzin_2002/{name}", seeds=2).mean()
    print(f"{name:16s} polarisation {score['polarisation']:.2f}  milling {score['milling']:.2f}")

# %%
# **Exercise 4.** Which of the two order parameters tells a mill from a swarm? Why does the other one not?

# %%
# 5. A flock of machines
# ----------------------
# Birds see each other at once; drones hear by radio, and late. The law of Vásárhelyi et al. (2018) was made for that.
# Look at how well neighbours agree, how close two drones came, and how often they collided.
late = [0.0, 1.0, 2.0, 4.0]
table = airflock.sweep("vasarhelyi_2018/4ms", {"radio.delay": late}, 3, settings={"agents": 40, "duration": 200.0})
print(table.groupby("radio.delay")[["phi_corr", "r_min", "n_coll"]].mean().round(2))

# %%
# **Exercise 5.** Up to which delay would you fly? Which of the three numbers decided it, and how many flights would
# you want to see first? Look at one: `airflock watch vasarhelyi_2018/4ms --agents 40 --set radio.delay=4`.

# %%
# Answers
# -------
# 1. About 0.09. The mean of N random unit vectors has a length of about 0.89 divided by the root of N.
# 2. Read it off your own curve; in a small box it falls less steeply, because chance alone gives more order.
# 3. With few neighbours an agent averages over few directions, so less noise cancels; and groups do not meet.
# 4. Milling. In a swarm and in a mill headings cancel, so the polarisation is small in both.
# 5. The smallest distance and the collisions decide, not the beauty of the flock. If n flights had no collision, the
#    share of flights with one may still be 3 / n: three flights say little, a hundred say below 3 %.
