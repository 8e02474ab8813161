"""Limits: what is to be shown, such as "r_min<1 at 1e-3/h" or "phi_vel>=3 in 99%"."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from airflock.parts.metrics import reported_values, scalar_names
from airflock.recordings import upper_probability_bound
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
    score, sign, value : the event: an order parameter of the flight, < <= > or >=, and a number in
                         its unit
    rate, unit : how often at most: per flock hour (h), per drone hour (drone-h) or per flight;
                 None: only to be bounded
    is_timed : whether the event, once it has happened, stays true for the rest of the flight
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
        """Return True if the event happened in a flight; nan counts as an event."""
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
    known = scalar_names(scenario.metrics.rule, scenario.metrics.numbers, scenario.goals.kind != "none")
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
        _, meaning = reported_values(scenario.metrics.rule).get(score, ("", score))
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
    """Return True if an event stays true once it has happened: of a minimum, a maximum, or a growing count."""
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


EARLY = 16  # flights at the first look that could refute
# Sizes fixed in advance, look k pays alpha / (k (k + 1)): all bounds hold together, whatever the
# reason to stop. The price is 23 % more flights at 95 % than for one fixed look.
GROWTH = 1.5  # ratio of two sizes: a limit is shown after at most so many times the flights that would do


def lower_bound(events: int, flights: int, confidence: float) -> float:
    """Return the one-sided lower bound on the probability of an event per flight (Clopper and Pearson 1934)."""
    return 1.0 - upper_probability_bound(flights - events, flights, confidence)


def alpha_share(look: int) -> float:
    """Return the share of alpha that look 1, 2, 3, ... pays; all shares sum up to 1."""
    return 1.0 / (look * (look + 1.0))


def flights_needed(limit: float, alpha: float) -> int:
    """Return the number of flights without any event after which the bound lies below a limit per flight."""
    return max(1, math.ceil(math.log(alpha) / math.log1p(-limit)))


def look_schedule(limit: float, alpha: float) -> Iterator[tuple[int, float, float]]:
    """Yield looks in their order: flights, alpha of the upper bound (0: not used), alpha of the lower bound."""
    # Before the first size that could show the limit only refutation is possible, so only the lower
    # bound pays there.
    shows, turn, size = flights_needed(limit, alpha * alpha_share(1)), 0, float(EARLY)
    while math.ceil(size) < shows:
        turn += 1
        yield math.ceil(size), 0.0, alpha * alpha_share(turn)
        size *= GROWTH
    for k in count():
        yield math.ceil(shows * GROWTH**k), alpha * alpha_share(k + 1), alpha * alpha_share(turn + k + 1)


@dataclass(frozen=True)
class InterimLook:
    """Events among the first flights, and what they say.

    above, below : alpha that the upper and the lower bound pay; 0: it was not looked at
    low, high    : probability per flight, one-sided bounds
    """

    flights: int
    events: int
    above: float
    below: float
    low: float
    high: float


def take_look(flights: int, events: int, upper_alpha: float, lower_alpha: float) -> InterimLook:
    """Return both bounds: the upper one with confidence 1 - upper_alpha, the lower one with 1 - lower_alpha."""
    low = lower_bound(events, flights, 1.0 - lower_alpha) if lower_alpha > 0.0 else 0.0
    high = upper_probability_bound(events, flights, 1.0 - upper_alpha) if upper_alpha > 0.0 else 1.0
    return InterimLook(flights, events, upper_alpha, lower_alpha, low, high)


def rate_per_hour(probability: float, hours: float) -> float:
    """Rate (1/h) of first events, averaged over a flight of so many hours, from the probability of one."""
    return math.inf if probability >= 1.0 else -math.log1p(-probability) / hours


def probability_per_flight(rate: float, hours: float) -> float:
    """Probability of an event in a flight of so many hours, from the rate (1/h) of first events."""
    return -math.expm1(-rate * hours)


ENOUGH = 30  # flights of one candidate
NEAREST, FEWEST = 0.1, 10  # share of its flights that show how its tail falls, and at least so many
REPEATED = 0.1  # share of flights; distances in single precision meet by chance, some of ten thousand
LIKE = 8  # candidates that share a deviation as far as they differ: wide flocks' distances vary more than narrow ones'
LEAST = 0.1  # share of a difference that is left where chance explains all: so the order of candidates stays
ScoreRow = Mapping[str, Any] | None  # scores of a flight; None: it failed


def reliability_indices(limit: EventLimit, flights: Sequence[Sequence[ScoreRow]]) -> NDArray[np.float64]:
    """Return the reliability index (candidate,): standard deviations between a candidate's mean and the event.

    flights : of each candidate; a flight that failed counts as the event
    """
    counted = [sum(row is None or limit.has_happened(row) for row in rows) for rows in flights]
    rooms = [np.array([_room(limit, row) for row in rows]) for rows in flights]
    every = np.concatenate(rooms)
    known = every[np.isfinite(every)]
    if len(known) < 2 or len(np.unique(known)) < (1.0 - REPEATED) * len(known):
        return np.array([_of_share(events, len(room)) for events, room in zip(counted, rooms, strict=True)])
    found = np.array([_of_share(events, len(room)) for events, room in zip(counted, rooms, strict=True)])
    sound = [bool(np.isfinite(room).all()) for room in rooms]
    few = [i for i, room in enumerate(rooms) if sound[i] and len(room) < ENOUGH]
    if few:
        found[few] = _together([rooms[i] for i in few])
    for i, room in enumerate(rooms):
        if sound[i] and len(room) >= ENOUGH:
            found[i] = min(found[i], _of_tail(room))
    return found


def estimated_probability(limit: EventLimit, flights: Sequence[ScoreRow]) -> float:
    """Estimate the probability of an event per flight of one candidate: no less than the counted share."""
    counted = sum(row is None or limit.has_happened(row) for row in flights) / len(flights)
    return max(counted, float(norm.sf(reliability_indices(limit, [flights])[0])) if counted < 1.0 else 1.0)


def reliability_index(probability: float) -> float:
    """Return the reliability index of a probability."""
    return float(norm.isf(probability))


def _of_share(events: int, flights: int) -> float:
    """Return the index of a share of flights; infinite without events, finite if all flights have one."""
    return reliability_index(min(events, flights - 0.5) / flights) if events else math.inf


def _of_tail(room: NDArray[np.float64]) -> float:
    """Return the index of one candidate by an exponential tail of its nearest flights; infinite if it has none."""
    # The nearest tenth as an exponential tail was 0.88 to 2.91 times the truth in 80 % of trials, a
    # normal one 0.08 to 3.11 times.
    nearest = np.sort(room)[: max(FEWEST, round(NEAREST * len(room))) + 1]
    begin, excess = nearest[-1], float((nearest[-1] - nearest[:-1]).mean())
    if begin <= 0.0 or excess == 0.0:
        return math.inf
    return reliability_index((len(nearest) - 1) / len(room) * math.exp(-begin / excess))


def _together(rooms: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the index of each candidate (candidate,) from the distances of all flights to the limit."""
    # Shrunk towards all candidates (James & Stein): without it the lucky ones win, and their sets
    # then collide in up to 4e-3 of flights where 1.7e-4 was allowed.
    sizes, own = np.array([len(room) for room in rooms]), np.array([room.mean() for room in rooms])
    squares, freedom = np.array([((room - room.mean()) ** 2).sum() for room in rooms]), sizes - 1
    # The share of differences between candidates that chance does not explain (one-way analysis of
    # variance).
    left, flat = 1.0, not freedom.any()  # left of each difference, after what chance explains
    if not flat and len(rooms) > 1:
        within, between = float(squares.sum()) / int(freedom.sum()), float(own.var(ddof=1))
        left = max(LEAST, 1.0 - within * float((1.0 / sizes).mean()) / between) if between > 0.0 else LEAST
    means = own.mean() + left * (own - own.mean())
    around = np.full(len(rooms), own.mean()) if flat else means  # where each flew once: around the common mean
    away = np.concatenate([room - mean for room, mean in zip(rooms, around, strict=True)])
    # Deviations towards the event only: distances above the mean say nothing of the dangerous side
    # of a skew score.
    below = away[away < 0.0]
    counted = len(away) - (1.0 if flat else left * len(rooms))
    variance = float((below**2).mean()) * len(away) / counted if len(below) else 0.0
    pooled = variance
    if not flat:
        # Spread is pooled over candidates of similar means: wide flocks' distances vary more than
        # narrow ones'.
        near = np.argsort(np.abs(own[:, None] - own[None, :]), axis=1, kind="stable")[:, :LIKE]
        pooled = squares[near].sum(axis=1) / np.maximum(freedom[near].sum(axis=1), 1)
    spread = np.sqrt(left * pooled + (1.0 - left) * variance)
    if len(rooms) == 1:
        spread = np.array([math.sqrt(variance)])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(spread > 0.0, means / spread, np.copysign(math.inf, means)), float)


def _room(limit: EventLimit, row: ScoreRow) -> float:
    """Return how far a score lies on the safe side of the event, in its unit; nan without a score."""
    found = math.nan if row is None or row.get(limit.score) is None else float(row[limit.score])
    return found - limit.value if limit.sign in ("<", "<=") else limit.value - found
