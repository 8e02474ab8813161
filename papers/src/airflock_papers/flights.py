"""Flights behind the claims: many scenarios and seeds on all cores, with word of how far they are."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from airflock.engine import score_flights
from airflock.recordings import over_time, simulate
from airflock.scenarios import Scenario, rebuilt
from airflock.support import run_in_threads
from airflock_papers.progress import Progress


@dataclass
class Flights:
    """How a paper's flights are flown.

    quick : fewer seeds, coarser maps; seeds : flights per number instead of the paper's
    changes : keys that are set in every scenario, for `airflock_papers.breaks`; those of `search` are of an evolution
    wanted : ids of the claims that are asked for, else all; a part may leave out flights of others
    """

    quick: bool = False
    seeds: int | None = None
    threads: int | None = None
    progress: Progress | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)
    wanted: frozenset[str] | None = None
    flown: int = field(default=0, init=False)

    def count(self, full: int, quick: int) -> int:
        """Number of seeds: what was asked for, else the paper's or a quick number."""
        return self.seeds or (quick if self.quick else full)

    def as_changed(self, scenario: Scenario) -> Scenario:
        """The scenario with the changes set."""
        return with_changes(scenario, scenario_keys(self.changes))

    def score(self, title: str, scenarios: Mapping[Any, Scenario], seeds: int | Mapping[Any, int]) -> pd.DataFrame:
        """Order parameters of every scenario with seeds 0, 1, ...; index (key, seed), in the order given."""
        scenarios = {key: self.as_changed(scenario) for key, scenario in scenarios.items()}
        pairs = [(k, s) for k in scenarios for s in range(seeds if isinstance(seeds, int) else seeds[k])]
        rows = score_flights(
            [scenarios[k] for k, _ in pairs],
            [s for _, s in pairs],
            threads=self.threads,
            on_done=self.counter(title, len(pairs)),
        )
        keys = [(*k, s) if isinstance(k, tuple) else (k, s) for k, s in pairs]
        return pd.DataFrame(rows, index=pd.MultiIndex.from_tuples(keys))

    def courses(self, title: str, scenario: Scenario, seeds: int) -> list[pd.DataFrame]:
        """Order parameters over time of each seed's flight; index time in s."""
        scenario = self.as_changed(scenario)
        over_time(simulate(scenario, 0))  # compiles both drivers once, before threads ask for them

        def job(seed: int) -> Callable[[], pd.DataFrame]:
            return lambda: over_time(simulate(scenario, seed))

        jobs = [job(seed) for seed in range(seeds)]
        return list(run_in_threads(jobs, self.threads, self.counter(title, seeds)))

    def counter(self, title: str, total: int) -> Callable[[], None]:
        """What is called after each flight of a title, to tell how far it is."""
        done = 0

        def count() -> None:
            nonlocal done
            done += 1
            self.flown += 1
            if self.progress:
                self.progress(title, done, total)

        if self.progress:
            self.progress(title, 0, total)
        return count


def scenario_keys(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Of some changes those of a scenario, not of a search."""
    return {key: value for key, value in changes.items() if not key.startswith("search.")}


def with_changes(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """A scenario with keys set anew; a text like "times 0.5" multiplies what the scenario has."""
    if not changes:
        return scenario
    settings = {}
    for key, value in changes.items():
        if isinstance(value, str) and value.startswith("times "):
            section, _, name = key.rpartition(".")
            owner = scenario.records[section] if section else scenario.flight
            value = getattr(owner, name) * float(value.removeprefix("times "))
        settings[key] = value
    return rebuilt(scenario, settings)
