"""
Order parameters, low and high
==============================

Two flocks for each group of order parameters. The numbers below a flock are its scores. Grey is the arena of 100 m,
and an arrow is one second of flight.
"""

import matplotlib.pyplot as plt
import numpy as np
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
    world = {"world.arena": "square", "world.side": 100.0, "world.walls": "every_edge"}
    lengths = {
        "r_coll": 3.0,
        "r_b": 3.0,
        "r_cluster": 15.0,
        "r_comm": 20.0,
        "r_flock": 30.0,
        "r_body": 0.5,
        "r_tol": 2.0,
    }
    told = {"v_flock": 5.0, "max_e": 70.0, "k": 70.0, "centre_x": 0.0, "centre_y": 0.0}  # tracks do not say these
    world |= {f"metrics.{key}": value for key, value in (lengths | told).items()}
    sets = ("kidger", "vasarhelyi", "groups", "order", "contacts", "swarmlab")
    found = [airflock.score(recording, settings={"metrics.kind": name, **world}).iloc[0] for name in sets]
    return {name: row[name] for row in found for name in row.index}


# The order parameters that each two flocks show, and the places and velocities of both.
PAIRS = [
    (("phi_vel", "f_speed"), (loose, 1.0 * alike), (loose, 8.0 * alike)),
    (
        ("phi_corr", "f_corr", "fitness", "polarisation", "polarization_deg", "polarization_groups_deg"),
        (loose, 5.0 * anyhow),
        (loose, 5.0 * alike),
    ),
    (("r_min_mean", "r_min", "extension_cm", "area"), (loose * 0.3, 5.0 * alike), (loose, 5.0 * alike)),
    (("local_density", "phi_coll", "n_coll", "f_coll"), (loose, 5.0 * alike), (loose * 0.15, 5.0 * alike)),
    (
        ("f_collision", "quality", "cns_ext", "cns_pol", "quality_groups", "cns_ext_groups", "cns_pol_groups"),
        (loose * 0.3, 5.0 * alike),
        (loose * 0.15, 5.0 * alike),
    ),
    (
        ("n_min", "n_groups", "n_clusters", "share_largest", "extension_groups_cm", "flocked", "time_to_flock"),
        (halves, 5.0 * alike),
        (loose * 0.6, 5.0 * alike),
    ),
    (
        ("n_disc", "f_disc", "share_alone", "n_stragglers", "f_cluster"),
        (loose * 0.6, 5.0 * alike),
        (alone, 5.0 * alike),
    ),
    (
        ("phi_wall", "f_wall", "clearance", "n_contacts", "touching"),
        (loose, 5.0 * alike),
        (loose + 35.0, 5.0 * alike),
    ),
    (("order", "union", "connectivity", "safety"), (halves, 5.0 * anyhow), (loose * 0.15, 5.0 * alike)),
    (("phi_lap", "phi_lap_abs"), (beside, north), (beside, east)),
    (("milling",), (round_, 5.0 * alike), (round_, 5.0 * along)),
    (("elongation",), (round_, 5.0 * alike), (round_ * (1.5, 0.25), 5.0 * alike)),
]


def drawn(names, *flocks):
    """Two flocks side by side, with their scores."""
    figure = plt.figure(figsize=(8, 4.2), layout="constrained")
    for axes, (places, velocities) in zip(figure.subplots(1, 2), flocks, strict=True):
        found = measured(places, velocities)
        axes.quiver(*places.T, *velocities.T, angles="xy", scale_units="xy", scale=1.0, width=0.008, color="C0")
        axes.add_patch(Rectangle((-50, -50), 100, 100, fill=False, color="0.8"))
        axes.set(xlim=(-75, 75), ylim=(-75, 75), aspect="equal", xticks=[], yticks=[])
        told = [f"{name} {round(found[name], 5) + 0.0:.3g}" for name in names]
        axes.set_xlabel("\n".join(", ".join(told[k : k + 2]) for k in range(0, len(told), 2)))
    return figure


figures = [drawn(*pair) for pair in PAIRS]
