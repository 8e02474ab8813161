"""Sweeps: order parameters over a grid of values of any keys."""

import hashlib
import itertools
import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd

from airflock import __version__
from airflock.engine import pick_device
from airflock.parts.metrics import reported_values, scalar_names
from airflock.recordings.scores import with_units
from airflock.runs import (
    CandidateBatch,
    Flight,
    ScenarioTask,
    check_worker_device,
    fingerprint,
    held_request,
    make_executor,
    open_folder,
    open_run,
    requested_scenario,
    score_scenarios,
    unpublished,
)
from airflock.scenarios import Scenario, check_seeds, keys_by_last_word, scenario_variant
from airflock.support import (
    ScenarioError,
    StudyError,
    as_error,
    atomic,
    collect_errors,
    expand_path,
    log,
    suggest,
)

ORDER = "polarisation"  # shown where nothing judges flights: the first that a set reports may be a constant speed
MOST_POINTS = 100_000  # of a grid


def sweep(
    scenario: Scenario | str | os.PathLike[str] | None = None,
    over: Mapping[str, Sequence[Any]] | None = None,
    seeds: int | Iterable[int] = 5,
    *,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    trust: bool = False,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = log,
    scheduler: str | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
) -> pd.DataFrame:
    """Fly a scenario over a grid of values, several seeds at each point of the grid.

    Parameters
    ----------
    scenario : Scenario, str or path (PRESET|FILE), optional
        A scenario, or the name of a preset or scenario file; none to continue what a folder holds.
    over : mapping (KEY=VALUES), optional
        Keys and the values that each takes; several keys make a grid. For a command a list KEY=a,b,c or a range
        KEY=low:high:count; repeatable.
    seeds : int or iterable of int
        Number of flights at each point, or their seeds; the same at all points, so that differences are paired.
    settings : mapping, optional
        Keys that are changed at all points.
    law : optional
        A flocking law of your own, or one by its name or file, that flies instead of the file's, as in `airflock.load`.
    trust : bool
        Whether code that the file names may run.
    threads : int, optional
        Flights side by side; by default one per core.
    precision : int
        Bits per number, 32 or 64.
    done : callable, optional
        Called after each flight.
    device : str
        cpu, cuda, python, or auto, which reports its choice to `say`.
    say : callable, optional
        Called with the choice of auto; by default the logger `airflock`.
    scheduler : str, optional
        Address of a dask scheduler whose workers fly, instead of this process.
    out : str or path (DIR), optional
        Folder that keeps every flight as it lands, and the table as result.csv.
    resume : bool
        Continue the sweep in the folder, which holds scenario, grid and seeds.

    Returns
    -------
    pandas.DataFrame
        One row per flight (points times seeds): a column for each key of `over`, the seed, and the order parameters.

    Raises
    ------
    ScenarioError, FlightError, ParameterError, DeviceError, StudyError
        With the errors of all points, before anything flies; if a flight goes wrong; if seeds or device are none that
        there are; if the scheduler does not answer.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> table = airflock.sweep(short, {"radio.delay": [0.0, 0.4, 0.8]}, seeds=2)
    >>> table.shape[0], list(table.columns[:2])
    (6, ['radio.delay', 'seed'])
    >>> table.attrs["units"]["phi_vel"], table.attrs["meanings"]["phi_vel"]
    ('m/s', 'mean speed')
    """
    if scenario is None:
        beside = {"over": over, "settings": settings, "law": law}
        made = resumed_sweep(out if resume else None, trust=trust, **beside)
    else:
        axes = {} if over is None else over  # what is no mapping is refused by its own line, pandas' NA too
        made = make_sweep(scenario, axes, check_seeds(seeds), settings, law, precision, device, trust=trust)
    options = {"threads": threads, "on_done": done, "notify": say}
    return fly_sweep(made, scheduler=scheduler, out=out, resume=resume, **options)


