"""Fig. 2: collisions and nearest-neighbour distance over range and delay of the radio at 32 m/s."""

import math
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from airflock.papers import statistics
from airflock.papers.claims import Claim, judged
from airflock.papers.flights import Flights
from airflock.papers.vasarhelyi_2018.published import optimum

SIMULATIONS = 20  # per bin
RANGES = tuple(float(r) for r in range(80, 401, 40))  # m
DELAYS = tuple(round(0.2 * k, 1) for k in range(11))  # s, multiples of the sensor period
SAFE_DELAY, SAFE_RANGE = 1.0, 240.0  # caption: below 1 s, above 240 m
FEW = 0.1  # collisions per flight that count as vanished: one in ten flights
ONE = 1.0  # collision per flight: where the map changes by orders of magnitude
EARLY = 60.0  # s from the start at rest in random places
SOURCE = "Fig. 2, caption (20 simulations a bin)"


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


def claims(data: Data) -> list[Claim]:
    """All claims about Fig. 2."""
    found, early = data
    reach, delay = (found.index.get_level_values(name).to_numpy() for name in ("range", "delay"))
    quick, far = delay < SAFE_DELAY - 1e-9, reach > SAFE_RANGE
    safe = found[quick & far]["n_coll"]
    worst = safe.groupby(level=["range", "delay"]).mean()
    value = statistics.mean(safe)
    where, start = worst.idxmax(), early["n_coll"].mean()
    late, short = found[~quick]["n_coll"].mean(), found[quick & ~far]["n_coll"].mean()
    result = [
        Claim(
            id="fig2.safe",
            statement="collisions per flight with a delay below 1 s and a range above 240 m: they vanish",
            source=SOURCE,
            test=f"mean over these bins below {FEW:g}",
            published=0.0,
            **value.fields(),
            **judged(
                value.ours < FEW,
                f"Largest of {len(worst)} bins: {worst.max():.2f} at {where[0]:g} m and {where[1]:g} s; "
                f"{(safe == 0).mean():.0%} of these flights have none. Of the {value.ours:.2f}, {start:.2f} fall into "
                f"the first {EARLY:g} s from random places. Outside the region there are {late:.0f} (delay from 1 s) "
                f"and {short:.0f} (range to 240 m).",
            ),
        ),
        _more("late", "a delay of 1 s and more (range above 240 m)", found[~quick & far]["n_coll"], safe),
        _more("short", "a range of 240 m and less (delay below 1 s)", found[quick & ~far]["n_coll"], safe),
    ]
    if (320.0, 1.0) in found.index.droplevel("seed"):
        result.append(_setup(found.loc[(320.0, 1.0)]))
    return [*result, _distance(found), _boundary(found)]


def _more(name: str, words: str, unsafe: pd.Series, safe: pd.Series) -> Claim:
    gap = statistics.difference(unsafe, safe)
    return Claim(
        id=f"fig2.{name}",
        statement=f"collisions per flight with {words}, minus those in the safe region",
        source=SOURCE,
        test="95 % interval above 0",
        **gap.fields(),
        **judged(gap.low > 0.0, "" if gap.low > 0.0 else f"{unsafe.mean():.3f} against {safe.mean():.3f}."),
    )


def _setup(bin_: pd.DataFrame) -> Claim:
    mean, sd = optimum(32).published["n_coll"]
    value = statistics.mean(bin_["n_coll"])
    p = statistics.welch(value, mean, sd or 0.0, 100)
    return Claim(
        id="fig2.setup",
        statement="collisions per flight in the bin of Table S2 (320 m, 1 s)",
        source="Table S2, column 32 m/s",
        test=f"Welch's test, p = {p:.2g}, not below 0.05",
        published=mean,
        published_sd=sd,
        **value.fields(),
        **judged(p >= 0.05, "" if p >= 0.05 else "See s2.n_coll.32ms: the rounding of p_rep in Table S1."),
    )


def _distance(found: pd.DataFrame) -> Claim:
    bins = found["r_min_mean"].groupby(level=["range", "delay"]).mean()
    low, high = bins.idxmin(), bins.idxmax()
    return Claim(
        id="fig2.distance",
        statement="mean nearest-neighbour distance over all bins, m",
        source="Fig. 2 (colours only, no number printed)",
        test="no number to agree with",
        **statistics.mean(found["r_min_mean"]).fields(),
        verdict="finding",
        reason=(
            f"From {bins.min():.1f} m (range {low[0]:g} m, delay {low[1]:g} s) to {bins.max():.1f} m "
            f"(range {high[0]:g} m, delay {high[1]:g} s)."
        ),
    )


def _boundary(found: pd.DataFrame) -> Claim:
    """For each delay, the shortest range from which on there is less than one collision per flight."""
    bins = found["n_coll"].groupby(level=["delay", "range"]).mean().unstack()
    edge = {}
    for delay, row in bins.iterrows():
        rare = (row < ONE).to_numpy()[::-1]
        count = int(np.argmin(rare)) if not rare.all() else len(rare)
        edge[delay] = f"{row.index[len(row) - count]:g} m" if count else "none"
    at = bins.columns.get_indexer([320.0], method="nearest")[0]
    return Claim(
        id="fig2.boundary",
        statement=f"largest delay with less than one collision per flight at {bins.columns[at]:g} m, s",
        source="Fig. 2, caption: below 1 s, above 240 m",
        test="where the border lies is a finding",
        published=SAFE_DELAY,
        ours=float(max((d for d, n in bins.iloc[:, at].items() if n < ONE), default=math.nan)),
        runs=len(found),
        verdict="finding",
        reason="Shortest range from which on there is less than one collision per flight, by delay: "
        + ", ".join(f"{d:g} s {r}" for d, r in edge.items())
        + ".",
    )
