"""Flies small flocks in Numba's CUDA simulator beside plain Python, and prints the differences as JSON.

Run in a process of its own, with NUMBA_ENABLE_CUDASIM=1: python simulated.py SEED CASE... A case is one of CASES, or
a plan of the covering set ("polygon"), or one of its larger set ("pair 7").
"""

import json
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import simulator  # noqa: E402

import airflock  # noqa: E402
import covering  # noqa: E402
import several_terms  # noqa: E402
import wary  # noqa: E402
from airflock.engine import plan_of  # noqa: E402
from airflock.scenarios.files import load  # noqa: E402
from airflock.scenarios.part_kinds import CallerParts  # noqa: E402
from airflock.scenarios.scenario_builder import build_scenario  # noqa: E402
from covering import fault  # noqa: E402
from flocks import IDEAL, ISLANDS, scenario  # noqa: E402
from inside import (
    Shape,  # noqa: E402
    fly_many,  # noqa: E402
    tables,  # noqa: E402
)
from reference.flight import fly_plainly  # noqa: E402

COMMON = {"duration": 0.8, "dt": 0.05, "world.side": 60.0, "world.height": 50.0, "world.radius": 30.0}
COMMON |= {"start.separation": 4.0, "agents": 5}
LAWS = [
    {"name": "a", "agents": [1, 4], "model": {"kind": "viragh_2014"}},
    {"name": "b", "agents": 2, "model": {"p_rep": 0.3}, "body": {"tau": 0.5}},
]
FAILS = [fault("fails", 0.1, [2]), fault("motor", 0.1, [0], share=0.5, lasts=0.3), fault("motor", 0.2, [0], share=0.2)]
REPLACED = {  # within the delay, and one who then leaves
    "radio.kind": "links", "radio.near": 30.0, "radio.far": 60.0, "radio.delay": 0.3, "faults": [
        fault("pretender", 0.0, [0], east=5.0), fault("pretender", 0.2, [0], east=-5.0),
        fault("pretender", 0.3, [0], east=3.0, lasts=0.2), fault("clock", 0.0, [1], ahead=0.2),
        fault("clock", 0.3, [1, 2], ahead=-0.1), fault("gnss_drift", 0.1, [2], east=3.0),
        fault("gnss_drift", 0.25, [2], north=9.0), fault("fails", 0.55, [1]),
    ],
}  # fmt: skip
# of a plan of the covering set: keys anew, threads per agent, states in registers
SMALL = {
    "paper": ({"metrics.r_coll": 9.0, "sensors.period": 0.15, "world.side": 60.0}, 1, True),
    "storm": ({"metrics.r_coll": 9.0, "metrics.collision_period": 0.15, "world.side": 60.0}, 1, True),
    "links": ({}, 1, True), "polygon": ({}, 2, True), "circle": ({}, 1, True), "silo": ({"dt": 0.04}, 1, False),
    "silence": ({}, 1, True), "seen": ({}, 2, True), "boids": ({}, 2, True), "fish": ({}, 1, True),
}  # fmt: skip
# model or preset, keys, threads per agent, states in registers
CASES = {
    "lonely": ("vasarhelyi_2018", {  # one after another leaves, until nobody is left
        "agents": 3, "radio.kind": "links", "radio.delay": 0.2, "radio.near": 30.0, "radio.far": 60.0, "faults": [
            *(fault("fails", 0.2 * (1 + k), [agent]) for k, agent in enumerate((1, 0, 2))),
        ],
    }, 2, True),
    "replaced": ("vasarhelyi_2018", REPLACED, 2, True),
    "replaced, in tables": ("vasarhelyi_2018", REPLACED, 1, False),
    "leavers": ("vasarhelyi_2018", {  # their commands wait
        "body.delay": 0.15,
        "agents": 6, "radio.loss": 0.4, "radio.delay": 0.2, "radio.kind": "shadow", "world.obstacles": ISLANDS,
        "silence.rule": "stop", "silence.patience": 0.1, "metrics.r_cluster": 12.0, "faults": [
            fault("fails", 0.0, [0]), fault("battery", 0.1, [3], endurance=0.2), fault("radio_deaf", 0.3, [4]),
        ],
    }, 1, False),
    "collided": ("vasarhelyi_2018", {
        "metrics.stop": "collision", "metrics.r_coll": 14.0, "start.separation": 15.0, "start.speed": 4.0,
        "agents": 10, "duration": 1.6, "metrics.period": 0.05, "faults": [fault("fails", 0.05, [0, 9])],
    }, 2, True),
    "herd leaves": ("kidger/city", {
        "agents": 4, "duration": 0.4, "scene.blocks": 2, "goals.kind": "points", "goals.points": [[5.0, 5.0, 9.0]],
        "goals.role": "herd", "faults": FAILS,
    }, 1, True),
    "display fails": ("formation", {
        "agents": 4, "duration": 0.6, "world.dimensions": "3", "world.arena": "none", "goals.kind": "own",
        "goals.points": [[0.0, 0.0, 9.0], [3.0, 0.0, 12.0], [6.0, 1.0, 9.0], [3.0, 0.0, 6.0]], "goals.speed": 4.0,
        "start.kind": "box", "start.side": 15.0, "metrics.period": 0.2, "faults": FAILS,
    }, 2, True),
    "wing fails": ("dimock_2003/published", {
        "agents": 3, "duration": 0.6, "dt": 0.1, "sensors.period": 0.2, "metrics.period": 0.2, "wing.segments": "5",
        "faults": FAILS,
    }, 1, False),
    "in turn, fewer": ("vasarhelyi_2018", IDEAL | {
        "update": "sequential", "sensors.period": 0.0, "duration": 0.3, "topology.kind": "visible", "agents": 6,
        "topology.radius": 4.0, "faults": FAILS, "world.obstacles": ISLANDS,
    }, 2, False),
    "stop": ("vasarhelyi_2018", {
        "metrics.stop": "collision", "metrics.r_coll": 14.0, "start.separation": 15.0, "start.speed": 4.0,
        "agents": 10, "duration": 1.6, "metrics.period": 0.05,
    }, 1, True),
    "split": ("vasarhelyi_2018", {
        "metrics.r_cluster": 12.0, "start.speed": 15.0, "agents": 7, "body.kind": "fixed_wing", "model.v_flock": 15.0,
        "sensors.kind": "delayed", "sensors.lag": 0.3,
    }, 2, True),
    "torus": ("vasarhelyi_2018", {
        "world.edges": "periodic", "world.side": 40.0, "radio.kind": "links", "radio.loss": 0.5, "radio.near": 5.0,
        "radio.far": 20.0, "start.speed": 4.0,
    }, 2, True),
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
    "jitter": ("vasarhelyi_2018", {
        "radio.kind": "jitter", "radio.delay": 0.2, "agents": 7, "groups": LAWS, "world.edges": "periodic",
        "world.side": 40.0,
    }, 1, False),
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
    if name.startswith("pair "):
        found, per_agent, registers = covering.flight(covering.pairs()[int(name[5:])]), 1, True
        return found, Shape(32, per_agent, found.agents, registers=registers, simulated=True)
    if name in SMALL:
        keys, per_agent, registers = SMALL[name]
        fast = name in ("boids", "fish")  # which have a step of their own
        found = covering.build(name, **{"agents": 5, "duration": 0.8, **({} if fast else {"dt": 0.05}), **keys})
        return found, Shape(
            32, per_agent, found.agents * per_agent if registers else 3, registers=registers, simulated=True
        )
    kind, keys, per_agent, registers = CASES[name]
    if not isinstance(kind, str):
        found = build_scenario({}, name, COMMON | keys, caller_parts=CallerParts(law=airflock.model(vars(kind))))
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
    flown = fly_many(plan, [tables(found, plan, s) for s in (seed, seed + 1)], shape=shape)
    trusted = [fly_plainly(found, s) for s in (seed, seed + 1)]
    frames, values = 0.0, {}
    for simulated, known in zip(flown, trusted, strict=True):
        assert simulated.status == known.status == 0
        for one, other in ((simulated.frames, known.frames), (simulated.state, known.state)):
            assert one.shape == other.shape and np.array_equal(np.isnan(one), np.isnan(other))
            assert plan.absence or np.isfinite(one).all()
            frames = max(frames, float(np.nan_to_num(np.abs(one - other)).max()))
        assert np.array_equal(np.broadcast_to(simulated.present, found.agents), ~np.isnan(known.state[0]))
        for key, value in known.values.items():
            other = simulated.values[key]
            if isinstance(value, list):
                assert np.array_equal(value, other, equal_nan=True), (key, value, other)
                continue
            if value != value:
                assert other != other, (key, value, other)
                continue
            values[key] = max(values.get(key, 0.0), abs(other - value) / max(1.0, abs(value)))
    moved = float(np.nanmax(np.abs(np.diff(trusted[0].frames, axis=0))))
    return {"frames": frames, "values": max(values.values()), "moved": moved, "known": trusted[0].values}


if __name__ == "__main__":
    simulator.quick()
    simulator.littered()
    warnings.simplefilter("ignore", RuntimeWarning)  # the simulator's 32-bit words overflow on purpose
    seed, *names = sys.argv[1:]
    json.dump({name: differ(name, int(seed)) for name in names}, sys.stdout)
