"""Does certify's bound hold as often as it says? Repetitions on stored flights whose truth is known.

python benchmarks/bounds.py FLIGHTS DISTANCE [DISTANCE ...]

FLIGHTS is the folder of flights of `airflock certify --flights 50000 --out x.toml` (x_flights). How many of them come
nearer than DISTANCE (m) is taken to be the truth. Each of 200 repetitions draws flights from them (with replacement)
in a random order and counts as `airflock certify` does: with looks until a limit of 1, 1.5 or 3 times the truth is
shown or refuted, and with one look at 4,000 flights. A repetition holds if its upper bound of 95 % is not below the
truth. "shown wrongly" counts limits just below the truth that were shown.
"""

import argparse
from pathlib import Path

import numpy as np
from splitting import counted

from airflock.certificates.limits import look_schedule, take_look

REPETITIONS, ALPHA, ONCE, MOST = 200, 0.05, 4000, 100.0  # MOST events expected in a repetition


def looked(events, limit):
    """Upper bound after the looks until a limit is shown or refuted; events (flight,) so far."""
    low, high = 0.0, 1.0
    for flights, above, below in look_schedule(limit, ALPHA):
        if flights > len(events):
            break
        found = take_look(flights, int(events[flights - 1]), above, below)
        low, high = max(low, found.low), min(high, found.high)
        if high <= limit or low > limit:
            break
    return high


def main():
    """One row for each distance and way of counting."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("flights", type=Path)
    parser.add_argument("distances", type=float, nargs="+", metavar="DISTANCE")
    asked = parser.parse_args()
    least, rng = np.array(counted(asked.flights)[2]), np.random.default_rng(0)
    print(f"{len(least):,} flights, {REPETITIONS} repetitions, seed 0\n")
    print("| below | truth | one look | limit = truth | 1.5 times | 3 times | shown wrongly |")
    print("|---|---|---|---|---|---|---|")
    for distance in asked.distances:
        truth = float((least < distance).mean())
        held, wrong = [0, 0, 0, 0], 0
        for _ in range(REPETITIONS):
            drawn = rng.integers(0, len(least), max(ONCE, round(MOST / truth)))
            events = np.cumsum(least[drawn] < distance)
            held[0] += take_look(ONCE, int(events[ONCE - 1]), ALPHA, ALPHA).high >= truth
            for place, factor in enumerate((1.0, 1.5, 3.0), start=1):
                held[place] += looked(events, factor * truth) >= truth
            wrong += looked(events, truth / 1.001) <= truth / 1.001
        print(f"| {distance:g} m | {truth:.2e} | {' | '.join(map(str, held))} | {wrong} |")


if __name__ == "__main__":
    main()
