"""Sensitivity: which parameters decide the fitness, by the package SALib: Sobol's indices or Morris' screening."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from airflock.runs import CandidateBatch, Executor, FlightStore
from airflock.search.evaluator import Evaluator
from airflock.search.study import Study
from airflock.support import StudyError

SENSITIVITY_METHODS = ("sobol", "morris")


def run_sensitivity(
    study: Study,
    store: FlightStore,
    executor: Executor,
    *,
    method: str = "morris",
    samples: int = 16,
    on_flight: Callable[[bool], None] | None = None,
) -> pd.DataFrame:
    """Effect of each parameter on the first objective over the study's whole space.

    samples : base samples: sobol takes samples · (axes + 2) candidates, samples a power of two; morris
              samples · (axes + 1), in trajectories
    Returns one row a parameter. sobol: S1, ST (shares of the variance, alone and with all interactions) and their 95 %
    half-widths; morris: mu_star (mean absolute effect over the range), its half-width, and sigma (its spread).
    """
    try:
        from SALib.analyze import morris as analyse_morris, sobol as analyse_sobol
        from SALib.sample import morris as sample_morris, sobol as sample_sobol
    except ModuleNotFoundError as fault:
        raise StudyError("sensitivity needs SALib: pip install 'airflock[evolve]'") from fault
    if method not in SENSITIVITY_METHODS:
        raise StudyError(f"method = {method!r} is none of {', '.join(SENSITIVITY_METHODS)}")
    n = len(study.space.axes)
    problem: Any = {"num_vars": n, "names": list(study.space.keys), "bounds": [[0.0, 1.0]] * n}
    seed = study.whole("seed")
    if method == "sobol":
        points = sample_sobol.sample(problem, samples, calc_second_order=False, seed=seed)
    else:
        points = sample_morris.sample(problem, samples, seed=seed)
    batch = CandidateBatch(method, samples, 0)
    k = study.whole("seeds")
    seeds = [[study.seed(3, j) for j in range(k)]] * len(points)  # common: chance must not pass for an effect
    rows = Evaluator(study, store, executor, on_flight).evaluate(batch, np.asarray(points), seeds=seeds)
    values = np.array([np.nan if row[0] is None else row[0] for row in rows])
    if not np.isfinite(values).any():
        raise StudyError("every candidate failed: no sensitivity")
    values[~np.isfinite(values)] = np.nanmin(values) if study.objectives[0].maximise else np.nanmax(values)
    if method == "sobol":
        found = analyse_sobol.analyze(problem, values, calc_second_order=False, seed=seed)
        columns: tuple[str, ...] = ("S1", "S1_conf", "ST", "ST_conf")
    else:
        found = analyse_morris.analyze(problem, np.asarray(points), values, seed=seed)
        columns = ("mu_star", "mu_star_conf", "sigma")
    return pd.DataFrame({"parameter": list(study.space.keys), **{c: np.asarray(found[c], float) for c in columns}})
