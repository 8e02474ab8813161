"""Splitting: the probability of a rare fall of a score, by flights that branch off from those that came near it.

Subset simulation (Au & Beck 2001) over whole flights. A flight is a lineage: a seed, and moments
from which on other random numbers are drawn. Among the flights below a level, Metropolis-Hastings
steps draw all noise again from a moment before the level was first crossed, and keep what crosses
it again; a share of them lies below the next level.

This finds and ranks rare flights. As a number it is an estimate with a known weakness: what happens
once in a hundred flights that start the levels may be what all of the rarest have in common. So
repetitions start from different flights, and where they disagree with counting, or stem from too
few of them, no number is given.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, t

from airflock.certificates.campaign import COUNT_PURPOSE, SPLIT_PURPOSE, Campaign, certificate_seed
from airflock.certificates.counting import CampaignFlyer, CountResult
from airflock.certificates.limits import rate_per_hour
from airflock.runs import CandidateBatch, Flight, FlightResult
from airflock.scenarios import Event, Scenario
from airflock.support import ScenarioError

SHARE = 0.3  # of the flights of a level that define the next one
MOVES = 3  # steps of Metropolis and Hastings at a level
MOST = 30  # levels
ANCESTORS = 5  # distinct first flights of a repetition, below which it is not believed
SURE = 0.99  # confidence of each comparison with counting

RecordLows = Sequence[Sequence[float]]  # (sample, value) each time that a score fell below all before, of one flight


@dataclass(frozen=True)
class Lineage:
    """A flight: its seed, and (sample, world) from which on it draws that world's random numbers."""

    seed: int
    branches: tuple[tuple[int, int], ...] = ()

    def branch(self, sample: int, world: int) -> "Lineage":
        """Return a lineage with this flight up to a sample and new noise from there on."""
        return Lineage(self.seed, (*(b for b in self.branches if b[0] < sample), (sample, world)))


@dataclass(frozen=True)
class LineageFlight:
    """A flight and how its score fell."""

    lineage: Lineage
    falls: RecordLows

    @property
    def least(self) -> float:
        """Least value of the score."""
        return float(self.falls[-1][1]) if self.falls else math.inf

    def crossing(self, level: float) -> int:
        """First sample at or below a level that it reaches."""
        return next(int(sample) for sample, value in self.falls if value <= level)


FlyLineages = Callable[
    [int, list[Lineage]], list[RecordLows]
]  # number of the batch, its flights → how their scores fell


@dataclass
class Repetition:
    """One run through the levels.

    levels : (level, probability of a flight at or below it), falling
    last   : flights below the last level; seen: (level, probability, least values of the flights of
             that level)
    """

    levels: list[tuple[float, float]]
    last: list[LineageFlight]
    seen: list[tuple[float, float, list[float]]] = field(default_factory=list)
    flights: int = 0

    def probability(self, level: float) -> float:
        """Probability of a flight at or below a level, nan above the first one."""
        found = math.nan
        for begin, p, values in self.seen:
            if level <= begin:
                found = p * sum(value <= level for value in values) / len(values)
        return found

    @property
    def ancestor_count(self) -> int:
        """Distinct first flights among those below the last level."""
        return len({particle.lineage.seed for particle in self.last})


