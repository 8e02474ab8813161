"""Branches: flights of a scenario as lineages, for splitting; and what it found, with a line that flies it again."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.certificates.bounds import per_hour
from airflock.certificates.campaign import Campaign
from airflock.certificates.counting import Count
from airflock.certificates.flyer import Flyer
from airflock.certificates.seeds import COUNT, SPLIT, seed
from airflock.certificates.splitting import Estimate, Falls, Fly, Lineage, Particle, Repetition, estimate, repetition
from airflock.runs.executors import Flight, Landed
from airflock.runs.store import Batch
from airflock.scenarios.events import Event
from airflock.scenarios.scenario import Scenario
from airflock.support.errors import ScenarioError

REPETITIONS = 5
SIZE = 200  # flights of a level
FEWEST = 2000  # flights from which repetitions start, each from its share of them
START = 100  # flights with which a repetition goes on: the nearest ones of its share
BACK = 4.0  # s, mean time before the first crossing from which noise is drawn anew
WORST = 5


def sound_split(campaign: Campaign) -> None:
    """Refuse what cannot be split, before anything flies."""
    faults = []
    if not any(limit.score == "r_min" for limit in campaign.limits):
        faults.append("--split needs a limit on r_min, such as --limit 'r_min<1 at 1e-4/h'")
    if campaign.scenario.world.edges == "periodic":
        faults.append("--split does not follow distances across the edges of a periodic world; leave it out")
    if campaign.uncertain:
        faults.append("--split flies one scenario only; leave out --uncertain")
    if faults:
        raise ScenarioError(faults)


def split(flyer: Flyer, counted: Count, threads: int | None = None, where: str = "") -> dict[str, Any]:
    """Estimate how often r_min falls to the smallest limit, starting from the flights that were counted.

    where : file of the scenario, by which flights are flown again
    Returns plain values: target, statements, probability with its interval or why it is refused, worst flights.
    """
    campaign = flyer.campaign
    target = min(limit.value for limit in campaign.limits if limit.score == "r_min")
    own = [seed(campaign.hash, COUNT, i) for i in range(len(counted.rows))]
    values = [float(row["r_min"]) for row in counted.rows]
    try:
        seeds, least = _topped_up(flyer, own, values)
    except TimeOver:
        return _refused(target, "time ran out before there were enough flights to start from")
    share, runs, period = len(least) // REPETITIONS, [], sample_period(campaign.scenario)
    for number in range(REPETITIONS):
        fly = LineageFlyer(flyer, number, threads, len(counted.rows))
        mine = range(number * share, (number + 1) * share)
        rng = np.random.default_rng([int(campaign.hash[:12], 16), number])

        def say(level: float, p: float, number: int = number) -> None:
            flyer.say(f"splitting {number + 1}/{REPETITIONS}: r_min<{level:.3g} at {p:.2g}")

        try:
            runs.append(begun([seeds[i] for i in mine], [least[i] for i in mine], target, fly, period, rng, say))
        except TimeOver:
            return _refused(target, f"time ran out in repetition {number + 1} of {REPETITIONS}")
    return _plain_values(campaign, estimate(runs, target, least), where or campaign.scenario.name)


def begun(
    seeds: Sequence[int],
    least: Sequence[float],
    target: float,
    fly: Fly,
    period: float,
    rng: np.random.Generator,
    say: Callable[[float, float], None] | None = None,
) -> Repetition:
    """One repetition, from the nearest of its flights (seed, smallest distance) on; `period` between samples, s."""
    nearest = sorted(range(len(seeds)), key=lambda i: least[i])[:START]
    lineages = [Lineage(seeds[i]) for i in nearest]
    start = [Particle(x, falls) for x, falls in zip(lineages, fly(-1, lineages), strict=True)]
    return repetition(start, len(seeds), target, fly, BACK / period, rng, size=SIZE, say=say)


def _topped_up(flyer: Flyer, seeds: list[int], least: list[float]) -> tuple[list[int], list[float]]:
    """Seeds and smallest distances of FEWEST flights at least: those that were counted, and more on other seeds."""
    place, identity = Batch("split-start", 0, 0), flyer.campaign.hash
    flown = {number: values for (_, number), values in flyer.store.flown(place).items()}
    for first in range(0, max(0, FEWEST - len(seeds)), FEWEST // 10):
        part = range(first, min(first + FEWEST // 10, FEWEST - len(seeds)))
        missing = [number for number in part if number not in flown]
        if missing and flyer.time_over:
            raise TimeOver
        flights = [Flight(0, number, {}, seed(identity, SPLIT, number)) for number in missing]
        for landed in flyer.fly(place, flights):
            flown[landed.flight.repeat] = landed.values
    more = [number for number in range(max(0, FEWEST - len(seeds))) if flown.get(number) is not None]
    distances = [float((flown[number] or {})["r_min"]) for number in more]
    return [*seeds, *(seed(identity, SPLIT, number) for number in more)], [*least, *distances]


class TimeOver(Exception):
    """The time budget ran out before all flights were flown."""


class LineageFlyer:
    """Flies lineages of one repetition, and keeps how their distances fell.

    counted : flights from which splitting starts; from more of them it starts anew
    """

    def __init__(self, flyer: Flyer, number: int, threads: int | None, counted: int):
        self.flyer, self.number, self.threads, self.counted = flyer, number, threads, counted

    def __call__(self, batch: int, lineages: list[Lineage]) -> list[Falls]:
        """How the smallest distance fell in each flight; batch -1 is the start. Raises TimeOver."""
        from airflock.support.threads import in_threads

        campaign, store = self.flyer.campaign, self.flyer.store
        place = Batch(f"split of {self.counted}", self.number, batch + 1)
        flown = {i: values for (i, _), values in store.flown(place).items() if values is not None}
        missing = [i for i in range(len(lineages)) if i not in flown]
        if missing and self.flyer.time_over:
            raise TimeOver

        def job(lineage: Lineage) -> Callable[[], Falls]:
            return lambda: falls(campaign.scenario, lineage, campaign.precision, campaign.device)

        alone = 1 if campaign.device != "cpu" else self.threads
        for i, fell in zip(missing, in_threads([job(lineages[i]) for i in missing], alone), strict=True):
            values = {"falls": fell, "branches": [list(b) for b in lineages[i].branches]}
            store.land(place, Landed(Flight(i, 0, {}, lineages[i].seed), values))
            flown[i] = values
        return [flown[i]["falls"] for i in range(len(lineages))]


def falls(scenario: Scenario, lineage: Lineage, precision: int = 32, device: str = "cpu") -> list[list[float]]:
    """Sample and smallest distance of two agents (m), each time that it fell below all before."""
    from airflock.engine import Flight as Open

    flight = Open(
        scenario, lineage.seed, precision=precision, record=True, device=device, events=events(scenario, lineage)
    )
    flight.finish()
    nearest = least_distances(flight.frames[:, : scenario.dimensions])
    running = np.minimum.accumulate(nearest)
    fell = np.flatnonzero(np.diff(running, prepend=np.inf) < 0.0)
    return [[int(k), float(running[k])] for k in fell]


def events(scenario: Scenario, lineage: Lineage) -> list[Event]:
    """What is done to a flight so that it is that of a lineage."""
    every = max(1, round(sample_period(scenario) / scenario.flight.dt))
    return [Event(sample * every, "branch", {"world": world}) for sample, world in lineage.branches]


def least_distances(positions: NDArray[Any]) -> NDArray[np.float64]:
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
    from airflock.scenarios.timing import clock

    return float(clock(scenario)["sample_every"] * scenario.flight.dt)


def _refused(target: float, reason: str) -> dict[str, Any]:
    """What is said of splitting that gives no number."""
    return {"target": target, "refused": reason, "statements": [f"splitting: r_min<{target:g}: no number: {reason}"]}


def _plain_values(campaign: Campaign, result: Estimate, where: str) -> dict[str, Any]:
    plain: dict[str, Any] = (
        _refused(result.target, result.refused)
        if result.refused
        else {
            "target": result.target, "probability": result.probability, "low": result.low, "high": result.high,
            "per_hour": per_hour(result.probability, campaign.hours), "statements": [],
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
    nearest: dict[int, Particle] = {}
    for particle in last:
        nearest.setdefault(particle.lineage.seed, particle)
    plain["worst"] = [_worst(campaign.scenario, p, where) for p in list(nearest.values())[:WORST]]
    if plain["worst"] and math.isfinite(plain["worst"][0]["r_min"]):
        plain["statements"].append(f"closest approach that splitting found: {plain['worst'][0]['replay']}")
    return plain


def _worst(scenario: Scenario, particle: Particle, where: str) -> dict[str, Any]:
    done = [event.plain() for event in events(scenario, particle.lineage)]
    line = f"airflock.open({where!r}, {particle.lineage.seed}, events={done})"
    return {"seed": particle.lineage.seed, "r_min": particle.least, "events": done, "replay": line}
