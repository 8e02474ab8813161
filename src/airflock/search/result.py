"""Result of a study: the winner, its score and its working ranges; the files that hold them."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from airflock.runs import to_toml_values
from airflock.scenarios import Scenario, formats
from airflock.search import portrait
from airflock.search.study import Study
from airflock.support import atomic

RESULT_FILE, BEST_FILE = "result.toml", "best.toml"


@dataclass(frozen=True)
class EvolveResult:
    """What a study found.

    parameters : of the winner, by key; scenario : with these parameters
    fitness, sd, low, high, seeds : of the winner on fresh seeds, with Student's 95 % interval of the
                 mean; the fitness in the unit of the objective
    largest    : best candidate of the search, luck included, in the same unit of the objective
    origin     : "mean" or "top": what the winner was
    ranges     : key → (low, high) over the `above` candidates of the search that reach the winner's fitness
    finalists  : one row each: origin, parameters, fitness on fresh seeds
    failed     : candidates of the search that failed
    scenarios  : of several: what each is called → mean, low and high of the winner's fitness in it
    limits     : what the winner's fresh flights say of each limit: events, flights, estimated and allowed probability
    dead       : why nothing flies, in words; then no best.toml is written; empty if something flies
    """

    folder: Path
    scenario: Scenario
    parameters: dict[str, float]
    fitness: float
    sd: float
    low: float
    high: float
    seeds: int
    largest: float
    origin: str
    ranges: dict[str, tuple[float, float]]
    above: int
    candidate_count: int
    failed: int
    finalists: pd.DataFrame
    dead_reason: str = ""
    scenarios: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    limits: tuple[Mapping[str, Any], ...] = ()

    def __repr__(self) -> str:
        return f"<{portrait.result_summary(self)}>"

    def _repr_html_(self) -> str:
        """A table of the winner's parameters, for a notebook."""
        return portrait.result_html(self)

    def document(self) -> dict[str, Any]:
        """The result as plain values, for result.toml and --json.

        Examples
        --------
        >>> import airflock
        >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
        >>> vary = {"model": {"p_rep": {"low": 0.0, "high": 1.0}}}
        >>> few = {"population": 4, "generations": 2, "pool": 2, "top": 1, "final_seeds": 2}
        >>> airflock.evolve(short, "study", space=vary, **few).document()["fitness"]["seeds"]
        2
        """
        return {
            "scenario": self.scenario.name,
            "fitness": {
                "mean": self.fitness,
                "sd": self.sd,
                "low": self.low,
                "high": self.high,
                "seeds": self.seeds,
                "largest_in_search": self.largest,
            },
            "origin": self.origin,
            **({"dead": self.dead_reason} if self.dead_reason else {}),
            "parameters": self.parameters,
            **({"limits": [dict(entry) for entry in self.limits]} if self.limits else {}),
            **({"scenarios": [_told(name, *span) for name, span in self.scenarios.items()]} if self.scenarios else {}),
            "working_ranges": {
                "candidates": self.candidate_count,
                "failed": self.failed,
                "above_mean": self.above,
                "range": {key: list(span) for key, span in self.ranges.items()},
            },
        }


def _told(name: str, mean: float, low: float, high: float) -> dict[str, Any]:
    return {"scenario": name, "mean": mean, "low": low, "high": high}


def best_files(study: Study) -> list[str]:
    """Files that hold the winner: best.toml, and best_2.toml and so on for further scenarios."""
    return [BEST_FILE, *(f"best_{place}.toml" for place in range(2, len(study.scenarios) + 1))]


def further_best_files(folder: Path) -> list[Path]:
    """Files of the winner in the further scenarios of a study's folder, in their order."""
    found = (folder / f"best_{place}.toml" for place in itertools.count(2))
    return list(itertools.takewhile(Path.is_file, found))


def best_document(
    study: Study, parameters: dict[str, float], result: EvolveResult, folder: Path, scenario_index: int = 0
) -> dict[str, Any]:
    """A scenario file with the winner's parameters, each with its source; a law in a file of its own comes along.

    place : which of the study's scenarios
    """
    scenario = study.scenarios[scenario_index]
    document = {formats.KEY: formats.FORMAT, **to_toml_values(scenario.document)}
    document.pop("published", None)
    law = Path(scenario.name).parent / str(document.get("model", {}).get("kind", ""))
    if law.suffix == ".py" and law.is_file():
        atomic.write_file(folder / law.name, law.read_bytes())
        document["model"]["kind"] = law.name
    source = f"evolved: {study.search.algorithm}, {result.candidate_count} evaluations, seed {study.whole('seed')}"
    units = {axis.key: axis.unit for axis in study.space.axes}
    for key, value in parameters.items():
        section, _, name = key.rpartition(".")
        entry: dict[str, Any] = {"value": value, "source": source}
        if key in units:
            entry = {"value": value, "unit": units[key], "source": source}
        (document.setdefault(section, {}) if section else document)[name] = entry
    document["title"] = f"evolved from {scenario.name}: {study.objectives[0].name} {result.fitness:.4f}"
    return dict(document)
