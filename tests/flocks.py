"""Scenarios that several tests fly. Interpreted, but for tests of compiling: to compile a plan takes ten seconds."""

from dataclasses import replace

import numpy as np

from airflock.engine import fly_world, measure_frames
from airflock.scenarios.scenario_builder import build_scenario

ISLANDS = [[[-12.0, -10.0], [4.0, -14.0], [2.0, 3.0], [-9.0, 6.0]], [[12.0, 8.0], [20.0, 8.0], [16.0, 17.0]]]
NOTCHED = [[-45.0, -38.0], [40.0, -38.0], [40.0, 4.0], [2.0, 6.0], [6.0, 44.0], [-45.0, 40.0]]  # an L
PENTAGON = [[-40.0, -30.0], [35.0, -38.0], [50.0, 10.0], [5.0, 45.0], [-45.0, 20.0]]
SILENT = {"sensors.noise": 0.0, "body.noise": 0.0}
IDEAL = SILENT | {"radio.delay": 0.0, "radio.range": 1e6}  # no noise, everybody hears everybody at once


def scenario(kind="vasarhelyi_2018", **settings):
    """Scenario with keys such as world__side = 100."""
    return build_scenario(
        {"model": {"kind": kind}}, "test", {key.replace("__", "."): value for key, value in settings.items()}
    )


def ideal(dims=2, **settings):
    """Scenario without noise, delay or loss; every edge of a square acts."""
    keys = {key.replace(".", "__"): value for key, value in IDEAL.items()}
    keys |= {"world__dimensions": str(dims), "agents": 1}  # `from_start` brings its own
    return scenario(**keys | settings)


def flown(found, seed=0, start=None, precision=64):
    """Frames and order parameters of a compiled flight."""
    return fly_world(found, seed, precision=precision, record=True, start=start)


def interpreted(found, seed=0, start=None):
    """The same flight by the same driver text, not compiled: for whatever is no question of compiling."""
    return fly_world(found, seed, precision=64, record=True, start=start, device="python")


def measured_plainly(scenario, frames, period, **more):
    """Stands for `measure_frames` where recordings are scored: interpreted, as are the flights here."""
    return measure_frames(scenario, frames, period, **more | {"precision": 64, "device": "python"})


def from_start(found, *agents):
    """Interpreted flight from given (x, y, vx, vy) or (x, y, z, vx, vy, vz) of each agent."""
    return interpreted(replace(found, flight=replace(found.flight, agents=float(len(agents)))), 0, np.array(agents).T)


def measured(found, frames):
    """Order parameters of frames (time, component, agent), by the driver that scores recordings, interpreted."""
    frames = np.asarray(frames, float)
    every = replace(found, flight=replace(found.flight, agents=float(frames.shape[2])))
    return measure_frames(every, frames, 0.0, device="python")[0]
