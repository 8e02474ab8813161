"""Flies small flocks in Numba's CUDA simulator beside plain Python, and prints the differences as JSON.

Run in a process of its own, with NUMBA_ENABLE_CUDASIM=1: python simulated.py CASE...
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import simulator  # noqa: E402

import airflock  # noqa: E402
import several_terms  # noqa: E402
import wary  # noqa: E402
from airflock.engine import plan_of  # noqa: E402
from airflock.scenarios.files import load  # noqa: E402
from airflock.scenarios.making import make  # noqa: E402
from flocks import IDEAL, ISLANDS, NOTCHED, scenario  # noqa: E402
from inside import (
    Shape,  # noqa: E402
    fly_many,  # noqa: E402
    tables,  # noqa: E402
)
from reference.flight import fly_plainly  # noqa: E402

COMMON = {"duration": 0.8, "dt": 0.05, "world.side": 60.0, "world.height": 50.0, "world.radius": 30.0}
COMMON |= {"start.separation": 4.0, "agents": 5}
GNSS = {
    "sensors.kind": "gnss", "sensors.drift_time": 1.0, "sensors.bias": 1.0, "sensors.white": 0.3,
    "sensors.jump_rate": 0.7, "sensors.jump_time": 0.3, "sensors.outage_rate": 0.7, "sensors.outage_time": 0.3,
}  # fmt: skip
NUMBERS = [
    {"name": "a", "agents": [1, 4], "body": {"tau": 2.0}, "model": {"p_rep": {"value": 0.3, "spread": 0.1}}},
    {"name": "b", "agents": 2, "sensors": {"noise": 0.1}},
]
LAWS = [
    {"name": "a", "agents": [1, 4], "model": {"kind": "viragh_2014"}},
    {"name": "b", "agents": 2, "model": {"p_rep": 0.3}, "body": {"tau": 0.5}},
]
# model or preset, keys, threads per agent, states in registers
CASES = {
    "paper": ("vasarhelyi_2018", {
        "world.walls": "nearest_per_axis", "metrics.r_coll": 9.0, "sensors.period": 0.15,
    }, 1, True),
    "stop": ("vasarhelyi_2018", {
        "metrics.stop": "collision", "metrics.r_coll": 14.0, "start.separation": 15.0, "start.speed": 4.0,
        "agents": 10, "duration": 1.6, "metrics.period": 0.05,
    }, 1, True),
    "split": ("vasarhelyi_2018", {
        "metrics.r_cluster": 12.0, "start.speed": 15.0, "agents": 7, "body.kind": "fixed_wing", "model.v_flock": 15.0,
        "sensors.kind": "delayed", "sensors.lag": 0.3,
    }, 2, True),
    "storm": ("viragh_2014", {
        "world.obstacles": ISLANDS, "radio.loss": 0.7, "radio.delay": 0.47, "wind.gust": 2.0, "start.speed": 3.0,
        "metrics.r_coll": 9.0, "metrics.collision_period": 0.15,
    }, 1, True),
    "links": ("vasarhelyi_2018", {
        "world.dimensions": "3", "radio.kind": "links", "radio.delay": 0.2, "radio.near": 5.0, "radio.far": 30.0,
        "model.limit": "cap",
    }, 2, True),
    "torus": ("vasarhelyi_2018", {
        "world.edges": "periodic", "world.side": 40.0, "radio.kind": "links", "radio.loss": 0.5, "radio.near": 5.0,
        "radio.far": 20.0, "start.speed": 4.0,
    }, 2, True),
    "polygon": ("vasarhelyi_2018", {
        "world.arena": "polygon", "world.corners": NOTCHED, "sensors.noise": 0.0, "radio.delay": 0.31,
        "sensors.period": 0.25, "metrics.period": 0.5, "agents": 4,
    }, 1, True),
    "silo": ("viragh_2014", {key: value for key, value in IDEAL.items() if not key.endswith(".noise")} | GNSS | {
        "world.dimensions": "3", "world.arena": "circle", "world.floor": 5.0, "world.obstacles": ISLANDS[:1],
        "world.heights": [[0.0, 18.0]], "body.kind": "quadrotor", "dt": 0.04, "duration": 0.6, "wind.east": 3.0,
        "wind.kind": "dryden",
    }, 1, True),
    "table": ("vasarhelyi_2018", {
        "metrics.r_cluster": 12.0, "start.speed": 3.0, "radio.loss": 0.4, "body.kind": "quadrotor", "dt": 0.04,
    }, 1, False),
    "couzin": ("couzin_2002/swarm", {"agents": 5, "duration": 1.0}, 1, True),
    "vicsek": ("vicsek_1995/ordered", {"agents": 6, "duration": 5.0, "world.side": 3.0}, 1, True),
    "groups": ("zapotecatl_2016/best", {
        "agents": 4, "dt": 0.02, "duration": 0.06, "metrics.kind": "groups", "metrics.r_cluster": 0.3,
        "start.speed": 0.1,
    }, 2, False),
    "together": ("zapotecatl_2016/best", {
        "agents": 5, "dt": 0.02, "duration": 0.1, "update": "synchronous", "metrics.kind": "groups",
        "metrics.r_cluster": 0.3, "start.speed": 0.1,
    }, 1, True),
    "herd": ("kidger/city", {
        "agents": 3, "duration": 0.3, "scene.blocks": 2, "goals.kind": "points", "goals.points": [[5.0, 5.0, 9.0]],
        "goals.role": "herd", "scene.later": 0.5, "scene.later_until": 0.3,
    }, 1, True),
    "display": ("formation", {
        "agents": 4, "duration": 0.6, "dt": 0.05, "world.dimensions": "3", "world.arena": "none", "goals.kind": "own",
        "goals.points": [[0.0, 0.0, 9.0], [3.0, 0.0, 12.0], [6.0, 1.0, 9.0], [3.0, 0.0, 6.0]], "goals.speed": 4.0,
        "scene.kind": "boxes", "scene.boxes": [[2.0, 1.0, 7.0, 3.0, 2.5, 8.0, 0.0]], "start.kind": "box",
        "start.side": 15.0, "sensors.noise": 2e-6, "metrics.kind": "kidger", "metrics.period": 0.2,
    }, 2, True),
    "vee": ("dimock_2003/published", {
        "agents": 2, "duration": 0.4, "dt": 0.1, "sensors.period": 0.2, "metrics.period": 0.2, "wing.segments": "5",
    }, 1, False),
    "echelon": ("viragh_2014", {
        "start.kind": "echelon", "start.jitter": 0.5, "metrics.kind": "dimock", "metrics.t_settle": 0.0, "agents": 3,
        "metrics.period": 0.4, "wing.segments": "5", "start.separation": 0.0,
    }, 1, False),
    "wings": ("dimock_2003/physical", {
        "agents": 3, "duration": 0.6, "dt": 0.1, "sensors.period": 0.2, "metrics.period": 0.3, "wing.segments": "5",
    }, 1, False),
    "city": ("kidger/city", {"agents": 3, "duration": 0.3, "scene.blocks": 3, "goals.count": 2}, 1, True),
    "crowded air": ("vasarhelyi_2018", {
        "radio.kind": "congestion", "radio.delay": 0.2, "radio.airtime": 0.02, "agents": 8, "groups": LAWS,
        "metrics.r_coll": 9.0,
    }, 1, True),
    "shadow": ("vasarhelyi_2018", {
        "radio.kind": "shadow", "radio.delay": 0.2, "radio.near": 5.0, "radio.far": 40.0, "agents": 7,
        "world.obstacles": ISLANDS, "groups": NUMBERS,
    }, 2, True),
    "bursts": ("vasarhelyi_2018", {
        "world.dimensions": "3", "radio.kind": "bursts", "radio.delay": 0.2, "radio.outage_rate": 2.0,
        "radio.outage_time": 0.4, "radio.loss": 0.4, "groups": NUMBERS,
    }, 1, False),
    "jitter": ("vasarhelyi_2018", {
        "radio.kind": "jitter", "radio.delay": 0.2, "agents": 7, "groups": LAWS, "world.edges": "periodic",
        "world.side": 40.0,
    }, 1, False),
    "seen": ("vasarhelyi_2018", {"radio.kind": "vision", "radio.delay": 0.1, "scene.kind": "boxes",
        "scene.boxes": [[2.0, 1.0, 7.0, 3.0, 2.5, 18.0, 0.0]], "world.dimensions": "3", "metrics.kind": "order",
    }, 2, True),
    "species": (wary, {
        "agents": 7, "radio.delay": 0.1, "metrics.kind": "order", "model.k": 1.0, "groups": [
            {"name": "wary", "agents": [0, 3, 5], "model": {"k": {"value": 2.0, "spread": 0.3}}},
            {"name": "bold", "agents": [1, 6], "model": {"style": "chase", "k": 3.0}},
            {"name": "slow", "agents": [2], "model": {"k": 0.5}},
        ],
    }, 1, True),
    "in turn": ("vasarhelyi_2018", IDEAL | {
        "update": "sequential", "sensors.period": 0.0, "groups": LAWS[:1], "duration": 0.3,
    }, 2, False),
    "weights": (several_terms, {"model.w": [0.5, 0.3, 0.1], "start.separation": 3.0}, 1, True),
}  # fmt: skip


def build(name):
    """Scenario and layout of a case."""
    kind, keys, per_agent, registers = CASES[name]
    if not isinstance(kind, str):
        found = make({}, name, COMMON | keys, law=airflock.model(vars(kind)))
    elif "/" in kind:
        found = load(kind, keys)
    else:
        found = scenario(kind, **{key.replace(".", "__"): value for key, value in (COMMON | keys).items()})
    sequential = found.flight.update == "sequential"
    lanes = -(-found.agents // 32) * 32
    threads = per_agent if sequential else (found.agents * per_agent if registers else 3)
    return found, Shape(lanes, per_agent, threads, registers=registers, simulated=True)


def differ(name, seed):
    """Largest differences of a case: frames (m, m/s), order parameters, and how far anything moved."""
    found, shape = build(name)
    plan = plan_of(found, precision=64, record=True, grid=False)
    one, two = fly_many(plan, [tables(found, plan, s) for s in (seed, seed + 1)], shape=shape)
    trusted = [fly_plainly(found, s) for s in (seed, seed + 1)]
    frames, values = 0.0, {}
    for simulated, known in zip((one, two), trusted, strict=True):
        assert simulated.status == known.status == 0
        assert np.isfinite(simulated.state).all() and np.isfinite(simulated.frames).all()
        frames = max(frames, float(np.abs(simulated.frames - known.frames).max()))
        frames = max(frames, float(np.abs(simulated.state - known.state).max()))
        for key, value in known.values.items():
            other = simulated.values[key]
            if isinstance(value, list):
                assert np.array_equal(value, other, equal_nan=True), (key, value, other)
                continue
            if value != value:
                assert other != other, (key, value, other)
                continue
            values[key] = max(values.get(key, 0.0), abs(other - value) / max(1.0, abs(value)))
    moved = float(np.abs(np.diff(trusted[0].frames, axis=0)).max())
    return {"frames": frames, "values": max(values.values()), "moved": moved, "known": trusted[0].values}


if __name__ == "__main__":
    simulator.quick()
    warnings.simplefilter("ignore", RuntimeWarning)  # the simulator's 32-bit words overflow on purpose
    seed, *names = sys.argv[1:]
    json.dump({name: differ(name, int(seed)) for name in names}, sys.stdout)