def run_repetition(
    start: Sequence[LineageFlight],
    counted: int,
    target: float,
    fly: FlyLineages,
    mean_branch_lead: float,
    rng: np.random.Generator,
    *,
    size: int,
    notify: Callable[[float, float], None] | None = None,
) -> Repetition:
    """Go down level by level until `target`.

    start : the flights with the least values among `counted` independent ones
    mean_branch_lead : mean number of samples before the first crossing from which noise is drawn
                       again
    size  : flights of a level
    """
    # Subset simulation: each level is a quantile of the scores below the level before, so that its
    # conditional probability is about SHARE. The product of these probabilities is that of the
    # target.
    level = max(particle.least for particle in start)
    p, below = len(start) / counted, list(start)
    made = Repetition([(level, p)], below)
    for number in range(MOST):
        if level <= target or not below:
            break
        # Resampled in a random order: each survivor is copied as evenly as possible.
        flock = [below[i] for i in rng.permutation(np.resize(np.arange(len(below)), size))]
        states: list[LineageFlight] = []
        for move in range(MOVES):
            flock = _moved(flock, level, fly, number * MOVES + move, mean_branch_lead, rng)
            states += flock
        made.flights += len(states)
        values = [particle.least for particle in states]
        made.seen.append((level, p, values))
        level = max(target, float(np.quantile(values, SHARE)))
        below = [particle for particle in states if particle.least <= level]
        p *= len(below) / len(states)
        made.levels.append((level, p))
        made.last = below
        if notify:
            notify(level, p)
    return made


def _moved(
    flock: list[LineageFlight], level: float, fly: FlyLineages, batch: int, back: float, rng: np.random.Generator
) -> list[LineageFlight]:
    """Move each flight by one Metropolis-Hastings step: branch it before its crossing, accept or keep the old one."""
    # The moment of branching depends on the crossing, so its ratio exp(-(new - old) / back) enters
    # the acceptance.
    size = len(flock)
    gaps, chances = rng.exponential(back, size), rng.random(size)
    crossings = [particle.crossing(level) for particle in flock]
    moments = [max(0, math.floor(at - gap)) for at, gap in zip(crossings, gaps, strict=True)]
    branched = [
        p.lineage.branch(at, 1 + batch * size + i) for i, (p, at) in enumerate(zip(flock, moments, strict=True))
    ]
    found = []
    for i, (lineage, falls) in enumerate(zip(branched, fly(batch, branched), strict=True)):
        new = LineageFlight(lineage, falls)
        taken = new.least <= level and math.log(chances[i]) < -(new.crossing(level) - crossings[i]) / back
        found.append(new if taken else flock[i])
    return found


@dataclass(frozen=True)
class SplittingEstimate:
    """Estimate of all repetitions together.

    probability, low, high : per flight, mean and 95 % t-interval of the logarithms; nan where
                             refused says why
    """

    target: float
    probability: float
    low: float
    high: float
    refused: str
    repetitions: tuple[Repetition, ...]


def estimate_probability(
    repetitions: Sequence[Repetition], target: float, values: Sequence[float]
) -> SplittingEstimate:
    """Join repetitions and compare them with counting.

    values : least score of each flight that was counted
    """
    found = [r.probability(target) for r in repetitions]
    mean, low, high = _interval(found)
    refused = ""
    few = median([r.ancestor_count for r in repetitions])
    if any(p == 0.0 or math.isnan(p) for p in found):
        refused = f"{sum(p > 0.0 for p in found)} of {len(found)} repetitions came so far"
    elif few < ANCESTORS:
        refused = f"half of the repetitions stem from {few:g} first flights or fewer, {ANCESTORS} are needed"
    else:
        refused = _disagreement(repetitions, [*_thresholds(repetitions, values, target), target], values)
    none = math.nan
    return SplittingEstimate(target, *((none,) * 3 if refused else (mean, low, high)), refused, tuple(repetitions))


def _interval(found: Sequence[float]) -> tuple[float, float, float]:
    """Mean, and the 95 % interval of the mean logarithm, stretched to hold the mean."""
    if len(found) < 2 or min(found) <= 0.0:
        return math.nan, math.nan, math.nan
    # Estimates of a product of probabilities are skewed; their logarithms are nearly normal.
    logs = np.log(found)
    half = float(t.ppf(0.975, len(found) - 1)) * float(logs.std(ddof=1)) / math.sqrt(len(found))
    mean = float(np.mean(found))
    return mean, min(mean, math.exp(logs.mean() - half)), max(mean, math.exp(logs.mean() + half))


