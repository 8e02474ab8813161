"""What a search is asked for, checked before anything flies: its study, its device, and how far it goes."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.runs import check_worker_device
from airflock.scenarios import Scenario, scenario_variant
from airflock.search.fitness import Objective, UserFitness
from airflock.search.resumed import resume_study
from airflock.search.search_table import fast_search_keys as fast_keys
from airflock.search.sensitivity import SENSITIVITY_METHODS
from airflock.search.study import Study, load_study, make_study
from airflock.support import StudyError


def evolve_request(
    scenario: Any,
    settings: Mapping[str, Any] | None = None,
    search_keys: Mapping[str, Any] | None = None,
    limit: str | Sequence[str] = (),
    *,
    fast: bool = False,
    folder: Path | None = None,
    **others: Any,
) -> tuple[Study, str]:
    """As `study_from_request`, which takes the others; if a folder is given, what is not asked for is as that holds it.

    Also a note of what the folder gave.
    """

    def ask(changes: Mapping[str, Any] | None, keys: Mapping[str, Any], limits: Any, *, quick: bool = False) -> Study:
        return study_from_request(scenario, changes, search_keys=keys, limit=limits, fast=quick, **others)

    limits = [limit] if isinstance(limit, str) else list(limit)
    study = ask(settings, search_keys or {}, limits, quick=fast)
    if folder is None or isinstance(scenario, Study):
        return study, ""
    keys = fast_keys(search_keys or {}, limits=bool(limits)) if fast else search_keys or {}
    return resume_study(folder, study, settings or {}, keys, limits, ask)


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
    """The study that `evolve` is asked for."""
    if isinstance(what, Study):
        asked: dict[str, Any] = {"settings": settings, "space": space, "objective": objective, "fitness": fitness}
        asked |= {"limit": limit, "over_scenarios": over_scenarios, "fast": fast}
        beside = [*(key for key, value in asked.items() if value), *(search_keys or {})]
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
    if fitness is not None:
        code = getattr(fitness, "__code__", None)
        text = _text_of(code) if code is not None else ""
        name = getattr(fitness, "__name__", "fitness")
        study = replace(study, objectives=(Objective(name, own=fitness, text=text),))
    return study


def _text_of(code: Any) -> str:
    """Hash of what a function does, the same in every process."""
    constants = [constant for constant in code.co_consts if not hasattr(constant, "co_code")]
    return hashlib.sha256(code.co_code + repr((code.co_names, constants)).encode()).hexdigest()[:12]


def check_sensitivity_method(sensitivity: str) -> None:
    """Refuse a method of finding sensitivities that nobody knows."""
    if sensitivity and sensitivity not in SENSITIVITY_METHODS:
        raise StudyError(f"sensitivity = {sensitivity!r} is none of {', '.join(SENSITIVITY_METHODS)}")


def check_study_device(device: str, scheduler: str | None = None) -> None:
    """Refuse a device on which no study flies, and another one than their cpu for a scheduler's workers."""
    check_worker_device(scheduler, device)
    if device not in ("cpu", "cuda", "auto"):
        raise StudyError(f"device = {device!r} is none of cpu, cuda, auto")
