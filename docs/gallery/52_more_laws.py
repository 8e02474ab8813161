"""
A lattice, a consensus, boids that turn, a field
================================================

Paths of 20 agents in the last 20 s of a minute, and where they end: the lattice of Olfati-Saber (2006), which gathers
about a point; Cucker and Smale (2007), whose velocities meet; Reynolds' steering (1999) and a potential field, on
drones between walls; and a network of one layer, which no one has trained.
"""

import matplotlib.pyplot as plt

import airflock

PRESETS = ("olfati_saber_2006/lattice", "cucker_smale_2007/flock", "reynolds_1999/drones", "potential_field/drones",
           "network/drones")  # fmt: skip
figure = plt.figure(figsize=(12, 2.8), layout="constrained")
for place, preset in zip(figure.subplots(1, len(PRESETS)), PRESETS, strict=True):
    recording = airflock.simulate(airflock.load(preset, {"agents": 20, "duration": 60.0}), seed=3)
    paths = recording.position.isel(keypoint=0).sel(time=slice(40.0, None))
    for agent in range(20):
        place.plot(*paths.isel(individual=agent).values.T, color="0.7", lw=0.7)
    place.plot(*paths.isel(time=-1).values, "o", ms=3, color="tab:blue")
    place.set_aspect("equal")
    place.set_title(preset.split("/")[0], fontsize=9)
    place.set_xlabel("east, m")
figure.axes[0].set_ylabel("north, m")
