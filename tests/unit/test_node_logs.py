"""Logs of our own nodes are tracks: places, velocities and commands as they were told, on one clock."""

import json

import numpy as np
import pytest

import airflock
from airflock.core.agent import State
from airflock.drones.onboard.flight_log import LoggingNode
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node import Node, NodeMemory
from airflock.support.errors import RecordingError
from fleets import card

KEY, UTC = bytes(range(32)), 1_767_225_600 * 10**6  # µs

CARD = card(airflock.load("vasarhelyi_2018/real_4ms", {"agents": 4}))


def written(path, member, boot, place, phase=MissionPhase.FLOCK, hold=1):
    """The log of a node whose autopilot tells places (tick, axis) at each tick, 0.05 s apart, or at each `hold`-th.

    boot : since when its computer is on, s
    """
    lines = []
    node = Node(CARD, member, KEY, now=boot, utc=UTC, memory=NodeMemory(), radios=(0.2,))
    logged = LoggingNode(node, lines.append, now=boot, memory=NodeMemory(), radios=(0.2,))
    speed = np.gradient(place, 0.05, axis=0)
    place, speed = (np.repeat(each[::hold], hold, axis=0) for each in (place, speed))
    for k in range(len(place)):
        logged.tick(boot + 0.05 * k)
        node.autopilot_link.state, node.phase = State(*place[k], *speed[k]), phase
        node.command = (1.0, 0.0, -0.5)
        row = json.loads(lines[-1])
        row |= {"phase": node.phase.name, "own": list(node.autopilot_link.state), "set": list(node.command)}
        lines[-1] = json.dumps(row)
    path.write_text("\n".join(lines) + "\n")
    return path


def circle(start):
    angle = start + 0.3 * 0.05 * np.arange(400)
    return np.stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), 50.0 + 0.0 * angle], axis=1)


def test_two_drones_meet_on_one_clock(tmp_path):
    files = [written(tmp_path / f"mission-{k}-x.log", k, boot, circle(k)) for k, boot in ((1, 12.0), (2, 4711.5))]
    notes = []
    found = airflock.load_tracks(files, precision=64, say=notes.append)
    assert list(found["individual"].values) == ["member_1", "member_2"]
    place = found["position"].transpose("time", "individual", "space", "keypoint").values[..., 0]
    assert np.abs(np.hypot(place[..., 0], place[..., 1]) - 20.0).max() < 1e-3 and (place[..., 2] == 50.0).all()
    apart = np.linalg.norm(place[:, 0] - place[:, 1], axis=-1)
    np.testing.assert_allclose(apart, 40.0 * np.sin(0.5), atol=2e-2)  # of drones whose clocks differ by 78 minutes
    asked = found["command"].transpose("time", "individual", "space", "keypoint").values[..., 0]
    assert (asked == [1.0, 0.0, -0.5]).all()
    assert any("clocks aligned" in note for note in notes)


def test_what_a_node_on_the_ground_says_is_no_command(tmp_path):
    log = written(tmp_path / "a.log", 3, 5.0, circle(0.0), phase=MissionPhase.READY)
    notes = []
    found = airflock.load_tracks(log, say=notes.append)
    assert "command" not in found and any("never flew" in note for note in notes)


def test_places_told_again_are_one_row(tmp_path):
    slow = written(tmp_path / "a.log", 1, 0.0, circle(0.0), hold=4)
    found = airflock.load_tracks(slow, precision=64)
    assert np.median(np.diff(found["time"].values)) == pytest.approx(0.2)


def flown_at_two_clocks(path, seed, radius=20.0, speed=4.0):
    """The log of a node whose autopilot sends its position 20 times a second while it ticks 20 times a second.

    The autopilot's clock is 300 ppm fast, and a message is up to 30 ms late: now and then a tick sees nothing new, and
    the next one two steps. Measured so on ArduCopter 4.6.0-dev in software in the loop.
    """
    from pymavlink.dialects.v20 import common as dialect

    random, lines = np.random.default_rng(seed), []
    node = Node(CARD, 1, KEY, now=50.0, utc=UTC, memory=NodeMemory(), radios=(0.2,))
    logged = LoggingNode(node, lines.append, now=50.0, memory=NodeMemory(), radios=(0.2,))
    source = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    site = CARD.site
    lat, lon, height = (round(value * factor) for value, factor in zip(site.origin, (1e7, 1e7, 1e3), strict=True))
    logged.autopilot(bytes(dialect.MAVLink_gps_global_origin_message(lat, lon, height).pack(source)), 50.0)
    events = [(50.0 + 0.05 * k + random.uniform(0.0, 0.004), None) for k in range(600)]
    for k in range(600):
        held = 50.0 + 0.0501 * k * (1.0 - 3e-4)
        a = speed / radius * (held - 50.0)
        ned = radius * np.cos(a), radius * np.sin(a), -30.0
        velocity = -speed * np.sin(a), speed * np.cos(a), 0.0
        data = dialect.MAVLink_local_position_ned_message(700_000 + round(50.1 * k), *ned, *velocity).pack(source)
        events.append((held + random.uniform(0.0, 0.03), bytes(data)))
    for now, data in sorted(events, key=lambda event: event[0]):
        if data is None:
            logged.tick(now)
        else:
            logged.autopilot(data, now)
    rows = [json.loads(line) for line in lines]
    flown = [row | {"phase": "FLOCK", "set": [0.0, 1.0, 0.0]} if "out" in row else row for row in rows]
    path.write_text("\n".join(json.dumps(row) for row in flown) + "\n")
    (path.parent / "ticks.log").write_text("\n".join(json.dumps(row) for row in flown if "a" not in row) + "\n")
    return path


@pytest.mark.parametrize(("name", "off"), [("mission-1.log", 0.05), ("ticks.log", 0.1)])
def test_rows_have_the_time_of_their_states_and_not_that_of_the_tick(tmp_path, seed, name, off):
    """By the autopilot's bytes, and without them by the steps themselves; the clocks alone make jumps of 0.2 m."""
    flown_at_two_clocks(tmp_path / "mission-1.log", seed)
    found = airflock.load_tracks(tmp_path / name, precision=64)
    place = found["position"].values[:, :2, 0, 0]
    sure = np.isfinite(place[:, 0])
    angle = np.unwrap(np.arctan2(place[sure, 0], place[sure, 1]))
    ahead = 20.0 * angle - 4.0 * found["time"].values[sure]  # m along the circle, but for one delay of all
    assert sure.mean() > 0.98 and np.ptp(ahead) < 2.0 * off
    assert np.nanmax(np.abs(np.linalg.norm(found["velocity"].values[:, :, 0, 0], axis=1) - 4.0)) < 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lines: ["FMT, 128, 89, FMT"], "give the .bin"),
        (lambda lines: lines[:1], "never told where it is"),
        (lambda lines: [lines[0], lines[5].replace('"own": [', '"own": [7, ')], "line 2: was not written by a node"),
        (lambda lines: [lines[0].replace('"log":1', '"log":9'), *lines[1:]], "not a log of a flight on board"),
    ],
)
def test_what_is_no_log_of_a_node_is_one_line(tmp_path, change, said):
    path = written(tmp_path / "a.log", 1, 0.0, circle(0.0))
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    with pytest.raises(RecordingError) as fault:
        airflock.load_tracks(path)
    assert said in str(fault.value) and "\n" not in str(fault.value) and str(path) in str(fault.value)