@dataclass(frozen=True)
class Sweep:
    """A grid of scenarios, each flown with the same seeds.

    scenario  : what the points change
    scenarios : one for each of `points`
    device    : cpu, cuda or python; in a folder the choice of auto
    """

    scenario: Scenario
    over: Mapping[str, Sequence[Any]]
    seeds: Sequence[int]
    precision: int
    device: str
    points: Sequence[Mapping[str, Any]]
    scenarios: Sequence[Scenario]
    kind = "sweep"
    also: ClassVar[Mapping[str, Any]] = {}

    def document(self) -> dict[str, Any]:
        """Return the sweep as plain values: the request in its folder."""
        rules = "".join(fingerprint(each, self.precision) for each in self.scenarios)
        return {
            "airflock": __version__,
            "rules": hashlib.sha256(rules.encode()).hexdigest()[:12],
            "precision": self.precision,
            "device": self.device,
            "name": self.scenario.name,
            "seeds": list(self.seeds),
            "over": {key: list(values) for key, values in self.over.items()},
            "scenario": unpublished(self.scenario),
        }


def make_sweep(
    scenario: Scenario | str | os.PathLike[str],
    over: Mapping[str, Sequence[Any]],
    seeds: Sequence[int],
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    precision: int = 32,
    device: str = "cpu",
    *,
    trust: bool = False,
) -> Sweep:
    """Make a sweep. Raises ScenarioError with the errors of all points."""
    points = grid_points(over)
    scenarios = scenarios_at(scenario, points, settings, law, trust=trust)
    base = scenario_variant(scenario, settings, law, trust=trust)
    return Sweep(base, over, seeds, precision, device, points, scenarios)


def resumed_sweep(folder: str | os.PathLike[str] | None, *, trust: bool = False, **given: Any) -> Sweep:
    """Return the sweep that a folder holds; options that it holds itself (`given`) are refused."""
    held = held_request(folder, Sweep.kind, given)
    with as_error(folder or "", StudyError):
        name, seeds = str(held["name"]), check_seeds(held["seeds"])
        base = requested_scenario(held["scenario"], name, trust=trust)
        bits, device = held["precision"], held["device"]
        return make_sweep(base, held["over"], seeds, precision=bits, device=device, trust=trust)


