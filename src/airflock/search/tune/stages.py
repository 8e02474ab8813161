"""Stages of a tuning: search, hardening, certificate; each is continued where it was left."""

import itertools
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from airflock.certificates import (
    CAMPAIGN_KIND,
    Certificate,
    CountProgress as Counted,
    campaign_executor,
    campaign_from_request,
    run_campaign as certified,
)
from airflock.runs import open_folder, write_toml_file
from airflock.scenarios import Scenario, load
from airflock.search.harden import MAX_ROUNDS, harden, hardened_document as hardened_document
from airflock.search.result import BEST_FILE, EvolveResult
from airflock.search.run import run_study as evolved, study_executor as searching
from airflock.search.search import SearchProgress as Searched
from airflock.search.steps import StepResult
from airflock.search.study import make_study
from airflock.search.tune.folder import read_steps, scenario_text_document
from airflock.search.tune.plan import BudgetPlan
from airflock.search.tune.result import CERTIFICATE_FILE, STEPS_FILE, STUDY_FOLDER, TUNED_FILE
from airflock.support import ScenarioError, atomic

PILOT = 4  # flights per core that tell how long one takes
Notify = Callable[[str], None]


class TuneProgress(NamedTuple):
    """What tuning is at: its stage, what that has found so far in a few words, its flights and how many there will be.

    total : None where it is not known; hardening often ends before its total
    """

    stage: str
    told: str = ""
    done: int = 0
    total: int | None = None


OnTuneProgress = Callable[[TuneProgress], None]


def measure_flight_rate(scenario: Scenario, threads: int | None) -> float:
    """Flights per second, from a few of them."""
    from airflock.engine import compile_for, score_flights
    from airflock.support import available_cores

    compile_for(scenario)
    count = PILOT * (threads or available_cores())
    began = time.perf_counter()
    score_flights([scenario] * count, range(count), threads=threads)
    return count / max(time.perf_counter() - began, 1e-6)


def run_search_stage(
    folder: Path,
    start: Scenario,
    plan: BudgetPlan,
    limits: Sequence[str],
    threads: int | None,
    on_progress: OnTuneProgress,
) -> EvolveResult:
    """What the search of the folder found."""
    on_progress(TuneProgress("search"))

    def searched(p: Searched) -> None:
        best = "" if p.best is None else f", best {p.best:.4f}"
        on_progress(TuneProgress("search", f"generation {p.generation + 1}{best}", p.done, p.total))

    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=plan.search, scenario=start)
    open_folder(folder / STUDY_FOLDER, study, resume=(folder / STUDY_FOLDER / "study.toml").is_file())
    return evolved(study, folder / STUDY_FOLDER, searching(study, threads=threads), searched)


def run_hardening_stage(
    folder: Path, plan: BudgetPlan, limits: Sequence[str], threads: int | None, trust: bool, on_progress: OnTuneProgress
) -> tuple[Scenario, list[StepResult], str]:
    """The scenario after hardening, its steps, and why there are none."""
    if (folder / STEPS_FILE).is_file():
        steps, why = read_steps(folder / STEPS_FILE)
        return load(folder / TUNED_FILE, trust=trust), steps, why
    best = load(folder / STUDY_FOLDER / BEST_FILE, trust=trust)
    steps, why = [], ""
    flown = itertools.count(1)
    on_progress(TuneProgress("hardening"))

    def done() -> None:
        count = next(flown)
        on_progress(TuneProgress("hardening", "", count, max(count, MAX_ROUNDS * plan.seeds)))

    try:
        steps = harden(best, range(plan.seeds), limit=limits, threads=threads, done=done)
        write_toml_file(
            folder / TUNED_FILE, hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune."
        )
    except ScenarioError as fault:
        why = fault.faults[0]
        law = folder / STUDY_FOLDER / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write_file(folder / law.name, law.read_bytes())
        write_toml_file(folder / TUNED_FILE, scenario_text_document(best), "Evolved by airflock tune; not hardened.")
    told = {"why": why, "steps": [step.as_dict() for step in steps]}
    atomic.write_file(folder / STEPS_FILE, json.dumps(told))
    return load(folder / TUNED_FILE, trust=trust), steps, why


def run_certificate_stage(
    folder: Path,
    tuned: Scenario,
    limits: Sequence[str],
    confidence: float,
    plan: BudgetPlan,
    threads: int | None,
    on_progress: OnTuneProgress,
) -> Certificate:
    """The certificate of the tuned set, saved in the folder."""
    on_progress(TuneProgress("certificate"))

    def counted(p: Counted) -> None:
        events = ", ".join(str(count) for count in p.events)
        on_progress(TuneProgress("certificate", f"{events} events", p.done, p.total))

    def follows(text: str) -> None:
        on_progress(TuneProgress("certificate", text))

    from airflock.certificates import used_and_unused_keys

    campaign = campaign_from_request(tuned, limits, confidence)
    path = folder / "certificate_flights"
    open_folder(path, campaign, resume=(path / f"{CAMPAIGN_KIND}.toml").is_file(), kind=CAMPAIGN_KIND)
    executor = campaign_executor(campaign, threads=threads)
    try:
        keys = used_and_unused_keys(tuned)
        made = certified(campaign, path, executor, plan.seconds, counted, keys=keys, threads=threads, notify=follows)
    finally:
        executor.close()
    made.save(folder / CERTIFICATE_FILE)
    return made
