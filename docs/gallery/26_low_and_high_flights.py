"""
Order parameters of flights, low and high
=========================================

What a flight among buildings, a formation of wings, or a flock from which some drop out is scored with. The numbers
below a flight are its scores.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

import airflock

CITY = {"duration": 60.0}
BLIND = {**CITY, "model.s_obst": 0.0}  # nothing turns it away from buildings
FEW = {"duration": 60.0, "agents": 20}
FAIL = {**FEW, "faults": [{"kind": "fails", "number": 10, "at": 0.0}]}
BIRDS = {"agents": 5, "duration": 30.0}

TRAIL = {"dimock_2003": 4, "couzin_2002": 20, "vasarhelyi_2018": 50}  # samples shown of a path; all of the others

PAIRS = [
    (("goals_reached", "f_goals", "avoiding", "n_avoid", "rays"), ("kidger/poor", CITY), ("kidger/city", CITY)),
    (("n_env_coll", "f_env"), ("kidger/city", CITY), ("kidger/city", BLIND)),
    (("goals", "time_to_goal"), ("kidger/final_2d", CITY), ("kidger/city", CITY)),
    (
        ("power", "power_most", "power_solo", "saving", "crowding", "unrest", "stable"),
        ("dimock_2003/published", BIRDS),
        ("dimock_2003/physical", BIRDS),
    ),
    (("volume",), ("couzin_2002/highly_parallel", FEW), ("couzin_2002/highly_parallel", {"duration": 60.0})),
    (("present",), ("vasarhelyi_2018/real_4ms", FAIL), ("vasarhelyi_2018/real_4ms", FEW)),
]


def written(value):
    """A score as text; of several goals when the first one was reached."""
    return f"first {value[0]:.3g} s" if isinstance(value, list) else f"{value:.3g}"


def drawn(names, *flights):
    """Two flights side by side, from above: paths, agents at the end, buildings in grey, goals as stars."""
    figure = plt.figure(figsize=(9, 4.6), layout="constrained")
    for axes, (name, keys) in zip(figure.subplots(1, 2), flights, strict=True):
        scenario = airflock.load(name, keys)
        found = airflock.score(scenario, seeds=[2]).iloc[0]
        paths = airflock.simulate(scenario, seed=2).position.isel(keypoint=0).sel(space=["x", "y"]).values
        last = paths[-TRAIL.get(name.partition("/")[0], 0) :]
        for low_x, low_y, _, high_x, high_y, _ in scenario.stands().shapes[:, :6]:
            if high_x - low_x < 100.0:  # not the ground
                axes.add_patch(Rectangle((low_x, low_y), high_x - low_x, high_y - low_y, color="0.85"))
        for path in last.transpose(2, 0, 1):
            axes.plot(*path.T, color="C0", lw=0.5)
        axes.plot(*paths[-1], "k.", ms=5)
        axes.plot(*scenario.waypoints()[:, :2].T, "*", color="C1", ms=9)
        (left, below), (right, above) = np.nanmin(last, (0, 2)) - 3.0, np.nanmax(last, (0, 2)) + 3.0
        axes.set(xlim=(left, right), ylim=(below, above), aspect="equal", title=name)
        told = [f"{key} {written(found.get(key, 1.0))}" for key in names]
        axes.set_xlabel("\n".join(", ".join(told[k : k + 3]) for k in range(0, len(told), 3)))
    return figure


figures = [drawn(*pair) for pair in PAIRS]
