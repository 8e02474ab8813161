"""Fig. 1: Algorithm A (Virágh et al. 2014) against Algorithm B at 4 m/s: order, speed, transient, open constants."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from airflock.scenarios import Scenario, load
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018.published import optimum

SIMULATIONS = 10  # behind each number of the caption
CAPTION_B = {"phi_corr": (0.92, 0.002), "phi_vel": (3.83, 0.005)}
# Of A nobody printed r2 (m). The side (m) is that of Table S2; 500 is the arena whose walls are 250 m from its centre.
R2, SIDES = (0.0, 5.0, 10.0, 15.0, 20.0), (250.0, 400.0, 500.0)
D_WALL = (10.0, 25.0)  # m, width of the walls' ramp, which is not printed either
DELAYS = (0.0, 0.05, 0.1, 0.2, 0.4, 1.0)  # s
AT = (5.0, 250.0)  # a point of the map beside the one that was chosen
AT_A = "algorithm A, 4 m/s, r2 = r0/2 and a side of 250 m"
AT_MAP = f"algorithm A, 4 m/s, r2 = {AT[0]:g} m and a side of {AT[1]:g} m"
SHARE = 0.8  # of the long-time correlation that ends the transient
SMOOTH = 5.0  # s, moving mean of phi_corr before it is compared with that share


@dataclass(frozen=True)
class Data:
    """What was flown.

    a, b   : courses over time of each flight; early: A with a delay of 0.1 s; scores: of more flights
    points : map over r2 and the side; delays: sweep of the delay
    """

    a: list[pd.DataFrame]
    b: list[pd.DataFrame]
    early: list[pd.DataFrame]
    scores: pd.DataFrame
    points: pd.DataFrame
    delays: pd.DataFrame


def algorithm_a(settings: dict[str, float] | None = None) -> Scenario:
    """Algorithm A at 4 m/s."""
    return load("viragh_2014/4ms", settings)


def fly(flights: Flights) -> Data:
    """Courses of both algorithms, the map over r2 and the side, and a sweep of the delay."""
    few = flights.count(SIMULATIONS, 4)
    sides = SIDES[:1] if flights.quick else SIDES
    points = {(r, side): algorithm_a({"model.r2_frict": r, "world.side": side}) for r, side in product(R2, sides)}
    delays = {(t, d): algorithm_a({"radio.delay": t, "model.d_wall": d}) for t, d in product(DELAYS, D_WALL)}
    return Data(
        a=flights.courses("Fig. 1, algorithm A", algorithm_a(), 4 * few),
        b=flights.courses("Fig. 1, algorithm B", optimum(4), 4 * few),
        early=flights.courses("Fig. 1, algorithm A, delay 0.1 s", algorithm_a({"radio.delay": 0.1}), few),
        scores=flights.score("Fig. 1, scores", {"a": algorithm_a(), "b": optimum(4)}, {"a": 4 * few, "b": 2 * few}),
        points=flights.score("Fig. 1, r2 and side of A", points, 4 * few).rename_axis(["r2", "side", "seed"]),
        delays=flights.score("Fig. 1, delay of A", delays, few).rename_axis(["delay", "d_wall", "seed"]),
    )


def transient(course: pd.DataFrame, level: float) -> float:
    """Time (s) at which the smoothed phi_corr first exceeds a level; the whole flight if it never does."""
    times = course.index.to_numpy()
    window = max(1, round(SMOOTH / (times[1] - times[0])))
    smooth = np.convolve(course["phi_corr"], np.ones(window) / window, mode="valid")
    above = np.flatnonzero(smooth > level)
    return float(times[above[0] + window - 1] if above.size else times[-1])


def settled(course: pd.DataFrame) -> float:
    """Long-time mean of phi_corr: the second half of a flight."""
    return float(course["phi_corr"].iloc[len(course) // 2 :].mean())


def measured(data: Data) -> list[Measured]:
    """Everything that is said of Fig. 1."""
    a, b = data.scores.loc["a"], data.scores.loc["b"]
    found = []
    for column, (mean, sd) in CAPTION_B.items():
        value = statistics.mean(b[column])
        note = f"median {b[column].median():.4g}; flights at 4 m/s settle in one of two patterns"
        p = statistics.welch(value, mean, sd, SIMULATIONS)
        found.append(Measured(f"fig1.b.{column}", column, "algorithm B, 4 m/s", value, note, p))
        note = _sweep(data) if column == "phi_corr" else "with the side of Table S2, 250 m"
        found.append(Measured(f"fig1.a.kernel.{column}", column, AT_A, statistics.mean(a[column]), note))
    found.append(Measured("fig1.a.phi_vel", "phi_vel", "algorithm A, 4 m/s", statistics.mean(a["phi_vel"])))
    gap = statistics.difference(b["phi_corr"], a["phi_corr"])
    found.append(Measured("fig1.gap.coherence", "phi_corr", "algorithm B less algorithm A, 4 m/s", gap))
    return [*found, *_transients(data), _map(data)]


def _sweep(data: Data) -> str:
    """Describe the effect of the delay."""
    means = data.delays.groupby(level=[0, 1])[list(CAPTION_B)].mean()
    usual = means.xs(algorithm_a().parameters.d_wall, level="d_wall")
    listed = "; ".join(f"{t:g} s: {row.phi_corr:.2f}, {row.phi_vel:.2f} m/s" for t, row in usual.iterrows())
    return f"by delay (phi_corr, phi_vel): {listed}"


def _inside(row: pd.Series) -> bool:
    printed = algorithm_a().published
    return all(abs(row[c] - printed[c][0]) <= (printed[c][1] or 0.0) for c in CAPTION_B)


def _transients(data: Data) -> list[Measured]:
    times = {name: [transient(c, SHARE * settled(c)) for c in getattr(data, name)] for name in ("a", "b", "early")}
    listed = ", ".join(
        f"{label} {np.median(times[name]):.0f} s"
        for name, label in (("a", "A"), ("early", "A with a delay of 0.1 s"), ("b", "B"))
    )
    note = f"medians, each against its own long-time mean: {listed}"
    at = f"algorithm B, until {SHARE:g} of its long-time mean"
    apart = f"algorithm A less algorithm B, each until {SHARE:g} of its long-time mean"
    return [
        Measured("fig1.transient", "transient", at, statistics.mean(times["b"]), note),
        Measured("fig1.gap.transient", "transient", apart, statistics.difference(times["a"], times["b"]), note),
    ]


def _map(data: Data) -> Measured:
    """List the map over r2 and the side, and where both printed numbers come out."""
    points = data.points.groupby(level=[0, 1])[list(CAPTION_B)].mean()
    listed = "; ".join(
        f"side {side:g} m: "
        + ", ".join(f"{r:g} m {row.phi_corr:.2f} {row.phi_vel:.2f}" for (r, _), row in rows.iterrows())
        for side, rows in points.groupby(level=1)
    )
    inside = [f"r2 = {r:g} m and side = {side:g} m" for (r, side), row in points.iterrows() if _inside(row)]
    note = (
        f"by r2, phi_corr and phi_vel (m/s): {listed}; both lie in the box of the caption at "
        f"{', '.join(inside) or 'no point'}"
    )
    return Measured("fig1.a.map", "phi_corr", AT_MAP, statistics.mean(data.points.loc[AT]["phi_corr"]), note)
