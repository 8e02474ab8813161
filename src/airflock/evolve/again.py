"""Workaround (i) of Vásárhelyi et al. 2018: evolve again where the flock is larger or hears later."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.evolve.folder import STUDY, open_folder
from airflock.evolve.run import executor_for, run
from airflock.evolve.search import Watch
from airflock.evolve.space import Space, declared
from airflock.evolve.steps import Measured, Step, measured
from airflock.evolve.study import Study, make_study
from airflock.scenarios.families import FAMILIES, Given
from airflock.scenarios.making import make
from airflock.scenarios.scenario import Scenario


def cautious(scenario: Scenario, r_coll: float = 1.5, delay: float = 1.0) -> dict[str, float]:
    """Settings of workaround (i): a radius of collision and a delay so many times as large."""
    return {"metrics.r_coll": scenario.metrics.r_coll * r_coll, "radio.delay": scenario.radio.delay * delay}


def stricter(scenario: Scenario, space: Space, settings: Mapping[str, float], search: Mapping[str, Any]) -> Study:
    """Study of workaround (i): the scenario's space, searched under the stricter settings."""
    own = {family.field: getattr(scenario, family.field) for family in FAMILIES}
    found = make(scenario.document, f"{scenario.name}, stricter", settings, given=Given(law=scenario.model, **own))
    return replace(make_study({}, found.name, search=search, scenario=found), space=space)


def evolved_again(
    scenario: Scenario,
    study: Study,
    settings: Mapping[str, float],
    folder: Path,
    seeds: Sequence[int],
    threads: int | None = None,
    watch: Watch | None = None,
    note: Callable[[bool], None] | None = None,
) -> list[Measured]:
    """Workaround (i): run the stricter study, then measure its result where the optimum was found.

    folder : of that study; one that is there already is continued
    watch, note : told of flights of the search and after it, as by `run`
    """
    open_folder(folder, study, resume=(folder / STUDY).exists())
    result = run(study, folder, executor_for(study, threads=threads), watch, note)
    known = declared(scenario)
    before = {key: float(known[key][1] or 0.0) for key in result.parameters}
    told = ", ".join(f"{key} = {value:g}" for key, value in settings.items())
    plans = [
        (Step("optimum", {}, "where hardening begins"), before),
        (Step("evolved again", {}, f"workaround (i): evolved with {told}"), result.parameters),
    ]
    return measured(scenario, plans, seeds, threads)
