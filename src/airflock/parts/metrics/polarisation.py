"""Polarisation: length of the mean heading; 1 aligned, about 1/sqrt(n) disordered (Vicsek et al. 1995 call it v_a)."""

from typing import NamedTuple

from airflock.core import norm

REPORTS = {"polarisation": ("", "length of the mean heading, 1 is aligned")}
FORMULAS = {
    "polarisation": (
        r"\left\langle \left| \frac{1}{N}\sum_i h_i \right| \right\rangle_t",
        r"0 to 1; about $1/\sqrt{N}$ in disorder",
    ),
}


class Sample(NamedTuple):
    """Length of the mean heading."""

    polarisation: float


def sample(mean):
    """Length of the mean heading, 0 to 1."""
    return Sample(norm(mean.hx, mean.hy, mean.hz))
