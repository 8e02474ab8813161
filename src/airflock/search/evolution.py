"""Evolve: a study from its request to its result in one folder, begun or resumed; also validation and sensitivity."""

import hashlib
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from airflock import __version__
from airflock.core import bound_values
from airflock.engine import plan_of
from airflock.recordings import load_recording, replay_recording
from airflock.runs import (
    REQUEST_FILE,
    RESULT_FILE,
    CandidateBatch,
    Executor,
    FlightStore,
    OnProgress,
    ProgressTally,
    ScenarioTask,
    check_timeout,
    check_worker_device,
    differences,
    held_request,
    list_differences,
    make_executor,
    open_folder,
    open_run,
    read_request,
    run_place,
    to_toml_values,
    write_toml_file,
)
from airflock.scenarios import Scenario, load, scenario_variant
from airflock.search.generations import Evaluator, conclude_study, run_search, total_finals, total_flights
from airflock.search.study import (
    Objective,
    Study,
    UserFitness,
    fast_search_keys as fast_keys,
    is_study,
    load_study,
    make_study,
    study_of_request,
)
from airflock.search.study_result import EvolveResult, draw_study, export
from airflock.support import AirflockError, ErrorCollector, StudyError, as_error, atomic


def evolve(
    scenario: str | os.PathLike[str] | Scenario | Study | Sequence[str | os.PathLike[str] | Scenario] | None = None,
    out: str | os.PathLike[str] | None = None,
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
    watch: OnProgress | None = None,
    trust: bool = False,
    fast: bool = False,
    **search_keys: Any,
) -> EvolveResult:
    """Evolve the parameters of a flock, in a folder that survives whatever ends the process.

    Parameters
    ----------
    scenario : str, path, Scenario or Study, several scenarios, or None (PRESET|FILE)
        A preset, a scenario or study file, a Scenario, or a Study. Of a list of presets, files and Scenarios one set
        of numbers is searched that flies in all of them. None continues what the folder holds.
        of numbers is searched that flies in all of them.
    out : str or path (DIR)
        The study's folder.
    resume : bool
        Continue the study in the folder to the identical end; nothing else has to be given but a function `fitness`.
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
    sensitivity : str (METHOD)
        "sobol" or "morris": also measure which parameters matter; table sensitivity.csv.
    watch : callable, optional
        Called with an `airflock.runs.RunProgress` after each flight.
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
    folder = run_place(out)
    errors = ErrorCollector()
    found = errors.read(
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
    errors.read(check_sensitivity_method, sensitivity)
    errors.read(check_timeout, timeout)
    errors.read(check_study_device, device, scheduler)
    errors.raise_errors()
    study = resolve_device(found[0], device)
    open_folder(folder, study, resume=resume)
    executor = study_executor(study, scheduler, threads, timeout)
    return run_study(study, folder, executor, watch, sensitivity=sensitivity)


def resolve_device(study: Study, device: str) -> Study:
    """Return the study for a device: cpu, cuda, or the choice of auto for one generation. Raises if it is missing."""
    check_study_device(device)
    if device == "cpu":
        return study
    from airflock.engine import pick_device

    generation = [study.scenario] * study.whole("population") * study.whole("seeds")
    return replace(study, device=pick_device(generation, device, precision=int(study.search.precision)))


def study_executor(
    study: Study, scheduler: str | None = None, threads: int | None = None, timeout: float | None = None
) -> Executor:
    """Make the executor of a study: threads of this process, or the workers of a dask scheduler."""
    return make_executor(study_tasks(study), scheduler=scheduler, threads=threads, timeout=timeout)


def study_plan(study: Study) -> str:
    """Return in words what a study flies: its search, and about how much of finals."""
    runs = study.whole("restarts") + 1
    search = f"{study.whole('generations')} generations of {study.whole('population')} candidates"
    times = f", {runs} times" if runs > 1 else ""
    return f"plan: {total_flights(study):,} flights ({search}{times}), then about {total_finals(study):,} of finalists"


def study_tasks(study: Study) -> list[ScenarioTask]:
    """Return how flights of each scenario of a study are scored."""
    return [ScenarioTask(scenario, int(study.search.precision), study.device) for scenario in study.scenarios]


def run_study(
    study: Study,
    folder: Path,
    executor: Executor,
    on_progress: OnProgress | None = None,
    *,
    sensitivity: str = "",
    say: Callable[[str], None] | None = None,
) -> EvolveResult:
    """Search and conclude in a folder that `open_folder` has accepted; close the executor.

    sensitivity : a method, "" for that of an earlier call
    say         : takes the plan of flights, once the folder and the workers are there
    """
    if sensitivity:
        open_folder(folder, study, also={"sensitivity": sensitivity})
    elif (folder / REQUEST_FILE).is_file():  # a folder of one's own may hold flights alone
        sensitivity = (read_request(folder, study.kind) or {}).get("also", {}).get("sensitivity", "")
    with open_run(folder, executor) as store:
        if say is not None:
            say(study_plan(study))
        centres = run_search(study, store, executor, on_progress)
        result = conclude_study(study, store, executor, centres, folder, on_progress)
        if sensitivity:
            shares = run_sensitivity(study, store, executor, method=sensitivity, on_progress=on_progress)
            atomic.write_file(folder / "sensitivity.csv", shares.to_csv(index=False))
        if store.landed or not (folder / RESULT_FILE).is_file():
            export(store, folder, study.labels)
            draw_study(study, store, result, folder)
        # last: a folder with a result is complete
        comment = "What the study found; parameters and ranges in SI units."
        write_toml_file(folder / RESULT_FILE, result.document(), comment)
        return result


def evolve_request(
    scenario: Any,
    settings: Mapping[str, Any] | None = None,
    search_keys: Mapping[str, Any] | None = None,
    limit: str | Sequence[str] = (),
    *,
    fast: bool = False,
    folder: Path | None = None,
    fitness: UserFitness | None = None,
    **others: Any,
) -> tuple[Study, str]:
    """Make a study by `study_from_request`, which takes the other arguments; a resumed one as its folder holds it.

    scenario : None for what the folder holds
    folder   : of a study to resume; what this call gives wins, so that `open_folder` can compare
    Returns the study, and a note of what is otherwise in its files and options now.
    """
    limits = [limit] if isinstance(limit, str) else list(limit)
    keys = fast_keys(search_keys or {}, limits=bool(limits)) if fast else dict(search_keys or {})
    if scenario is None:
        beside = {key: value for key, value in others.items() if key not in ("fitness", "trust")}
        held, given = held_request(folder, Study.kind, beside), None
    else:
        found = None if folder is None else read_request(folder, Study.kind)
        given = study_from_request(scenario, settings, search_keys=keys, limit=limits, fitness=fitness, **others)
        if found is None or isinstance(scenario, Study) or found.get("airflock") != __version__:
            return given, ""
        held = found
    objectives: tuple[Objective, ...] | None = None if fitness is None else (own_objective(fitness),)
    if given is not None and (others.get("objective") or any(objective.own for objective in given.objectives)):
        objectives = given.objectives
    changes: dict[str, Any] = {"settings": settings, "search": keys, "limits": limits, "objectives": objectives}
    with as_error(folder or "", StudyError):
        study = study_of_request(held, given, **changes, trust=bool(others.get("trust")))
    study = replace(study, space=given.space) if given is not None and others.get("space") else study
    changed = [] if given is None else differences(to_toml_values(study.document()), to_toml_values(given.document()))
    return study, f"goes on with what {folder} holds: {list_differences(changed)}" if changed else ""


def study_from_request(
    what: str | os.PathLike[str] | Scenario | Study | Sequence[str | os.PathLike[str] | Scenario],
    settings: Mapping[str, Any] | None = None,
    space: Mapping[str, Any] | None = None,
    objective: Mapping[str, Any] | None = None,
    fitness: UserFitness | None = None,
    search_keys: Mapping[str, Any] | None = None,
    over_scenarios: str | None = None,
    limit: str | Sequence[str] = (),
    *,
    trust: bool = False,
    fast: bool = False,
) -> Study:
    """Make the study of a call of `evolve` from its arguments."""
    if isinstance(what, Study):
        requested: dict[str, Any] = {"settings": settings, "space": space, "objective": objective, "fitness": fitness}
        requested |= {"limit": limit, "over_scenarios": over_scenarios, "fast": fast}
        beside = [*(key for key, value in requested.items() if value), *(search_keys or {})]
        if beside:
            said = ", ".join(beside)
            raise StudyError(f"{said}: a Study object sets this itself; give a preset, a file or a Scenario")
        return what
    search_keys = fast_keys(search_keys or {}, limits=bool(limit)) if fast else search_keys
    limits = [limit] if isinstance(limit, str) else list(limit)
    given = {"space": space, "objective": objective, "over_scenarios": over_scenarios}
    tables = {key: value for key, value in given.items() if value is not None}
    if isinstance(what, Scenario) or (isinstance(what, Sequence) and not isinstance(what, str)):
        several = [what] if isinstance(what, Scenario) else list(what)
        scenarios = [scenario_variant(each, settings, trust=trust) for each in several]
        if not scenarios:
            raise StudyError("evolve is given an empty list of scenarios")
        where = ", ".join(scenario.name for scenario in scenarios)
        study = make_study(tables, where, search=search_keys, scenario=scenarios, limits=limits, trust=trust)
    else:
        study = load_study(what, settings=settings, search=search_keys, tables=tables, limits=limits, trust=trust)
    return study if fitness is None else replace(study, objectives=(own_objective(fitness),))


def own_objective(fitness: UserFitness) -> Objective:
    """Return the aim of a function of the user's own."""
    return Objective(getattr(fitness, "__name__", "fitness"), own=fitness, text=_text_of(fitness))


