"""Whether each limit can be shown at all in the time that is kept for certifying; said before the search begins."""

import math

from airflock.certificates import COUNT_BUDGET_SHARE, Campaign, flights_to_show
from airflock.search.tune.plan import CERTIFY_SHARE, BudgetPlan


def infeasible_limit_lines(campaign: Campaign, plan: BudgetPlan) -> list[str]:
    """A line for each limit that the plan's flights could not show even if nothing ever happened in them."""
    able = int(COUNT_BUDGET_SHARE * plan.seconds * plan.rate)
    return [
        f"{limit.text}: needs {flights:,} flights without an event to be shown, and there is time for {able:,}; "
        f"give --budget {_time(1.1 * flights / plan.rate / CERTIFY_SHARE / COUNT_BUDGET_SHARE)}, "
        "or ask for a larger limit"
        for limit in campaign.limits
        if (flights := flights_to_show(campaign, limit)) > able
    ]


def _time(seconds: float) -> str:
    """At least so long, as --budget takes it."""
    return f"{math.ceil(seconds / 3600.0)}h" if seconds > 7200.0 else f"{math.ceil(seconds / 60.0)}min"
