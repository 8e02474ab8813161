"""The public door: start, evolve, harden, certify, report; each stage is continued where it was left."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from airflock.runs import Interrupted
from airflock.scenarios import Scenario, scenario_variant
from airflock.search.bounds import default_space
from airflock.search.safe import flights_per_event
from airflock.search.tune.feasible import infeasible_limit_lines
from airflock.search.tune.folder import load_plan, save_plan
from airflock.search.tune.logs import REPORT_FILE, IdentifiedFleet, Paths, identify_fleet
from airflock.search.tune.plan import make_plan
from airflock.search.tune.request import check_tune_budget, make_request
from airflock.search.tune.result import TuneResult
from airflock.search.tune.stages import (
    Notify,
    OnTuneProgress,
    TuneProgress,
    measure_flight_rate,
    run_certificate_stage,
    run_hardening_stage,
    run_search_stage,
)
from airflock.search.tune.start import prepare_start
from airflock.support import ErrorCollector, ScenarioError, StudyError, expand_path, value_or_default


def tune(
    scenario: Scenario | str | os.PathLike[str] | Paths,
    out: str | os.PathLike[str],
    *,
    budget: float = 1200.0,
    limit: Sequence[str] = (),
    confidence: float | None = None,
    like: Scenario | str | os.PathLike[str] | None = None,
    heard: str | os.PathLike[str] | None = None,
    warm: bool = False,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    watch: OnTuneProgress | None = None,
    note: Notify | None = None,
    trust: bool = False,
) -> TuneResult:
    """From a scenario or logs of your own to a set that is evolved, hardened and certified, with a report.

    Parameters
    ----------
    scenario : Scenario, str or path, or a list of paths
        Your drones, field and speed; numbers of the law that it does not give are scaled to its speed. With `like`, log
        files of your drones, as `airflock.identify` reads them.
    out : str or path
        Folder of everything: start, study, hardening, certificate, report, and tuned.toml to fly.
    budget : float
        Time to spend, s.
    limit : sequence of str
        What is to be shown, as `airflock.certify` takes it; by default that collisions (`metrics.r_coll`) are rarer
        than 0.01 per flock hour, and so is leaving the arena or entering an obstacle. Search and hardening put sets
        that look as if they kept these limits before all others.
    confidence : float, optional
        Confidence of the certificate, a share in [0.5, 1); by default 0.95.
    like : Scenario, str or path, optional
        The scenario whose law, field and speed are tuned with the numbers that the logs tell of the drones.
    heard : str or path, optional
        Table of packets of these logs, as `airflock identify --heard` takes it.
    warm : bool
        Search from the start's own numbers on, which its speed scales, instead of the middle of all ranges.
    resume : bool
        Continue the work in the folder; limits and confidence that are not given are as in the first call.
    settings : mapping, optional
        Keys of the scenario to change.
    threads : int, optional
        Flights side by side; by default one per core.
    watch, note : callable, optional
        Told as each stage begins and of its flights (`airflock.search.tune.stages.TuneProgress`); told in a line,
        before they begin, of each limit that the budget leaves too little time to show.
    trust : bool
        Whether code that files name may run.

    Returns
    -------
    Tuned
        The scenario to fly, what each stage found, and whether the limit is shown.

    Raises
    ------
    ScenarioError, StudyError
        If the scenario or the folder cannot be used, the budget is too small, or nothing flies.
    Interrupted
        At Ctrl-C.

    Examples
    --------
    >>> import airflock
    >>> airflock.tune("vasarhelyi_2018/4ms", "tuned", limit=["r_mim<3 at 1%"])  # refused before anything flies
    Traceback (most recent call last):
    airflock.support.errors.ScenarioError: limit 'r_mim<3 at 1%': r_mim: unknown order parameter; did you mean r_min?
    """
    began = time.monotonic()
    folder = expand_path(out)
    parts = ErrorCollector()  # all of it is refused before anything flies
    parts.read(check_tune_budget, budget)
    if like is not None:
        parts.raise_errors()  # before logs are read, which takes long
    begun = parts.read(_begun, scenario, like, heard, settings, folder, trust)
    start = parts.read(lambda found: found.start, begun)
    plan = parts.read(load_plan, folder, start, resume)
    asked = parts.read(make_request, start, limit, confidence, value_or_default(plan, None))
    parts.raise_errors()
    logs = begun.logs
    sure, rated = asked.campaign.confidence, [each for each in asked.campaign.limits if each.rate is not None]
    if plan is None:
        telling = flights_per_event(rated, start)
        made = make_plan(budget, measure_flight_rate(start, threads), warm=warm, flights_for_limits=telling)
        plan = replace(made, limits=asked.limits, confidence=sure)
        save_plan(folder, start, plan)
    searched = [each.text for each in rated]
    if logs is not None and not (folder / REPORT_FILE).is_file():
        logs.save(folder)
    short = infeasible_limit_lines(asked.campaign, plan)
    for line in short:
        if note is not None:
            note(line)
    notes = [*begun.notes, *default_space(start)[1], *short]
    watch = watch or (lambda stage: None)
    try:
        result = run_search_stage(folder, start, plan, searched, threads, watch)
        if result.dead_reason:
            raise StudyError(f"{start.name}: {result.dead_reason}")
        tuned, steps, why = run_hardening_stage(folder, plan, searched, threads, trust, watch)
        shown = run_certificate_stage(folder, tuned, asked.limits, sure, plan, threads, watch)
        found = TuneResult(
            folder, tuned, start, tuple(notes), result, tuple(steps), why, shown, time.monotonic() - began,
            {} if logs is None else logs.told,
        )  # fmt: skip
        watch(TuneProgress("report"))
        from airflock.search.tune.report import save

        save(found)
    except KeyboardInterrupt as stop:
        raise Interrupted(f"interrupted: stages that are over are kept in {folder}; continue with --resume") from stop
    return found


class _Begun(NamedTuple):
    """Where a tuning begins: its scenario, what was set in it, and what logs told if it began with logs."""

    start: Scenario
    notes: list[str]
    logs: IdentifiedFleet | None


def _begun(
    what: Scenario | str | os.PathLike[str] | Paths,
    like: Scenario | str | os.PathLike[str] | None,
    heard: str | os.PathLike[str] | None,
    settings: Mapping[str, Any] | None,
    folder: Path,
    trust: bool,
) -> _Begun:
    paths = [what] if isinstance(what, (Scenario, str, os.PathLike)) else list(what)
    if like is None:
        if len(paths) != 1 or heard is not None:
            raise ScenarioError(
                ["tune takes one scenario; for logs, give --like PRESET, the scenario with their law, field and speed"]
            )
        return _Begun(*prepare_start(scenario_variant(paths[0], settings, trust=trust)), None)
    files = [path for path in paths if not isinstance(path, Scenario)]
    if not files or len(files) != len(paths):
        raise ScenarioError(["like is given, so give log files, not a scenario"])
    found = identify_fleet(folder, files, scenario_variant(like, settings, trust=trust), heard)
    return _Begun(*prepare_start(found.scenario), found)
