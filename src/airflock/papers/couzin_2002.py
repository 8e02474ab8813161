"""Couzin et al., J. Theor. Biol. 218, 1-11 (2002): four kinds of groups as the zone of orientation widens.

Part: groups (Fig. 2 and 3: swarm, torus, dynamic parallel, highly parallel). The paper tells the groups apart by the
polarization p_group (here `polarisation`) and the momentum m_group (`milling`); its surfaces are not digitised, so what
is claimed is which of the two is high. The hysteresis between the groups, the paper's title, is not flown.
"""

from collections.abc import Sequence

import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.paper import Found, Paper
from airflock.scenarios.files import load

LOW, HIGH = 0.35, 0.65  # our choice, because the paper's words low and high name no numbers
# group: statement, then what p_group and m_group must be: (least, most) of each
GROUPS = {
    "swarm": ("cohesive, hardly polarized and hardly turning", (0.0, LOW), (0.0, LOW)),
    "torus": ("the group turns about an empty centre: momentum high, polarization low", (0.0, LOW), (HIGH, 1.0)),
    "dynamic_parallel": ("polarized and mobile: polarization high, momentum low", (HIGH, 1.0), (0.0, LOW)),
    "highly_parallel": ("rectilinear motion: polarization very high, momentum low", (0.95, 1.0), (0.0, LOW)),
}


def fly(_wanted: Sequence[str], flights: Flights) -> Found:
    """Fly the four groups."""
    scenarios = {name: load(f"couzin_2002/{name}") for name in GROUPS}
    flown = flights.score("Figs 2 and 3", scenarios, flights.count(10, 3))
    claims = [*(claim for name in GROUPS for claim in group_claims(name, flown)), order_claim(flown)]
    return claims, {"groups": flown}


def group_claims(name: str, flown: pd.DataFrame) -> list[Claim]:
    """Polarization and momentum of one kind of group."""
    statement, *bands = GROUPS[name]
    found = []
    for column, symbol, (low, high) in zip(("polarisation", "milling"), ("p_group", "m_group"), bands, strict=True):
        value = statistics.mean(flown.loc[name, column])
        inside = low <= value.ours <= high
        found.append(
            Claim(
                id=f"groups.{name}.{symbol}",
                statement=statement,
                source="Figs 2 and 3",
                test=f"mean {symbol} in [{low:g}, {high:g}], the time of forming included",
                **value.fields(),
                **judged(inside, "" if inside else f"{value.ours:.3f} lies outside"),
            )
        )
    return found


def order_claim(flown: pd.DataFrame) -> Claim:
    """Polarization rises from dynamic to highly parallel groups, as their zone of orientation is wider."""
    gap = statistics.difference(
        flown.loc["highly_parallel", "polarisation"], flown.loc["dynamic_parallel", "polarisation"]
    )
    return Claim(
        id="groups.order",
        statement="a highly parallel group is more polarized than a dynamic parallel one",
        source="Fig. 3",
        test="95 % interval of the difference above 0",
        **gap.fields(),
        **judged(gap.low > 0.0, "" if gap.low > 0.0 else "the two overlap"),
    )


PAPER = Paper("Couzin et al. 2002, Collective memory and spatial sorting in animal groups", ("groups",), fly)
