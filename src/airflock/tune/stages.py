"""Stages of a tuning: search, hardening, certificate; each is continued where it was left."""

import itertools
import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from airflock import atomic
from airflock.certify.campaign import FOLDER
from airflock.certify.certificate import Certificate
from airflock.certify.counting import Progress as Counted
from airflock.certify.executing import executor_for
from airflock.certify.request import campaign_of
from airflock.certify.run import run as certified
from airflock.errors import ScenarioError
from airflock.evolve.folder import open_folder, write
from airflock.evolve.harden import MOST, harden
from airflock.evolve.harden import document as hardened_document
from airflock.evolve.result import BEST, Result
from airflock.evolve.run import executor_for as searching
from airflock.evolve.run import run as evolved
from airflock.evolve.search import Progress as Searched
from airflock.evolve.steps import Measured
from airflock.evolve.study import make_study
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario
from airflock.tune.folder import document, read_steps
from airflock.tune.plan import Plan
from airflock.tune.result import CERTIFICATE, STEPS, STUDY, TUNED

PILOT = 4  # flights per core that tell how long one takes
Note = Callable[[str], None]


class Stage(NamedTuple):
    """What tuning is at: its stage, what that has found so far in a few words, its flights and how many there will be.

    total : None where it is not known; hardening often ends before its total
    """

    stage: str
    told: str = ""
    done: int = 0
    total: int | None = None


Watch = Callable[[Stage], None]


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
    folder: Path, start: Scenario, plan: Plan, limits: Sequence[str], threads: int | None, watch: Watch
) -> Result:
    """What the search of the folder found."""
    watch(Stage("search"))

    def searched(p: Searched) -> None:
        best = "" if p.best is None else f", best {p.best:.4f}"
        watch(Stage("search", f"generation {p.generation + 1}{best}", p.done, p.total))

    objective = {"objective": {"limits": list(limits)}} if limits else {}
    study = make_study(objective, start.name, search=plan.search, scenario=start)
    open_folder(folder / STUDY, study, resume=(folder / STUDY / "study.toml").is_file())
    return evolved(study, folder / STUDY, searching(study, threads=threads), searched)


def hardening(
    folder: Path, plan: Plan, limits: Sequence[str], threads: int | None, trust: bool, watch: Watch
) -> tuple[Scenario, list[Measured], str]:
    """The scenario after hardening, its steps, and why there are none."""
    if (folder / STEPS).is_file():
        steps, why = read_steps(folder / STEPS)
        return load(folder / TUNED, trust=trust), steps, why
    best = load(folder / STUDY / BEST, trust=trust)
    steps, why = [], ""
    flown = itertools.count(1)
    watch(Stage("hardening"))

    def done() -> None:
        count = next(flown)
        watch(Stage("hardening", "", count, max(count, MOST * plan.seeds)))

    try:
        steps = harden(best, range(plan.seeds), limit=limits, threads=threads, done=done)
        write(folder / TUNED, hardened_document(best, steps[-1]), "Evolved and hardened by airflock tune.")
    except ScenarioError as fault:
        why = fault.faults[0]
        law = folder / STUDY / str(best.document.get("model", {}).get("kind", ""))
        if law.suffix == ".py" and law.is_file():
            atomic.write(folder / law.name, law.read_bytes())
        write(folder / TUNED, document(best), "Evolved by airflock tune; not hardened.")
    told = {"why": why, "steps": [step.as_dict() for step in steps]}
    atomic.write(folder / STEPS, json.dumps(told))
    return load(folder / TUNED, trust=trust), steps, why


def certificate(
    folder: Path,
    tuned: Scenario,
    limits: Sequence[str],
    confidence: float,
    plan: Plan,
    threads: int | None,
    watch: Watch,
) -> Certificate:
    """The certificate of the tuned set, saved in the folder."""
    watch(Stage("certificate"))

    def counted(p: Counted) -> None:
        events = ", ".join(str(count) for count in p.events)
        watch(Stage("certificate", f"{events} events", p.done, p.total))

    def follows(text: str) -> None:
        watch(Stage("certificate", text))

    from airflock.evolve.environment import usual_keys

    campaign = campaign_of(tuned, limits, confidence)
    path = folder / "certificate_flights"
    open_folder(path, campaign, resume=(path / f"{FOLDER}.toml").is_file(), kind=FOLDER)
    executor = executor_for(campaign, threads=threads)
    try:
        keys = usual_keys(tuned)
        made = certified(campaign, path, executor, plan.seconds, counted, keys=keys, threads=threads, note=follows)
    finally:
        executor.close()
    made.save(folder / CERTIFICATE)
    return made
