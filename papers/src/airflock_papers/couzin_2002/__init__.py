"""Couzin et al., J. Theor. Biol. 218, 1-11 (2002): four kinds of groups as the zone of orientation widens.

Part: groups (Fig. 2 and 3: swarm, torus, dynamic parallel, highly parallel). The paper tells the groups apart by the
polarization p_group (here `polarisation`) and the momentum m_group (`milling`); its surfaces are not digitised, so what
is claimed is which of the two is high. The hysteresis between the groups, the paper's title, is not flown.
"""

from collections.abc import Sequence

from airflock.scenarios import load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.paper import Flown, Paper

GROUPS = ("swarm", "torus", "dynamic_parallel", "highly_parallel")
SYMBOLS = {"polarisation": "p_group", "milling": "m_group"}


def fly(_wanted: Sequence[str], flights: Flights) -> Flown:
    """Fly the four groups."""
    scenarios = {name: load(f"couzin_2002/{name}") for name in GROUPS}
    flown = flights.score("Figs 2 and 3", scenarios, flights.count(10, 3))
    measured = [
        Measured(
            f"groups.{name}.{symbol}",
            column,
            f"{name}, the time of forming included",
            statistics.mean(flown.loc[name, column]),
        )
        for name in GROUPS
        for column, symbol in SYMBOLS.items()
    ]
    gap = statistics.difference(*(flown.loc[name, "polarisation"] for name in ("highly_parallel", "dynamic_parallel")))
    measured.append(Measured("groups.order", "polarisation", "highly_parallel less dynamic_parallel", gap))
    return measured, {"groups": flown}


PAPER = Paper("Couzin et al. 2002, Collective memory and spatial sorting in animal groups", __name__, ("groups",), fly)
