"""Mean speed (Vásárhelyi et al. 2018, Eq. 16)."""

from typing import NamedTuple

REPORTS = {"phi_vel": ("m/s", "mean speed")}
FORMULAS = {
    "phi_vel": (r"\left\langle \frac{1}{N}\sum_i |v_i| \right\rangle_t", "0 and more; v_flock is best"),
}


class Agent(NamedTuple):
    """Speed of one agent, m/s."""

    speed: float


class Sample(NamedTuple):
    """Mean speed of the flock, m/s."""

    phi_vel: float


def agent(speed):
    """Speed of one agent, m/s."""
    return Agent(speed)


def sample(agents, n):
    """Mean over the n agents, m/s."""
    return Sample(agents.speed / n)
