"""What our evolution gains over Table S1, from the optima that ship: the same seeds for all, so that flights are pairs.

Against Table S1 as it is printed, and against Table S1 refitted inside its rounding, each with and without F_wall.
"""

from collections.abc import Mapping

import pandas as pd

from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018 import table_s1
from airflock_papers.vasarhelyi_2018.optima import evolved
from airflock_papers.vasarhelyi_2018.published import REFIT, SPEEDS, optimum

Data = Mapping[tuple[str, int], pd.DataFrame]


def fly(flights: Flights) -> Data:
    """Order parameters by side (ours, printed, refitted) and speed."""
    scenarios = {("ours", v): evolved(v) for v in SPEEDS} | {("printed", v): optimum(v) for v in SPEEDS}
    scenarios |= {("refitted", v): optimum(v, settings) for v, settings in REFIT.items()}
    flown = flights.score("Table S1, ours against printed", scenarios, flights.count(table_s1.PAIRS, 20))
    return {key: flown.loc[key] for key in scenarios}


def measured(data: Data) -> list[Measured]:
    """Paired differences of the fitness at every speed."""
    found = []
    for v in SPEEDS:
        found += table_s1.gains(v, data["ours", v], data["printed", v], data.get(("refitted", v)))
    return found
