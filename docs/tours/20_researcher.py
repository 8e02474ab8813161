"""
The researcher's tour: the same order parameters for model and data
===================================================================

A recording is an xarray Dataset with the dimensions time, space, keypoint, individual, as in the package movement.
Anything with positions in m and times in s can be scored by the rules that score a simulation.
"""

import numpy as np
import xarray as xr

import airflock

# %%
# Your own tracks, here forty animals on noisy circles: an array (time, space, keypoint, individual), m.
time = np.arange(0.0, 30.0, 0.2)
phase = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 40)
radius = np.random.default_rng(2).normal(5.0, 0.3, 40)
angle = phase[None] + 0.4 * time[:, None]
position = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)[:, :, None, :]
tracks = xr.Dataset(
    {"position": (("time", "space", "keypoint", "individual"), position, {"units": "m"})},
    {"time": time, "space": ["x", "y"], "keypoint": ["centre"], "individual": np.arange(40)},
)
mine = airflock.score(tracks, settings={"metrics.kind": "order"})
mine.round(3)

# %%
# A model beside it, measured the same way.
model = airflock.score("couzin_2002/torus", seeds=3)
print(model[["polarisation", "milling"]].mean().round(3).to_dict())

# %%
# Every order parameter over time, as a table.
course = airflock.over_time(tracks, {"metrics.kind": "order"})
course.describe().loc[["mean", "std"]].round(3)

# %%
figure = airflock.plots.trajectories(tracks)
figure
