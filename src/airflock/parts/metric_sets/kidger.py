"""Fitness from the measures of Kidger's thesis, whose first wish is to learn parameters from them. Our definition.

Four factors from 0 to 1: share flocked; share of goals reached, averaged over the flight, so that
sooner is better; and two that halve their root at a given number of collisions per agent and
minute, of two agents and with the environment.

A collision of two agents counts when they meet and once more for every second that they stay in
contact: n_coll alone is smallest where a flock falls together into one point and never parts.
"""

import math
from collections.abc import Mapping
from typing import Any

from airflock.core import peak

METRICS = ["flocked", "swarms", "polarisation", "nearest", "collisions", "environment", "avoidance", "speed"]
COLLISIONS = 3.0  # per agent and minute, at which f_coll is a quarter
CRASHES = 0.1  # the same with the environment
VIOLATES = {"units": "COLLISIONS and CRASHES are numbers per agent and minute"}
REPORTS = {
    "f_goals": ("", "share of goals reached, averaged over the flight"),
    "f_coll": ("", "partial fitness of collisions"),
    "f_env": ("", "partial fitness of collisions with the environment"),
    "fitness": ("", "flocked · f_goals · f_coll · f_env"),
}
FORMULAS = {
    "f_goals": (r"\frac{1}{G}\sum_g \max\left(1 - \frac{t_g}{T}, 0\right)", "0 to 1"),
    "f_coll": (
        r"F_3(C, 3) = \left(\frac{3}{C + 3}\right)^2",
        "0 to 1",
        "$C$ are collisions per agent and minute, and seconds that pairs spend in contact.",
    ),
    "f_env": (r"F_3 \textrm{ of the collisions with the environment per agent and minute}", "0 to 1"),
    "fitness": (
        r"F = \textrm{flocked}\, F^{goals} F^{coll} F^{env}",
        "0 to 1",
        "A product: one partial fitness of 0 makes it 0, so look at the parts first.",
    ),
}
NEEDS = {"f_coll": ("r_coll",), "f_env": ("r_body",), "fitness": ("r_coll", "r_flock")}


def fitness(values: Mapping[str, Any], agents: int, duration: float) -> dict[str, float]:
    """Partial fitnesses and fitness of a flight of `duration` s from its measures; without goals f_goals is 1."""
    share = max(agents * duration / 60.0, 1e-9)
    times = values.get("time_to_goal") or [0.0]
    left = sum(0.0 if math.isnan(time) else max(1.0 - time / duration, 0.0) for time in times)
    goals = left / float(len(times))
    contact = 0.5 * agents * (agents - 1.0) * duration * float(values["phi_coll"])  # s, of all pairs together
    coll, env = peak((values["n_coll"] + contact) / share, COLLISIONS), peak(values["n_env_coll"] / share, CRASHES)
    return {"f_goals": goals, "f_coll": coll, "f_env": env, "fitness": float(values["flocked"]) * goals * coll * env}
