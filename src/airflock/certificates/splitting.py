"""Splitting: the probability of a rare fall of a score, by flights that branch off from those that came near it.

Subset simulation (Au & Beck 2001) over whole flights. A flight is a lineage: a seed, and moments from which on other
random numbers are drawn. Among the flights below a level, Metropolis-Hastings steps draw all noise anew from a moment
before the level was first crossed, and keep what crosses it again; a share of them lies below the next level.

This finds and ranks rare flights. As a number it is an estimate with a known weakness: what happens once in a hundred
flights that start the levels may be what all of the rarest have in common. So repetitions start from different flights,
and where they disagree with counting, or stem from too few of them, no number is given.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from statistics import median

import numpy as np
from scipy.stats import beta, t

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
        """The same flight up to a sample, another one from there on."""
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
    last   : flights below the last level; seen: (level, probability, least values of the flights of that level)
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
    back  : mean number of samples before the first crossing from which noise is drawn anew
    size  : flights of a level
    """
    level = max(particle.least for particle in start)
    p, below = len(start) / counted, list(start)
    made = Repetition([(level, p)], below)
    for number in range(MOST):
        if level <= target or not below:
            break
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
    """One step for each flight. The moment of branching depends on the crossing: the ratio exp(-(new - old) / back)."""
    size = len(flock)
    gaps, chances = rng.exponential(back, size), rng.random(size)
    crossings = [particle.crossing(level) for particle in flock]
    moments = [max(0, math.floor(at - gap)) for at, gap in zip(crossings, gaps, strict=True)]
    asked = [p.lineage.branch(at, 1 + batch * size + i) for i, (p, at) in enumerate(zip(flock, moments, strict=True))]
    found = []
    for i, (lineage, falls) in enumerate(zip(asked, fly(batch, asked), strict=True)):
        new = LineageFlight(lineage, falls)
        taken = new.least <= level and math.log(chances[i]) < -(new.crossing(level) - crossings[i]) / back
        found.append(new if taken else flock[i])
    return found


@dataclass(frozen=True)
class SplittingEstimate:
    """What the repetitions show together.

    probability, low, high : per flight, mean and 95 % t-interval of the logarithms; nan where refused says why
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
        k = sum(value <= level for value in values)
        least = float(beta.ppf(rest, k, n - k + 1)) if k else 0.0
        most = float(beta.ppf(1.0 - rest, k + 1, n - k)) if k < n else 1.0
        mean, low, high = _interval([r.probability(level) for r in repetitions])
        if math.isnan(mean) or high < least or low > most:
            said = "nothing" if math.isnan(mean) else f"{low:.2g} to {high:.2g}"
            return f"disagrees with counting at {level:.3g}: {said} against {least:.2g} to {most:.2g} per flight"
    return ""
