"""Closed flights: scenarios in, recordings or order parameters out, on all devices; and the errors of such flights."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import cpu
from airflock.engine.cpu import DriverResult
from airflock.engine.driver_state import DriverState
from airflock.engine.drivers import flight_driver, flight_text, is_loaded
from airflock.engine.layout import lane_count
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan, plan_of
from airflock.engine.stages.cells import CHUNKS, MAX_CELLS_PER_AGENT, SPARE
from airflock.engine.tables import world_tables
from airflock.scenarios import (
    Scenario,
    check_seed,
    cost,
    estimated_seconds,
    estimated_total_seconds,
    largest_fitting,
    start_error,
    step_counts,
    uses_all_cores,
    wrap_start,
)
from airflock.support import DeviceError, FlightError, available_cores, check_device, free_memory, run_in_threads

MOST_TOGETHER = 20_000  # agents whose pairs one block of a GPU can look at in reasonable time
WORTH = 5.0  # s of work on all cores from which a GPU is worth its start
# How much longer a block of a GPU takes for one flock than a core does, and how many flocks a
# multiprocessor flies in the time of one. Measured: one NVIDIA H200 beside a core of its machine,
# 1,000 steps of four presets.
SOLVING, SEEING, IN_TURN, USUAL = 120.0, 4.0, 6.0, 1.0
SIDE_BY_SIDE = 2.5
BY_CELLS = 40.0  # cores that a GPU stands for with one big flock (100,000 boids)


def choose_device(device: str, scenarios: Sequence[Scenario], plans: Sequence[Plan]) -> tuple[str, str]:
    """Choose a device for these flights; return it and why `auto` picked it, empty where it was named.

    plans : one per scenario
    Raises ScenarioError for an unknown name, DeviceError where a named device cannot fly them.
    """
    check_device(device)
    if device != "cuda" and device != "auto":
        return device, ""
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
        return device, ""
    missing = unavailable_reason() or next(filter(None, faults), None)
    if missing is not None:
        return "cpu", missing
    seconds = estimated_total_seconds(scenarios) / available_cores()
    if seconds < WORTH:
        return "cpu", f"about {seconds:.2g} s of work on {available_cores()} cores"
    missing = next(filter(None, map(gpu_memory_error, largest.values(), largest)), None)
    if missing is not None:
        return "cpu", missing
    there = seconds_on_gpu(scenarios, plans)
    if there > seconds:
        why = f"about {seconds:.2g} s of work on {available_cores()} cores, where the GPU would take {there:.2g} s"
        return "cpu", why
    return "cuda", f"about {seconds:.2g} s of work on {available_cores()} cores would be left to the CPU"


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


# Memory and time that a flight needs, judged before it is compiled. What grows with the flock is
# counted: rows, past states that a delay needs, a packet of each pair where the radio keeps them,
# the grid and the frames of a recording.

MOST_OBSERVED = 32  # neighbours, and rays around: each is written out in the driver
SMALL = 2**28  # bytes that are not worth a look at what is free
SHARE = 0.9  # of the free memory that one flight may take
ROWS = 40  # numbers that a driver keeps of an agent besides its memory; the laws here keep 20 to 60


def check_resources(scenario: Scenario, plan: Plan) -> None:
    """Refuse a flight that memory cannot hold or nobody can wait for; raises FlightError with the number that fits."""
    key = "needs", plan
    if key not in scenario.engine_cache:
        cost.check_run_time(scenario)
        scenario.engine_cache[key] = estimated_bytes(scenario, plan, scenario.agents)
    needed: int = scenario.engine_cache[key]
    free = free_memory() if needed > SMALL else None
    if free is None:
        return
    room = int(SHARE * free)
    if needed <= room:
        return
    fit = largest_fitting(scenario.agents, lambda agents: estimated_bytes(scenario, plan, agents) <= room)
    parts = [f"agents = {scenario.agents} needs about {needed / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free"]
    parts.append(f"about {fit} agents fit")
    frames = _frames(scenario, plan, scenario.agents)
    if frames > 0 and needed - frames <= room:
        share = (room - needed + frames) / frames
        parts.append(f"or a recording of {share * scenario.flight.duration:.3g} s, or samples further apart")
    raise FlightError(f"{scenario.name}: {'; '.join(parts)}")


def estimated_bytes(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes that a flight of so many agents takes, about."""
    times, real, width = step_counts(scenario), plan.bits // 8, lane_count(agents)
    kept = max(len(getattr(memory, "_fields", ())) for memory in plan.memories)
    kept += sum(len(getattr(metric.Memory, "_fields", ())) for metric in plan.metrics)
    past = times["ring"] * plan.in_ring if plan.remembers else 0
    numbers = (ROWS + kept + past) * width + (agents * len(plan.of_pair) * width if plan.packets else 0)
    cells = 8 * CHUNKS * (MAX_CELLS_PER_AGENT * agents + SPARE) if plan.grid else 0
    return real * numbers + cells + _frames(scenario, plan, agents)


