"""Flies one big flock by cells in the CUDA simulator beside plain Python, and prints the differences as JSON."""

import json
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import simulator  # noqa: E402

from airflock.engine import plan_of  # noqa: E402
from airflock.scenarios.files import load  # noqa: E402
from inside import Crowd, cells_of, fly_crowd  # noqa: E402
from reference.flight import fly_plainly  # noqa: E402

COMMON = {"update": "synchronous", "metrics.kind": "order", "start.kind": "arena", "start.separation": 0.0,
          "start.speed": 0.2, "dt": 0.05, "duration": 0.3, "metrics.period": 0.15, "agents": 20}  # fmt: skip
CASES = {
    "periodic": ("zapotecatl_2016/literal", {
        "world.edges": "periodic", "world.arena": "square", "world.side": 2.2, "world.height": 2.2,
    }),
    "few cells": ("zapotecatl_2016/literal", {
        "world.edges": "periodic", "world.arena": "square", "world.side": 1.0, "world.height": 1.9, "agents": 9,
    }),
    "walls": ("zapotecatl_2016/literal", {"world.arena": "square", "world.side": 2.2, "world.height": 1.1}),
    "open": ("couzin_2002/swarm", {"sensors.period": 0.1, "agents": 12, "start.kind": "ball", "start.radius": 20.0,
                                   "start.speed": 3.0}),
    "plane": ("vicsek_1995/ordered", {"world.side": 7.0, "dt": 1.0, "duration": 6.0, "metrics.period": 2.0,
                                      "start.speed": 0.03}),
    # gusts outlast a step, and a decision after which agents lie in another order
    "gusts": ("kidger/final_2d", {"sensors.period": 0.1, "agents": 12, "start.kind": "ball", "start.radius": 20.0,
                                  "start.speed": 3.0, "wind.east": 1.0, "wind.gust": 3.0, "duration": 0.6,
                                  "scene.kind": "none", "goals.kind": "none", "body.kind": "multirotor",
                                  "sensors.noise": 0.0, "body.noise": 0.0, "radio.delay": 0.0}),
}  # fmt: skip


def differ(name, seed):
    """Largest differences of a case."""
    kind, keys = CASES[name]
    found = load(kind, COMMON | keys)
    plan = plan_of(found, precision=64, record=True).built(grid=True)
    known, flown = fly_plainly(found, seed), fly_crowd(found, plan, seed)
    flock, other = Crowd(found, plan, seed), Crowd(found, plan, seed)
    for each in (flock, other) if name in ("periodic", "plane") else ():
        each.advance(2)
    cells = int(np.prod(cells_of(found, plan, flock.tables)[2]))
    return {
        "state": float(np.abs(flown.state - known.state).max()),
        "frames": float(np.abs(flown.frames - known.frames).max()),
        "values": max(abs(flown.values[key] - value) for key, value in known.values.items()),
        "moved": float(np.abs(np.diff(known.frames, axis=0)).max()),
        "cells": cells,
        "same bits": bool(np.array_equal(flock.near.copy_to_host(), other.near.copy_to_host())),
    }


if __name__ == "__main__":
    simulator.quick()
    warnings.simplefilter("ignore", RuntimeWarning)
    seed, *names = sys.argv[1:]
    json.dump({name: differ(name, int(seed)) for name in names or CASES}, sys.stdout)
