"""Flies fleets of ten with one fault each beside the same seeds without it, and says which faults the rules hold.

    python tests/nightly/fleets_with_faults.py FOLDER [SEEDS]

One line of FOLDER/flights.csv for each flight; flights that stand there are not flown again. FOLDER/table.csv has a row
for each condition: the median of the smallest distance of any two drones in the air from the fault on is at least 5 m,
and at most one flight more than without the fault comes below 3 m. Ends with status 0 if every row holds that is not in
OPEN, 1 if not, 3 if its time (AIRFLOCK_LIMIT, s) is over: call it again to go on.
"""

import csv
import gc
import math
import os
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from airflock.fleets import compare  # noqa: E402
from airflock.fleets.drone_faults import InjectedFault  # noqa: E402
from fleets import scenario  # noqa: E402

SEEDS = 40
AGENTS, DURATION, BEGIN = 10, 60.0, 20.0
CONDITIONS = {
    "none": (),
    "blackout of 15 s": (InjectedFault("outage", (), BEGIN, BEGIN + 15.0),),
    "blackout of 15 s, no rule of silence": (InjectedFault("outage", (), BEGIN, BEGIN + 15.0),),
    "partition of 15 s": (InjectedFault("partition", (1, 2, 3, 4, 5), BEGIN, BEGIN + 15.0),),
    "60 % of all packets lost": (InjectedFault("loss", (), BEGIN, amount=0.6),),
    "clock 0.5 s ahead": (InjectedFault("clock", (2,), amount=0.5),),
    "frozen navigation": (InjectedFault("gnss", (2,), BEGIN),),
    "node killed": (InjectedFault("node", (2,), BEGIN),),
    "motors off": (InjectedFault("motor", (2,), BEGIN),),
}
FIRST = ("none", "blackout of 15 s")
FREE = "blackout of 15 s, no rule of silence"  # flown to show what the rule is for
# condition → mechanism, and the rule that is missing; at most two may stand here
OPEN: dict[str, str] = {}
MEDIAN, NEAR, MORE = 5.0, 3.0, 1  # m, m, flights
GROUND = 0.5  # m; who is lower has landed or fallen
SPARE = 60.0  # s before the limit at which no further flight is begun
FIELDS = ("condition", "seed", "smallest_m", "at_s", "one", "other", "phases")


def flown(condition, seed):
    """One flight: the smallest distance of two drones in the air from the fault on, when, and of whom."""
    found = compare.with_metric_period(scenario(AGENTS, DURATION, noisy=True), 0.2)
    card = compare.software_card(found, stop_for_lost=condition != FREE)
    fleet = compare.fly_in_lockstep(found, card, seed, faults=CONDITIONS[condition])
    rows = fleet.array()[round(BEGIN / card.period) :, :, :3]
    gaps = np.linalg.norm(rows[:, :, None] - rows[:, None], axis=-1)
    down = rows[:, :, 2] < GROUND
    gaps[down[:, :, None] | down[:, None, :] | np.eye(AGENTS, dtype=bool)] = math.inf
    at, one, other = np.unravel_index(gaps.argmin(), gaps.shape)
    phases = " ".join(sorted({phase.name for phase in fleet.phases()}))
    smallest = round(float(gaps.min()), 3)
    return dict(
        zip(FIELDS, (condition, seed, smallest, BEGIN + at * card.period, one + 1, other + 1, phases), strict=True)
    )


def table(rows):
    """A row for each condition that has been flown: counts, and whether it holds beside the same seeds without it."""
    low = {(row["condition"], int(row["seed"])): float(row["smallest_m"]) for row in rows}
    lines = []
    for condition in CONDITIONS:
        seeds = [s for c, s in low if c == condition and ("none", s) in low]
        if not seeds:
            continue
        values, plain = [low[condition, s] for s in seeds], [low["none", s] for s in seeds]
        near, before = sum(v < NEAR for v in values), sum(v < NEAR for v in plain)
        holds = median(values) >= MEDIAN and near <= before + MORE
        lines.append({
            "condition": condition, "flights": len(seeds), "median_m": f"{median(values):.2f}",
            "least_m": f"{min(values):.2f}", "below_3_m": near, "below_3_m_without": before,
            "holds": "yes" if holds else "open" if condition in OPEN or condition == FREE else "no",
            "why": OPEN.get(condition, ""),
        })  # fmt: skip
    return lines


def main():
    folder, seeds = Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else SEEDS
    folder.mkdir(parents=True, exist_ok=True)
    gc.freeze()  # what is imported stays; to look through it takes a twentieth of the time
    kept = folder / "flights.csv"
    rows = list(csv.DictReader(kept.open())) if kept.exists() else []
    done = {(row["condition"], int(row["seed"])) for row in rows}
    until = time.monotonic() + float(os.environ.get("AIRFLOCK_LIMIT", "inf")) - SPARE
    first = [(c, s) for s in range(seeds) for c in CONDITIONS if c in FIRST]
    waiting = [each for each in (*first, *((c, s) for s in range(seeds) for c in CONDITIONS)) if each not in done]
    waiting = list(dict.fromkeys(waiting))
    with kept.open("a", newline="") as out:
        writer = csv.DictWriter(out, FIELDS)
        if not rows:
            writer.writeheader()
        while waiting and time.monotonic() < until:
            rows.append(flown(*waiting.pop(0)))
            writer.writerow(rows[-1])
            out.flush()
            if len(rows) % len(CONDITIONS) == 0:
                print(f"{len(rows)} of {seeds * len(CONDITIONS)} flights", flush=True)
    lines = table(rows)
    with (folder / "table.csv").open("w", newline="") as out:
        writer = csv.DictWriter(out, lines[0])
        writer.writeheader()
        writer.writerows(lines)
    for line in lines:
        print("  ".join(str(value) for value in line.values()))
    if waiting:
        print(f"{len(waiting)} flights still to fly")
        return 3
    wrong = [line["condition"] for line in lines if line["holds"] == "no"]
    print(f"{len(rows)} flights: {', '.join(wrong) or 'nothing'} fails; {len(OPEN)} rows open")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
