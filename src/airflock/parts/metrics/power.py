"""Power that the birds of a flock spend, and what flying together saves (Dimock & Selig 2003, Eq. 10).

Drag times airspeed of the wing that the scenario describes, from one lifting-line solution per
instant: of a simulated flock, another model's flock or a flight log. The saving is against a lone
wing of the same discretisation.
"""

from typing import NamedTuple

from airflock.parts.aero import forward, induced_drag, place_wings, profile_drag, segments_of, shapes, solo_drag, solve

REPORTS = {
    "power": ("W", "mean power per bird"),
    "power_most": ("W", "power of the bird that uses most, averaged over time"),
    "power_solo": ("W", "power of a bird alone"),
    "saving": ("", "share of power that a bird saves by flying together"),
}
FORMULAS = {
    "power": (r"P = \left\langle \frac{1}{N}\sum_i (D^{ind}_i + D^{prof})\,V \right\rangle_t", "above 0"),
    "power_most": (r"\left\langle \max_i P_i \right\rangle_t", "above 0"),
    "power_solo": (r"(D^{ind}_{solo} + D^{prof})\,V", "above 0"),
    "saving": ("1 - P/P_{solo}", "below 1; negative if birds disturb each other"),
}
VIOLATES = {"rotation": "forward is along x, in a frame that flies along (wing.frame)"}
REDUCE = {"most": "max"}


class Shared(NamedTuple):
    """Induced drag of a bird, and of a lone one, N."""

    drag: float
    solo: float


class Agent(NamedTuple):
    """Power of one bird, in its sum and its maximum, and of a lone bird, W."""

    power: float
    most: float
    solo: float


class Sample(NamedTuple):
    """Mean and largest power of a bird, and that of a lone one, W."""

    power: float
    power_most: float
    power_solo: float


def workspace(n, q, wing):
    """Scratch of the lifting line for n birds."""
    return shapes(n, segments_of(wing), "none")


def survey(n, x, y, z, vx, vy, wing, work, shared):
    """Drag of every bird."""
    hx, hy = forward(n, vx, vy, wing)
    place_wings(n, x, y, z, hx, hy, wing, work)
    solve(n, work, wing)
    for i in range(n):
        shared.drag[i] = induced_drag(i, work, work.circulation, wing)
        shared.solo[i] = solo_drag(work, wing)


def agent(shared, wing):
    """Power of one bird, W."""
    power = (shared.drag + profile_drag(wing)) * wing.speed
    return Agent(power, power, (shared.solo + profile_drag(wing)) * wing.speed)


def sample(agents, n):
    """Mean over the birds."""
    return Sample(agents.power / n, agents.most, agents.solo / n)


def total(over_time):
    """The saving from the means over time."""
    return {**over_time, "saving": 1.0 - over_time["power"] / max(over_time["power_solo"], 1e-30)}