def _thresholds(repetitions: Sequence[Repetition], values: Sequence[float], target: float) -> list[float]:
    """Levels below the start of every repetition that counting reaches: its 10, 20, 40, ... least values."""
    top, ordered = min(r.levels[0][0] for r in repetitions), sorted(values)
    found, k = [], 10
    while k <= len(ordered) and ordered[k - 1] < top:
        found.append(ordered[k - 1])
        k *= 2
    return [level for level in found if level > target]


def _disagreement(repetitions: Sequence[Repetition], levels: Sequence[float], values: Sequence[float]) -> str:
    """The first level at which repetitions and counting cannot both be right; empty if there is none."""
    n, rest = len(values), 0.5 * (1.0 - SURE)
    for level in levels:
        # Exact binomial interval of counting against the t-interval of splitting: they have to
        # overlap.
        k = sum(value <= level for value in values)
        least = float(beta.ppf(rest, k, n - k + 1)) if k else 0.0
        most = float(beta.ppf(1.0 - rest, k + 1, n - k)) if k < n else 1.0
        mean, low, high = _interval([r.probability(level) for r in repetitions])
        if math.isnan(mean) or high < least or low > most:
            said = "nothing" if math.isnan(mean) else f"{low:.2g} to {high:.2g}"
            return f"disagrees with counting at {level:.3g}: {said} against {least:.2g} to {most:.2g} per flight"
    return ""


REPETITIONS = 5
# 100 flights a level gave three of four repetitions inside the interval of counting, 200 gave 29 of
# 30.
SIZE = 200  # flights of a level
FEWEST = 2000  # flights from which repetitions start, each from its share of them
START = 100  # flights with which a repetition goes on: the nearest ones of its share
BACK = 4.0  # s, mean time before the first crossing from which noise is drawn again
WORST = 5


def check_split(campaign: Campaign) -> None:
    """Refuse a campaign that cannot be split, before anything flies."""
    faults = []
    if not any(limit.score == "r_min" for limit in campaign.limits):
        faults.append("--split needs a limit on r_min, such as --limit 'r_min<1 at 1e-4/h'")
    if campaign.scenario.world.edges == "periodic":
        faults.append("--split does not follow distances across the edges of a periodic world; leave it out")
    if campaign.flies_intervals:
        faults.append("--split flies one scenario only; leave out --uncertain")
    if faults:
        raise ScenarioError(faults)


def estimate_by_splitting(
    flyer: CampaignFlyer, counted_rows: CountResult, threads: int | None = None, scenario_file: str = ""
) -> dict[str, Any]:
    """Estimate how often r_min falls to the smallest limit, starting from the flights that were counted.

    scenario_file : file of the scenario, by which flights are flown again
    Returns plain values: target, statements, probability with its interval or why it is refused,
    worst flights.
    """
    campaign = flyer.campaign
    target = min(limit.value for limit in campaign.limits if limit.score == "r_min")
    own = [certificate_seed(campaign.hash, COUNT_PURPOSE, i) for i in range(len(counted_rows.rows))]
    values = [float(row["r_min"]) for row in counted_rows.rows]
    try:
        seeds, least = _topped_up(flyer, own, values)
    except BudgetSpent:
        return _refused(target, "time ran out before there were enough flights to start from")
    # Repetitions start from disjoint flights, so that they are independent and their spread is an
    # honest interval.
    share, runs, period = len(least) // REPETITIONS, [], sample_period(campaign.scenario)
    for number in range(REPETITIONS):
        fly = LineageFlyer(flyer, number, threads, len(counted_rows.rows))
        mine = range(number * share, (number + 1) * share)
        rng = np.random.default_rng([int(campaign.hash[:12], 16), number])

        def say(level: float, p: float, number: int = number) -> None:
            flyer.report(f"splitting {number + 1}/{REPETITIONS}: r_min<{level:.3g} at {p:.2g}")

        try:
            runs.append(
                start_repetition([seeds[i] for i in mine], [least[i] for i in mine], target, fly, period, rng, say)
            )
        except BudgetSpent:
            return _refused(target, f"time ran out in repetition {number + 1} of {REPETITIONS}")
    return _plain_values(campaign, estimate_probability(runs, target, least), scenario_file or campaign.scenario.name)


