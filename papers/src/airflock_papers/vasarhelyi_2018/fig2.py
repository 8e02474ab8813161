"""Fig. 2: collisions and nearest-neighbour distance over range and delay of the radio at 32 m/s."""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import optimum

SIMULATIONS = 40  # per bin, twice the paper's: one start serves a whole map, so few starts may all be lucky
RANGES = tuple(float(r) for r in range(80, 401, 40))  # m
DELAYS = tuple(round(0.2 * k, 1) for k in range(11))  # s, multiples of the sensor period
SAFE_DELAY, SAFE_RANGE = 1.0, 240.0  # caption: below 1 s, above 240 m
ONE = 1.0  # collision per flight: where the map changes by orders of magnitude
EARLY = 60.0  # s from the start at rest in random places


class Data(NamedTuple):
    """Order parameters by range (m), delay (s) and seed: of whole flights, and of the safe region's first minute."""

    bins: pd.DataFrame
    early: pd.DataFrame


def fly(flights: Flights) -> Data:
    """The map, and the same flights in the safe region cut off after a minute."""
    ranges, delays = (RANGES[::4], DELAYS[::5]) if flights.quick else (RANGES, DELAYS)
    bins = {(r, t): optimum(32, {"radio.range": r, "radio.delay": t}) for r, t in product(ranges, delays)}
    seeds, axes = flights.count(SIMULATIONS, 4), ["range", "delay", "seed"]
    starts = {
        (r, t): optimum(32, {"radio.range": r, "radio.delay": t, "duration": EARLY})
        for r, t in bins
        if r > SAFE_RANGE and t < SAFE_DELAY - 1e-9
    }
    found = flights.score("Fig. 2, range and delay", bins, seeds)
    early = flights.score("Fig. 2, first minute", starts, seeds)
    return Data(found.rename_axis(axes), early.rename_axis(axes))


def measured(data: Data) -> list[Measured]:
    """Everything that is said of Fig. 2."""
    found, early = data
    reach, delay = (found.index.get_level_values(name).to_numpy() for name in ("range", "delay"))
    quick, far = delay < SAFE_DELAY - 1e-9, reach > SAFE_RANGE
    safe, late, short = (found[part]["n_coll"] for part in (quick & far, ~quick & far, quick & ~far))
    worst = safe.groupby(level=["range", "delay"]).mean()
    where = worst.idxmax()
    note = (
        f"largest of {len(worst)} bins: {worst.max():.2f} at {where[0]:g} m and {where[1]:g} s; "
        f"{(safe == 0).mean():.0%} of these flights have none; {early['n_coll'].mean():.2f} of the {safe.mean():.2f} "
        f"fall into the first {EARLY:g} s from random places"
    )
    outside = (
        ("late", "delay of 1 s and more, range above 240 m", late),
        ("short", "range to 240 m, delay below 1 s", short),
    )
    return [
        Measured("fig2.safe", "n_coll", "32 m/s, delay < 1 s and range > 240 m", statistics.mean(safe), note),
        *(
            Measured(
                f"fig2.{name}",
                "n_coll",
                f"{words}, less the safe region",
                statistics.difference(unsafe, safe),
                f"{unsafe.mean():.3g} against {safe.mean():.3g}",
            )
            for name, words, unsafe in outside
        ),
        _distance(found),
        _boundary(found),
    ]


def _distance(found: pd.DataFrame) -> Measured:
    bins = found["r_min_mean"].groupby(level=["range", "delay"]).mean()
    low, high = bins.idxmin(), bins.idxmax()
    note = (
        f"from {bins.min():.1f} m (range {low[0]:g} m, delay {low[1]:g} s) to {bins.max():.1f} m (range {high[0]:g} m, "
        f"delay {high[1]:g} s)"
    )
    return Measured("fig2.distance", "r_min_mean", "32 m/s, all bins", statistics.mean(found["r_min_mean"]), note)


def _boundary(found: pd.DataFrame) -> Measured:
    """For each delay, the shortest range from which on there is less than one collision per flight."""
    bins = found["n_coll"].groupby(level=["delay", "range"]).mean().unstack()
    edge = {}
    for delay, row in bins.iterrows():
        rare = (row < ONE).to_numpy()[::-1]
        count = int(np.argmin(rare)) if not rare.all() else len(rare)
        edge[delay] = f"{row.index[len(row) - count]:g} m" if count else "none"
    at = bins.columns.get_indexer([320.0], method="nearest")[0]
    largest = float(max((d for d, n in bins.iloc[:, at].items() if n < ONE), default=math.nan))
    note = "shortest range with less than one collision a flight from there on, by delay: "
    note += ", ".join(f"{d:g} s {r}" for d, r in edge.items())
    return Measured("fig2.boundary", "delay", "32 m/s, near 320 m", statistics.one(largest, len(found)), note)
