"""What a certificate is asked for, checked before anything flies: limits, confidence, keys, times."""

from collections.abc import Sequence
from typing import Any

from airflock.certify.campaign import Campaign
from airflock.errors import ScenarioError, StudyError, gathering
from airflock.executors.cluster import fly_on_their_cpu
from airflock.limits.limit import read_all
from airflock.scenarios.scenario import Scenario


def campaign_of(
    scenario: Scenario,
    limit: str | Sequence[str],
    confidence: float = 0.95,
    flights: int | None = None,
    *,
    uncertain: bool = False,
    precision: int = 32,
    device: str = "cpu",
) -> Campaign:
    """The campaign that is asked for. Raises ScenarioError, all faults together."""
    faults: list[str] = []
    limits: tuple[Any, ...] = ()
    with gathering(faults):
        limits = read_all([limit] if isinstance(limit, str) else list(limit), scenario)
    if not 0.5 <= confidence < 1.0:
        faults.append(f"confidence = {confidence:g} lies outside [0.5, 1); 0.95 is usual")
    if flights is not None and not 1 <= flights < 1 << 30:
        faults.append(f"flights = {flights} lies outside [1, {(1 << 30) - 1}]")
    if precision not in (32, 64):
        faults.append(f"precision = {precision} is neither 32 nor 64")
    if device not in ("cpu", "python"):
        faults.append(f"device = {device!r}: a certificate flies on cpu or python")
    campaign = Campaign(
        scenario, limits, confidence, 64 if device == "python" else precision, flights, uncertain, device
    )
    if uncertain and not campaign.intervals:
        faults.append(f"{scenario.name}: no number has an interval; airflock identify --uncertain writes them")
    if faults:
        raise ScenarioError(faults)
    return campaign


def asked(campaign: Campaign, tolerance: bool | Sequence[str], split: bool = False) -> tuple[str, ...]:
    """Keys whose tolerance is asked for; ScenarioError where one cannot be varied, or nothing can be split."""
    if split:
        from airflock.certify.branches import refuse

        refuse(campaign)
    if not tolerance:
        return ()
    from airflock.evolve.environment import sound_keys, usual_keys

    return usual_keys(campaign.scenario) if tolerance is True else sound_keys(campaign.scenario, list(tolerance))


def check_options(budget: float, timeout: float | None, scheduler: str | None, device: str) -> None:
    """Refuse times in which nothing could fly, and a scheduler's workers in plain Python."""
    if not budget > 0.0:
        raise StudyError(f"budget = {budget:g} s is not positive")
    if timeout is not None and not timeout > 0.0:
        raise StudyError(f"timeout = {timeout:g} s is not positive")
    fly_on_their_cpu(scheduler, device)
