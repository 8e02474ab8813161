"""Devices: on what flights run. `auto` picks by the size of the work and by what there is, and says what it picked."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from airflock.engine import cpu
from airflock.engine.cpu import DriverResult
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan
from airflock.engine.tables import world_tables
from airflock.scenarios import Scenario, estimated_seconds, estimated_total_seconds
from airflock.support import DeviceError, available_cores, check_device

MOST_TOGETHER = 20_000  # agents whose pairs one block of a GPU can look at in reasonable time
WORTH = 5.0  # s of work on all cores from which a GPU is worth its start
# How much longer a block of a GPU takes for one flock than a core does, and how many flocks a
# multiprocessor flies in the time of one. Measured: one NVIDIA H200 beside a core of its machine,
# 1,000 steps of four presets.
SOLVING, SEEING, IN_TURN, USUAL = 120.0, 4.0, 6.0, 1.0
SIDE_BY_SIDE = 2.5
BY_CELLS = 40.0  # cores that a GPU stands for with one big flock (100,000 boids)


@dataclass(frozen=True)
class DeviceChoice:
    """A device, and why `auto` picked it; the reason is empty where it was named."""

    device: str
    why: str = ""

    @property
    def note(self) -> str:
        """One line for a person, empty if there is nothing to say."""
        return f"device auto: {self.device}, {self.why}" if self.why else ""


def choose_device(device: str, scenarios: Sequence[Scenario], plans: Sequence[Plan]) -> DeviceChoice:
    """Device for these flights: ScenarioError for an unknown name, DeviceError where a named one cannot fly them.

    plans : one per scenario
    """
    check_device(device)
    if device != "cuda" and device != "auto":
        return DeviceChoice(device)
    from airflock.support import require_gpu, unavailable_reason

    largest: dict[Plan, Scenario] = {}
    for scenario, plan in zip(scenarios, plans, strict=True):
        if plan not in largest or scenario.agents > largest[plan].agents:
            largest[plan] = scenario
    faults = [cuda_plan_error(plan, scenario.agents) for plan, scenario in largest.items()]
    if any(scenario.can_land for scenario in scenarios):
        faults.append("drones that land with an empty battery (body.battery) fly on cpu")
    if device == "cuda":
        require_gpu()
        for fault in filter(None, faults):
            raise DeviceError(f"device = cuda: {fault}")
        for fault in filter(None, map(gpu_memory_error, largest.values(), largest)):
            raise DeviceError(f"device = cuda: {fault}; or choose device = cpu")
        return DeviceChoice(device)
    missing = unavailable_reason() or next(filter(None, faults), None)
    if missing is not None:
        return DeviceChoice("cpu", missing)
    seconds = estimated_total_seconds(scenarios) / available_cores()
    if seconds < WORTH:
        return DeviceChoice("cpu", f"about {seconds:.2g} s of work on {available_cores()} cores")
    missing = next(filter(None, map(gpu_memory_error, largest.values(), largest)), None)
    if missing is not None:
        return DeviceChoice("cpu", missing)
    there = seconds_on_gpu(scenarios, plans)
    if there > seconds:
        return DeviceChoice(
            "cpu", f"about {seconds:.2g} s of work on {available_cores()} cores, where the GPU would take {there:.2g} s"
        )
    return DeviceChoice("cuda", f"about {seconds:.2g} s of work on {available_cores()} cores would be left to the CPU")


def seconds_on_gpu(scenarios: Sequence[Scenario], plans: Sequence[Plan]) -> float:
    """Seconds that a GPU takes for these flights, about: one flock as slowly as its law lets it, many side by side."""
    from airflock.support import multiprocessor_count

    kinds = {id(scenario): (scenario, plan) for scenario, plan in zip(scenarios, plans, strict=True)}
    counts = Counter(map(id, scenarios))
    alone = together = longest = 0.0
    for kind, (scenario, plan) in kinds.items():
        if flies_by_cells(scenario, plan, plan.given_start):
            alone += counts[kind] * estimated_seconds(scenario) / BY_CELLS
        else:
            one = _slower(plan) * estimated_seconds(scenario)
            together, longest = together + counts[kind] * one, max(longest, one)
    return alone + max(longest, together / (SIDE_BY_SIDE * multiprocessor_count()))


def _slower(plan: Plan) -> float:
    """How much longer a block of a GPU takes for a flock than a core."""
    if flock_rules(plan):
        return SOLVING  # which one thread does
    return IN_TURN if plan.sequential else SEEING if plan.scene else USUAL


def flies_by_cells(scenario: Scenario, plan: Plan, given_start: bool = False) -> bool:
    """Return True if a GPU flies a flock by cells, step by step, and not as one block; given: from given places."""
    from airflock.engine.cuda.large_flock import cell_plan_error

    return cell_plan_error(plan, scenario.agents) is None and (given_start or not scenario.separation())


def gpu_memory_error(scenario: Scenario, plan: Plan) -> str | None:
    """Why a flock does not fit into the GPU's free memory; None if it does."""
    from airflock.engine.cuda import large_flock as crowd, launch

    if flies_by_cells(scenario, plan, plan.given_start):
        return crowd.memory_error(scenario, plan)
    plan = plan.built(grid=False)
    return launch.memory_error(plan, world_tables(scenario, plan, 0))


def cuda_plan_error(plan: Plan, agents: int) -> str | None:
    """Why a GPU cannot fly a plan with this many agents; None if it can."""
    if agents <= MOST_TOGETHER:
        return None
    from airflock.engine.cuda.large_flock import cell_plan_error

    fault = cell_plan_error(plan, agents)
    return None if fault is None else f"{agents} agents are more than one block flies ({MOST_TOGETHER}), and {fault}"


def fly_one(scenario: Scenario, plan: Plan, seed: int, device: str, start: Any = None) -> DriverResult:
    """Fly one world on a named device; plan: with or without recorded frames."""
    if device == "cuda":
        return fly_on_gpu([scenario], [plan], [seed], None if start is None else [start])[0]
    if device == "python":
        plan = plan.built(grid=False, bits=64)
    return cpu.fly_on_cpu(plan, world_tables(scenario, plan, seed), start, device)


def fly_on_gpu(
    scenarios: Sequence[Scenario],
    plans: Sequence[Plan],
    seeds: Sequence[int],
    starts: Sequence[Any] | None = None,
    on_done: Callable[[], None] | None = None,
) -> list[DriverResult]:
    """Fly worlds on the GPU, flight i with plans[i] and seeds[i]; those of one plan together in one launch."""
    from airflock.engine.cuda.large_flock import fly_large_flock
    from airflock.engine.cuda.launch import fly_many

    groups: dict[Plan, list[int]] = {}
    results: dict[int, DriverResult] = {}
    for number, plan in enumerate(plans):
        if flies_by_cells(scenarios[number], plan, starts is not None):
            start = None if starts is None else starts[number]
            results[number] = fly_large_flock(scenarios[number], plan, seeds[number], start)
            if on_done:
                on_done()
        else:
            groups.setdefault(plan.built(grid=False), []).append(number)
    for plan, members in groups.items():
        jobs = [world_tables(scenarios[m], plan, seeds[m]) for m in members]
        given = None if starts is None else [np.asarray(starts[m]) for m in members]
        results |= zip(members, fly_many(plan, jobs, given, on_done), strict=True)
    return [results[number] for number in range(len(plans))]
