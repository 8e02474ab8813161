"""One flight of a certificate: its scores, and where an event happened, when, and how near agents came.

A flight in which an event happened is flown a second time in parts, measured at every motion step. That costs nothing
where events are rare, and flights are deterministic: both are the same one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from airflock.certificates.limit import R_COLL_METRICS, EventLimit
from airflock.runs import ScenarioTask, ScoreFunction, with_parameters
from airflock.scenarios import Scenario

PARTS = 60  # of a flight that is flown again: when an event happened is known to a sixtieth of its duration


def with_distance_metrics(scenario: Scenario, limits: Sequence[EventLimit]) -> Scenario:
    """The scenario, measured so that no approach within the largest distance of a limit is missed.

    Collisions are looked for at every motion step, so its radius becomes that distance, unless other limits mind it.
    """
    radii = [limit.value for limit in limits if limit.score == "r_min"]
    if not radii:
        return scenario
    if any(metric.name == "collisions" for metric in scenario.order_parameters):
        if any(limit.score in R_COLL_METRICS for limit in limits):
            return scenario
        return replace(scenario, metrics=replace(scenario.metrics, r_coll=max(radii), collision_period=None))
    return sampled_every_step(scenario)


def sampled_every_step(scenario: Scenario) -> Scenario:
    """The scenario, sampled at every motion step."""
    return replace(scenario, metrics=replace(scenario.metrics, period=0.0, collision_period=None))


def limit_score_function(
    scenario: Scenario, limits: Sequence[EventLimit], precision: int, device: str = "cpu"
) -> ScoreFunction:
    """Parameters and a seed → scores; with `closest` (m) and `first` (s) where an event of a limit happened.

    scenario : as `with_distance_metrics` gives it
    """
    from airflock.engine import fly_world, score_flight

    watched = [limit for limit in limits if limit.is_timed]
    radius = max((limit.value for limit in limits if limit.score == "r_min"), default=0.0)

    def score(parameters: Mapping[str, float], seed: int) -> Mapping[str, Any]:
        flown = with_parameters(scenario, parameters) if parameters else scenario
        if device == "cpu":
            values = score_flight(flown, seed, precision=precision)
        else:
            values = flown.judged(fly_world(flown, seed, precision=precision, device=device).values)
        found = {name: value for name, value in values.items() if isinstance(value, (int, float))}
        near = radius > 0.0 and (found["r_min"] <= radius or found.get("n_coll", 0.0) > 0.0)
        if near or any(limit.has_happened(found) for limit in watched):
            found |= event_details(flown, seed, watched, precision, device)
        return found

    return score


def event_details(
    scenario: Scenario, seed: int, limits: Sequence[EventLimit], precision: int, device: str = "cpu"
) -> dict[str, Any]:
    """Smallest distance at any motion step (`closest`, m) and when each event had happened (`first`, s or None)."""
    from airflock.engine import Flight

    flight = Flight(sampled_every_step(scenario), seed, precision=precision, device=device)
    part = max(1, round(scenario.flight.duration / scenario.flight.dt / PARTS))
    first: list[float | None] = [None] * len(limits)
    scores: Mapping[str, Any] = {}
    while not flight.over:
        scores = flight.advance(steps=part).scores()
        for i, limit in enumerate(limits):
            if first[i] is None and limit.has_happened(scores):
                first[i] = flight.time
    scores = flight.finish()
    for i, limit in enumerate(limits):
        if first[i] is None and limit.has_happened(scores):
            first[i] = flight.time
    return {"closest": scores.get("r_min"), "first": first}


class CampaignTask(ScenarioTask):
    """What a worker of a dask scheduler is sent: the scenario as text, the limits, and how to measure."""

    def __init__(self, scenario: Scenario, limits: Sequence[EventLimit], precision: int):
        """Raises StudyError for a law that exists only in this process."""
        super().__init__(scenario, precision)
        self.limits = tuple(limits)

    def flown(self, scenario: Scenario) -> Scenario:
        """The scenario with the distances measured that the limits ask for."""
        return with_distance_metrics(scenario, self.limits)

    def score_function(self, scenario: Scenario) -> ScoreFunction:
        """Parameters and seed → what the limits look at."""
        return limit_score_function(scenario, self.limits, self.precision)
