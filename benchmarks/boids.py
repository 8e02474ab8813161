"""Boids against the authors' program of Zapotecatl et al. 2016: steps per second and ratios, small flocks and large.

    python benchmarks/boids.py [--only small|ball|large] [--rounds 3]

The program's figures are its own headless build (g++ -O2, one core, CPU seconds, with metrics): 13,400 steps/s for 50
boids, 0.26 steps/s for 10,000 in the start ball. Ours on one thread are CPU seconds too, the least of several rounds;
on all threads they are wall seconds, which other work on the machine spoils.
"""

import argparse
import os
import time
from collections.abc import Callable

import numba

from airflock.engine import cpu, plan_of
from airflock.engine.stages.flight import EVERY
from airflock.engine.tables import world_tables
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

PROGRAM = {50: 13_400.0, 10_000: 0.26}  # steps per CPU second
BEST = "zapotecatl_2016/best"
Timer = Callable[[], float]


def box(agents: int, around: float) -> Scenario:
    """Boids at random in a periodic cube with `around` neighbours each within r_c = 0.5 m."""
    side = (agents * (4.0 / 3.0 * 3.14159265 * 0.5**3) / around) ** (1.0 / 3.0)
    return large({"start.kind": "arena", "start.separation": 0.0, "world.edges": "periodic", "world.side": side,
                  "world.height": side, "agents": agents})  # fmt: skip


def large(settings: dict[str, object]) -> Scenario:
    """A large flock without metrics over pairs."""
    usual = {"update": "synchronous", "dt": 0.02, "metrics.kind": "order", "metrics.period": 600.0}
    return load(BEST, {**usual, **settings})


def seconds_per_step(scenario: Scenario, steps: int, rounds: int, timer: Timer) -> float:
    """Least seconds of one step: a flight of 1 + steps minus one of 1, so that the start does not count."""
    dt, best = scenario.flight.dt, {}
    for count in (1, 1 + steps):
        found = load(BEST, {**settings_of(scenario), "duration": count * dt})
        plan = plan_of(found)
        table = world_tables(found, plan, 1)
        cpu.fly_on_cpu(plan, table)
        best[count] = min(
            timed(lambda plan=plan, table=table: cpu.fly_on_cpu(plan, table), timer) for _ in range(rounds)
        )
    return max(best[1 + steps] - best[1], 1e-9) / steps


def settings_of(scenario: Scenario) -> dict[str, object]:
    """Keys and values of a scenario as they were set."""
    flat: dict[str, object] = {}
    for section, entry in scenario.document.items():
        if hasattr(entry, "items") and "value" not in entry:
            flat |= {f"{section}.{key}": plain(value) for key, value in entry.items()}
        elif section not in ("title",):
            flat[section] = plain(entry)
    return {key: value for key, value in flat.items() if not key.startswith("published")}


def plain(value: object) -> object:
    """A value without its unit and source."""
    return value["value"] if isinstance(value, dict) and "value" in value else value


def timed(call: Callable[[], object], timer: Timer) -> float:
    """Seconds that a call takes."""
    begun = timer()
    call()
    return timer() - begun


def report(title: str, scenario: Scenario, steps: int, rounds: int, program: float | None = None) -> None:
    """One line: on one thread by CPU time, and on all threads by the clock on the wall."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    one = seconds_per_step(scenario, steps, rounds, time.process_time)
    numba.set_num_threads(threads)
    every = seconds_per_step(scenario, steps, rounds, time.perf_counter)
    ratio = f"{1.0 / one / program:9.1f} x program" if program else ""
    each = one / scenario.agents * 1e9
    print(
        f"{title:44s} one thread {1.0 / one:10.1f} steps/s, {each:7.1f} ns per agent-step {ratio}"
        f" | {threads} threads, wall {1.0 / every:10.1f} steps/s",
        flush=True,
    )


def main() -> None:
    """Print all lines, or those of one group."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("small", "ball", "large"))
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if given.only in (None, "small"):
        for update in ("sequential", "synchronous"):
            small = load(BEST, {"update": update})
            report(f"50 boids, {update}, metrics at every step", small, 20_000, given.rounds, PROGRAM[50])
    if given.only in (None, "ball"):
        ball = large({"agents": 10_000})
        report("10,000 in the paper's start ball", ball, 3, given.rounds, PROGRAM[10_000])
        for around in (16.0, 50.0):
            title = f"10,000 at fixed density, {around:g} neighbours"
            report(title, box(10_000, around), 60, given.rounds, PROGRAM[10_000])
    if given.only in (None, "large"):
        for agents in (100_000, 1_000_000):
            report(f"{agents:,} at fixed density, 16 neighbours", box(agents, 16.0), EVERY, given.rounds)


if __name__ == "__main__":
    main()
