"""Steadiness of a formation: how close its members come, and how much they still move once they should have settled.

Our choice, because Dimock & Selig 2003 name both as what their fitness lacks: no steady
oscillation, a stable formation after a fixed time, and collisions that are graded and not only
counted.
"""

import math
from typing import NamedTuple

REPORTS = {
    "crowding": ("", "mean over birds of the squared shares by which others are nearer than r_safe"),
    "unrest": ("m/s", "RMS velocity relative to the flock's mean, after t_settle"),
    "stable": ("", "1 if unrest is below v_settle"),
}
FORMULAS = {
    "crowding": (
        r"\left\langle \frac{1}{N}\sum_i\sum_j \max\left(1 - r_{ij}/r_{safe}, 0\right)^2 \right\rangle_t",
        "0 and more",
    ),
    "unrest": (
        r"\sqrt{\left\langle \frac{1}{N}\sum_i |v_i - \bar v|^2 \right\rangle_{t > t_{settle}}}",
        "0 and more; nan if the flight ends before t_settle",
    ),
    "stable": (r"\Theta(v_{settle} - \textrm{unrest})", "0 or 1"),
}
NEEDS = {"crowding": ("r_safe",)}
COURSES = {
    "late": ("", "1 after t_settle"),
    "motion": ("m²/s²", "mean squared velocity relative to the flock's mean, after t_settle"),
    "allowed": ("m²/s²", "v_settle squared"),
}


class Pair(NamedTuple):
    """Squared share by which one other agent is nearer than q.r_safe."""

    near: float


class Agent(NamedTuple):
    """Crowding of one agent; its squared velocity (m²/s²) against the mean."""

    near: float
    motion: float


class Sample(NamedTuple):
    """Crowding; 1.0 after q.t_settle; mean squared relative velocity then, and its limit, m²/s²."""

    crowding: float
    late: float
    motion: float
    allowed: float


def pair(r, q):
    """Share by which one other agent is too near."""
    s = max(1.0 - r / max(q.r_safe, 1e-6), 0.0)
    return Pair(s * s)


def agent(vx, vy, vz, pair, mean):
    """Terms of one agent."""
    x = vx - mean.vx
    y = vy - mean.vy
    z = vz - mean.vz
    return Agent(pair.near, x * x + y * y + z * z)


def sample(agents, n, time, q):
    """Means over the flock at one instant."""
    late = 1.0 if time >= q.t_settle else 0.0
    return Sample(agents.near / n, late, late * agents.motion / n, q.v_settle * q.v_settle)


def total(over_time):
    """Crowding, unrest and whether the formation is stable; a flight that ends before q.t_settle is not."""
    late = over_time["late"]
    unrest = math.sqrt(over_time["motion"] / late) if late > 0.0 else math.nan
    stable = late > 0.0 and over_time["motion"] / late < over_time["allowed"]
    return {"crowding": over_time["crowding"], "unrest": unrest, "stable": float(stable)}
