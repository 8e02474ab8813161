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
# constants of A that nobody printed: width of the wall's ramp (m), speed of the shill agents (m/s), strength
D_WALL, V_SHILL, C_SHILL = (2.0, 10.0, 25.0, 50.0), (4.0, 8.0, 13.6), (1.0, 3.0)
DELAYS = (0.0, 0.05, 0.1, 0.2, 0.4, 1.0)  # s
SHARE = 0.8  # of the long-time correlation that ends the transient
SMOOTH = 5.0  # s, moving mean of phi_corr before it is compared with that share


@dataclass(frozen=True)
class Data:
    """What was flown.

    a, b   : courses over time of each flight; early: A with a delay of 0.1 s; scores: of more flights
    points : map over the open constants; delays: sweep of the delay
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
    """Courses of both algorithms, the map over the open constants, and a sweep of the delay."""
    few = flights.count(SIMULATIONS, 4)
    walls = (D_WALL[1:3], V_SHILL[:1], C_SHILL[:1]) if flights.quick else (D_WALL, V_SHILL, C_SHILL)
    points = {
        (d, v, c): algorithm_a({"model.d_wall": d, "model.v_shill": v, "model.c_shill": c})
        for d, v, c in product(*walls)
    }
    delays = {(t, d): algorithm_a({"radio.delay": t, "model.d_wall": d}) for t, d in product(DELAYS, D_WALL[1:3])}
    return Data(
        a=flights.courses("Fig. 1, algorithm A", algorithm_a(), few),
        b=flights.courses("Fig. 1, algorithm B", optimum(4), few),
        early=flights.courses("Fig. 1, algorithm A, delay 0.1 s", algorithm_a({"radio.delay": 0.1}), few),
        scores=flights.score("Fig. 1, scores", {"a": algorithm_a(), "b": optimum(4)}, 2 * few),
        points=flights.score("Fig. 1, open constants of A", points, few).rename_axis(
            ["d_wall", "v_shill", "c_shill", "seed"]
        ),
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
        found.append(
            Measured(f"fig1.a.{column}", column, "algorithm A, 4 m/s", statistics.mean(a[column]), _sweep(data))
        )
    return [*found, _transient(data), _open(data)]


def _sweep(data: Data) -> str:
    """What the delay does, which the caption does not name."""
    means = data.delays.groupby(level=[0, 1])[list(CAPTION_B)].mean()
    usual = means.xs(algorithm_a().parameters.d_wall, level="d_wall")
    listed = "; ".join(f"{t:g} s: {row.phi_corr:.2f}, {row.phi_vel:.2f} m/s" for t, row in usual.iterrows())
    inside = [f"{t:g} s (d_wall {d:g} m)" for (t, d), row in means.iterrows() if _inside(row)]
    return (
        f"with the delay of Table S5 A does not flock. By delay (phi_corr, phi_vel): {listed}; both printed numbers "
        f"lie within one SD at {', '.join(inside) or 'no delay'}, and nothing in the text supports such a delay"
    )


def _inside(row: pd.Series) -> bool:
    printed = algorithm_a().published
    return all(abs(row[c] - printed[c][0]) <= (printed[c][1] or 0.0) for c in CAPTION_B)


def _transient(data: Data) -> Measured:
    times = {name: [transient(c, SHARE * settled(c)) for c in getattr(data, name)] for name in ("a", "b", "early")}
    listed = ", ".join(
        f"{label} {np.median(times[name]):.0f} s"
        for name, label in (("a", "A"), ("early", "A with a delay of 0.1 s"), ("b", "B"))
    )
    note = f"medians, each against its own long-time mean: {listed}; A's own is so low that noise reaches it"
    at = f"algorithm B, until {SHARE:g} of its long-time mean"
    return Measured("fig1.transient", "transient", at, statistics.mean(times["b"]), note)


def _open(data: Data) -> Measured:
    """The best of the sets of constants that nobody printed."""
    points = data.points.groupby(level=[0, 1, 2])[list(CAPTION_B)].mean()
    inside = int(points.apply(_inside, axis=1).sum())
    best = points["phi_corr"].idxmax()
    note = (
        f"{inside} of {len(points)} sets lie inside both printed SDs; the best one is d_wall = {best[0]:g} m, v_shill "
        f"= {best[1]:g} m/s, c_shill = {best[2]:g}; phi_vel from {points['phi_vel'].min():.2f} to "
        f"{points['phi_vel'].max():.2f} m/s"
    )
    value = statistics.mean(data.points.loc[best]["phi_corr"])
    return Measured("fig1.a.open", "phi_corr", "algorithm A, best set of open constants", value, note)
