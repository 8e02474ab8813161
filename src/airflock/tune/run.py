"""The public door: start, evolve, harden, certify, report; each stage is continued where it was left."""

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.certify.request import campaign_of
from airflock.errors import ScenarioError, StudyError
from airflock.evolve.bounds import usual_space
from airflock.evolve.margins import read_margins
from airflock.evolve.run import Interrupted
from airflock.evolve.safe import flights_that_count
from airflock.metrics.registry import numbers_of
from airflock.scenarios.change import variant
from airflock.scenarios.scenario import Scenario
from airflock.tune.feasible import infeasible
from airflock.tune.folder import keep_plan, kept_plan
from airflock.tune.logs import TOLD, FromLogs, Paths, identified
from airflock.tune.plan import CONFIDENCE, plan_of
from airflock.tune.result import Tuned
from airflock.tune.stages import Note, Stage, Watch, certificate, hardening, rate_of, search
from airflock.tune.start import has_walls, start_of
from airflock.untrusted import own_path


def tune(
    scenario: Scenario | str | os.PathLike[str] | Paths,
    out: str | os.PathLike[str],
    *,
    budget: float = 1200.0,
    limit: Sequence[str] = (),
    margin: str | Sequence[str] = (),
    confidence: float | None = None,
    like: Scenario | str | os.PathLike[str] | None = None,
    heard: str | os.PathLike[str] | None = None,
    warm: bool = False,
    resume: bool = False,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    watch: Watch | None = None,
    note: Note | None = None,
    trust: bool = False,
) -> Tuned:
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
    margin : str or sequence of str
        Margins that hardening is to widen as well, as `airflock.harden` takes them.
    confidence : float, optional
        Confidence of the certificate, a share in [0.5, 1); by default 0.95.
    like : Scenario, str or path, optional
        The scenario whose law, field and speed are tuned with the numbers that the logs tell of the drones.
    heard : str or path, optional
        Table of packets of these logs, as `airflock identify --heard` takes it.
    warm : bool
        Search from the start's own numbers on, which its speed scales, instead of the middle of all ranges.
    resume : bool
        Continue the work in the folder; limits, margins and confidence that are not given are as in the first call.
    settings : mapping, optional
        Keys of the scenario to change.
    threads : int, optional
        Flights side by side; by default one per core.
    watch, note : callable, optional
        Told as each stage begins and of its flights (`airflock.tune.stages.Stage`); told in a line, before they begin,
        of each limit that the budget leaves too little time to show.
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
    airflock.errors.ScenarioError: limit 'r_mim<3 at 1%': r_mim: unknown order parameter; did you mean r_min?
    """
    began = time.monotonic()
    if not 0.0 < budget < math.inf:
        raise StudyError(f"budget = {budget:g} s is not positive")
    folder = own_path(out)
    mine, logs = _mine(folder, scenario, like, heard, settings, trust)
    start, notes = start_of(mine)
    plan = kept_plan(folder, start, resume)
    limits = list(limit) or (plan.limits if plan else []) or usual_limits(start)
    sure = (plan.confidence if plan else CONFIDENCE) if confidence is None else confidence
    asked = campaign_of(start, limits, sure)  # refused before anything flies
    margins = [margin] if isinstance(margin, str) else list(margin) or (plan.margins if plan else [])
    if faults := read_margins(margins, [start])[1]:
        raise ScenarioError(faults)
    telling = flights_that_count([each for each in asked.limits if each.rate is not None], start)
    if plan is None:
        made = plan_of(budget, rate_of(start, threads), warm=warm, telling=telling, margins=margins)
        plan = replace(made, limits=limits, confidence=sure, margins=margins)
        keep_plan(folder, start, plan)
    searched = [each.text for each in asked.limits if each.rate is not None]
    if logs is not None and not (folder / TOLD).is_file():
        logs.save(folder)
    short = infeasible(asked, plan)
    for line in short:
        if note is not None:
            note(line)
    notes = [*notes, *usual_space(start)[1], *short]
    watch = watch or (lambda stage: None)
    try:
        result = search(folder, start, plan, searched, threads, watch)
        if result.dead:
            raise StudyError(f"{mine.name}: {result.dead}")
        tuned, steps, why = hardening(folder, plan, searched, threads, trust, watch, margins)
        shown = certificate(folder, tuned, limits, sure, plan, threads, watch)
        found = Tuned(
            folder, tuned, start, tuple(notes), result, tuple(steps), why, shown, time.monotonic() - began,
            {} if logs is None else logs.told,
        )  # fmt: skip
        watch(Stage("report"))
        from airflock.tune.report import save

        save(found)
    except KeyboardInterrupt as stop:
        raise Interrupted(f"interrupted: stages that are over are kept in {folder}; continue with --resume") from stop
    return found


def _mine(
    folder: Path,
    what: Scenario | str | os.PathLike[str] | Paths,
    like: Scenario | str | os.PathLike[str] | None,
    heard: str | os.PathLike[str] | None,
    settings: Mapping[str, Any] | None,
    trust: bool,
) -> tuple[Scenario, FromLogs | None]:
    """The scenario to tune, and what logs told of it if it began with logs."""
    paths = [what] if isinstance(what, (Scenario, str, os.PathLike)) else list(what)
    if like is None:
        if len(paths) != 1 or heard is not None:
            raise ScenarioError(
                ["tune takes one scenario; for logs, give --like PRESET, the scenario with their law, field and speed"]
            )
        return variant(paths[0], settings, trust=trust), None
    files = [path for path in paths if not isinstance(path, Scenario)]
    if not files or len(files) != len(paths):
        raise ScenarioError(["like is given, so give log files, not a scenario"])
    found = identified(folder, files, variant(like, settings, trust=trust), heard)
    return found.scenario, found


def usual_limits(scenario: Scenario) -> list[str]:
    """Collisions, and contacts where there are walls or obstacles, rarer than once in a hundred flock hours each.

    Raises ScenarioError where distances are not measured.
    """
    if "r_min" not in numbers_of(scenario.measures, scenario.metrics):
        kind = scenario.measures.name
        raise ScenarioError(
            [f"{scenario.name}: metrics.kind = {kind!r} has no r_min to limit; say what is to be shown with --limit"]
        )
    contacts = ["clearance<0 at 0.01/h"] if has_walls(scenario) else []
    return [f"r_min<{scenario.metrics.r_coll:g} at 0.01/h", *contacts]