def _text_of(fitness: Any) -> str:
    """Return a hash of the code of a function and of what it refers to; it is equal in every process."""
    text = b""
    for function, values in bound_values([fitness]).items():
        code = function.__code__
        # Nested code objects print their address: they would change the hash in every process.
        constants = [constant for constant in code.co_consts if not hasattr(constant, "co_code")]
        numbers = repr({k: v for k, v in values.items() if not isinstance(v, type)}) if values else ""
        text += code.co_code + repr((code.co_names, constants)).encode() + numbers.encode()
    return hashlib.sha256(text).hexdigest()[:12] if text else ""


def check_sensitivity_method(sensitivity: str) -> None:
    """Refuse an unknown method of sensitivity analysis."""
    if sensitivity and sensitivity not in SENSITIVITY_METHODS:
        raise StudyError(f"sensitivity = {sensitivity!r} is none of {', '.join(SENSITIVITY_METHODS)}")


def check_study_device(device: str, scheduler: str | None = None) -> None:
    """Refuse an unknown device, and any device but the CPU for workers of a scheduler."""
    check_worker_device(scheduler, device)
    if device not in ("cpu", "cuda", "auto"):
        raise StudyError(f"device = {device!r} is none of cpu, cuda, auto")


class ValidationReport(NamedTuple):
    """Summary of a valid file in one sentence, with notes for the reader."""

    verdict: str
    notes: tuple[str, ...]


