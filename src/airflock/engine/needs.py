"""Needs: how much memory and time a flight takes on this machine, judged before it is compiled and flown.

What grows with the flock is counted: rows of numbers, past states that a delay asks for, a packet of each pair where
the radio keeps them, the grid, and the frames of a recording; and looks at pairs, at what stands in the way, at wings.
"""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from airflock.engine.cuda.memory import most_below
from airflock.engine.passes import grid
from airflock.engine.plan import Plan
from airflock.engine.state import lanes
from airflock.errors import FlightError
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.timing import clock

TIMES = (("days", 86400.0), ("h", 3600.0), ("min", 60.0))
SMALL = 2**28  # bytes that are not worth a look at what is free
SHARE = 0.9  # of the free memory that one flight may take
ROWS = 40  # numbers that a driver keeps of an agent besides its memory; the laws here keep 20 to 60
LONGEST = 30 * 86400.0  # s of a processor that one flight may take; nobody waits longer for one
# s of one core (2 cores of 2025, single precision). Of the shipped presets none takes more than twice what is told, and
# none less than a fifth (benchmarks/RESULTS-trust.md).
PAIR = 7e-10  # for one look at one other agent
STEP = 4e-9  # for one motion step of one agent
SIGHT = 2e-6  # for one look of one agent among a hundred buildings
WING = 2e-6  # for what one wing does to another, while all are solved for
LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container


def check(scenario: Scenario, plan: Plan) -> None:
    """Refuse a flight that memory cannot hold or nobody can wait for; raises FlightError with the number that fits."""
    _check_time(scenario)
    needed = bytes_of(scenario, plan, scenario.agents)
    free = free_memory() if needed > SMALL else None
    if free is None:
        return
    room = int(SHARE * free)
    if needed <= room:
        return
    fit = most_below(scenario.agents, lambda agents: bytes_of(scenario, plan, agents) <= room)
    told = [f"agents = {scenario.agents} needs about {needed / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free"]
    told.append(f"about {fit} agents fit")
    frames = _frames(scenario, plan, scenario.agents)
    if frames > 0 and needed - frames <= room:
        share = (room - needed + frames) / frames
        told.append(f"or a recording of {share * scenario.flight.duration:.3g} s, or samples further apart")
    raise FlightError(f"{scenario.name}: {'; '.join(told)}")


def _check_time(scenario: Scenario) -> None:
    flight, n = scenario.flight, float(scenario.agents)
    if flight.duration / flight.dt * n * (2.0 * n * PAIR + STEP + SIGHT + n * WING) <= LONGEST:
        return  # whatever its rates and its law are
    took = seconds_of(scenario)
    if took <= LONGEST:
        return
    days = LONGEST / 86400.0
    fit = most_below(scenario.agents, lambda agents: seconds_of(_of(scenario, agents)) <= LONGEST)
    told = f"{scenario.name}: a flight takes about {took / 86400.0:.3g} days of a processor, more than {days:g}"
    fits = [f"about {fit} agents fit"] if fit else []
    fits.append(f"{'or ' if fits else ''}a duration of about {flight.duration * LONGEST / took:.3g} s")
    raise FlightError(f"{told}; {'; '.join(fits)}, or a longer dt = {flight.dt:g} s")


def _of(scenario: Scenario, agents: float) -> Scenario:
    """The same with so many agents."""
    return replace(scenario, flight=replace(scenario.flight, agents=float(agents)))


def seconds_of(scenario: Scenario) -> float:
    """Seconds of one core that a flight takes, about, without its compilation; at all cores, cells take a share."""
    times, n, model = clock(scenario), float(scenario.agents), scenario.model
    decisions = times["steps"] / times["decide_every"]
    pairs = min(n, 60.0) if n >= 1000 and model.reach is not None else n
    seconds = (decisions + times["steps"] / times["sample_every"]) * n * pairs * PAIR + times["steps"] * n * STEP
    seconds += decisions * n * SIGHT if model.sight is not None else 0.0
    return seconds + (decisions * n * n * WING if model.flock is not None else 0.0)


def total_seconds(scenarios: Sequence[Scenario]) -> float:
    """Seconds of one core that flights take, about; the same scenario may stand there very often."""
    kinds = {id(scenario): scenario for scenario in scenarios}
    return sum(count * seconds_of(kinds[kind]) for kind, count in Counter(map(id, scenarios)).items())


def time_note(scenarios: Sequence[Scenario], threads: int) -> str:
    """How long these flights take side by side, about, where that is more than a minute; empty if it is not."""
    seconds = total_seconds(scenarios) / max(1, min(threads, len(scenarios)))
    if seconds < 60.0:
        return ""
    unit, size = next((unit, size) for unit, size in TIMES if seconds >= size)
    count = f"{len(scenarios)} flights" if len(scenarios) > 1 else "the flight"
    return f"{count} will take about {seconds / size:.2g} {unit}"


def bytes_of(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes that a flight of so many agents takes, about."""
    times, real, width, states = clock(scenario), plan.bits // 8, lanes(agents), 2 * plan.dimensions
    kept = max(len(getattr(memory, "_fields", ())) for memory in plan.memories)
    kept += sum(len(getattr(metric.Memory, "_fields", ())) for metric in plan.metrics)
    past = times["ring"] * states if plan.noisy or plan.delayed else 0
    numbers = (ROWS + kept + past) * width + (agents * len(plan.of_pair) * width if plan.packets else 0)
    cells = 8 * grid.CHUNKS * (grid.CELLS * agents + grid.SPARE) if plan.grid else 0
    return real * numbers + cells + _frames(scenario, plan, agents)


def _frames(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes of the frames of a recording, as they are flown and as they are handed over."""
    if not plan.record:
        return 0
    times = clock(scenario)
    return 2 * (times["steps"] // times["sample_every"] + 1) * 3 * plan.dimensions * agents * plan.bits // 8


def free_memory() -> int | None:
    """Bytes that this process may still take: of the machine, or of its container if that is less; None if unknown."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024 * int(line.split()[1]))
    except (OSError, ValueError):
        names = os.sysconf_names if hasattr(os, "sysconf_names") else {}
        if {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(names):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for limit in map(Path, LIMITS):
        try:
            found.append(int(limit.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no container, or one without a limit
            continue
    return min(found, default=None)
