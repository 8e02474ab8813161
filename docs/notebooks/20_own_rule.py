"""
A rule of your own
==================

A flocking law is a handful of plain functions of floats. They ask for what they need by the names of their arguments;
a drone that flies them needs nothing else. Here is a published law that does not come with Airflock, in fifteen lines:
self-propelled particles that attract and repel each other (D'Orsogna et al. 2006).
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import airflock

COMMAND = "acceleration"  # what `decide` returns, m/s²


@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    """Every number has a unit, a range and a meaning; help, validation and search use them."""

    alpha: float = airflock.quantity(1.6, "1/s", low=0.0, high=10.0, meaning="thrust per speed")
    beta: float = airflock.quantity(0.5, "s/m^2", low=0.01, high=10.0, meaning="drag per speed cubed")
    c_a: float = airflock.quantity(0.5, "m^2/s^2", low=0.0, high=10.0, meaning="depth of attraction")
    l_a: float = airflock.quantity(2.0, "m", low=0.1, high=100.0, meaning="length of attraction")
    c_r: float = airflock.quantity(1.0, "m^2/s^2", low=0.0, high=10.0, meaning="height of repulsion")
    l_r: float = airflock.quantity(0.5, "m", low=0.01, high=100.0, meaning="length of repulsion")


# %%
# Neighbours
# ----------
# `neighbour` is called for each neighbour that is heard, and its results are summed. Here `dx, dy, dz` is the offset
# to the neighbour and `r` its length. The force is the slope of the Morse potential.


class Sums(NamedTuple):
    """Attraction less repulsion, m/s²."""

    x: float
    y: float
    z: float


def neighbour(dx, dy, dz, r, p):
    """Towards the neighbour if attraction is stronger, away from it if repulsion is."""
    k = (p.c_a / p.l_a * math.exp(-r / p.l_a) - p.c_r / p.l_r * math.exp(-r / p.l_r)) / r
    return Sums(k * dx, k * dy, k * dz)


# %%
# It is a plain function, so you can try it at once: a neighbour 2 m to the north attracts, one at 0.3 m repels.
print(neighbour(0.0, 2.0, 0.0, 2.0, Parameters()))
print(neighbour(0.0, 0.3, 0.0, 0.3, Parameters()))

# %%
# The decision
# ------------


def decide(own, sums, p):
    """Thrust along the velocity, drag against it, and the neighbours."""
    k = p.alpha - p.beta * (own.vx * own.vx + own.vy * own.vy + own.vz * own.vz)
    return k * own.vx + sums.x, k * own.vy + sums.y, k * own.vz + sums.z


def preferred_speed(p):
    """Speed at which thrust and drag balance, m/s."""
    return math.sqrt(p.alpha / p.beta)


# %%
# Check it
# --------
# Before it flies, check: is it the same law in every direction, in other units, for half the time step, in single
# precision?
law = airflock.model(globals(), "dorsogna_2006")
print(airflock.check_model(law))

# %%
# An order parameter of your own
# ------------------------------
# It is made of rules, too: `agent` is called for each agent and summed, `sample` makes numbers from the sums. Milling
# as defined by Couzin et al. (2002) is the length of a mean of vectors, so two mills in one place that turn opposite
# ways cancel. Here each agent counts, whichever way it turns.


class Agent(NamedTuple):
    """Share of one agent's heading that goes around the centre."""

    around: float


class Sample(NamedTuple):
    """The mean over the group."""

    turning: float


class Turning:
    """How far a group moves around its own centre, either way."""

    REPORTS = {"turning": ("", "share of motion around the own centre, either way, 1 is a circle")}
    Agent, Sample = Agent, Sample

    def agent(x, y, hx, hy, mean):
        """Of one agent."""
        dx = x - mean.x
        dy = y - mean.y
        return Agent(abs(dx * hy - dy * hx) / math.sqrt(dx * dx + dy * dy + 1e-12))

    def sample(agents, n):
        """Of all."""
        return Sample(agents.around / n)


print(airflock.check_metric(Turning))

# %%
# Fly it
# ------
# A scenario file with a hundred particles, without walls, noise or delay.
SCENARIO = """
agents = 100
duration = "3 min"
dt = "20 ms"

[body]
kind = "steered"
speed_max = "10 m/s"

[sensors]
period = 0.0
noise = 0.0

[radio]
delay = 0.0

[world]
arena = "none"

[start]
kind = "ball"
radius = "1.5 m"
speed = "0.1 m/s"
"""
Path("mill.toml").write_text(SCENARIO)
measured = ["polarisation", "milling", airflock.metric(Turning)]
scenario = airflock.load("mill.toml", law=law, metrics=measured)
recording = airflock.simulate(scenario, seed=1)
figure = airflock.plots.trajectories(recording.sel(time=slice(175.0, None)))
figure

# %%
# Most of the motion goes around the centre, and yet there is little milling: some turn left, the others right.
airflock.score(scenario, seeds=3).round(2)

# %%
# A typing mistake is reported with the nearest right word.


class Wrong:
    """An order parameter that asks for something that does not exist."""

    REPORTS, Agent, Sample = Turning.REPORTS, Agent, Sample
    sample = staticmethod(Turning.sample)

    def agent(x, y, hx, yh, mean):
        """Never called."""


try:
    airflock.metric(Wrong)
except airflock.AirflockError as fault:
    print(fault)

# %%
# From its own file, `mine.py`, the same law flies with `model.kind = "mine.py"` in a scenario file, and `--trust`.

# %%
# Several numbers with one meaning
# --------------------------------
# A force with several terms has a weight for each. `size` declares them in one line: a rule reads a tuple, and loops
# over it are unrolled when the law is compiled. A scenario file sets all of them, `model.w = [1.0, 0.3, 0.1]`, or
# one, `model.w_1 = 0.5`; each has a slider on the live page, and bounds in a search.


@dataclass(frozen=True, kw_only=True)
class Terms(airflock.Parameters):
    """Weights of the terms of a force."""

    w: tuple[float, ...] = airflock.quantity(
        (1.0, 0.3, 0.1), "m/s^2", size=3, low=0.0, high=5.0, meaning="weight of a term"
    )


def strength(near, p):
    """Force at a nearness from 0 (far) to 1 (close): terms of growing power, m/s²."""
    total, power = 0.0, near
    for k in range(len(p.w)):
        total += p.w[k] * power
        power *= near
    return total


print(strength(0.5, Terms()), strength(0.5, Terms(w_2=2.0)))
