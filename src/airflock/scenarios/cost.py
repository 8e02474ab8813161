"""The cost of a flight: its steps, its use of cells, and its run time, estimated before a compilation."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from airflock.core import fields_read
from airflock.scenarios.groups import FlownLaw
from airflock.scenarios.scenario import Scenario
from airflock.support import FlightError
from airflock.world import half_sizes


def step_counts(scenario: Scenario) -> dict[str, int]:
    """Return all times of a scenario in motion steps."""
    dt, q = scenario.flight.dt, scenario.resolved_metrics()
    decide_every = max(1, round(scenario.sensors.period / dt))
    delay, lag = round(scenario.radio.delay / dt), round(scenario.body.delay / dt)
    return {
        "steps": round(scenario.flight.duration / dt),
        "decide_every": decide_every,
        "sample_every": max(1, round(q.period / dt)),
        "collide_every": round((q.collision_period or dt) / dt),
        "delay": delay,
        "ring": max(delay, lag) // decide_every + 2,
        "lag": lag,
    }


# Neighbours are found in cells as wide as the reach of a law.

GRID_FROM = 1000  # agents; below, all pairs on one core are as fast, and flights side by side use the cores
# Agents from which order parameters look at pairs by cells: below, all pairs in vectors are as
# fast. A pair costs four times as much where its offset goes to the nearest image. Measured: one
# sample of `zapotecatl` on one thread, of 1,000 to 8,000 agents.
NEAR_FROM, NEAR_FROM_IN_A_BOX = 6000, 2000


def uses_all_cores(scenario: Scenario) -> bool:
    """Return True if one flight uses all cores, so that several side by side gain nothing.

    Its neighbours are found by cells: many agents, laws of finite reach, exact perception.
    """
    # Cells hold true states: errors, delays and losses belong to a pair and would need a memory for
    # each.
    perfect = not scenario.has_sensor_error and step_counts(scenario)["delay"] == 0 and scenario.radio.loss == 0.0
    return (
        scenario.agents >= GRID_FROM
        and perfect
        and uses_cells(scenario)
        and not scenario.radio.rule.keeps_packets
        and scenario.silence.rule == "fly_on"
        and scenario.flight.update == "synchronous"
        and not any({"sense", "tell", "radio", "clock"} & set(kind.rules) for kind in scenario.fault_kinds)
        and box_fits_cells(scenario)
    )


def cell_notes(scenario: Scenario) -> list[str]:
    """Note laws of groups that alone keep a large flock from being flown by cells."""
    if not scenario.groups or uses_all_cores(scenario) or not uses_all_cores(replace(scenario, groups=())):
        return []
    if not uses_cells(scenario):
        endless = next(law.model.name for law in scenario.laws if not _within_reach(law))
        why = f"{endless} sees without limit (it has no reach)"
    else:
        drawn = any(_widest_reach(scenario, law) == math.inf for law in scenario.laws)
        why = "their reach is drawn, in a periodic box" if drawn else "the box is less than two of their reaches wide"
    return [
        f"groups: {why}, so each of {scenario.agents} agents looks at all others, on one core, instead of at those "
        "in the cells around it, on all cores"
    ]


def uses_cells(scenario: Scenario) -> bool:
    """Return True if cells as wide as a law's reach contain every agent that an agent may meet."""
    if not any(law.model.neighbour for law in scenario.laws) or not all(map(_within_reach, scenario.laws)):
        return False
    kind = scenario.topology.rule
    walls = scenario.scene.kind != "none" or bool(scenario.world.obstacles)
    return kind is None or (kind.near and not (walls and kind.asks_for("hidden")))


def _within_reach(law: FlownLaw) -> bool:
    """Return True if a law reads no neighbour beyond a reach that it declares."""
    return law.model.neighbour is None or law.model.reach is not None


def box_fits_cells(scenario: Scenario) -> bool:
    """Return True if a periodic box is two reaches wide, so that only one image is in reach."""
    if scenario.world.edges != "periodic":
        return True
    halves = half_sizes(scenario.world)[: scenario.dimensions]
    return min(halves) >= max(_widest_reach(scenario, law) for law in scenario.laws)


def _widest_reach(scenario: Scenario, law: FlownLaw) -> float:
    """Return the widest reach of the agents that fly by a law, m; inf where it is drawn."""
    if law.model.reach is None or law.model.neighbour is None:
        return 0.0
    read = fields_read(law.model.reach, "p")
    reaches = [float(law.model.reach(law.parameters))]
    for group in scenario.groups:
        # Groups that fly by another law do not widen this one's cells; all agents of a group fly by one.
        if group.agents and group.agents[0] in law.agents:
            if any(letter == "p" and (read is None or name in read) for letter, name in group.spread):
                return math.inf
            own = {name: value for (letter, name), value in group.numbers.items() if letter == "p"}
            reaches.append(float(law.model.reach(replace(law.parameters, **own))))
    return max(reaches)


