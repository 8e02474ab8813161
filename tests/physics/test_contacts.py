"""Contacts are counted once each, at the places where they begin; a table of them and the order parameter agree."""

import numpy as np
import pytest

import airflock
from airflock.recordings.measures.contacts import contacts
from airflock.scenarios.files import load
from flocks import measured

pytestmark = pytest.mark.usefixtures("scored_plainly")

ISLAND = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [0.0, 1.0], [-2.0, 2.0]]
KEYS = {
    "world.side": 40.0, "world.obstacles": [ISLAND], "metrics.kind": "contacts", "metrics.r_body": 0.5, "agents": 2,
    "metrics.period": 0.1, "metrics.collision_period": 0.1, "dt": 0.1, "sensors.period": 0.2,
    "world.walls": "every_edge", "start.separation": 3.0, "duration": 8.0,
}  # fmt: skip


def frames(*ways):
    """Positions and velocities (frame, component, agent) of agents along x at the heights y of `ways`."""
    places = np.array([[(x, y) for x in xs] for xs, y in ways]).transpose(1, 2, 0)
    return np.concatenate([places, np.gradient(places, 0.1, axis=0)], axis=1)


def test_each_contact_counts_once():
    """One agent touches the east wall twice, for a while; the other flies through the island and stays clear of it."""
    there = np.concatenate([np.linspace(10.0, 21.0, 23), np.linspace(21.0, 15.0, 13), np.linspace(15.0, 19.8, 13)])
    through = np.linspace(-12.0, 12.0, 49)
    values = measured(load("vasarhelyi_2018/4ms", KEYS), frames((there, 10.0), (through, 0.0)))
    assert values["n_contacts"] == 3.0
    wall, island = (there > 19.5).sum(), (np.abs(through) < 2.5).sum()
    assert values["touching"] == pytest.approx((wall + island) / (2 * 49))
    clear = measured(load("vasarhelyi_2018/4ms", KEYS), frames((0 * there + 5.0, 9.0), (through, 3.0)))
    assert clear["n_contacts"] == clear["touching"] == 0.0


def test_the_table_of_contacts_says_where_and_with_what(seed):
    """Flown past everything by a law that knows no walls: as many rows as the order parameter counts."""
    keys = {**KEYS, "start.speed": 3.0, "world.arena": "polygon", "duration": 30.0}
    keys |= {"world.corners": [[-15, -15], [15, -15], [15, 5], [5, 5], [5, 15], [-15, 15]], "model.v_flock": 3.0}
    scenario = load("vasarhelyi_2018/4ms", keys | {"model.v_shill": 0.0, "model.r0_shill": -10.0, "sensors.noise": 0.0})
    recording = airflock.simulate(scenario, seed, device="python")
    table = contacts(recording)
    assert len(table) and set(table["what"]) <= {"wall", "obstacle 0"}
    again = airflock.score(recording, device="python")["n_contacts"].item()
    assert len(table) >= again > 0.0  # who leaves one thing for another begins a contact in the table, and none there
    assert (table["end"] >= table["begin"]).all() and table["begin"].is_monotonic_increasing
    rows = table[table["what"] == "obstacle 0"]
    assert (np.hypot(rows["east"], rows["north"]) < 2.0 * 2.0**0.5 + 0.5).all()
    assert contacts(recording, radius=0.0).shape[0] <= len(table)
    assert list(contacts(recording.isel(time=slice(0, 2)), radius=0.0).columns) == list(table.columns)
