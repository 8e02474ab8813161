"""Groups in a large flock: what differing numbers and laws cost by cells, and what all pairs would.

    python benchmarks/groups.py [--agents 1000 10000] [--rounds 5] [--pairs]

Fish of Couzin et al. in a periodic box, about 16 others within the reach of each. Rows take turns, on one thread, by
processor time; a row's figure is the least of its rounds, of a flight of 1 + STEPS steps less one of a single step.
Told is the time of an agent-step and its ratio to the flock of one law. `--pairs` flies each row by all pairs, too.
"""

import argparse
import time

import numba

from airflock.engine import cpu, plan_of
from airflock.engine.tables import world_tables
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

AROUND, REACH = 16.0, 5.0  # neighbours, and m
STEPS = {True: 64, False: 2}  # by cells, which put agents beside those they meet now and then; by all pairs
VICSEK = {"kind": "vicsek_1995", "r": REACH}
ROWS: dict[str, list[dict[str, object]]] = {
    "one law": [],
    "one law, again": [],
    "half with numbers of their own": [{"agents": "50 %", "model": {"dr_o": 0.5}}],
    "each with a number of its own": [{"agents": "100 %", "model": {"sigma": {"value": 0.05, "spread": 0.01}}}],
    "half by another law": [{"agents": "50 %", "model": VICSEK}],
    "one in a hundred by another law": [{"agents": "1 %", "model": VICSEK}],
    "one in a hundred who look three times as far": [{"agents": "1 %", "model": {**VICSEK, "r": 3.0 * REACH}}],
}


def flock(agents: int, groups: list[dict[str, object]], steps: int) -> Scenario:
    """Fish at random in a cube, without metrics over pairs, for so many steps."""
    side = (agents * (4.0 / 3.0 * 3.14159265 * REACH**3) / AROUND) ** (1.0 / 3.0)
    dt = load("couzin_2002/torus").flight.dt
    return load("couzin_2002/torus", {
        "agents": agents, "duration": steps * dt, "metrics.kind": "order", "metrics.period": 600.0,
        "model.r_r": 1.0, "model.dr_o": 1.0, "model.dr_a": REACH - 2.0, "start.kind": "arena", "start.separation": 0.0,
        "world.arena": "square", "world.edges": "periodic", "world.side": side, "world.height": side, "groups": groups,
    })  # fmt: skip


def timed(scenario: Scenario, grid: bool) -> float:
    """Processor seconds of a flight that is compiled already."""
    plan = plan_of(scenario, grid=grid)
    assert plan.grid == grid
    table = world_tables(scenario, plan, 1)
    begun = time.process_time()
    cpu.fly_on_cpu(plan, table)
    return time.process_time() - begun


def measure(agents: int, rounds: int, grid: bool) -> None:
    """The rows of one size in turn."""
    flights = {name: [flock(agents, groups, n) for n in (1, 1 + STEPS[grid])] for name, groups in ROWS.items()}
    least = {name: [1e9, 1e9] for name in flights}
    for turn in range(rounds + 1):
        for name, both in flights.items():
            for k, scenario in enumerate(both):
                seconds = timed(scenario, grid)
                if turn:  # the first one compiles
                    least[name][k] = min(least[name][k], seconds)
    step = {name: (more - one) / STEPS[grid] / agents for name, (one, more) in least.items()}
    print(f"{agents} agents, {'by cells' if grid else 'all pairs'}", flush=True)
    for name, seconds in step.items():
        print(f"    {name:44s} {1e9 * seconds:9.1f} ns  {seconds / step['one law']:6.3f}", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agents", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--pairs", action="store_true")
    given = parser.parse_args()
    numba.set_num_threads(1)
    for agents in given.agents:
        for grid in (True, False) if given.pairs else (True,):
            measure(agents, given.rounds, grid)


if __name__ == "__main__":
    main()