def _frames(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes of the frames of a recording, as they are flown and as they are handed over."""
    if not plan.record:
        return 0
    times = step_counts(scenario)
    return 2 * (times["steps"] // times["sample_every"] + 1) * 3 * plan.dimensions * agents * plan.bits // 8


def no_place_message(scenario: Scenario, seed: int, agent: int) -> str:
    """One line for an agent that found no place at the start."""
    walls = scenario.start.wall_clearance
    keys = ["start.separation", *(["start.wall_clearance"] if walls else [])]
    room = f"{keys[0]} = {scenario.separation():g} m" + (f" and {keys[1]} = {walls:g} m" if walls else "")
    return (
        f"{scenario.name}: seed {seed}: agent {agent} of {scenario.agents} found no place at {room}; "
        f"enlarge the arena or lower {' or '.join(keys)}"
    )


def not_finite_message(scenario: Scenario, seed: int, agent: int, step: int) -> str:
    """One line for an agent whose state stopped being finite at a step."""
    return (
        f"{scenario.name}: seed {seed}: agent {agent} left the finite numbers at step {step} "
        f"(t = {step * scenario.flight.dt:g} s)"
    )


def first_bad_step(state: DriverState, low: int, high: int, half: int = 0) -> int:
    """First step after which a state is not finite, by halves.

    state : of a flight that is about to fly the step `low`, is finite there, and is not before the
            step `high`
    half  : as in `State.advance`, for the step `low`
    """
    # Kernels never raise: a test per step would end vector loops. Flights are deterministic, so the
    # step is found afterwards by flying again by halves.
    while high - low > 1:
        middle, kept = (low + high) // 2, state.buffer.copy()
        state.advance(low, middle, half)
        if state.is_finite:
            low, half = middle, 0
        else:
            high = middle
            state.buffer[:] = kept
    return high


def driver_text(scenario: Scenario, *, precision: int = 32) -> str:
    """Text of the driver that flies a scenario: all rules are inside, so equal texts are equal physics."""
    return flight_text(plan_of(scenario, precision=precision))


def fly_world(
    scenario: Scenario,
    seed: int = 0,
    *,
    precision: int = 32,
    record: bool = False,
    start: Any = None,
    device: str = "cpu",
) -> cpu.DriverResult:
    """Fly one world. Raises FlightError where agents find no room or a state stops being finite.

    device : cpu, cuda, python (no compiler, double precision), or auto
    """
    seed = check_seed(seed)
    scenario = scenario.with_drawn_scene(seed)
    plan = plan_of(scenario, precision=precision, record=record)
    if start is not None:
        plan = plan.built(given_start=True)
        start = check_start(scenario, plan, start)
    chosen = choose_device(device, [scenario], [plan])[0]
    if chosen != "cuda":
        check_resources(scenario, plan)
    flown = fly_one(scenario, plan, seed, chosen, start)
    return check_result(scenario, seed, flown, chosen, precision, start)


def pick_device(
    scenarios: Sequence[Scenario],
    device: str = "auto",
    *,
    precision: int = 32,
    record: bool = False,
    notify: Callable[[str], None] | None = None,
) -> str:
    """Device on which these flights run: the one that is named if it can fly them, else what `auto` picks."""
    if device == "cpu":
        return device
    plans = [plan_of(scenario, precision=precision, record=record) for scenario in scenarios]
    chosen, why = choose_device(device, scenarios, plans)
    if notify is not None and why:
        notify(f"device auto: {chosen}, {why}")
    return chosen


def check_result(
    scenario: Scenario, seed: int, result: cpu.DriverResult, device: str = "cpu", precision: int = 32, start: Any = None
) -> cpu.DriverResult:
    """A flight that went well; raises FlightError for any other."""
    if result.status < 0:
        raise FlightError(no_place_message(scenario, seed, -result.status - 1))
    bad = _first_bad(result)
    if bad is not None:
        raise FlightError(
            not_finite_message(scenario, seed, bad, _first_bad_step(scenario, seed, precision, start, device))
        )
    return result


def _first_bad(flown: cpu.DriverResult) -> int | None:
    """First agent whose state is not finite."""
    bad = np.flatnonzero(~np.isfinite(flown.state).all(axis=0) & flown.present)
    return int(bad[0]) if bad.size else None


def _first_bad_step(scenario: Scenario, seed: int, precision: int, start: Any, device: str) -> int:
    """First step after which a state is not finite: flights are deterministic, so another one finds it by halves."""
    last = step_counts(scenario)["steps"]
    if device != "cuda":
        return first_bad_step(open_state(scenario, seed, precision, False, start, device=device), 0, last)
    plan = plan_of(scenario, precision=precision).built(given_start=start is not None)

    def bad(steps: int) -> bool:
        shorter = replace(scenario, flight=replace(scenario.flight, duration=steps * scenario.flight.dt))
        return _first_bad(fly_one(shorter, plan, seed, device, start)) is not None

    return bisect_left(range(1, last), True, key=bad) + 1


def open_state(
    scenario: Scenario,
    seed: int,
    precision: int = 32,
    record: bool = False,
    start: Any = None,
    world: int = 0,
    *,
    given_start: bool = False,
    absence: bool = False,
    device: str = "cpu",
    observe: tuple[int, int] = (0, 0),
) -> DriverState:
    """State of a flight before its first step.

    start       : as in `fly_world`; given_start : whether agents have been given their places
                  already, so that none are drawn
    absence     : as in `plan_of`
    device      : cpu, or python, in double precision and with all pairs
    observe     : as in `Plan`
    Raises FlightError where `start` cannot be flown.
    """
    given_start = given_start or start is not None
    plan = flight_plan(
        scenario, precision, record, given_start=given_start, absence=absence, device=device, observe=observe
    )
    given = None if start is None else check_start(scenario, plan, start)
    return DriverState.of(plan, scenario, seed, world, given, device)


def flight_plan(
    scenario: Scenario, precision: int, record: bool, *, given_start: bool, absence: bool, device: str,
    observe: tuple[int, int] = (0, 0),
) -> Plan:  # fmt: skip
    """The plan that `open_state` flies by, before any text is made. Raises FlightError where memory cannot hold it."""
    plan = plan_of(scenario, precision=precision, record=record, absence=absence)
    plan = plan.built(grid=False, bits=64) if device == "python" else plan
    if any(observe):  # observers go through all pairs
        plan = check_observable(scenario, plan.built(grid=False, observe=observe))
    check_resources(scenario, plan)
    return plan.built(given_start=given_start)


def check_observable(scenario: Scenario, plan: Plan) -> Plan:
    """Return a plan whose agents can observe what it says. Raises FlightError, one line, where they cannot."""
    count, rays = plan.observe
    if plan.sequential:
        raise FlightError(f"{scenario.name}: with update = 'sequential' agents move before all have observed")
    for name, value, most, why in (
        ("neighbours", count, min(scenario.agents - 1, MOST_OBSERVED), f"of {scenario.agents} agents"),
        ("rays", rays, MOST_OBSERVED * plan.bounded, "" if plan.bounded else "nothing stands in this world"),
    ):
        if not (isinstance(value, Integral) and 0 <= value <= most):
            raise FlightError(f"{scenario.name}: {name} = {value!r}: give 0 to {most}{why and f'; {why}'}")
    return plan


def check_start(scenario: Scenario, plan: Plan, start: Any) -> NDArray[Any]:
    """Positions and velocities to start from, as a driver reads them: (component, agent), m and m/s; in a periodic box.

    Raises FlightError, one line, where their shape, their kind or their values are wrong.
    """
    names = plan.motion
    shape, said = (len(names), scenario.agents), f"{scenario.name}: start: "
    try:
        given = np.asarray(start, np.float32 if plan.bits == 32 else np.float64)
    except (TypeError, ValueError) as fault:
        raise FlightError(f"{said}not an array of numbers: {fault}") from fault
    if given.shape != shape:
        wanted = f"{shape}, the rows {', '.join(names)} of {scenario.agents} agents in m and m/s"
        raise FlightError(f"{said}its shape is {given.shape}; give {wanted}")
    bad = np.argwhere(~np.isfinite(given))
    if len(bad):
        row, agent = bad[0]
        raise FlightError(f"{said}{names[row]} of agent {agent} is {given[row, agent]}, not a finite number")
    outside = start_error(scenario, given)
    if outside:
        raise FlightError(f"{scenario.name}: {outside}")
    return wrap_start(scenario, given)


def score_flight(scenario: Scenario, seed: int = 0, *, precision: int = 32) -> dict[str, float]:
    """Order parameters and fitness of one flight, from running sums: no trajectory is kept."""
    return scenario.judged(fly_world(scenario, seed, precision=precision).values)


def compile_for(scenario: Scenario, *, precision: int = 32) -> None:
    """Compile what flies a scenario, if that has not been done; scenarios that differ by numbers share it."""
    if not is_loaded(flight_driver(plan_of(scenario, precision=precision))):
        open_state(scenario, 0, precision).compile()


def score_flights(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    *,
    threads: int | None = None,
    precision: int = 32,
    on_done: Callable[[], None] | None = None,
    device: str = "cpu",
) -> list[dict[str, float]]:
    """Order parameters of many flights, flight i with seeds[i]; side by side on all cores, or together on a GPU.

    device : cpu, cuda, python (no compiler, double precision), or auto
    """
    seeds = [check_seed(seed) for seed in seeds]
    if device != "cpu":
        plans = [plan_of(scenario, precision=precision) for scenario in scenarios]
        device = choose_device(device, scenarios, plans)[0]
        if device == "cuda":
            flown = fly_on_gpu(scenarios, plans, seeds, None, on_done)
            together = zip(scenarios, seeds, flown, strict=True)
            return [s.judged(check_result(s, seed, f, device, precision).values) for s, seed, f in together]
    if device == "python":
        precision, threads = 64, 1
    else:
        for scenario in {plan_of(scenario, precision=precision): scenario for scenario in scenarios}.values():
            compile_for(scenario, precision=precision)  # once, before threads ask for it
        if any(uses_all_cores(scenario) for scenario in scenarios):
            threads = 1  # each flight takes all cores by itself

    def job(scenario: Scenario, seed: int) -> Callable[[], dict[str, float]]:
        return lambda: scenario.judged(fly_world(scenario, seed, precision=precision, device=device).values)

    return list(run_in_threads([job(*pair) for pair in zip(scenarios, seeds, strict=True)], threads, on_done))
