"""Fig. 7 and Eqs 17-22: the transfer functions, and the fitness recomputed from Table S2's own means."""

import math

from airflock.core.maths import bell, peak, rising
from airflock.metrics.fitness_vasarhelyi import fitness
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.vasarhelyi_2018.published import optimum

# name, value, expected: landmarks of the three curves that follow from Eqs 17-20 by hand
LANDMARKS = (
    ("f1.zero", "F1(phi0 - d) = 0", rising(2.5, 4.0, 1.5), 0.0),
    ("f1.half", "F1(phi0 - d/2) = 1/2", rising(3.25, 4.0, 1.5), 0.5),
    ("f1.one", "F1(phi0) = 1", rising(4.0, 4.0, 1.5), 1.0),
    ("f2.one", "F2(0) = 1", bell(0.0, 2.0), 1.0),
    ("f2.e", "F2(s) = 1/e", bell(2.0, 2.0), math.exp(-1.0)),
    ("f3.one", "F3(0) = 1", peak(0.0, 3e-5), 1.0),
    ("f3.quarter", "F3(a) = 1/4", peak(3e-5, 3e-5), 0.25),
)
SPEEDS = (6, 8, 16, 32)  # at 4 m/s runs are bistable: the mean of F is not F of the mean
WITHIN = 0.004  # the last printed digit of phi_vel, seen through F1


def fly(flights: Flights) -> None:
    """Nothing to fly."""


def recomputed(speed: int) -> dict[str, float]:
    """Partial fitnesses from the means that Table S2 prints at one speed (m/s)."""
    scenario = optimum(speed)
    s2 = scenario.published
    score = {"phi_vel": s2["phi_vel"][0], "phi_coll": s2["phi_coll"][0], "phi_corr": s2["f_corr"][0]}
    score |= {"phi_wall": 0.0, "n_disc": 0.0, "n_min": float(scenario.agents)}
    return dict(fitness(score, scenario.agents, scenario.measured_by()))


def claims(_: None = None) -> list[Claim]:
    """All claims about Fig. 7 and Eqs 17-22."""
    exact = [
        Claim(
            id=f"fig7.{name}",
            statement=words,
            source="Fig. 7, Eqs 17-20",
            test="equal to 1e-12",
            published=expected,
            ours=value,
            **judged(abs(value - expected) < 1e-12, "" if abs(value - expected) < 1e-12 else "Not equal."),
        )
        for name, words, value, expected in LANDMARKS
    ]
    speeds = []
    for v in SPEEDS:
        value, (mean, sd) = recomputed(v)["f_speed"], optimum(v).published["f_speed"]
        off = abs(value - mean)
        speeds.append(
            Claim(
                id=f"fig7.f_speed.{v}ms",
                statement=f"Eqs 17 and 22 on Table S2's own phi_vel at {v} m/s",
                source=f"Table S2, column {v} m/s",
                test=f"within {WITHIN:g}",
                published=mean,
                published_sd=sd,
                ours=value,
                **judged(off <= WITHIN, "" if off <= WITHIN else f"Off by {off:.3g}."),
            )
        )
    return exact + speeds