def validate(
    name: str | os.PathLike[str], settings: Mapping[str, Any] | None = None, law: Any = None, *, trust: bool = False
) -> ValidationReport:
    """Check a scenario, a study or a recording; a recording is flown again and its bits are compared.

    Parameters
    ----------
    name : str or path (FILE...)
        A preset, a scenario file, a study file, or a recording (.nc).
    settings : mapping, optional
        Keys to change before the check. Of a recording only {"metrics.kind": "mine.py"} and the like: the file of what
        it was flown with and does not hold.
    law : optional
        A flocking law of your own, or one by its name or file, instead of the file's; for a recording that was flown
        with a law of its own, that law.
    trust : bool
        Whether code that the file names may run.

    Returns
    -------
    Valid
        Verdict and notes.

    Raises
    ------
    AirflockError
        With one line for each error: key, value, unit, allowed range, and the nearest right key.

    Examples
    --------
    >>> import airflock
    >>> airflock.validate("vasarhelyi_2018/4ms").verdict
    'valid; vasarhelyi_2018, 100 agents, 600 s'
    >>> airflock.validate("vasarhelyi_2018/4ms", {"radio.delay": -1.0})
    Traceback (most recent call last):
    airflock.support.errors.ScenarioError: vasarhelyi_2018/4ms: radio.delay = -1 s lies outside [0, 30] s
    """
    text = str(name)
    if text.lower().endswith(".nc"):
        same, differences = replay_recording(load_recording(name), law, settings, trust=trust)
        if not same:
            listed = "".join(f"\n{text}: {line}" for line in differences)
            reason = "see below" if differences else "although nothing relevant differs"
            raise AirflockError(f"{text}: flown again, the positions differ, {reason}{listed}")
        return ValidationReport("flown again with the same bits", tuple(differences))
    if is_study(text):
        if law is not None:
            raise AirflockError(f"{text}: is a study; --law is for scenarios and recordings")
        study = load_study(text, settings=settings, trust=trust)
        for scenario in study.scenarios:
            plan_of(scenario)
        where = ", ".join(study.labels)
        what = f"{len(study.space.axes)} parameters of {where} vary"
        return ValidationReport(f"valid study; {what}; begin it with airflock evolve {text} --out DIR", ())
    found = load(name, settings, law, trust=trust)
    plan_of(found)  # probes the rules
    return ValidationReport(
        f"valid; {found.model.name}, {found.agents} agents, {found.flight.duration:g} s", found.notes
    )


