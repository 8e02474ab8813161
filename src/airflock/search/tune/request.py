"""What a tuning is asked for, checked before anything flies: what is to be shown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from airflock.certificates import Campaign, campaign_from_request
from airflock.parts.metrics import scalar_names
from airflock.scenarios import Scenario
from airflock.search.tune.plan import DEFAULT_CONFIDENCE, BudgetPlan
from airflock.search.tune.start import measures_walls
from airflock.support import ErrorCollector, ScenarioError, StudyError


@dataclass(frozen=True)
class TuneRequest:
    """What a tuning is asked for.

    campaign : what its certificate is to show; limits: the texts of its limits
    """

    campaign: Campaign
    limits: list[str]


def make_request(
    start: Scenario,
    limit: Sequence[str] = (),
    confidence: float | None = None,
    plan: BudgetPlan | None = None,
) -> TuneRequest:
    """What is asked for; what is not given is as in the plan of a tuning that goes on, or else as usual.

    Raises ScenarioError, all faults together.
    """
    asked = ErrorCollector()
    limits = list(limit) or (plan.limits if plan else []) or asked.read(default_limits, start)
    sure = (plan.confidence if plan else DEFAULT_CONFIDENCE) if confidence is None else confidence
    campaign = asked.read(campaign_from_request, start, limits, sure)
    asked.raise_errors()
    return TuneRequest(campaign, limits)


def check_tune_budget(budget: float) -> None:
    """Refuse a time in which nothing could be tuned, and one without an end."""
    if not 0.0 < budget < math.inf:
        raise StudyError(f"budget = {budget:g} s is not positive")


def default_limits(scenario: Scenario) -> list[str]:
    """Collisions, and contacts where there are walls or obstacles, rarer than once in a hundred flock hours each.

    Raises ScenarioError where distances are not measured.
    """
    if "r_min" not in scalar_names(scenario.measures, scenario.metrics):
        kind = scenario.measures.name
        raise ScenarioError(
            [f"{scenario.name}: metrics.kind = {kind!r} has no r_min to limit; say what is to be shown with --limit"]
        )
    contacts = ["clearance<0 at 0.01/h"] if measures_walls(scenario) else []
    return [f"r_min<{scenario.metrics.r_coll:g} at 0.01/h", *contacts]
