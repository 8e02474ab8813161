"""What held: the constraints of an optimum, whether a change keeps them, and whether it gains distance or room."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from airflock.certificates import EventLimit, estimated_probability
from airflock.scenarios import Scenario
from airflock.search.intervals import mean_interval
from airflock.search.safe import allowed_probability, limit_excess
from airflock.search.search_table import SearchSettings
from airflock.search.steps import ScoreColumns, join_scenarios, table_rows

SAFETY = ("f_coll", "f_disc", "f_cluster", "f_wall")  # partial fitnesses that are constraints; the others are its price
SLACK = 0.02  # by which the mean of one may fall, and the share of flights with a contact may rise
WALLS = ("clearance", "phi_wall", "n_contacts", "f_wall")  # scores of what flies into walls and obstacles
RESERVE = SearchSettings().reserve  # how many times rarer than allowed an event is to look, as in a search


@dataclass(frozen=True)
class Constraints:
    """What must go on to hold in each of several scenarios; flights are one table for each of them.

    limits : events that may happen so rarely; cost : fitness that may be given up in all
    """

    limits: Sequence[EventLimit]
    cost: float

    @property
    def wall_limits(self) -> list[EventLimit]:
        """Limits of walls and obstacles."""
        return [limit for limit in self.limits if limit.score in WALLS]

    @property
    def other_limits(self) -> list[EventLimit]:
        """All other limits."""
        return [limit for limit in self.limits if limit.score not in WALLS]

    def refused(
        self, scenarios: Sequence[Scenario], before: Sequence[ScoreColumns], after: Sequence[ScoreColumns]
    ) -> str:
        """What a step breaks, or that it costs too much, in words; empty if it may stay."""
        for scenario, was, now in zip(scenarios, before, after, strict=True):
            if found := violation_text(was, now) or self._limit_broken(scenario, was, now):
                return f"{found}, in {scenario.name}" if len(scenarios) > 1 else found
        if self.short(scenarios, after) < self.short(scenarios, before):
            return ""
        price = float((join_scenarios(before)["fitness"] - join_scenarios(after)["fitness"]).mean())
        return f"costs {price:.3g} of fitness, more than {self.cost:g}" if price > self.cost else ""

    def short(self, scenarios: Sequence[Scenario], tables: Sequence[ScoreColumns]) -> float:
        """How far flights are from keeping all limits in all scenarios; 0: they keep them."""
        return scenarios_excess(self.limits, scenarios, tables)

    def _limit_broken(self, scenario: Scenario, before: ScoreColumns, after: ScoreColumns) -> str:
        """Return which limit that was kept is broken, or broken more than before, in words; empty if none."""
        for limit in self.limits:
            most = allowed_probability(limit, scenario)
            was, now = (estimated_probability(limit, table_rows(table)) for table in (before, after))
            if now > max(was, most / RESERVE):
                return f"{limit.event} in about {now:.2g} of flights, before {was:.2g}; allowed are {most:.2g}"
        return ""


def scenarios_excess(
    limits: Sequence[EventLimit], scenarios: Sequence[Scenario], tables: Sequence[ScoreColumns]
) -> float:
    """How far flights are from keeping these limits in all scenarios, in standard deviations added up."""
    return math.fsum(
        float(limit_excess(limits, scenario, [table_rows(table)], RESERVE)[0])
        for scenario, table in zip(scenarios, tables, strict=True)
    )


def violation_text(before: ScoreColumns, after: ScoreColumns) -> str:
    """Return which constraint that held is broken in one scenario, in words; empty if none."""
    for name in SAFETY:
        if name in before:
            drop, _, low, _ = mean_interval((before[name] - after[name]).tolist())
            if drop > SLACK and low > 0.0:
                return f"{name} falls from {before[name].mean():.3g} to {after[name].mean():.3g}"
    for name, what in (("phi_wall", "leave the arena or enter obstacles"), ("n_coll", "have collisions")):
        if name in before:
            was, now = float((before[name] > 0.0).mean()), float((after[name] > 0.0).mean())
            if now - was > SLACK:
                return f"{100.0 * now:.0f} % of flights {what}, before {100.0 * was:.0f} %"
    return ""


def has_gained(before: ScoreColumns, after: ScoreColumns) -> bool:
    """Whether distances or clearances grew or excursions shrank, each with 95 % confidence."""
    wider = mean_interval((after["r_min"] - before["r_min"]).tolist())[2] > 0.0
    if "phi_wall" not in before:
        return wider
    fewer = 1.0 * (before["phi_wall"] > 0.0) - 1.0 * (after["phi_wall"] > 0.0)
    changes = [fewer, before["phi_wall"] - after["phi_wall"]]
    if "clearance" in before:
        changes.append(after["clearance"] - before["clearance"])
    return wider or any(mean_interval(change.tolist())[2] > 0.0 for change in changes)
