"""Stages of a tuning: search, hardening, certificate; each is continued where it was left."""

import itertools
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from airflock import atomic
from airflock.certify.campaign import FOLDER
from airflock.certify.certificate import Certificate
from airflock.certify.executing import executor_for
from airflock.certify.request import campaign_of
from airflock.certify.run import run as certified
from airflock.errors import ScenarioError
from airflock.evolve.folder import open_folder, write
from airflock.evolve.harden import document as hardened_document
from airflock.evolve.harden import harden
from airflock.evolve.result import BEST, Result
from airflock.evolve.run import executor_for as searching
from airflock.evolve.run import run as evolved
from airflock.evolve.search import Watch
from airflock.evolve.steps import Measured
from airflock.evolve.study import make_study
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.tune.folder import document, read_steps
from airflock.tune.plan import Plan
from airflock.tune.result import CERTIFICATE, STEPS, STUDY, TUNED

PILOT = 4  # flights per core that tell how long one takes
Note = Callable[[str], None]


def rate_of(scenario: Scenario, threads: int | None) -> float:
    """Flights per second, from a few of them."""
    from airflock.engine import compile_for, score_flights
    from airflock.threads import cores

    compile_for(scenario)
    count = PILOT * (threads or cores())
    began = time.perf_counter()
    score_flights([scenario] * count, range(count), threads=threads)
    return count / max(time.perf_counter() - began, 1e-6)


def search(
    folder: Path, start: Scenario, plan: Plan, limits: Sequence[str], threads: int | None, watch: Watch | None
) -> Result:
    """What the search of the folder found."""
    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=plan.search, scenario=start)
    open_folder(folder / STUDY, study, resume=(folder / STUDY / "study.toml").is_file())
    return evolved(study, folder / STUDY, searching(study, threads=threads), watch)


def hardening(
    folder: Path, plan: Plan, limits: Sequence[str], threads: int | None, trust: bool, margins: Sequence[str] = ()
) -> tuple[Scenario, list[Measured], str]:
    """The scenario after hardening, its steps, and why there are none."""
    if (folder / STEPS).is_file():
        steps, why = read_steps(folder / STEPS)
        return load(folder / TUNED, trust=trust), steps, why
    best = load(folder / STUDY / BEST, trust=trust)
    steps, why, count = [], "", itertools.count()
    try:
        how: dict[str, Any] = {"threads": threads, "done": lambda: next(count)}
        steps = harden(best, range(plan.seeds), limit=limits, margin=margins, **how)
        write(folder / TUNED, hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune.")
    except ScenarioError as fault:
        why = fault.faults[0]
        law = folder / STUDY / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write(folder / law.name, law.read_bytes())
        write(folder / TUNED, document(best), "Evolved by airflock tune; not hardened.")
    told = {"why": why, "flights": next(count), "steps": [step.as_dict() for step in steps]}
    atomic.write(folder / STEPS, json.dumps(told))
    return load(folder / TUNED, trust=trust), steps, why


def certificate(
    folder: Path,
    tuned: Scenario,
    limits: Sequence[str],
    confidence: float,
    plan: Plan,
    threads: int | None,
    note: Note | None,
) -> Certificate:
    """The certificate of the tuned set, saved in the folder."""
    from airflock.evolve.environment import usual_keys

    campaign = campaign_of(tuned, limits, confidence)
    path = folder / "certificate_flights"
    open_folder(path, campaign, resume=(path / f"{FOLDER}.toml").is_file(), kind=FOLDER)
    executor = executor_for(campaign, threads=threads)
    try:
        made = certified(campaign, path, executor, plan.seconds, keys=usual_keys(tuned), threads=threads, note=note)
    finally:
        executor.close()
    made.save(folder / CERTIFICATE)
    return made
