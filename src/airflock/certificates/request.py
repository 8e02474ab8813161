"""What a certificate is asked for, checked before anything flies: limits, confidence, keys, times."""

from collections.abc import Sequence

from airflock.certificates.campaign import Campaign
from airflock.certificates.limit import parse_limits
from airflock.runs import check_timeout, check_worker_device
from airflock.scenarios import Scenario
from airflock.support import ErrorCollector, ScenarioError, StudyError, check_precision


def campaign_from_request(
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
    asked = ErrorCollector()
    limits = asked.read(parse_limits, [limit] if isinstance(limit, str) else list(limit), scenario)
    asked.read(check_confidence, confidence)
    asked.read(check_flight_count, flights)
    asked.read(check_flight_options, precision, device)
    bits = 64 if device == "python" else precision
    campaign = Campaign(scenario, limits, confidence, bits, flights, uncertain, device)
    if uncertain and not campaign.number_intervals:
        asked.note(f"{scenario.name}: no number has an interval; airflock identify --uncertain writes them")
    asked.raise_errors()
    return campaign


def check_confidence(confidence: float) -> None:
    """Refuse what is no confidence of a certificate."""
    if not 0.5 <= confidence < 1.0:
        raise ScenarioError([f"confidence = {confidence:g} lies outside [0.5, 1); 0.95 is usual"])


def check_flight_count(flights: int | None) -> None:
    """Refuse a number of flights that cannot be numbered."""
    if flights is not None and not 1 <= flights < 1 << 30:
        raise ScenarioError([f"flights = {flights} lies outside [1, {(1 << 30) - 1}]"])


def check_flight_options(precision: int, device: str) -> None:
    """Refuse a precision and a device on which no certificate flies."""
    asked = ErrorCollector()
    asked.read(check_precision, precision)
    if device not in ("cpu", "python"):
        asked.note(f"device = {device!r}: a certificate flies on cpu or python")
    asked.raise_errors()


def tolerance_keys(scenario: Scenario, tolerance: bool | Sequence[str]) -> tuple[str, ...]:
    """Keys whose tolerance is asked for; ScenarioError where one cannot be varied."""
    if not tolerance:
        return ()
    from airflock.certificates.environment import check_environment_keys, used_and_unused_keys

    return used_and_unused_keys(scenario) if tolerance is True else check_environment_keys(scenario, list(tolerance))


def check_certify_budget(budget: float) -> None:
    """Refuse a time in which nothing could fly."""
    if not budget > 0.0:
        raise StudyError(f"budget = {budget:g} s is not positive")


def check_workers(timeout: float | None, scheduler: str | None, device: str) -> None:
    """Refuse a time in which no flight could fly on a worker, and a scheduler's workers in plain Python."""
    asked = ErrorCollector()
    asked.read(check_timeout, timeout)
    asked.read(check_worker_device, scheduler, device)
    asked.raise_errors()