def metrics_use_cells(scenario: Scenario) -> bool:
    """Return True if order parameters look at pairs by cells, too."""
    periodic = scenario.world.edges == "periodic"
    return bool(scenario.agents >= (NEAR_FROM_IN_A_BOX if periodic else NEAR_FROM))


TIMES = (("days", 86400.0), ("h", 3600.0), ("min", 60.0))
# Counted and not timed, as an answer is needed before anything is compiled. Shipped presets took
# 0.2 to 1.6 times the estimate, so 30 days refuse nothing that anybody waits for.
LONGEST = 30 * 86400.0  # s of a processor that one flight may take; nobody waits longer for one
# s of one core (2 cores of 2025, single precision). Measured: flights of 31 presets take 0.20 to
# 1.62 of the estimate.
PAIR = 7e-10  # for one look at one other agent
STEP = 4e-9  # for one motion step of one agent
SIGHT = 2e-6  # for one look of one agent among a hundred buildings
WING = 2e-6  # for what one wing does to another, while all are solved for


def check_run_time(scenario: Scenario) -> None:
    """Refuse a flight that takes too long; raises FlightError with the size that fits."""
    flight, n = scenario.flight, float(scenario.agents)
    if flight.duration / flight.dt * n * (2.0 * n * PAIR + STEP + SIGHT + n * WING) <= LONGEST:
        return  # whatever its rates and its law are
    # Slow rates of decision and cells make a flight cheaper, but take longer to find out.
    took = estimated_seconds(scenario)
    if took <= LONGEST:
        return
    days = LONGEST / 86400.0

    def fits_with(agents: int) -> bool:
        return estimated_seconds(replace(scenario, flight=replace(flight, agents=float(agents)))) <= LONGEST

    fit = largest_fitting(scenario.agents, fits_with)
    message = f"{scenario.name}: a flight takes about {took / 86400.0:.3g} days of a processor, more than {days:g}"
    fits = [f"about {fit} agents fit"] if fit else []
    fits.append(f"{'or ' if fits else ''}a duration of about {flight.duration * LONGEST / took:.3g} s")
    raise FlightError(f"{message}; {'; '.join(fits)}, or a longer dt = {flight.dt:g} s")


def estimated_seconds(scenario: Scenario) -> float:
    """Estimate the seconds of one core that a flight takes, without its compilation."""
    times, n, model = step_counts(scenario), float(scenario.agents), scenario.model
    decisions = times["steps"] / times["decide_every"]
    # By cells an agent looks at about sixty others, however large the flock is.
    pairs = min(n, 60.0) if uses_all_cores(scenario) else n
    seconds = (decisions + times["steps"] / times["sample_every"]) * n * pairs * PAIR + times["steps"] * n * STEP
    seconds += decisions * n * SIGHT if model.sight is not None else 0.0
    return seconds + (decisions * n * n * WING if model.flock is not None else 0.0)


def estimated_total_seconds(scenarios: Sequence[Scenario]) -> float:
    """Estimate the seconds of one core that flights take; scenarios may repeat."""
    # By identity: a sweep repeats one object for thousands of seeds, and a Scenario holds dicts, so
    # it has no hash.
    kinds = {id(scenario): scenario for scenario in scenarios}
    return sum(count * estimated_seconds(kinds[kind]) for kind, count in Counter(map(id, scenarios)).items())


def run_time_note(scenarios: Sequence[Scenario], threads: int) -> str:
    """Return the run time of flights side by side, for a person to read; empty below a minute."""
    seconds = estimated_total_seconds(scenarios) / max(1, min(threads, len(scenarios)))
    if seconds < 60.0:
        return ""
    unit, size = next((unit, size) for unit, size in TIMES if seconds >= size)
    count = f"{len(scenarios)} flights" if len(scenarios) > 1 else "the flight"
    return f"{count} will take about {seconds / size:.2g} {unit}"


def largest_fitting(limit: int, fits: Callable[[int], bool]) -> int:
    """Return the largest number below `limit` that fits, by bisection; 0 if not even one does."""
    low = 0
    while limit - low > 1:
        middle = (low + limit) // 2
        low, limit = (middle, limit) if fits(middle) else (low, middle)
    return low
