"""Vásárhelyi et al., Science Robotics 3, eaat3536 (2018): optimised flocking of drones in confined environments.

Parts: s2 (Table S2), fig1 (algorithm A against B), fig2 (range and delay), fig34 (outdoor flights), fig7 (transfer
functions), pressure (30 to 1000 drones). Each part flies, claims and draws. And s1 (Table S1, the evolution itself),
which takes hours and is flown only when it is asked for by name.
"""

from airflock.papers.paper import Paper, by_modules
from airflock.papers.vasarhelyi_2018 import fig1, fig2, fig7, outdoor, pressure, table_s1, table_s2

PAPER = Paper(
    "Vásárhelyi et al. 2018, Optimized flocking of autonomous drones in confined environments",
    ("s2", "fig1", "fig2", "fig34", "fig7", "pressure"),
    by_modules(
        {
            "s1": table_s1,
            "s2": table_s2,
            "fig1": fig1,
            "fig2": fig2,
            "fig34": outdoor,
            "fig7": fig7,
            "pressure": pressure,
        }
    ),
    long=("s1",),
)
