"""Simulate: scenarios in, recordings or order parameters out. The only public door of the engine."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from airflock.core.contract import Metric, Model
from airflock.core.parameters import choices
from airflock.engine import cpu
from airflock.engine.plan import Plan, make_plan
from airflock.engine.probe import probe
from airflock.engine.tables import clock, tables
from airflock.errors import FlightError, ScenarioError
from airflock.metrics.fitness_vasarhelyi import fitness
from airflock.metrics.registry import SETS
from airflock.scenarios.geometry import half_sizes
from airflock.scenarios.scenario import Scenario


def plan_of(
    scenario: Scenario,
    *,
    precision: int = 32,
    record: bool = False,
    metrics: tuple[Metric, ...] | None = None,
    grid: bool | None = None,
) -> Plan:
    """Plan of a scenario's flight; its metrics are those that metrics.kind names, unless given.

    grid : neighbours by cells or all pairs; by default what is faster, and all pairs in a box too small for cells
    """
    if precision not in (32, 64):
        raise ScenarioError([f"precision = {precision} is neither 32 nor 64"])
    _probed(scenario.model, tuple(choices(scenario.parameters).items()))
    wind = scenario.wind
    return make_plan(
        scenario.model,
        scenario.parameters,
        SETS[scenario.metrics.kind] if metrics is None else metrics,
        scenario.world,
        grid=(_pays(scenario) if grid is None else grid) and _has_room(scenario),
        body=scenario.vehicle,
        body_choices=tuple(sorted(choices(scenario.body).items())),
        start=scenario.start.kind,
        scene=bool(len(scenario.stands().shapes)),
        goals=scenario.goals.kind != "none",
        sequential=scenario.flight.update == "sequential",
        bits=precision,
        noisy=scenario.sensors.noise > 0.0,
        delayed=clock(scenario)["delay"] > 0,
        lossy=scenario.radio.loss > 0.0,
        links=scenario.radio.kind == "links",
        windy=any((wind.east, wind.north, wind.up, wind.gust)),
        record=record,
    )


@lru_cache
def _probed(model: Model, chosen: tuple[tuple[str, str], ...]) -> None:
    """Probe a model once per set of choices; its numbers decide nothing about the rules' text."""
    probe(model, model.Parameters(**dict(chosen)))


def fly(
    scenario: Scenario, seed: int = 0, *, precision: int = 32, record: bool = False, start: Any = None
) -> cpu.Flown:
    """Fly one world. Raises FlightError where agents find no room or a state stops being finite."""
    plan = plan_of(scenario, precision=precision, record=record)
    if start is not None:
        plan = replace(plan, given_start=True)
    flown = cpu.fly(plan, tables(scenario, plan, seed), start)
    if flown.status < 0:
        raise FlightError(
            f"{scenario.name}: seed {seed}: agent {-flown.status - 1} of {scenario.agents} found no place at "
            f"start.separation = {scenario.separation():g} m; enlarge the arena or lower start.separation"
        )
    bad = _first_bad(flown)
    if bad is not None:
        step = _first_bad_step(scenario, seed, precision, start)
        raise FlightError(
            f"{scenario.name}: seed {seed}: agent {bad} left the finite numbers at step {step} "
            f"(t = {step * scenario.flight.dt:g} s)"
        )
    return flown


def _first_bad(flown: cpu.Flown) -> int | None:
    """First agent whose state is not finite."""
    import numpy as np

    bad = np.flatnonzero(~np.isfinite(flown.state).all(axis=0))
    return int(bad[0]) if bad.size else None


def _first_bad_step(scenario: Scenario, seed: int, precision: int, start: Any) -> int:
    """First step after which a state is not finite: flights are deterministic, so shorter ones find it by halves."""
    low, high = 0, clock(scenario)["steps"]
    plan = plan_of(scenario, precision=precision)
    plan = replace(plan, given_start=start is not None)
    while high - low > 1:
        middle = (low + high) // 2
        shorter = replace(scenario, flight=replace(scenario.flight, duration=middle * scenario.flight.dt))
        if _first_bad(cpu.fly(plan, tables(shorter, plan, seed), start)) is None:
            low = middle
        else:
            high = middle
    return high


def score_flight(scenario: Scenario, seed: int = 0, *, precision: int = 32) -> dict[str, float]:
    """Order parameters and fitness of one flight, from running sums: no trajectory is kept."""
    return finish(scenario, fly(scenario, seed, precision=precision).values)


def finish(scenario: Scenario, values: dict[str, float]) -> dict[str, float]:
    """Order parameters, with partial fitnesses and fitness where the metrics are those that they are made of."""
    if scenario.metrics.kind != "vasarhelyi":
        return values
    return {**values, **fitness(values, scenario.agents, scenario.measured_by())}


def score_flights(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    *,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
) -> list[dict[str, float]]:
    """Order parameters of many flights, flight i with seeds[i]; side by side on all cores."""
    for plan in {plan_of(scenario, precision=precision) for scenario in scenarios}:
        cpu.flight_driver(plan)  # compiled once, before threads ask for it

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        return lambda: score_flight(scenario, seed, precision=precision)

    jobs = [job(scenario, seed) for scenario, seed in zip(scenarios, seeds, strict=True)]
    if any(_pays(scenario) for scenario in scenarios):
        threads = 1  # each flight takes all cores by itself
    return list(cpu.in_threads(jobs, threads, done))


GRID_FROM = 1000  # agents; below, all pairs on one core are as fast, and flights side by side use the cores


def _pays(scenario: Scenario) -> bool:
    """Whether neighbours are found by cells: many agents, a model of finite reach, perception as things are."""
    perfect = scenario.sensors.noise == 0.0 and clock(scenario)["delay"] == 0 and scenario.radio.loss == 0.0
    return (
        scenario.agents >= GRID_FROM
        and scenario.model.reach is not None
        and scenario.model.neighbour is not None
        and perfect
        and scenario.radio.kind == "constant"
        and scenario.flight.update == "synchronous"
        and _has_room(scenario)
    )


def _has_room(scenario: Scenario) -> bool:
    """Whether a periodic box is two reaches wide, so that a neighbour is in reach at one image only."""
    if scenario.world.edges != "periodic" or scenario.model.reach is None:
        return True
    halves = half_sizes(scenario.world)[: scenario.dimensions]
    return min(halves) >= float(scenario.model.reach(scenario.parameters))
