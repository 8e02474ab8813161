"""Cost: how long a flight takes on this machine, about, judged before it is compiled and flown."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from airflock.scenarios.cells import uses_all_cores
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.timing import step_counts
from airflock.support import FlightError

TIMES = (("days", 86400.0), ("h", 3600.0), ("min", 60.0))
LONGEST = 30 * 86400.0  # s of a processor that one flight may take; nobody waits longer for one
# s of one core (2 cores of 2025, single precision). Measured: flights of 31 presets take 0.20 to 1.62 of the estimate.
PAIR = 7e-10  # for one look at one other agent
STEP = 4e-9  # for one motion step of one agent
SIGHT = 2e-6  # for one look of one agent among a hundred buildings
WING = 2e-6  # for what one wing does to another, while all are solved for


def check_run_time(scenario: Scenario) -> None:
    """Refuse a flight that nobody can wait for; raises FlightError with the number of agents or the time that fits."""
    flight, n = scenario.flight, float(scenario.agents)
    if flight.duration / flight.dt * n * (2.0 * n * PAIR + STEP + SIGHT + n * WING) <= LONGEST:
        return  # whatever its rates and its law are
    took = estimated_seconds(scenario)
    if took <= LONGEST:
        return
    days = LONGEST / 86400.0
    fit = largest_fitting(scenario.agents, lambda agents: estimated_seconds(_of(scenario, agents)) <= LONGEST)
    told = f"{scenario.name}: a flight takes about {took / 86400.0:.3g} days of a processor, more than {days:g}"
    fits = [f"about {fit} agents fit"] if fit else []
    fits.append(f"{'or ' if fits else ''}a duration of about {flight.duration * LONGEST / took:.3g} s")
    raise FlightError(f"{told}; {'; '.join(fits)}, or a longer dt = {flight.dt:g} s")


def _of(scenario: Scenario, agents: float) -> Scenario:
    """The same with so many agents."""
    return replace(scenario, flight=replace(scenario.flight, agents=float(agents)))


def estimated_seconds(scenario: Scenario) -> float:
    """Seconds of one core that a flight takes, about, without its compilation; at all cores, cells take a share."""
    times, n, model = step_counts(scenario), float(scenario.agents), scenario.model
    decisions = times["steps"] / times["decide_every"]
    pairs = min(n, 60.0) if uses_all_cores(scenario) else n
    seconds = (decisions + times["steps"] / times["sample_every"]) * n * pairs * PAIR + times["steps"] * n * STEP
    seconds += decisions * n * SIGHT if model.sight is not None else 0.0
    return seconds + (decisions * n * n * WING if model.flock is not None else 0.0)


def estimated_total_seconds(scenarios: Sequence[Scenario]) -> float:
    """Seconds of one core that flights take, about; the same scenario may stand there very often."""
    kinds = {id(scenario): scenario for scenario in scenarios}
    return sum(count * estimated_seconds(kinds[kind]) for kind, count in Counter(map(id, scenarios)).items())


def run_time_note(scenarios: Sequence[Scenario], threads: int) -> str:
    """How long these flights take side by side, about, where that is more than a minute; empty if it is not."""
    seconds = estimated_total_seconds(scenarios) / max(1, min(threads, len(scenarios)))
    if seconds < 60.0:
        return ""
    unit, size = next((unit, size) for unit, size in TIMES if seconds >= size)
    count = f"{len(scenarios)} flights" if len(scenarios) > 1 else "the flight"
    return f"{count} will take about {seconds / size:.2g} {unit}"


def largest_fitting(limit: int, fits: Callable[[int], bool]) -> int:
    """The largest number up to `high` that fits, 0 if not even one does."""
    low = 0
    while limit - low > 1:
        middle = (low + limit) // 2
        low, limit = (middle, limit) if fits(middle) else (low, middle)
    return low
