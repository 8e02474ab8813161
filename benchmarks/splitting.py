"""Splitting against counting: repetitions that share no flight, each from its own part of flights that were counted.

python benchmarks/splitting.py FOLDER FLIGHTS LIMIT [LIMIT ...]      # continues where it was left

FLIGHTS is the folder of flights of `airflock certify --flights 40000 --out x.toml` (x_flights), LIMIT a smallest
distance in m. Ten repetitions begin with a tenth of these flights each, as `airflock certify --flights 4000 --split`
does with its own: five runs of 200 flights a level, refused where they disagree with the flights that they began with.
The number is then set beside intervals of Clopper and Pearson (95 %): of these flights, of the first 10,000, of all.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from scipy.stats import beta

from airflock import __version__
from airflock.certificates.counting import COUNT_BATCH
from airflock.certificates.splitting import (
    REPETITIONS,
    estimate_probability,
    record_falls,
    sample_period,
    start_repetition,
)
from airflock.runs.flight_store import FlightStore
from airflock.scenarios.files import load
from airflock.support import atomic

TIMES = 10


def counted(folder):
    """Seeds of the flights of a campaign in their order, and smallest distances (m) at samples and at motion steps."""
    wanted = "seed, json_extract(scores, '$.r_min'), json_extract(scores, '$.closest')"
    with FlightStore(folder, write=False) as store:
        rows = store.rows(f"SELECT {wanted} FROM flight WHERE stage=? ORDER BY repeat", (COUNT_BATCH.stage,))
    return [int(own) for own, _, _ in rows], [r for _, r, _ in rows], [r if c is None else c for _, r, c in rows]


def span(target, closest):
    """Clopper and Pearson's two-sided interval of 95 % that a flight comes nearer than the target."""
    events, flights = sum(value < target for value in closest), len(closest)
    low = beta.ppf(0.025, events, flights - events + 1) if events else 0.0
    return float(low), float(beta.ppf(0.975, events + 1, flights - events))


class Flown:
    """Flies lineages, each once: repetitions to a deeper limit begin with the flights of those to a higher one."""

    def __init__(self, scenario):
        self.scenario, self.known = scenario, {}

    def __call__(self, batch, lineages):
        """How the smallest distance fell in each flight."""
        for lineage in lineages:
            if lineage not in self.known:
                self.known[lineage] = record_falls(self.scenario, lineage)
        return [self.known[lineage] for lineage in lineages]


def repeated(scenario, seeds, least, targets, number):
    """One repetition of what `certify --split` does, for each target; plain values."""
    share, period, fly, rows = len(seeds) // REPETITIONS, sample_period(scenario), Flown(scenario), {}
    for target in sorted(targets, reverse=True):
        began, runs = time.process_time(), []
        for k in range(REPETITIONS):
            mine, rng = slice(k * share, (k + 1) * share), np.random.default_rng([number, k])
            runs.append(start_repetition(seeds[mine], least[mine], target, fly, period, rng))
        found = estimate_probability(runs, target, least)
        rows[target] = {
            "probability": found.probability, "low": found.low, "high": found.high, "refused": found.refused,
            "runs": [run.probability(target) for run in runs], "ancestors": [run.ancestor_count for run in runs],
            "flights": sum(run.flights for run in runs), "seconds": time.process_time() - began,
            "airflock": __version__,
        }  # fmt: skip
    return rows


def main():
    """Repetitions of each limit, and a table for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("flights", type=Path)
    parser.add_argument("limits", type=float, nargs="+", metavar="LIMIT")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    scenario = load(str(asked.flights / "scenario.toml"))
    seeds, least, closest = counted(asked.flights)
    share = len(least) // TIMES
    found = {target: [] for target in asked.limits}
    for number in range(TIMES):
        paths = {target: asked.folder / f"{scenario.parameters.v_flock:g}_{target:g}_{number}.json" for target in found}
        if not all(path.is_file() for path in paths.values()):
            part = slice(number * share, (number + 1) * share)
            for target, row in repeated(scenario, seeds[part], least[part], asked.limits, number).items():
                atomic.write_file(paths[target], json.dumps(row))
        for target, path in paths.items():
            found[target].append(json.loads(path.read_text()))
    for target, rows in found.items():
        table(target, rows, closest)


def table(target, rows, closest):
    """Repetitions of one limit beside counting: of the flights that each began with, of 10,000, and of all."""
    share = len(closest) // TIMES
    print("| repetition | estimate (95 %) | five runs | own counting | inside | 10,000 | all | flights | processor s |")
    print("|---|---|---|---|---|---|---|---|---|")
    kept = [0, 0, 0]
    for number, row in enumerate(rows):
        spans = [span(target, part) for part in (closest[number * share :][:share], closest[:10_000], closest)]
        inside = [low <= row["probability"] <= high for low, high in spans]
        kept = [count + (good and not row["refused"]) for count, good in zip(kept, inside, strict=True)]
        told = " | ".join("refused" if row["refused"] else "yes" if good else "no" for good in inside)
        said = row["refused"] or f"{row['probability']:.2e} ({row['low']:.1e} to {row['high']:.1e})"
        print(
            f"| {number} | {said} | {', '.join(f'{p:.1e}' for p in row['runs'])} | {spans[0][0]:.1e} to "
            f"{spans[0][1]:.1e} | {told} | {row['flights']} | {row['seconds']:.0f} |"
        )
    low, high = span(target, closest)
    events = sum(value < target for value in closest)
    print(
        f"\nr_min<{target:g}: {events} of {len(closest):,} by counting ({low:.2e} to {high:.2e}); numbers inside the "
    )
    print(f"interval of own counting {kept[0]}, of 10,000 flights {kept[1]}, of all {kept[2]} of {len(rows)}\n")


if __name__ == "__main__":
    main()
