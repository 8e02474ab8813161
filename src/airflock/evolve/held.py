"""What held: the constraints of an optimum, whether a change keeps them, and whether it gains distance or room."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from airflock.evolve.intervals import interval
from airflock.evolve.safe import allowed, excess
from airflock.evolve.search_table import Search
from airflock.evolve.steps import Table, rows_of, together
from airflock.limits.chance import chance
from airflock.limits.limit import Limit
from airflock.scenarios.scenario import Scenario

SAFETY = ("f_coll", "f_disc", "f_cluster", "f_wall")  # partial fitnesses that are constraints; the others are its price
SLACK = 0.02  # by which the mean of one may fall, and the share of flights with a contact may rise
WALLS = ("clearance", "phi_wall", "n_contacts", "f_wall")  # scores of what flies into walls and obstacles
RESERVE = Search().reserve  # how many times rarer than allowed an event is to look, as in a search


@dataclass(frozen=True)
class Constraints:
    """What must go on to hold in each of several scenarios; flights are one table for each of them.

    limits : events that may happen so rarely; cost : fitness that may be given up in all
    """

    limits: Sequence[Limit]
    cost: float

    @property
    def at_walls(self) -> list[Limit]:
        """Limits of walls and obstacles."""
        return [limit for limit in self.limits if limit.score in WALLS]

    @property
    def elsewhere(self) -> list[Limit]:
        """All other limits."""
        return [limit for limit in self.limits if limit.score not in WALLS]

    def refused(self, scenarios: Sequence[Scenario], before: Sequence[Table], after: Sequence[Table]) -> str:
        """What a step breaks, or that it costs too much, in words; empty if it may stay."""
        for scenario, was, now in zip(scenarios, before, after, strict=True):
            if found := broken(was, now) or self._limit_broken(scenario, was, now):
                return f"{found}, in {scenario.name}" if len(scenarios) > 1 else found
        if self.short(scenarios, after) < self.short(scenarios, before):
            return ""
        price = float((together(before)["fitness"] - together(after)["fitness"]).mean())
        return f"costs {price:.3g} of fitness, more than {self.cost:g}" if price > self.cost else ""

    def short(self, scenarios: Sequence[Scenario], tables: Sequence[Table]) -> float:
        """How far flights are from keeping all limits in all scenarios; 0: they keep them."""
        return excess_of(self.limits, scenarios, tables)

    def _limit_broken(self, scenario: Scenario, before: Table, after: Table) -> str:
        """Return which limit that was kept is broken, or broken more than before, in words; empty if none."""
        for limit in self.limits:
            most = allowed(limit, scenario)
            was, now = (chance(limit, rows_of(table)) for table in (before, after))
            if now > max(was, most / RESERVE):
                return f"{limit.event} in about {now:.2g} of flights, before {was:.2g}; allowed are {most:.2g}"
        return ""


def excess_of(limits: Sequence[Limit], scenarios: Sequence[Scenario], tables: Sequence[Table]) -> float:
    """How far flights are from keeping these limits in all scenarios, in standard deviations added up."""
    return math.fsum(
        float(excess(limits, scenario, [rows_of(table)], RESERVE)[0])
        for scenario, table in zip(scenarios, tables, strict=True)
    )


def broken(before: Table, after: Table) -> str:
    """Return which constraint that held is broken in one scenario, in words; empty if none."""
    for name in SAFETY:
        if name in before:
            drop, _, low, _ = interval((before[name] - after[name]).tolist())
            if drop > SLACK and low > 0.0:
                return f"{name} falls from {before[name].mean():.3g} to {after[name].mean():.3g}"
    for name, what in (("phi_wall", "leave the arena or enter obstacles"), ("n_coll", "have collisions")):
        if name in before:
            was, now = float((before[name] > 0.0).mean()), float((after[name] > 0.0).mean())
            if now - was > SLACK:
                return f"{100.0 * now:.0f} % of flights {what}, before {100.0 * was:.0f} %"
    return ""


def gains(before: Table, after: Table) -> bool:
    """Whether distances or clearances grew or excursions shrank, each with 95 % confidence."""
    wider = interval((after["r_min"] - before["r_min"]).tolist())[2] > 0.0
    if "phi_wall" not in before:
        return wider
    fewer = 1.0 * (before["phi_wall"] > 0.0) - 1.0 * (after["phi_wall"] > 0.0)
    changes = [fewer, before["phi_wall"] - after["phi_wall"]]
    if "clearance" in before:
        changes.append(after["clearance"] - before["clearance"])
    return wider or any(interval(change.tolist())[2] > 0.0 for change in changes)
