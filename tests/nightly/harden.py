"""Does hardening keep what held? 20 drawn scenarios: drones, delay, field and trees of their own.

    python tests/nightly/harden.py FOLDER [--start] [SEED ...]

Each is evolved for a short while (40 generations of 24) and then hardened on 60 seeds a step. Before and after are then
flown on the same 300 seeds that nothing has chosen. Must hold: constraints that held before hold after, 20 of 20; in at
least 12 the margin that was short grows by 20 % for at most 0.05 of fitness; the others say why not. The margin is the
share of flights without a contact where walls are short (it grows by 20 % when a fifth of the contacts go), else the
mean smallest distance. With --start nothing is evolved: the numbers of the law that the speed scales are hardened. Goes
on where it stopped; one JSON file per seed in FOLDER.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import airflock
from airflock import __version__
from airflock.engine import score_flights
from airflock.runs.folder import read_request
from airflock.runs.search_space import with_parameters
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search.hardening import COST, SAFETY, SLACK, ScoreColumns, harden, score_columns
from airflock.search.study_result import mean_interval
from airflock.search.tuning_run import prepare_start
from airflock.support import atomic
from airflock.support.errors import ScenarioError, StudyError

SEEDS = range(20)
STEP, JUDGED, FIRST = 60, 300, 100_000  # flights of a step, flights of the judge and the first of their seeds
SHORT = {"population": 24, "generations": 40, "averages": 2, "pool": 20, "top": 4, "final_seeds": 40}


def drawn(seed: int) -> Scenario:
    """A scenario of 6 to 20 drones at 3 to 8 m/s in a field that suits their number, with up to three trees."""
    rng = Random(seed)
    agents, speed = rng.randint(6, 20), round(rng.uniform(3.0, 8.0), 1)
    size = round(rng.uniform(40.0, 60.0) * math.sqrt(agents) * (speed / 6.0) ** 0.5, 0)  # m, side of a square field
    shape = rng.choice(("square", "circle", "L"))
    world: dict[str, Any] = {"arena": "square", "side": size}
    if shape == "circle":
        world = {"arena": "circle", "radius": round(0.56 * size, 0)}
    if shape == "L":
        a, b = -0.58 * size, 0.58 * size
        world = {"arena": "polygon", "corners": [[a, a], [b, a], [b, 0.0], [0.0, 0.0], [0.0, b], [a, b]]}
    trees = []
    for _ in range(rng.randint(0, 3)):
        x, y = (rng.uniform(-0.3, -0.1) * size for _ in range(2))
        trees.append([[x - 2.0, y - 2.0], [x + 2.0, y - 2.0], [x + 2.0, y + 2.0], [x - 2.0, y + 2.0]])
    document = {
        "agents": agents, "duration": 300.0, "dt": 0.05, "model": {"kind": "vasarhelyi_2018", "v_flock": speed},
        "radio": {"delay": round(rng.uniform(0.1, 1.0), 2), "range": round(rng.uniform(80.0, 200.0), 0)},
        "world": {**world, **({"obstacles": trees} if trees else {})},
    }  # fmt: skip
    return prepare_start(build_scenario(document, f"drawn {seed}"))[0]


def evolved(seed: int, folder: Path) -> Scenario:
    """The optimum of a short search, which is continued where it was cut off."""
    found = airflock.evolve(drawn(seed), folder, threads=1, resume=read_request(folder, "study") is not None, **SHORT)
    if found.dead_reason:
        raise StudyError(found.dead_reason)
    return found.scenario


def judged(seed: int, folder: Path | None) -> dict[str, Any]:
    """Evolve in a folder, if there is one, and harden; what hardening changed on fresh seeds."""
    told: dict[str, Any] = {"seed": seed, "airflock": __version__, "agents": int(drawn(seed).flight.agents)}
    try:
        scenario = drawn(seed) if folder is None else evolved(seed, folder)
    except StudyError as fault:
        return {**told, "refused": str(fault).splitlines()[0], "held": True, "grown": False}
    try:
        steps = harden(scenario, range(STEP), threads=1)
    except ScenarioError as fault:
        return {**told, "refused": fault.errors[0], "held": True, "grown": False}
    fresh = range(FIRST, FIRST + JUDGED)
    flown = [score_flights([with_parameters(scenario, each.parameters)] * JUDGED, fresh, threads=1)
             for each in (steps[0], steps[-1])]  # fmt: skip
    before, after = (score_columns(scenario, rows) for rows in flown)
    walls = contacts(before) > float((before["n_coll"] > 0.0).mean())
    cost = float((before["fitness"] - after["fitness"]).mean())
    margin = [1.0 - contacts(table) if walls else float(table["r_min"].mean()) for table in (before, after)]
    gain = (contacts(before) - contacts(after)) / contacts(before) if walls else margin[1] / margin[0] - 1.0
    short = "walls" if walls else "distance"
    return {
        **told, "short": short, "before": margin[0], "after": margin[1], "gain": gain,
        "cost": cost, "fitness": steps[0].fitness, "held": not broken(before, after), "broken": broken(before, after),
        "grown": gain >= 0.2 and cost <= COST, "verdict": steps[-1].verdict,
        "undone": [f"{step.name}: {step.verdict}" for step in steps[1:-1] if not step.kept],
    }  # fmt: skip


def contacts(table: ScoreColumns) -> float:
    """Share of flights in which somebody left the field or entered an obstacle."""
    return float((table["phi_wall"] > 0.0).mean())


def broken(before: ScoreColumns, after: ScoreColumns) -> list[str]:
    """Constraints that held before and do not hold after, both with what hardening allows to chance."""
    found = []
    for name in SAFETY:
        drop, _, low, _ = mean_interval((before[name] - after[name]).tolist())
        if drop > SLACK and low > 0.0:
            found.append(f"{name} {before[name].mean():.3f} to {after[name].mean():.3f}")
    for name in ("phi_wall", "n_coll"):
        more = 1.0 * (after[name] > 0.0) - 1.0 * (before[name] > 0.0)
        rise, _, low, _ = mean_interval(more.tolist())
        if rise > SLACK and low > 0.0:
            found.append(f"{name}: {np.mean(before[name] > 0.0):.3f} to {np.mean(after[name] > 0.0):.3f} of flights")
    return found


def main() -> int:
    """Fly what the folder lacks, and print the table; exit status 1 where less holds than must."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("seeds", type=int, nargs="*", default=list(SEEDS), metavar="SEED")
    parser.add_argument("--start", action="store_true", help="harden the scaled numbers, without a search")
    asked = parser.parse_intermixed_args()
    folder = asked.folder
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for seed in asked.seeds:
        path = folder / f"{seed}.json"
        if not path.is_file():
            began = time.process_time()
            found = judged(seed, None if asked.start else folder / f"study_{seed}")
            atomic.write_file(path, json.dumps({**found, "seconds": time.process_time() - began}))
        rows.append(json.loads(path.read_text()))
    print("| seed | drones | fitness | short | before | after | gain | cost | held | what hardening says |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        if "refused" in row:
            print(f"| {row['seed']} | {row['agents']} | | | | | | | yes | refused: {row['refused']} |")
            continue
        unit = {"walls": "", "distance": " m"}[row["short"]]
        held = "yes" if row["held"] else "; ".join(row["broken"])
        margin = f"{row['short']} | {row['before']:.3g}{unit} | {row['after']:.3g}{unit} | {100.0 * row['gain']:+.0f} %"
        drones = f"{row['seed']} | {row['agents']} | {row['fitness']:.3f}"
        said = row["verdict"] if row["grown"] else "; ".join([row["verdict"], *row["undone"]])
        print(f"| {drones} | {margin} | {row['cost']:+.3f} | {held} | {said} |")
    held, grown = sum(row["held"] for row in rows), sum(row["grown"] for row in rows)
    told = f"the short margin grew by 20 % for at most {COST:g} of fitness"
    print(f"{held} of {len(rows)} keep what held; in {grown} {told}")
    return 0 if held == len(rows) and grown >= 0.6 * len(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
