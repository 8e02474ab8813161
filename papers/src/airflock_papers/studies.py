"""Evolutions behind claims: shipped studies, kept in Airflock's cache folder and continued where they were left."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airflock.runs import RunProgress, open_folder
from airflock.search import EvolveResult, load_study, run_study, study_executor
from airflock.support import cache_folder
from airflock_papers.flights import Flights

QUICK = {"population": 12, "generations": 4, "pool": 24, "top": 4, "final_seeds": 10}


def folder_of(name: str, number: int = 0, quick: bool = False) -> Path:
    """Where a run of a study lies; number: of the run, which is its seed."""
    return cache_folder() / "studies" / f"{name}_{number}{'_quick' if quick else ''}"


def evolve(
    flights: Flights,
    title: str,
    name: str,
    number: int = 0,
    settings: Mapping[str, Any] | None = None,
    *,
    space: Mapping[str, Any] | None = None,
    folder: str = "",
    search: Mapping[str, Any] | None = None,
) -> EvolveResult:
    """Result of a run of a shipped study, begun or continued.

    settings : keys of the scenario to change; space : table that replaces the study's; folder : its name, if another
    search   : keys of the search to change, in place of those of a quick one
    """
    keys = search if search is not None else QUICK if flights.quick else {}
    study = load_study(
        name, settings=settings, search={"seed": number, **keys}, tables={"space": space} if space else None
    )
    place = folder_of(folder or name, number, flights.quick)
    open_folder(place, study)

    def watch(p: RunProgress) -> None:
        if flights.progress:
            flights.progress(title, p.done, p.total or p.done)

    return run_study(study, place, study_executor(study, threads=flights.threads), watch)
