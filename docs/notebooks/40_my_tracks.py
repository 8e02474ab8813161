"""
My tracks
=========

From a table of positions to order parameters, leaders and a comparison with a model. The first cell makes the table,
so the truth is known. Put your own in its place.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import airflock
from airflock.recordings.measures import delays, neighbours, surroundings

# %%
# A table as a tracking program writes it
# ---------------------------------------
# Eight fish for a minute at 25 frames per second, in millimetres, in a long table. The first one turns at will; each of
# the others copies its direction after its own delay. Some rows are lost, as always.
rng = np.random.default_rng(4)
frames, fps = 1500, 25
lag = np.array([0.0, 0.2, 0.32, 0.48, 0.6, 0.8, 1.0, 1.2])  # s
leading = np.cumsum(rng.normal(0.0, 0.05, frames + 100))
angle = np.stack([leading[100 - round(d * fps) :][:frames] for d in lag], axis=1) + rng.normal(0.0, 0.05, (frames, 8))
steps = 60.0 / fps * np.stack([np.cos(angle), np.sin(angle)], axis=2)  # 60 mm/s
places = np.cumsum(steps, axis=0) + rng.uniform(-80.0, 80.0, (8, 2))
table = pd.DataFrame(
    {
        "frame": np.repeat(np.arange(frames), 8),
        "fish": np.tile([f"fish {k}" for k in range(8)], frames),
        "x": places[..., 0].ravel(),
        "y": places[..., 1].ravel(),
    }
)
lost = (table["fish"] == "fish 6") & table["frame"].between(600, 680) | (rng.random(len(table)) < 0.01)
table[~lost].to_csv("fish.csv", index=False)
table.head(3)

# %%
# Import
# ------
# If the table lacks something, the error names the option that supplies it.
try:
    airflock.load_tracks("fish.csv")
except airflock.AirflockError as fault:
    print(fault)

# %%
# In the shell: `airflock import fish.csv --map id:=fish --unit mm --fps 25 --bridge 0.5 --save fish.nc`. Gaps up to
# half a second are bridged; in longer ones an individual is absent.
notes = []
recording = airflock.load_tracks("fish.csv", map={"id": "fish"}, unit="mm", fps=25.0, bridge=0.5, say=notes.append)
print(*notes, sep="\n")
figure = airflock.plots.trajectories(recording.sel(time=slice(20.0, 30.0)))
figure

# %%
# Order parameters
# ----------------
# The functions that score a simulation also score the recording. Fish are not drones, but the set `order` needs no
# lengths or speeds.
course = airflock.over_time(recording, {"metrics.kind": "order"})
course.describe().loc[["mean", "min", "max"]].round(3)

# %%
# How far is the nearest neighbour, in body lengths of 30 mm? Is it ahead or behind (1), or at the side (-1)?
nearest = neighbours.nearest_distances(recording) / 0.03
print(f"median {float(nearest.median()):.2f} body lengths; anisotropy {surroundings.anisotropy(recording, 0.3):+.2f}")

# %%
# Who leads?
# ----------
# For each pair, this is the delay at which one's direction is most like the other's earlier one (Nagy et al. 2010). It
# finds the delays set in the first cell.
pairs = delays.leadership(recording, longest=2.0)
found = pairs[pairs["leader"] == "fish 0"].set_index("follower")["delay"]
pd.DataFrame({"found, s": found.round(2), "true, s": pd.Series(lag[1:], [f"fish {k}" for k in range(1, 8)])})

# %%
curves = delays.delay_correlation(recording, longest=2.0).sel(leader="fish 0")
plot = plt.figure(figsize=(6, 3.2), layout="constrained")
axes = plot.subplots()
for name in ("fish 1", "fish 4", "fish 7"):
    axes.plot(curves["delay"], curves.sel(follower=name), label=name)
axes.set(xlabel="delay, s", ylabel="correlation of directions with fish 0")
axes.legend(frameon=False)

# %%
# Beside a model
# --------------
# These are the same order parameters of eight agents that follow a published law. The numbers show how they differ;
# to ask whether a law explains the tracks, use `airflock.infer`.
law = airflock.load("couzin_2002/dynamic_parallel", {"agents": 8, "duration": 120.0, "metrics.kind": "order"})
beside = {"fish": course.mean(), "couzin_2002": airflock.score(law, seeds=4).mean()}
pd.DataFrame(beside).loc[["polarisation", "milling"]].round(2)

# %%
# Save it as a recording of Airflock, and export it in the layout of the package movement.
airflock.save(recording, "fish.nc")
print(airflock.export(recording, "fish_movement.nc"))
