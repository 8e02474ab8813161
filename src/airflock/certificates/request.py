"""What a certificate is asked for, checked before anything flies: limits, confidence, keys, times."""

from collections.abc import Sequence

from airflock.certificates.campaign import Campaign
from airflock.certificates.limit import read_all
from airflock.runs.executors.cluster import fly_on_their_cpu, sound_timeout
from airflock.scenarios.scenario import Scenario
from airflock.support.asked import Asked
from airflock.support.errors import ScenarioError, StudyError
from airflock.support.hardware import sound_precision


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
    asked = Asked()
    limits = asked.read(read_all, [limit] if isinstance(limit, str) else list(limit), scenario)
    asked.read(sound_confidence, confidence)
    asked.read(sound_flights, flights)
    asked.read(sound_flyer, precision, device)
    bits = 64 if device == "python" else precision
    campaign = Campaign(scenario, limits, confidence, bits, flights, uncertain, device)
    if uncertain and not campaign.intervals:
        asked.note(f"{scenario.name}: no number has an interval; airflock identify --uncertain writes them")
    asked.refuse()
    return campaign


def sound_confidence(confidence: float) -> None:
    """Refuse what is no confidence of a certificate."""
    if not 0.5 <= confidence < 1.0:
        raise ScenarioError([f"confidence = {confidence:g} lies outside [0.5, 1); 0.95 is usual"])


def sound_flights(flights: int | None) -> None:
    """Refuse a number of flights that cannot be numbered."""
    if flights is not None and not 1 <= flights < 1 << 30:
        raise ScenarioError([f"flights = {flights} lies outside [1, {(1 << 30) - 1}]"])


def sound_flyer(precision: int, device: str) -> None:
    """Refuse a precision and a device on which no certificate flies."""
    asked = Asked()
    asked.read(sound_precision, precision)
    if device not in ("cpu", "python"):
        asked.note(f"device = {device!r}: a certificate flies on cpu or python")
    asked.refuse()


def tolerance_keys(scenario: Scenario, tolerance: bool | Sequence[str]) -> tuple[str, ...]:
    """Keys whose tolerance is asked for; ScenarioError where one cannot be varied."""
    if not tolerance:
        return ()
    from airflock.certificates.environment import sound_keys, usual_keys

    return usual_keys(scenario) if tolerance is True else sound_keys(scenario, list(tolerance))


def sound_budget(budget: float) -> None:
    """Refuse a time in which nothing could fly."""
    if not budget > 0.0:
        raise StudyError(f"budget = {budget:g} s is not positive")


def sound_workers(timeout: float | None, scheduler: str | None, device: str) -> None:
    """Refuse a time in which no flight could fly on a worker, and a scheduler's workers in plain Python."""
    asked = Asked()
    asked.read(sound_timeout, timeout)
    asked.read(fly_on_their_cpu, scheduler, device)
    asked.refuse()
