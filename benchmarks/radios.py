"""Radios: what realistic packets cost a flight of 30 drones, all flown in turn.

    python benchmarks/radios.py                   against 4870486, the commit before the radio went into the pair loop
    python benchmarks/radios.py TREE --rounds 10  against a commit, a tag or a checkout

Processor time of flights of 600 s on one thread, the least of all rounds. A set is a new pair of processes: where
code and arrays lie in memory decides a few percent. A motor fails in few flights if it does so once an hour: the last
row is the mean over SEEDS of the least time of each, against the same flights without. Status 1 where a ratio exceeds
its bound.
"""

import argparse
import sys
from pathlib import Path
from statistics import mean

from guard import HERE, Version, checkout

AGAINST = "4870486"
REAL, GNSS, DRONES = "vasarhelyi_2018/real_4ms", "vasarhelyi_2018/real_gnss", {"agents": 30}
SEEDS = range(1, 25)
MOTOR = {"faults": [{"kind": "motor", "share": 0.5, "per_hour": 1.0, "number": 1}]}

# name: preset, settings; the last two fly in the older version
FLIGHTS = {
    "real_gnss": (GNSS, DRONES),
    "real_gnss, constant radio": (GNSS, DRONES | {"radio.kind": "constant"}),
    "real_4ms": (REAL, DRONES),
    "real_4ms, links": (REAL, DRONES | {"radio.kind": "links"}),
    "real_4ms, loss armed": (REAL, DRONES | {"radio.loss": 1e-12}),
    "real_4ms, before": (REAL, DRONES),
    "real_gnss, before": (GNSS, DRONES),
}
BEFORE = ("real_4ms, before", "real_gnss, before")
# what is asked: flight, that it is compared with, and the bound of the ratio
ASKED = (
    ("real_gnss", "real_4ms, before", 2.0),
    ("real_gnss", "real_gnss, constant radio", 1.5),
    ("real_4ms, links", "real_4ms", 1.5),
    ("real_4ms, loss armed", "real_4ms", 1.3),
)
FAULT_BOUND = 1.05


def measured(tree: Path, sets: int, rounds: int) -> dict[str, float]:
    """Least seconds of each flight; said as it goes."""
    best = dict.fromkeys(FLIGHTS, float("inf"))
    for number in range(sets):
        ours, theirs = Version(HERE), Version(tree)
        for _ in range(rounds):
            for name, row in FLIGHTS.items():
                version = theirs if name in BEFORE else ours
                best[name] = min(best[name], version.seconds(row))
        ours.close()
        theirs.close()
        print(f"set {number + 1} of {sets}: real_gnss {1e3 * best['real_gnss']:.2f} ms", flush=True)
    return best


def with_faults(rounds: int) -> float:
    """Mean time of flights of which some have a fault, over that of the same flights without."""
    version = Version(HERE)
    rows = [(GNSS, DRONES, seed) for seed in SEEDS], [(GNSS, DRONES | MOTOR, seed) for seed in SEEDS]
    best = [[float("inf")] * len(SEEDS) for _ in rows]
    for _ in range(rounds):
        for place in range(len(SEEDS)):
            for least, flights in zip(best, rows, strict=True):
                least[place] = min(least[place], version.seconds(flights[place]))
    version.close()
    return mean(best[1]) / mean(best[0])


def main() -> int:
    """Measure and print; the status says whether all bounds hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", nargs="?", default=AGAINST, help=f"commit, tag or checkout; {AGAINST}")
    parser.add_argument("--rounds", type=int, default=15, help="flights of each kind in a set")
    parser.add_argument("--sets", type=int, default=3, help="pairs of new processes")
    asked = parser.parse_args()
    with checkout(asked.other) as (tree, commit):
        best = measured(tree, asked.sets, asked.rounds)
    print()
    for name, seconds in best.items():
        print(f"{name.replace('before', 'of ' + commit):<32}{1e3 * seconds:8.3f} ms")
    print()
    ratios = [(f"{one} / {other}", best[one] / best[other], bound) for one, other, bound in ASKED]
    print("flights with a motor that fails once an hour ...", flush=True)
    ratios.append(("real_gnss, a motor once an hour / real_gnss", with_faults(max(2, asked.rounds // 4)), FAULT_BOUND))
    for name, ratio, bound in ratios:
        print(f"{name:<52}{ratio:6.3f}  bound {bound:<5} {'holds' if ratio <= bound else 'missed'}")
    return 1 if any(ratio > bound for _, ratio, bound in ratios) else 0


if __name__ == "__main__":
    sys.exit(main())
