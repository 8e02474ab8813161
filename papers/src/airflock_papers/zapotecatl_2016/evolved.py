"""What the paper proposes for the future: radii, fields of view and weights evolved for its quality.

Long: 1,000 evaluations of 90 s, so it is flown only when it is asked for by name. The study lies in Airflock's cache
folder and is continued where it was left.
"""

from typing import NamedTuple

import pandas as pd

from airflock.runs import with_parameters
from airflock.scenarios import load
from airflock.search import EvolveResult
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.studies import evolve

STUDY = "zapotecatl_2016/best"
PAIRS = 100  # paired flights, evolved against the best of the paper's experiment
MEASURES = ("quality", "cns_ext", "cns_pol", "extension_cm", "polarization_deg", "f_collision")


class Data(NamedTuple):
    """The study's result, and paired flights with its parameters and with the paper's best."""

    result: EvolveResult
    ours: pd.DataFrame
    published: pd.DataFrame


def fly(flights: Flights) -> Data:
    """The study, and the paired flights on seeds that the search never saw."""
    result = evolve(flights, "boids evolved for quality", STUDY)
    best = load(STUDY)
    pair = {"evolved": with_parameters(best, result.parameters), "best": best}
    flown = flights.score("evolved and best boids", pair, flights.count(PAIRS, 10))
    return Data(result, flown.loc["evolved"], flown.loc["best"])


def measured(data: Data) -> list[Measured]:
    """What evolution gains on the best of the paper's grid, by each of its measures."""
    told = ", ".join(f"{key.removeprefix('model.')} {value:.3g}" for key, value in data.result.parameters.items())
    return [
        Measured(
            f"evolved.{name}",
            name,
            "evolved boids less the best of the radii",
            statistics.mean(data.ours[name] - data.published[name]),
            f"{data.ours[name].mean():.4g} against {data.published[name].mean():.4g}"
            + f"; {told}" * (name == "quality"),
        )
        for name in MEASURES
    ]
