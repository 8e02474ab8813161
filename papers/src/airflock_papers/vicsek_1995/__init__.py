"""Vicsek et al., Phys. Rev. Lett. 75, 1226 (1995): order and disorder of self-driven particles.

Parts: noise (Fig. 2 a: v_a falls with the noise at 4 particles per unit area), density (Fig. 2 b: it rises with the
density). The figures' points are not digitised; what is claimed are the limits and the order of the curves.
"""

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd

from airflock.scenarios import Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.paper import Flown, Paper

PRESET = "vicsek_1995/transition"
NOISES = (0.1, 1.0, 2.0, 3.0, 4.0, 5.0)  # eta, rad
SMALL = {"agents": 40, "world.side": 3.1}  # the smallest system of Fig. 2 a; the preset is that of N = 400
TURN = 2.0 * math.pi
NUMBERS = (50, 100, 200, 400)  # in a box of side 10: 0.5 to 4 per unit area
AT = 3.0  # eta of the part density: our choice, because it lies between order and disorder


def fly(wanted: Sequence[str], flights: Flights) -> Flown:
    """Fly the parts that are wanted."""
    measured: list[Measured] = []
    flown: dict[str, Any] = {}
    if "noise" in wanted:
        flown["noise"] = _fly(flights, "Fig. 2 a", noisy())
        measured += of_noise(flown["noise"])
    if "density" in wanted:
        flown["density"] = _fly(flights, "Fig. 2 b", dense())
        measured += of_density(flown["density"])
    return measured, flown


def noisy() -> dict[Any, Scenario]:
    """Scenarios of the part noise by (N, eta)."""
    found: dict[Any, Scenario] = {(400, eta): load(PRESET, {"model.eta": eta}) for eta in (*NOISES, TURN)}
    return found | {(40, eta): load(PRESET, {"model.eta": eta, **SMALL}) for eta in NOISES[-1:]}


def dense() -> dict[Any, Scenario]:
    """Scenarios of the part density by (N, eta)."""
    return {(n, AT): load(PRESET, {"agents": n, "model.eta": AT}) for n in NUMBERS}


def _fly(flights: Flights, title: str, scenarios: dict[Any, Scenario]) -> pd.DataFrame:
    return flights.score(title, scenarios, flights.count(10, 3)).sort_index()


def of_noise(flown: pd.DataFrame) -> list[Measured]:
    """Order at low noise, none at high noise, and a steady fall between them."""
    v_a = {key: statistics.mean(group["polarisation"]) for key, group in flown.groupby(level=[0, 1])}
    curve = [v_a[(400, eta)].ours for eta in NOISES]
    course = "v_a: " + ", ".join(f"{value:.3f} at {eta:g}" for eta, value in zip(NOISES, curve, strict=True))
    rises = sum(a <= b for a, b in zip(curve, curve[1:], strict=False))
    random, last = math.sqrt(math.pi / (4.0 * 400.0)), NOISES[-1]
    return [
        Measured("noise.ordered", "polarisation", f"N = 400, eta = {NOISES[0]:g}", v_a[(400, NOISES[0])], course),
        Measured(
            "noise.falls", "polarisation", "N = 400, steps of eta at which it rises", statistics.one(rises), course
        ),
        Measured(
            "noise.size", "polarisation", f"eta = {last:g}, N = 40 less 400", _gap(flown, (40, last), (400, last))
        ),
        Measured("noise.random", "polarisation", "N = 400, eta = 2 pi", v_a[(400, TURN)], reference=(random, None)),
    ]


def of_density(flown: pd.DataFrame) -> list[Measured]:
    """Order grows with the density."""
    means = flown["polarisation"].groupby(level=0).mean()
    course = ", ".join(f"{means[n]:.3f} at {n / 100.0:g}" for n in NUMBERS)
    falls = sum(means[a] >= means[b] for a, b in zip(NUMBERS, NUMBERS[1:], strict=False))
    gap = _gap(flown, (NUMBERS[-1], AT), (NUMBERS[0], AT))
    at = f"eta = {AT:g}"
    return [
        Measured(
            "density.rises", "polarisation", f"{at}, steps of density at which it falls", statistics.one(falls), course
        ),
        Measured("density.gap", "polarisation", f"{at}, 4 less 0.5 per unit area", gap, course),
    ]


def _gap(flown: pd.DataFrame, a: Any, b: Any) -> statistics.Estimate:
    return statistics.difference(flown.loc[a, "polarisation"], flown.loc[b, "polarisation"])


PAPER = Paper(
    "Vicsek et al. 1995, Novel type of phase transition in a system of self-driven particles",
    __name__,
    ("noise", "density"),
    fly,
)
