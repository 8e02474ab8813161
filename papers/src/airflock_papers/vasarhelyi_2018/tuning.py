"""Tables S3 and S4 and the Results: what each parameter is said to do, every sentence flown as a paired experiment.

A case is a preset with one change; both sides fly the same seeds, and the same starts and noise with them. Flights are
kept in Airflock's cache folder case by case, so that a run that was stopped goes on where it was.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from xarray import Dataset

from airflock.engine import score_flights
from airflock.recordings import provenance, simulate
from airflock.scenarios import Scenario, load
from airflock.support import atomic, cache_folder, run_in_threads
from airflock_papers import statistics
from airflock_papers.claims import Measured
from airflock_papers.flights import Flights

SPEEDS = (4, 6, 8)
SEEDS, RECORDED = 40, 10  # flights scored, and of these recorded for the measures below
SETTLED = 100.0  # s, from which on the measures of a recording begin
SMOOTH = 5  # samples (1 s): a moving mean that leaves the white outer noise out
SCORED = ("n_coll", "r_min_mean", "r_min", "phi_corr", "phi_vel", "fitness")


class Case(NamedTuple):
    """A set of parameters with a change: preset with the speed in braces, keys to set, keys to multiply."""

    preset: str
    settings: Mapping[str, Any] = {}
    factors: Mapping[str, float] = {}

    def scenario(self, v: int) -> Scenario:
        """Scenario at one speed (m/s)."""
        base = load(f"vasarhelyi_2018/{self.preset.format(v=v)}")
        scaled = {k: f * getattr(base.parameters, k.removeprefix("model.")) for k, f in self.factors.items()}
        return load(f"vasarhelyi_2018/{self.preset.format(v=v)}", {**self.settings, **scaled})


S1, S4 = "{v}ms", "real_{v}ms"
# free space, the first minute
OPEN = {"world.arena": "none", "world.walls": "every_edge", "start.kind": "box", "start.side": 250.0, "duration": 60.0}
CASES = {
    "s1": Case(S1),
    "r0_rep": Case(S1, factors={"model.r0_rep": 1.25}),
    "p_rep": Case(S1, factors={"model.p_rep": 2.0}),
    "open": Case(S1, OPEN),
    "open, p_rep": Case(S1, OPEN, {"model.p_rep": 2.0}),
    "c_frict": Case(S1, {"model.c_frict": 0.5}),
    "v_frict 0": Case(S1, {"model.v_frict": 0.0}),
    "v_frict large": Case(S1, factors={"model.v_frict": 10.0}),
    "braking": Case(S1, {"model.p_frict": 1.0, "model.a_frict": 3.0}),
    "a_frict, short": Case(S4, {"model.r0_frict": 0.0}),
    "a_frict high, short": Case(S4, {"model.r0_frict": 0.0, "model.a_frict": 30.0}),
    "r0_shill": Case(S1, {"model.r0_shill": 20.0}),
    "v_shill": Case(S1, factors={"model.v_shill": 1.5}),
    "cap": Case(S1, {"model.limit": "cap"}),
    "cap, v_max": Case(S1, {"model.limit": "cap"}, {"model.v_max": 2.0}),
    "s4": Case(S4),
    "s4, r0_rep of s1": Case(S4, {"model.r0_rep": 25.6}),
    "s4, p_rep of s1": Case(S4, factors={"model.p_rep": 0.5}),
    "s4, c_frict of s1": Case(S4, {"model.c_frict": 0.05}),
    "s4, r0_shill of s1": Case(S4, {"model.r0_shill": 0.0}),
}
# statement: the changed case, what it is compared with, and the measures in which they differ
PAIRS = {
    "r0_rep": ("r0_rep", "s1", ("r_min_mean", "n_coll")),
    "p_rep": ("p_rep", "s1", ("r_min_mean", "oscillation", "phi_corr")),
    "p_rep.open": ("open, p_rep", "open", ("n_coll",)),
    "c_frict": ("c_frict", "s1", ("oscillation", "agility")),
    "v_frict": ("s1", "v_frict 0", ("agility",)),
    "v_frict.large": ("v_frict large", "s1", ("phi_corr",)),
    "braking": ("braking", "s1", ("fitness",)),
    "a_frict": ("a_frict high, short", "a_frict, short", ("n_coll",)),
    "r0_shill": ("r0_shill", "s1", ("reach",)),
    "v_shill": ("v_shill", "s1", ("reach",)),
    "v_max": ("cap, v_max", "cap", ("top_speed",)),
    "s4.r0_rep": ("s4", "s4, r0_rep of s1", ("r_min_mean", "n_coll")),
    "s4.p_rep": ("s4", "s4, p_rep of s1", ("n_coll", "r_min_mean")),
    "s4.c_frict": ("s4", "s4, c_frict of s1", ("oscillation", "agility")),
    "s4.r0_shill": ("s4", "s4, r0_shill of s1", ("reach",)),
}
ONLY = {"s4.r0_rep": (4,), "s4.r0_shill": (6, 8)}  # speeds, where Tables S1 and S4 differ as the sentence says

Flown = dict[tuple[str, int], pd.DataFrame]


def measures(recording: Dataset) -> dict[str, float]:
    """Measures of a recording from SETTLED on, white noise smoothed out.

    oscillation : m/s, RMS of the velocities relative to the flock's mean
    agility     : 1/s, 95 % quantile of the mean velocity's acceleration over the flocking speed
    reach       : m, mean over agents of the 99 % quantile of the larger of |x| and |y|
    top_speed   : m/s, 99 % quantile of the speeds
    """
    late = recording.sel(time=slice(SETTLED, None))
    velocity = late["velocity"].values[:, :, 0, :].astype(np.float64)  # (time, axis, agent)
    position = late["position"].values[:, :, 0, :]
    if len(velocity) <= SMOOTH:
        return {}
    sums = np.cumsum(velocity, axis=0)
    smooth = (sums[SMOOTH:] - sums[:-SMOOTH]) / SMOOTH
    mean = smooth.mean(axis=2)
    dt = float(late["time"].values[1] - late["time"].values[0])
    pace = float(np.linalg.norm(smooth, axis=1).mean())
    turn = np.linalg.norm(np.gradient(mean, dt, axis=0), axis=1)
    return {
        "oscillation": float(np.sqrt(((smooth - mean[:, :, None]) ** 2).sum(axis=1).mean())),
        "agility": float(np.quantile(turn, 0.95)) / pace,
        "reach": float(np.quantile(np.abs(position).max(axis=1), 0.99, axis=0).mean()),
        "top_speed": float(np.quantile(np.linalg.norm(smooth, axis=1), 0.99)),
    }


def fly(flights: Flights) -> Flown:
    """Order parameters and measures of every case and speed by seed."""
    scored = flights.count(SEEDS, 6)
    recorded = flights.seeds or min(scored, RECORDED)
    needed = {
        (case, v) for name, v, column in _claims()
        if flights.wanted is None or _id(name, column, v) in flights.wanted
        for case in PAIRS[name][:2]
    }  # fmt: skip
    order = ((name, v) for name in CASES for v in SPEEDS)
    return {(name, v): _kept(flights, name, v, scored, recorded) for name, v in order if (name, v) in needed}


def _claims() -> Iterator[tuple[str, int, str]]:
    """Pair, speed (m/s) and measure of every claim."""
    for name, (_, _, columns) in PAIRS.items():
        yield from ((name, v, column) for v in ONLY.get(name, SPEEDS) for column in columns)


def _id(name: str, column: str, v: int) -> str:
    return f"tuning.{name}.{column}.{v}ms"


def _kept(flights: Flights, name: str, v: int, scored: int, recorded: int) -> pd.DataFrame:
    scenario = flights.as_changed(CASES[name].scenario(v))
    text = f"{json.dumps(provenance(scenario, 0, 32))}\n{scored} {recorded}"  # whatever decides the bits
    folder = cache_folder() / "papers" / "vasarhelyi_2018" / "tuning"
    path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.csv"
    if path.is_file():
        return pd.read_csv(path, index_col=0)
    title = f"Tables S3 and S4, {name}, {v} m/s"
    count = flights.counter(title, scored)
    scores = score_flights([scenario] * scored, list(range(scored)), threads=flights.threads, on_done=count)
    jobs = [lambda seed=seed: measures(simulate(scenario, seed)) for seed in range(recorded)]
    found = pd.DataFrame(scores)[list(SCORED)].join(
        pd.DataFrame(list(run_in_threads(jobs, flights.threads, lambda: None)))
    )
    folder.mkdir(parents=True, exist_ok=True)
    atomic.write_file(path, found.to_csv())
    return found


def measured(flown: Flown) -> list[Measured]:
    """Paired differences, changed less unchanged, at every speed at which both were flown."""
    found = []
    for name, v, column in _claims():
        changed, base, _ = PAIRS[name]
        if not {(changed, v), (base, v)} <= set(flown):
            continue
        a, b = (flown[case, v][column] for case in (changed, base))
        note = f"{a.mean():.4g} with {changed}, {b.mean():.4g} with {base}"
        at = f"{v} m/s, {changed}, less {base}"
        found.append(Measured(_id(name, column, v), column, at, statistics.mean((a - b).dropna()), note))
    return found
