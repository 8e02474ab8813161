"""A study whose flights cost nothing: a noisy bowl in place of a flock, through the very code of real studies."""

import math
import random
import time

from airflock.scenarios.files import load
from airflock.search.study import make_study

BEST = {"model.r0_rep": 30.0, "model.p_rep": 0.2, "model.v_frict": 1.0}
SPACE = {
    "model": {
        "r0_rep": {"low": 10.0, "high": 80.0},
        "p_rep": {"low": 0.01, "high": 0.5},
        "v_frict": {"low": 0.0, "high": 5.0},
    }
}


def study(tables=None, scenario=None, limits=(), **search):
    """A study of three parameters; `search` are keys of the table [search]."""
    usual = {"population": 8, "generations": 6, "top": 3, "pool": 0, "final_seeds": 4}
    scenario = scenario or load("vasarhelyi_2018/6ms")
    return make_study(
        {"space": SPACE, **(tables or {})}, "toy", search=usual | search, scenario=scenario, limits=limits
    )


def bowl(parameters, seed, noise=0.01):
    """Order parameters: 1 at BEST, less elsewhere, with noise that the seed alone decides; low p_rep fails."""
    away = sum(((parameters[key] - value) / SPACE["model"][key[6:]]["high"]) ** 2 for key, value in BEST.items())
    if parameters["model.p_rep"] < 0.03:
        raise ZeroDivisionError("nobody can fly so")
    return {"fitness": 1.0 - away + noise * random.Random(seed).gauss(0.0, 1.0), "phi_vel": math.exp(-away)}


def slow_bowl(parameters, seed):
    """The bowl, a millisecond late."""
    time.sleep(0.001)
    return bowl(parameters, seed)