def grid_points(over: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Return all combinations of the values of several keys; raise ScenarioError for keys without a list of values."""
    if not isinstance(over, Mapping) or not over:
        raise ScenarioError([f"over = {over!r}: give keys with lists of values, such as {{'radio.delay': [0.0, 1.0]}}"])
    lacking = [key for key, values in over.items() if isinstance(values, str) or not isinstance(values, Iterable)]
    if lacking:
        raise ScenarioError([f"{key} = {over[key]!r}: give the values to sweep over in a list" for key in lacking])
    axes = [list(itertools.islice(values, MOST_POINTS + 1)) for values in over.values()]
    if (count := math.prod(map(len, axes))) > MOST_POINTS:  # before a scenario is built at each
        raise ScenarioError([f"over: a grid of {count} points or more, which is more than {MOST_POINTS}"])
    return [dict(zip(over, values, strict=True)) for values in itertools.product(*axes)]


def scenarios_at(
    scenario: Scenario | str | os.PathLike[str],
    points: Sequence[Mapping[str, Any]],
    settings: Mapping[str, Any] | None,
    law: Any = None,
    *,
    trust: bool = False,
) -> list[Scenario]:
    """Build the scenario at each point of a grid; raise ScenarioError with the errors of all points."""
    errors: list[str] = []
    found = []
    # All points are built before any flies, so that an error in the last one costs no flights.
    for point in points:
        with collect_errors(errors):
            changed = {**(settings or {}), **point}
            found.append(scenario_variant(scenario, changed, law, trust=trust))
    errors += _columns_given_twice(points, found)
    if errors:
        raise ScenarioError(errors)
    return found


def _columns_given_twice(points: Sequence[Mapping[str, Any]], scenarios: Sequence[Scenario]) -> list[str]:
    """Return errors for swept keys whose last word is another column of the table: the seed, or an order parameter."""
    errors: list[str] = []
    for key in points[0] if points and scenarios else ():
        if key == "seed" or any(key in reported_values(found.metrics.rule) for found in scenarios):
            whole = " or ".join(keys_by_last_word(scenarios[0].records).get(key, ()))
            errors.append(f"{scenarios[0].name}: {key}: is a column of the table already; write {whole}")
    return errors


def fly_sweep(
    made: Sweep, *, out: str | os.PathLike[str] | None = None, resume: bool = False, **options: Any
) -> pd.DataFrame:
    """Fly all seeds at all points and return a tidy table; options as in `sweep`."""
    # One list of all flights: workers are busy until the end of the sweep, not of each point.
    jobs = [(place, seed) for place in range(len(made.points)) for seed in made.seeds]
    flights = [made.scenarios[place] for place, _ in jobs]
    rows: Sequence[Mapping[str, Any]]
    if out is None:
        how = {"precision": made.precision, "device": made.device, **options}
        rows = score_scenarios(flights, [seed for _, seed in jobs], **how)
    else:
        rows = _fly_in_folder(made, expand_path(out), resume=resume, **options)
    table = pd.DataFrame([{**made.points[i], "seed": seed, **row} for (i, seed), row in zip(jobs, rows, strict=True)])
    if out is not None:
        atomic.write_file(expand_path(out) / "result.csv", table.to_csv(index=False))
    known = {name: text for found in made.scenarios for name, text in reported_values(found.metrics.rule).items()}
    return with_units(table, known)


def _fly_in_folder(
    made: Sweep, folder: Path, *, resume: bool, scheduler: str | None, threads: int | None,
    on_done: Callable[[], None] | None, notify: Callable[[str], None] | None,
) -> list[Mapping[str, Any]]:  # fmt: skip
    """Fly what the folder does not hold yet; return the order parameters of all flights as it holds them."""
    if max(made.seeds) >= 1 << 63:
        raise StudyError(f"seed = {max(made.seeds)}: a folder keeps seeds below 2^63; leave out --out, or take another")
    check_worker_device(scheduler, made.device)
    if scheduler is None:
        picked = pick_device(list(made.scenarios), made.device, precision=made.precision, notify=notify)
        made = replace(made, device=picked)
    open_folder(folder, made, resume=resume)
    tasks = [ScenarioTask(each, made.precision, made.device) for each in made.scenarios]
    batch = CandidateBatch("sweep", 0, 0)
    executor = make_executor(tasks, scheduler=scheduler, threads=threads)
    with open_run(folder, executor) as store:
        store.ask(batch, [[float(i)] for i in range(len(tasks))], made.points)
        flights = [Flight(i, j, {}, seed, i) for i in range(len(tasks)) for j, seed in enumerate(made.seeds)]
        rows = store.fly_missing(executor, batch, flights, on_done)
    return [rows[flight.candidate_index, flight.repeat] for flight in flights]


def metric_to_show(metric: str | None, scenarios: Sequence[Scenario]) -> str:
    """Choose the order parameter to show: `metric`, or the usual one; raise ScenarioError if a flight does not report
    it.
    """
    each = [
        scalar_names(found.metrics.rule, found.metrics.numbers, found.goals.kind in ("points", "scene"))
        for found in scenarios
    ]
    known = [name for name in (each[0] if each else ()) if all(name in names for names in each)]
    if metric is None:
        judged = (*(found.metrics.rule.best for found in scenarios), ORDER)
        usual = [name for name in judged if name in known]
        return str((usual + known + [""])[0])
    if each and metric not in known:
        hint = suggest(metric, known, f"known: {', '.join(known)}")
        raise ScenarioError([f"--show {metric}: unknown order parameter; {hint}"])
    return metric
