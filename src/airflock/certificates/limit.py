"""Limits: what is to be shown, such as "r_min<1 at 1e-3/h" or "phi_vel>=3 in 99%"."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from airflock.certificates.bounds import probability_per_flight, rate_per_hour
from airflock.parts.metrics import reported_values, scalar_names
from airflock.scenarios import Scenario
from airflock.support import ScenarioError, collect_errors, suggest

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
FORM = re.compile(rf"\s*(\w+)\s*(<=|>=|<|>)\s*({NUMBER})\s*(?:(at|in)\s*({NUMBER})\s*(%?)\s*(?:/\s*([a-z -]+?))?)?\s*")
UNITS = {"h": "h", "flock hour": "h", "hour": "h", "drone-h": "drone-h", "drone hour": "drone-h", "flight": "flight"}
OPPOSITE = {"<": ">=", ">=": "<", ">": "<=", "<=": ">"}
EXAMPLES = "write SCORE<VALUE at RATE/h, such as 'r_min<1 at 1e-3/h', or SCORE>=VALUE in SHARE, as 'phi_vel>=3 in 99%'"
RAREST = 1e-18  # probability per flight below which a limit is a slip of the pen
R_COLL_METRICS = ("n_coll", "phi_coll", "f_coll", "fitness")  # scores that metrics.r_coll changes


@dataclass(frozen=True)
class EventLimit:
    """An event of a flight, and how often it may happen.

    text  : as it was given
    score, sign, value : the event: an order parameter of the flight, < <= > or >=, and a number in its unit
    rate, unit : how often at most: per flock hour (h), per drone hour (drone-h) or per flight; None: only to be bounded
    timed : whether the event, once it has happened, stays true for the rest of the flight
    """

    text: str
    score: str
    sign: str
    value: float
    rate: float | None
    unit: str
    is_timed: bool

    @property
    def event(self) -> str:
        """The event in short."""
        return f"{self.score}{self.sign}{self.value:g}"

    def has_happened(self, scores: Mapping[str, Any]) -> bool:
        """Whether the event happened in a flight; a score that is nan counts as one."""
        found = scores.get(self.score)
        if self.score == "r_min" and scores.get("closest") is not None:
            found = scores["closest"]
        if found is None or math.isnan(found):
            return True
        low = found < self.value if self.sign in ("<", ">=") else found <= self.value
        return bool(low == (self.sign in ("<", "<=")))

    def probability(self, hours: float, agents: int) -> float | None:
        """The limit as the probability of an event per flight of so many hours; None where there is no rate."""
        if self.rate is None:
            return None
        if self.unit == "flight":
            return self.rate
        return probability_per_flight(self.rate * (agents if self.unit == "drone-h" else 1.0), hours)

    def to_limit_unit(self, probability: float, hours: float, agents: int) -> float:
        """A probability per flight in the limit's own unit."""
        if self.unit == "flight":
            return probability
        return rate_per_hour(probability, hours) / (agents if self.unit == "drone-h" else 1.0)


def parse_limit(text: str, scenario: Scenario) -> EventLimit:
    """A limit from its text. Raises ScenarioError, one line, with what is wrong."""
    where = f"limit '{text}'"
    found = FORM.fullmatch(text)
    if found is None:
        raise ScenarioError([f"{where}: cannot be read; {EXAMPLES}"])
    score, sign, value, word, rate, percent, unit = found.groups()
    known = scalar_names(scenario.measures, scenario.metrics, scenario.goals.kind != "none")
    if score not in known:
        hint = suggest(score, known, f"known: {', '.join(known)}")
        raise ScenarioError([f"{where}: {score}: unknown order parameter; {hint}"])
    often = None if rate is None else float(rate) * (0.01 if percent else 1.0)
    timed = _lasting(scenario, score, sign, float(value))
    fault = ""
    if word == "in":
        sign, often, unit = OPPOSITE[sign], 1.0 - float(often or 0.0), "flight" if unit is None else "?"
        timed = _lasting(scenario, score, sign, float(value))
    elif word == "at":
        unit = "flight" if percent and unit is None else UNITS.get((unit or "").strip(), "?")
    else:
        unit = "h" if timed else "flight"
    if unit == "?":
        fault = "say how often: a rate /h (flock hour), /drone-h or /flight, or a share in %"
    elif often is not None and not 0.0 < often < (1.0 if unit == "flight" else math.inf):
        ranges = {"in": "the share lies outside (0, 100 %)", "at": "the rate must be above 0, and below 1 per flight"}
        fault = ranges[word]
    elif unit in ("h", "drone-h") and not timed:
        _, meaning = reported_values(scenario.measures).get(score, ("", score))
        fault = f"{meaning} has no rate per hour; give it /flight, or as '{score}{OPPOSITE[sign]}{value} in 99%'"
    elif score == "r_min" and sign in (">", ">="):
        fault = f"near is what is dangerous; give 'r_min<{value} at ...', or 'r_min>={value} in 99%'"
    elif score == "r_min" and float(value) <= 0.0:
        fault = "a distance must be above 0 m"
    if fault:
        raise ScenarioError([f"{where}: {fault}"])
    limit = EventLimit(text.strip(), score, sign, float(value), often, unit, timed)
    allowed = limit.probability(scenario.flight.duration / 3600.0, scenario.agents)
    if allowed is not None and not RAREST <= allowed < 1.0:
        said = "every flight may have it" if allowed >= 1.0 else "no number of flights could show that"
        raise ScenarioError([f"{where}: allows the event in {allowed:g} of flights: {said}"])
    return limit


def _lasting(scenario: Scenario, score: str, sign: str, value: float) -> bool:
    """Whether an event stays true once it has happened: of a minimum, a maximum, or a count that only grows."""
    if score == "phi_wall":  # mean over those outside: above 0 from the first moment on
        return sign == ">" and value == 0.0
    for metric in scenario.order_parameters:
        how = metric.over_time.get(score, "mean")
        if score in metric.reports and score in getattr(metric.Sample, "_fields", ()):
            return (how == "min" and sign in ("<", "<=")) or (how in ("max", "sum") and sign in (">", ">="))
    return False


def parse_limits(texts: list[str], scenario: Scenario) -> tuple[EventLimit, ...]:
    """Limits from their texts; all faults together."""
    faults: list[str] = []
    found = []
    for text in texts:
        with collect_errors(faults):
            found.append(parse_limit(text, scenario))
    if not texts:
        faults.append(f"no limit is given; {EXAMPLES}")
    radii = [limit.value for limit in found if limit.score == "r_min"]
    others = [limit.score for limit in found if limit.score in R_COLL_METRICS]
    if radii and others and max(radii) > scenario.metrics.r_coll:
        faults.append(
            f"limits: {others[0]} is measured with metrics.r_coll = {scenario.metrics.r_coll:g} m, and r_min<"
            f"{max(radii):g} asks for more; certify them apart, or set metrics.r_coll = {max(radii):g}"
        )
    often = scenario.metrics.collision_period
    if radii and others and often is not None and often > scenario.flight.dt:
        faults.append(
            f"limits: {others[0]} is measured every metrics.collision_period = {often:g} s, and r_min at every motion "
            "step; certify them apart, or leave out metrics.collision_period"
        )
    events = [limit.event for limit in found]
    faults += [f"limit '{event}': given twice" for event in dict.fromkeys(events) if events.count(event) > 1]
    if faults:
        raise ScenarioError(faults)
    return tuple(found)
