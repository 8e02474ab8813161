"""The public door: a study from beginning to end in one folder, begun or continued."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.runs import (
    DaskCluster,
    Executor,
    FlightStore,
    Interrupted,
    ScoreFunction,
    ThreadExecutor,
    check_timeout,
    open_folder,
    program_versions,
    remove_unfinished,
    with_parameters,
)
from airflock.scenarios import Scenario
from airflock.search.fitness import UserFitness
from airflock.search.pictures import draw_study
from airflock.search.request import check_sensitivity_method, check_study_device, evolve_request
from airflock.search.result import EvolveResult
from airflock.search.search import OnSearchProgress, run_search
from airflock.search.sensitivity import run_sensitivity as sensitivities
from airflock.search.study import Study
from airflock.search.winner import conclude_study
from airflock.support import ErrorCollector, atomic, expand_path


def evolve(
    scenario: str | os.PathLike[str] | Scenario | Study | Sequence[str | os.PathLike[str] | Scenario],
    out: str | os.PathLike[str],
    *,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    space: Mapping[str, Any] | None = None,
    objective: Mapping[str, Any] | None = None,
    fitness: UserFitness | None = None,
    limit: str | Sequence[str] = (),
    over_scenarios: str | None = None,
    scheduler: str | None = None,
    threads: int | None = None,
    device: str = "cpu",
    timeout: float | None = None,
    sensitivity: str = "",
    watch: OnSearchProgress | None = None,
    trust: bool = False,
    fast: bool = False,
    **search_keys: Any,
) -> EvolveResult:
    """Evolve the parameters of a flock, in a folder that survives whatever ends the process.

    Parameters
    ----------
    scenario : str, path, Scenario or Study, or several scenarios
        A preset, a scenario or study file, a Scenario, or a Study. Of a list of presets, files and Scenarios one set
        of numbers is searched that flies in all of them.
    out : str or path
        The study's folder.
    resume : bool
        Continue the study in the folder to the identical end. What is not asked for again is as in the first call.
    settings : mapping, optional
        Keys of the scenario to change, such as {"duration": 300.0}.
    space : mapping, optional
        Sections of parameters that vary, as in a study file: {"model": {"p_rep": {"low": 0.0, "high": 1.0}}}.
    objective : mapping, optional
        {"maximise": ..., "minimise": ..., "over_seeds": ..., "quantile": ...}, names of order parameters.
    fitness : callable, optional
        Instead of it, a function of your own: order parameters of one flight → number, more is better.
    limit : str or sequence of str
        What may happen how rarely, such as "r_min<3 at 0.01/h", as `airflock.certify` takes it. Candidates that look as
        if they kept all limits, with a reserve of ten (`reserve`), come before all others, whatever their fitness; each
        flies twice unless `seeds` says otherwise.
    over_scenarios : str, optional
        "mean" or "worst": what counts of the fitness in several scenarios; by default the mean.
    scheduler : str, optional
        Address of a dask scheduler; by default flights fly in this process.
    threads : int, optional
        Flights side by side; by default one per core.
    device : str
        cpu, cuda, or auto.
    timeout : float, optional
        Time that a flight may take on a dask worker, s.
    sensitivity : str
        "sobol" or "morris": also fly what tells which parameters matter; table sensitivity.csv.
    watch : callable, optional
        Called with a Progress after each flight.
    trust : bool
        Whether code that files name may run: a law, fitness functions.
    fast : bool
        A third of the flights: a small population, with ever more flights of each candidate (docs/evolve.md).
    **search_keys
        Keys of the table [search]: algorithm, population, generations, seeds, seed, restarts, ...

    Returns
    -------
    Result
        The optimum, its fitness on fresh seeds, and working ranges; the same stands in the folder as result.toml,
        best.toml, tables and pictures.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario, the study or its folder cannot be used.
    Interrupted
        At Ctrl-C; what has flown is kept.

    Notes
    -----
    CMA-ES is that of pycma; stages after the search and their reasons are on the page "Evolving a flock".

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> vary = {"model": {"p_rep": {"low": 0.0, "high": 1.0}}}
    >>> few = {"population": 4, "generations": 2, "pool": 2, "top": 1, "final_seeds": 2}
    >>> result = airflock.evolve(short, "study", space=vary, **few)
    >>> 0.0 <= result.parameters["model.p_rep"] <= 1.0
    True
    """
    folder = expand_path(out)
    asked = ErrorCollector()
    found = asked.read(
        evolve_request,
        scenario,
        settings,
        search_keys,
        limit,
        fast=fast,
        folder=folder if resume else None,
        space=space,
        objective=objective,
        fitness=fitness,
        over_scenarios=over_scenarios,
        trust=trust,
    )
    asked.read(check_sensitivity_method, sensitivity)
    asked.read(check_timeout, timeout)
    asked.read(check_study_device, device, scheduler)
    asked.raise_errors()
    study = resolve_device(found[0], device)
    open_folder(folder, study, resume=resume)
    executor = study_executor(study, scheduler, threads, timeout)
    return run_study(study, folder, executor, watch, sensitivity=sensitivity)


def study_score(study: Study, scenario_index: int = 0) -> ScoreFunction:
    """Parameters and a seed → order parameters, for one of the study's scenarios."""
    from airflock.engine import score_flight

    precision = int(study.search.precision)

    def score(parameters: Mapping[str, float], seed: int) -> Mapping[str, Any]:
        return score_flight(with_parameters(study.scenarios[scenario_index], parameters), seed, precision=precision)

    return score


