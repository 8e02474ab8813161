"""Requirements: how much memory and time a flight takes on this machine, judged before it is compiled and flown.

What grows with the flock is counted: rows of numbers, past states that a delay asks for, a packet of each pair where
the radio keeps them, the grid, and the frames of a recording; and looks at pairs, at what stands in the way, at wings.
"""

from airflock.engine.layout import lane_count
from airflock.engine.plan import Plan
from airflock.engine.stages.cells import CHUNKS, MAX_CELLS_PER_AGENT, SPARE
from airflock.scenarios import Scenario, cost, largest_fitting, step_counts
from airflock.support import FlightError, free_memory

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
    told = [f"agents = {scenario.agents} needs about {needed / 1e9:.3g} GB of memory and {free / 1e9:.3g} GB are free"]
    told.append(f"about {fit} agents fit")
    frames = _frames(scenario, plan, scenario.agents)
    if frames > 0 and needed - frames <= room:
        share = (room - needed + frames) / frames
        told.append(f"or a recording of {share * scenario.flight.duration:.3g} s, or samples further apart")
    raise FlightError(f"{scenario.name}: {'; '.join(told)}")


def estimated_bytes(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes that a flight of so many agents takes, about."""
    times, real, width = step_counts(scenario), plan.bits // 8, lane_count(agents)
    kept = max(len(getattr(memory, "_fields", ())) for memory in plan.memories)
    kept += sum(len(getattr(metric.Memory, "_fields", ())) for metric in plan.metrics)
    past = times["ring"] * plan.in_ring if plan.late else 0
    numbers = (ROWS + kept + past) * width + (agents * len(plan.of_pair) * width if plan.packets else 0)
    cells = 8 * CHUNKS * (MAX_CELLS_PER_AGENT * agents + SPARE) if plan.grid else 0
    return real * numbers + cells + _frames(scenario, plan, agents)


def _frames(scenario: Scenario, plan: Plan, agents: int) -> int:
    """Bytes of the frames of a recording, as they are flown and as they are handed over."""
    if not plan.record:
        return 0
    times = step_counts(scenario)
    return 2 * (times["steps"] // times["sample_every"] + 1) * 3 * plan.dimensions * agents * plan.bits // 8