SENSITIVITY_METHODS = ("sobol", "morris")


def run_sensitivity(
    study: Study,
    store: FlightStore,
    executor: Executor,
    *,
    method: str = "morris",
    samples: int = 16,
    on_progress: OnProgress | None = None,
) -> pd.DataFrame:
    """Measure the effect of each parameter on the first objective over the study's whole space.

    samples : base samples: sobol takes samples · (axes + 2) candidates, samples a power of two;
              morris samples · (axes + 1), in trajectories
    Returns one row a parameter. sobol: S1, ST (shares of the variance, alone and with all
    interactions) and their 95 % half-widths; morris: mu_star (mean absolute effect over the range),
    its half-width, and sigma (its spread).
    """
    try:
        from SALib.analyze import morris as analyse_morris, sobol as analyse_sobol
        from SALib.sample import morris as sample_morris, sobol as sample_sobol
    except ModuleNotFoundError as error:
        raise StudyError("sensitivity needs SALib: pip install 'airflock[evolve]'") from error
    n = len(study.space.axes)
    problem: Any = {"num_vars": n, "names": list(study.space.keys), "bounds": [[0.0, 1.0]] * n}
    seed = study.whole("seed")
    if method == "sobol":
        points = sample_sobol.sample(problem, samples, calc_second_order=False, seed=seed)
    else:
        points = sample_morris.sample(problem, samples, seed=seed)
    batch = CandidateBatch(method, samples, 0)
    k = study.whole("seeds")
    # Common random numbers: otherwise the chance of single flights would pass for an effect of a
    # parameter.
    seeds = [[study.seed(3, j) for j in range(k)]] * len(points)
    tally = ProgressTally("sensitivity", len(points) * k * len(study.scenarios), on_progress, method)
    rows = Evaluator(study, store, executor, tally.note).evaluate(batch, np.asarray(points), seeds=seeds)
    values = np.array([np.nan if row[0] is None else row[0] for row in rows])
    if not np.isfinite(values).any():
        raise StudyError("every candidate failed: no sensitivity")
    # SALib takes no gaps: a failed candidate counts as the worst value seen.
    values[~np.isfinite(values)] = np.nanmin(values) if study.objectives[0].maximise else np.nanmax(values)
    if method == "sobol":
        found = analyse_sobol.analyze(problem, values, calc_second_order=False, seed=seed)
        columns: tuple[str, ...] = ("S1", "S1_conf", "ST", "ST_conf")
    else:
        found = analyse_morris.analyze(problem, np.asarray(points), values, seed=seed)
        columns = ("mu_star", "mu_star_conf", "sigma")
    return pd.DataFrame({"parameter": list(study.space.keys), **{c: np.asarray(found[c], float) for c in columns}})