def resolve_device(study: Study, device: str) -> Study:
    """The study for a device: cpu, cuda, or what auto picks for a generation of it. A missing one is one line."""
    check_study_device(device)
    if device == "cpu":
        return study
    from airflock.engine import pick_device

    generation = [study.scenario] * study.population(0) * study.whole("seeds")
    return replace(study, device=pick_device(generation, device, precision=int(study.search.precision)))


def study_executor(
    study: Study, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Who flies: this process, or the workers of a dask scheduler."""
    if study.device != "cpu":
        from airflock.search.batched import BatchExecutor

        return BatchExecutor(study, study.device)
    if scheduler is not None:
        from airflock.search.task import study_tasks

        return DaskCluster(study_tasks(study), scheduler, timeout=timeout)
    from airflock.engine import compile_for
    from airflock.scenarios import uses_all_cores
    from airflock.support import available_cores

    # compiled once, before threads ask for it; a second processor has nothing to do until then
    for scenario in study.scenarios:
        compile_for(scenario, precision=int(study.search.precision))
    alone = any(uses_all_cores(scenario) for scenario in study.scenarios)
    scores = [study_score(study, place) for place in range(len(study.scenarios))]
    return ThreadExecutor(scores[0], 1 if alone else threads or available_cores(), scores[1:])


def run_study(
    study: Study,
    folder: Path,
    executor: Executor,
    on_progress: OnSearchProgress | None = None,
    notify: Callable[[bool], None] | None = None,
    *,
    sensitivity: str = "",
) -> EvolveResult:
    """Search and conclude in a folder that `open_folder` has accepted; closes the executor."""
    try:
        with FlightStore(folder) as store:
            store.begin(program_versions())
            remove_unfinished(folder)
            try:
                centres = run_search(study, store, executor, on_progress)
                result = conclude_study(study, store, executor, centres, folder, notify)
                if sensitivity:
                    shares = sensitivities(study, store, executor, method=sensitivity, on_flight=notify)
                    atomic.write_file(folder / "sensitivity.csv", shares.to_csv(index=False))
            except KeyboardInterrupt as stop:
                raise Interrupted(
                    f"interrupted: {store.count()} flights of the search are stored in {folder}; continue with --resume"
                ) from stop
            draw_study(study, store, result, folder)
            return result
    finally:
        executor.close()
