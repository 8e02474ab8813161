"""Branches: flights of a scenario as lineages, for splitting; and what it found, with a line that flies it again."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.certificates.bounds import rate_per_hour
from airflock.certificates.campaign import Campaign
from airflock.certificates.counting import CountResult
from airflock.certificates.flyer import CampaignFlyer
from airflock.certificates.seeds import COUNT_PURPOSE, SPLIT_PURPOSE, certificate_seed
from airflock.certificates.splitting import (
    FlyLineages,
    Lineage,
    LineageFlight,
    RecordLows,
    Repetition,
    SplittingEstimate,
    estimate_probability,
    run_repetition,
)
from airflock.runs import CandidateBatch, Flight, FlightResult
from airflock.scenarios import Event, Scenario
from airflock.support import ScenarioError

REPETITIONS = 5
SIZE = 200  # flights of a level
FEWEST = 2000  # flights from which repetitions start, each from its share of them
START = 100  # flights with which a repetition goes on: the nearest ones of its share
BACK = 4.0  # s, mean time before the first crossing from which noise is drawn anew
WORST = 5


def check_split(campaign: Campaign) -> None:
    """Refuse what cannot be split, before anything flies."""
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

    where : file of the scenario, by which flights are flown again
    Returns plain values: target, statements, probability with its interval or why it is refused, worst flights.
    """
    campaign = flyer.campaign
    target = min(limit.value for limit in campaign.limits if limit.score == "r_min")
    own = [certificate_seed(campaign.hash, COUNT_PURPOSE, i) for i in range(len(counted_rows.rows))]
    values = [float(row["r_min"]) for row in counted_rows.rows]
    try:
        seeds, least = _topped_up(flyer, own, values)
    except BudgetSpent:
        return _refused(target, "time ran out before there were enough flights to start from")
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
    """One repetition, from the nearest of its flights (seed, smallest distance) on; `period` between samples, s."""
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

    counted : flights from which splitting starts; from more of them it starts anew
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
    """What is done to a flight so that it is that of a lineage."""
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
    """What is said of splitting that gives no number."""
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
