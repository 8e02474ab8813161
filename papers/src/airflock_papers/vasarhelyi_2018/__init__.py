"""Vásárhelyi et al., Science Robotics 3, eaat3536 (2018): optimised flocking of drones in confined environments.

Parts: s2 (Table S2), fig1 (algorithm A against B), fig2 (range and delay), fig34 (outdoor flights), pressure (30 to
1000 drones), limits (what keeps the fitness below 1), tuning (what Tables S3 and S4 say of each parameter), real (shill
agents of Table S4, wind), beyond (a higher velocity, optima that keep farther apart). Each part flies and measures;
statements.toml says what the paper prints of it. Flown only when they are asked for by name: s1 (Table S1, the
evolution itself), which takes hours; optima and gains, the same sentences of the optima that ship; searches, what s1
found of its own course; rounding, the search inside the digits of Table S1.
"""

from airflock_papers.paper import Paper, by_modules
from airflock_papers.vasarhelyi_2018 import (
    beyond,
    fig1,
    fig2,
    gains,
    limits,
    optima,
    outdoor,
    pressure,
    real,
    rounding_claims,
    searches,
    table_s1,
    table_s2,
    tuning,
)

MODULES = {
    "s1": table_s1,
    "optima": optima,
    "gains": gains,
    "searches": searches,
    "rounding": rounding_claims,
    "s2": table_s2,
    "fig1": fig1,
    "fig2": fig2,
    "fig34": outdoor,
    "pressure": pressure,
    "limits": limits,
    "tuning": tuning,
    "real": real,
    "beyond": beyond,
}
PAPER = Paper(
    "Vásárhelyi et al. 2018, Optimized flocking of autonomous drones in confined environments",
    __name__,
    ("s2", "fig1", "fig2", "fig34", "pressure", "limits", "tuning", "real", "beyond"),
    by_modules(MODULES),
    long=("s1", "optima", "gains", "searches", "rounding"),
)
