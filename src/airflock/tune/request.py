"""What a tuning is asked for, checked before anything flies: what is to be shown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from airflock.asked import Asked
from airflock.certify.campaign import Campaign
from airflock.certify.request import campaign_of
from airflock.errors import ScenarioError, StudyError
from airflock.metrics.registry import numbers_of
from airflock.scenarios.scenario import Scenario
from airflock.tune.plan import CONFIDENCE, Plan
from airflock.tune.start import has_walls


@dataclass(frozen=True)
class Request:
    """What a tuning is asked for.

    campaign : what its certificate is to show; limits: the texts of its limits
    """

    campaign: Campaign
    limits: list[str]


def request_of(
    start: Scenario,
    limit: Sequence[str] = (),
    confidence: float | None = None,
    plan: Plan | None = None,
) -> Request:
    """What is asked for; what is not given is as in the plan of a tuning that goes on, or else as usual.

    Raises ScenarioError, all faults together.
    """
    asked = Asked()
    limits = list(limit) or (plan.limits if plan else []) or asked.read(usual_limits, start)
    sure = (plan.confidence if plan else CONFIDENCE) if confidence is None else confidence
    campaign = asked.read(campaign_of, start, limits, sure)
    asked.refuse()
    return Request(campaign, limits)


def sound_budget(budget: float) -> None:
    """Refuse a time in which nothing could be tuned, and one without an end."""
    if not 0.0 < budget < math.inf:
        raise StudyError(f"budget = {budget:g} s is not positive")


def usual_limits(scenario: Scenario) -> list[str]:
    """Collisions, and contacts where there are walls or obstacles, rarer than once in a hundred flock hours each.

    Raises ScenarioError where distances are not measured.
    """
    if "r_min" not in numbers_of(scenario.measures, scenario.metrics):
        kind = scenario.measures.name
        raise ScenarioError(
            [f"{scenario.name}: metrics.kind = {kind!r} has no r_min to limit; say what is to be shown with --limit"]
        )
    contacts = ["clearance<0 at 0.01/h"] if has_walls(scenario) else []
    return [f"r_min<{scenario.metrics.r_coll:g} at 0.01/h", *contacts]