def start_repetition(
    seeds: Sequence[int],
    smallest_distances: Sequence[float],
    target: float,
    fly: FlyLineages,
    period: float,
    rng: np.random.Generator,
    notify: Callable[[float, float], None] | None = None,
) -> Repetition:
    """Run one repetition from its nearest flights (seed, smallest distance) on; `period` between samples, s."""
    nearest = sorted(range(len(seeds)), key=lambda i: smallest_distances[i])[:START]
    lineages = [Lineage(seeds[i]) for i in nearest]
    start = [LineageFlight(x, falls) for x, falls in zip(lineages, fly(-1, lineages), strict=True)]
    return run_repetition(start, len(seeds), target, fly, BACK / period, rng, size=SIZE, notify=notify)


def _topped_up(flyer: CampaignFlyer, seeds: list[int], least: list[float]) -> tuple[list[int], list[float]]:
    """Seeds and smallest distances of FEWEST flights at least: those that were counted, and more on other seeds."""
    place, identity = CandidateBatch("split-start", 0, 0), flyer.campaign.hash
    flown = {number: values for (_, number), values in flyer.store.flown(place).items()}
    for first in range(0, max(0, FEWEST - len(seeds)), FEWEST // 10):
        part = range(first, min(first + FEWEST // 10, FEWEST - len(seeds)))
        missing = [number for number in part if number not in flown]
        if missing and flyer.is_time_over:
            raise BudgetSpent
        flights = [Flight(0, number, {}, certificate_seed(identity, SPLIT_PURPOSE, number)) for number in missing]
        for landed in flyer.fly(place, flights):
            flown[landed.flight.repeat] = landed.values
    more = [number for number in range(max(0, FEWEST - len(seeds))) if flown.get(number) is not None]
    distances = [float((flown[number] or {})["r_min"]) for number in more]
    return [*seeds, *(certificate_seed(identity, SPLIT_PURPOSE, number) for number in more)], [*least, *distances]


class BudgetSpent(Exception):
    """The time budget ran out before all flights were flown."""


class LineageFlyer:
    """Flies lineages of one repetition, and keeps how their distances fell.

    counted : flights from which splitting starts; with more of them it starts again
    """

    def __init__(self, flyer: CampaignFlyer, repetition: int, threads: int | None, counted: int):
        self.flyer, self.number, self.threads, self.counted = flyer, repetition, threads, counted

    def __call__(self, batch: int, lineages: list[Lineage]) -> list[RecordLows]:
        """How the smallest distance fell in each flight; batch -1 is the start. Raises TimeOver."""
        from airflock.support import run_in_threads

        campaign, store = self.flyer.campaign, self.flyer.store
        place = CandidateBatch(f"split of {self.counted}", self.number, batch + 1)
        flown = {i: values for (i, _), values in store.flown(place).items() if values is not None}
        missing = [i for i in range(len(lineages)) if i not in flown]
        if missing and self.flyer.is_time_over:
            raise BudgetSpent

        def job(lineage: Lineage) -> Callable[[], RecordLows]:
            return lambda: record_falls(campaign.scenario, lineage, campaign.bits, campaign.device)

        alone = 1 if campaign.device != "cpu" else self.threads
        for i, fell in zip(missing, run_in_threads([job(lineages[i]) for i in missing], alone), strict=True):
            values = {"falls": fell, "branches": [list(b) for b in lineages[i].branches]}
            store.land(place, FlightResult(Flight(i, 0, {}, lineages[i].seed), values))
            flown[i] = values
        return [flown[i]["falls"] for i in range(len(lineages))]


def record_falls(scenario: Scenario, lineage: Lineage, precision: int = 32, device: str = "cpu") -> list[list[float]]:
    """Sample and smallest distance of two agents (m), each time that it fell below all before."""
    from airflock.engine import Flight as Open

    flight = Open(
        scenario,
        lineage.seed,
        precision=precision,
        record=True,
        device=device,
        events=lineage_events(scenario, lineage),
    )
    flight.finish()
    nearest = smallest_distances(flight.frames[:, : scenario.dimensions])
    running = np.minimum.accumulate(nearest)
    fell = np.flatnonzero(np.diff(running, prepend=np.inf) < 0.0)
    return [[int(k), float(running[k])] for k in fell]


def lineage_events(scenario: Scenario, lineage: Lineage) -> list[Event]:
    """Return the events that make a flight that of a lineage."""
    every = max(1, round(sample_period(scenario) / scenario.flight.dt))
    return [Event(sample * every, "branch", {"world": world}) for sample, world in lineage.branches]


def smallest_distances(positions: NDArray[Any]) -> NDArray[np.float64]:
    """Smallest distance of two agents (time,), m, from positions (time, axis, agent)."""
    axes = np.ascontiguousarray(positions.transpose(1, 2, 0))  # long rows of time: eight times as fast
    least = np.full(len(positions), np.inf)
    for i in range(axes.shape[1] - 1):
        apart = axes[:, i + 1 :] - axes[:, i : i + 1]
        apart *= apart
        np.minimum(least, apart.sum(axis=0).min(axis=0), out=least)
    nearest: NDArray[np.float64] = np.sqrt(least)
    return nearest


def sample_period(scenario: Scenario) -> float:
    """Time between two samples, s."""
    from airflock.scenarios import step_counts

    return float(step_counts(scenario)["sample_every"] * scenario.flight.dt)


def _refused(target: float, reason: str) -> dict[str, Any]:
    """Return the plain values of a splitting that gives no number."""
    return {"target": target, "refused": reason, "statements": [f"splitting: r_min<{target:g}: no number: {reason}"]}


def _plain_values(campaign: Campaign, result: SplittingEstimate, where: str) -> dict[str, Any]:
    plain: dict[str, Any] = (
        _refused(result.target, result.refused)
        if result.refused
        else {
            "target": result.target, "probability": result.probability, "low": result.low, "high": result.high,
            "per_hour": rate_per_hour(result.probability, campaign.flight_hours), "statements": [],
        }
    )  # fmt: skip
    flights = sum(r.flights for r in result.repetitions)
    plain |= {"flights": flights, "repetitions": [[list(level) for level in r.levels] for r in result.repetitions]}
    if not result.refused:
        plain["statements"] = [
            f"splitting, an estimate that proves nothing: r_min<{result.target:g} in {result.probability:.2g} of "
            f"flights ({result.low:.2g} to {result.high:.2g}), {plain['per_hour']:.2g} per flock hour, "
            f"from {flights:,} flights"
        ]
    last = sorted((p for r in result.repetitions for p in r.last), key=lambda p: p.least)
    nearest: dict[int, LineageFlight] = {}
    for particle in last:
        nearest.setdefault(particle.lineage.seed, particle)
    plain["worst"] = [_worst(campaign.scenario, p, where) for p in list(nearest.values())[:WORST]]
    if plain["worst"] and math.isfinite(plain["worst"][0]["r_min"]):
        plain["statements"].append(f"closest approach that splitting found: {plain['worst'][0]['replay']}")
    return plain


def _worst(scenario: Scenario, particle: LineageFlight, where: str) -> dict[str, Any]:
    done = [event.plain() for event in lineage_events(scenario, particle.lineage)]
    line = f"airflock.open({where!r}, {particle.lineage.seed}, events={done})"
    return {"seed": particle.lineage.seed, "r_min": particle.least, "events": done, "replay": line}
