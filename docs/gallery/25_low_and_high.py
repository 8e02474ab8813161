"""
Order parameters, low and high
==============================

Two flocks for each group of order parameters. The numbers below a flock are its scores. Grey is the arena of 100 m,
and an arrow is one second of flight.
"""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import airflock

N = 24
rng = np.random.default_rng(1)
grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(4.0)), -1).reshape(-1, 2) - (2.5, 1.5)
loose = 12.0 * grid + rng.uniform(-1.5, 1.5, (N, 2))
turn = rng.uniform(-np.pi, np.pi, N)
anyhow, alike = np.stack([np.cos(turn), np.sin(turn)], 1), np.tile([0.6, 0.8], (N, 1))
north, east = np.tile([0.0, 5.0], (N, 1)), np.tile([5.0, 0.0], (N, 1))
ring = np.linspace(0.0, 2.0 * np.pi, N, endpoint=False)
round_ = 25.0 * np.stack([np.cos(ring), np.sin(ring)], 1)
along = np.stack([-np.sin(ring), np.cos(ring)], 1)
beside = 0.4 * loose - (0.0, 35.0)
halves = loose * 0.35 + np.where(np.arange(N) % 2, 1.0, -1.0)[:, None] * (32.0, 25.0)
alone = np.where((np.arange(N) % 6 == 0)[:, None], 2.0 * loose, 0.35 * loose)

# %%
# A flock is a position and a velocity (m, m/s) for each agent; it flies straight on for two seconds.


def measured(places, velocities):
    """All order parameters of such a flock."""
    times = np.arange(0.0, 2.1, 0.25)[:, None, None]
    recording = airflock.load_tracks(places + times * velocities, unit="m", fps=4.0)
    world = {"world.arena": "square", "world.side": 100.0, "metrics.v_flock": 5.0, "metrics.max_e": 70.0}
    world |= {"metrics.r_coll": 3.0, "metrics.r_cluster": 15.0, "metrics.r_comm": 20.0}
    world |= {"metrics.centre_x": 0.0, "metrics.centre_y": 0.0}  # tracks do not say the middle of their arena
    sets = ("vasarhelyi", "groups", "order")
    found = [airflock.score(recording, settings={"metrics.kind": name, **world}).iloc[0] for name in sets]
    return {name: row[name] for row in found for name in row.index}


PAIRS = [
    (("phi_vel",), (loose, 1.0 * alike), (loose, 8.0 * alike)),
    (
        ("phi_corr", "polarisation", "polarization_deg", "polarization_groups_deg"),
        (loose, 5.0 * anyhow),
        (loose, 5.0 * alike),
    ),
    (("r_min_mean", "r_min", "extension_cm", "area"), (loose * 0.3, 5.0 * alike), (loose, 5.0 * alike)),
    (("local_density", "phi_coll", "n_coll"), (loose, 5.0 * alike), (loose * 0.15, 5.0 * alike)),
    (("n_min", "n_groups", "share_largest", "extension_groups_cm"), (halves, 5.0 * alike), (loose * 0.6, 5.0 * alike)),
    (("n_disc", "share_alone"), (loose * 0.6, 5.0 * alike), (alone, 5.0 * alike)),
    (("phi_wall", "clearance"), (loose, 5.0 * alike), (loose + 35.0, 5.0 * alike)),
    (("phi_lap", "phi_lap_abs"), (beside, north), (beside, east)),
    (("milling",), (round_, 5.0 * alike), (round_, 5.0 * along)),
    (("elongation",), (round_, 5.0 * alike), (round_ * (1.5, 0.25), 5.0 * alike)),
]

figure = Figure(figsize=(10, 15), layout="constrained")
panels = figure.subplots(5, 4).ravel()
for axes in panels[2 * len(PAIRS) :]:
    axes.axis("off")
for number, (names, *flocks) in enumerate(PAIRS):
    for axes, (places, velocities) in zip(panels[2 * number :], flocks, strict=False):
        found = measured(places, velocities)
        axes.quiver(*places.T, *velocities.T, angles="xy", scale_units="xy", scale=1.0, width=0.012, color="C0")
        axes.add_patch(Rectangle((-50, -50), 100, 100, fill=False, color="0.8"))
        axes.set(xlim=(-75, 75), ylim=(-75, 75), aspect="equal", xticks=[], yticks=[])
        axes.set_xlabel("\n".join(f"{name} {found[name]:.3g}" for name in names))
