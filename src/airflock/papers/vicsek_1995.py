"""Vicsek et al., Phys. Rev. Lett. 75, 1226 (1995): order and disorder of self-driven particles.

Parts: noise (Fig. 2 a: v_a falls with the noise at 4 particles per unit area), density (Fig. 2 b: it rises with the
density). The figures' points are not digitised; what is claimed are the limits and the order of the curves.
"""

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.paper import Found, Paper
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

PRESET = "vicsek_1995/transition"
NOISES = (0.1, 1.0, 2.0, 3.0, 4.0, 5.0)  # eta, rad
SMALL = {"agents": 40, "world.side": 3.1}  # the smallest system of Fig. 2 a; the preset is that of N = 400
TURN = 2.0 * math.pi
NUMBERS = (50, 100, 200, 400)  # in a box of side 10: 0.5 to 4 per unit area
AT = 3.0  # eta of the part density: our choice, because it lies between order and disorder


def fly(wanted: Sequence[str], flights: Flights) -> Found:
    """Fly the parts that are wanted."""
    claims: list[Claim] = []
    flown: dict[str, Any] = {}
    if "noise" in wanted:
        flown["noise"] = _fly(flights, "Fig. 2 a", noisy())
        claims += noise_claims(flown["noise"])
    if "density" in wanted:
        flown["density"] = _fly(flights, "Fig. 2 b", dense())
        claims += density_claims(flown["density"])
    return claims, flown


def noisy() -> dict[Any, Scenario]:
    """Scenarios of the part noise by (N, eta)."""
    found: dict[Any, Scenario] = {(400, eta): load(PRESET, {"model.eta": eta}) for eta in (*NOISES, TURN)}
    return found | {(40, eta): load(PRESET, {"model.eta": eta, **SMALL}) for eta in NOISES[-1:]}


def dense() -> dict[Any, Scenario]:
    """Scenarios of the part density by (N, eta)."""
    return {(n, AT): load(PRESET, {"agents": n, "model.eta": AT}) for n in NUMBERS}


def _fly(flights: Flights, title: str, scenarios: dict[Any, Scenario]) -> pd.DataFrame:
    return flights.score(title, scenarios, flights.count(10, 3)).sort_index()


def noise_claims(flown: pd.DataFrame) -> list[Claim]:
    """Order at low noise, none at high noise, and a steady fall between them."""
    v_a = {key: statistics.mean(group["polarisation"]) for key, group in flown.groupby(level=[0, 1])}
    curve = [v_a[(400, eta)].ours for eta in NOISES]
    course = ", ".join(f"{value:.3f} at {eta:g}" for eta, value in zip(NOISES, curve, strict=True))
    random = math.sqrt(math.pi / (4.0 * 400.0))
    last = NOISES[-1]
    return [
        Claim(
            id="noise.ordered",
            statement="as eta goes to 0, all particles fly alike (v_a near 1)",
            source="Fig. 2 a, N = 400",
            test="v_a at eta = 0.1 at least 0.95, the time of ordering included",
            published=1.0,
            **v_a[(400, NOISES[0])].fields(),
            **judged(v_a[(400, NOISES[0])].ours >= 0.95, f"v_a: {course}"),
        ),
        Claim(
            id="noise.falls",
            statement="v_a falls steadily as the noise grows",
            source="Fig. 2 a, N = 400",
            test="each of eta = 0.1, 1, 2, 3, 4, 5 below the one before",
            **judged(all(a > b for a, b in zip(curve, curve[1:], strict=False)), f"v_a: {course}"),
        ),
        Claim(
            id="noise.size",
            statement="in disorder v_a is smaller in a larger system",
            source=f"Fig. 2 a, N = 40 and 400 at eta = {last:g}",
            test="95 % interval of the difference above 0",
            **(gap := _gap(flown, (40, last), (400, last))).fields(),
            **judged(gap.low > 0.0, f"v_a {v_a[(40, last)].ours:.3f} and {v_a[(400, last)].ours:.3f}"),
        ),
        Claim(
            id="noise.random",
            statement="with eta = 2 pi headings are drawn afresh: v_a is the mean length of a random walk",
            source="theory: sqrt(pi / (4 N)), N = 400",
            test="within 3 %",
            published=random,
            **v_a[(400, TURN)].fields(),
            **judged(abs(v_a[(400, TURN)].ours / random - 1.0) <= 0.03, "a check of the noise, not of the paper"),
        ),
    ]


def density_claims(flown: pd.DataFrame) -> list[Claim]:
    """Order grows with the density."""
    means = flown["polarisation"].groupby(level=0).mean()
    course = ", ".join(f"{means[n]:.3f} at {n / 100.0:g}" for n in NUMBERS)
    gap = _gap(flown, (NUMBERS[-1], AT), (NUMBERS[0], AT))
    rising = all(means[a] < means[b] for a, b in zip(NUMBERS, NUMBERS[1:], strict=False))
    return [
        Claim(
            id="density.rises",
            statement="v_a rises with the density at constant noise",
            source="Fig. 2 b (there in a larger box)",
            test="each of 0.5, 1, 2, 4 per unit area above the one before; 95 % interval of last minus first above 0",
            **gap.fields(),
            **judged(rising and gap.low > 0.0, f"v_a: {course} per unit area, eta = {AT:g}"),
        )
    ]


def _gap(flown: pd.DataFrame, a: Any, b: Any) -> statistics.Estimate:
    return statistics.difference(flown.loc[a, "polarisation"], flown.loc[b, "polarisation"])


PAPER = Paper(
    "Vicsek et al. 1995, Novel type of phase transition in a system of self-driven particles",
    ("noise", "density"),
    fly,
)
