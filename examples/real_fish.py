"""Score a real school: zebrafish that idtracker.ai followed, whose tracks come with `pip install trajectorytools`."""

import sys

import numpy as np

import airflock

try:
    from trajectorytools import Trajectories
    from trajectorytools.constants import test_trajectories_path
except ModuleNotFoundError:
    sys.exit("the fish are not here: pip install trajectorytools")

# the file holds Python objects, which Airflock never opens: its own loader does
fish = Trajectories.from_idtrackerai(test_trajectories_path, interpolate_nans=False)
pixels = np.asarray(fish.s) * fish.params.get("length_unit", 1.0)  # (time, individual, axis)
body, fps = float(fish.params["body_length_px"]), float(fish.params["frame_rate"])
# one body length stands for one metre, and whoever is lost for some frames is absent there
tracks = airflock.load_tracks(pixels, unit="px", scale=1.0 / body, fps=fps, accept=["jumps", "absent"])
print(f"{tracks.sizes['individual']} fish, {tracks.sizes['time']} frames of {1e3 / fps:.0f} ms")
wanted = ["phi_vel", "polarisation", "r_min_mean"]
print(airflock.score(tracks, body_length=1.0)[wanted].round(3).T)
nearest = airflock.measures.neighbours.nearest_distances(tracks)
print(f"nearest neighbour: {np.nanmedian(nearest):.2f} body lengths away, by the median")
