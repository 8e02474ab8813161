"""
A mill from above
=================

The last seconds of a group that turns about its own centre, seen along its axis of rotation.
"""

import matplotlib.pyplot as plt
import numpy as np

import airflock

recording = airflock.simulate("couzin_2002/torus", seed=1)
x = recording.position.isel(keypoint=0, time=slice(-60, None)).values
v = recording.velocity.isel(keypoint=0, time=slice(-60, None)).values
x = x - x.mean(axis=2, keepdims=True)
axis = np.cross(x, v, axis=1).mean(axis=(0, 2))
across = np.linalg.svd(axis[None])[2][1:]  # two directions across the axis
flat = np.einsum("ds,tsi->tdi", across, x)

figure = plt.figure(figsize=(5, 5), layout="constrained")
axes = figure.subplots()
axes.plot(flat[:, 0], flat[:, 1], lw=0.6, alpha=0.7)
axes.set(xlabel="m", ylabel="m", aspect="equal")
