"""Contacts of individuals with walls, obstacles and the scene."""

import numpy as np
import pandas as pd
import xarray as xr

from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.measures.states import check_numbers, track_arrays
from airflock.support import ParameterError
from airflock.world import Shapes, WorldMap


def contacts(recording: xr.Dataset, radius: float | None = None) -> pd.DataFrame:
    """Find contacts, a row each: individual, what, begin (s), end (s), and the place at the begin: east, north, up (m).

    recording : (time, space, keypoint, individual), simulated or flown: position m, velocity m/s
    radius    : of an individual, m; by default metrics.r_body of its scenario

    what is "wall", "obstacle 0" and so on as in world.obstacles, or "scene". Each is followed by
    itself: a contact lasts while an individual is nearer to it than its radius, and ends where the
    individual is gone. A log without an arena has no contacts. Touches between two frames are not
    seen; the order parameter n_contacts looks at every step. Geometry, of no publication.

    Raises RecordingError for what is no recording of one keypoint, or whose scenario cannot be read
    (ScenarioError), and ParameterError for a `radius` that is none.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> len(airflock.measures.contacts.contacts(airflock.simulate(short)))  # far from the walls
    0
    """
    scenario = scenario_of_recording(recording)
    radius = scenario.metrics.r_body if radius is None else radius
    check_numbers(radius=radius)
    if not 0.0 <= radius < float("inf"):
        raise ParameterError(f"radius = {radius:g} m is not a radius")
    stands = scenario.stands()
    place = WorldMap(scenario.world, Shapes(*stands.as_lists))
    found, rows = track_arrays(recording), []
    for i, name in enumerate(found.names):
        begun: dict[str, int] = {}
        # One frame more than there is, in which nobody is present, ends all contacts.
        for k in range(len(found.time) + 1):
            there = k < len(found.time) and found.placed[k, i]
            now = set()
            if there:
                x, y, z = (*found.position[k, :, i].tolist(), 0.0)[:3]
                now = {what for what, distance in place.distances(x, y, z) if distance < radius}
            for what in sorted(set(begun) - now):
                first = begun.pop(what)
                at = (*found.position[first, :, i].tolist(), 0.0)[:3]
                rows.append((name, what, found.time[first], found.time[k - 1], *at))
            for what in now - set(begun):
                begun[what] = k
    units = {"begin": "s", "end": "s", "east": "m", "north": "m", "up": "m"}
    table = pd.DataFrame(rows, columns=["individual", "what", *units]).astype(dict.fromkeys(units, np.float64))
    table = table.sort_values(["begin", "individual"], kind="stable", ignore_index=True)
    table.attrs["units"] = units
    return table
