"""Whether each limit can be shown at all in the time that is kept for certifying; said before the search begins."""

import math

from airflock.certificates.campaign import Campaign
from airflock.certificates.counting import least
from airflock.certificates.run import COUNTED
from airflock.search.tune.plan import CERTIFY, Plan


def infeasible(campaign: Campaign, plan: Plan) -> list[str]:
    """A line for each limit that the plan's flights could not show even if nothing ever happened in them."""
    able = int(COUNTED * plan.seconds * plan.rate)
    return [
        f"{limit.text}: needs {flights:,} flights without an event to be shown, and there is time for {able:,}; "
        f"give --budget {_time(1.1 * flights / plan.rate / CERTIFY / COUNTED)}, or ask for a larger limit"
        for limit in campaign.limits
        if (flights := least(campaign, limit)) > able
    ]


def _time(seconds: float) -> str:
    """At least so long, as --budget takes it."""
    return f"{math.ceil(seconds / 3600.0)}h" if seconds > 7200.0 else f"{math.ceil(seconds / 60.0)}min"
