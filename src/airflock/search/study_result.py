"""Result of a study: the winner, its score and its working ranges; the files that hold them."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from airflock.runs import FlightStore, declared_numbers, parse_values, to_toml_values
from airflock.scenarios import Scenario, format_number, formats, html_table
from airflock.search.limit_excess import limit_report_line
from airflock.search.optimisers import pareto_front
from airflock.search.study import Study
from airflock.support import (
    FormatError,
    StudyError,
    as_error,
    atomic,
    parse_json,
    result_group,
    result_table,
)

BEST_FILE = "best.toml"


@dataclass(frozen=True)
class EvolveResult:
    """Result of a study: the winner, its score, working ranges and finalists.

    parameters : of the winner, by key; scenario : with these parameters
    fitness, sd, low, high, seeds : of the winner on fresh seeds, with Student's 95 % interval of
                                    the
                 mean; the fitness in the unit of the objective
    largest    : best candidate of the search, luck included, in the same unit of the objective
    origin     : "mean" or "top": what the winner was
    ranges     : key → (low, high) over the `above` candidates of the search that reach the winner's
                 fitness
    finalists  : one row each: origin, parameters, fitness on fresh seeds
    failed     : candidates of the search that failed
    reasons    : why flights of the search failed → how many of them
    scenarios  : of several: what each is called → mean, low and high of the winner's fitness in it
    limits     : what the winner's fresh flights say of each limit: events, flights, estimated and
                 allowed probability
    dead_reason : why nothing flies; then no best.toml is written; empty if something flies
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
    reasons: Mapping[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<{self._summary}>"

    @property
    def _summary(self) -> str:
        """The winner's fitness on fresh seeds in one sentence."""
        if self.dead_reason:
            return f"Result {self.folder}: nothing flies: {self.dead_reason}"
        span = f"{self.fitness:.3g} (95 %: {self.low:.3g} to {self.high:.3g}) on {self.seeds} fresh seeds"
        return f"Result {self.folder}: {self.scenario.name}, fitness {span}"

    def _repr_html_(self) -> str:
        """A table of the winner's parameters, for a notebook."""
        known = declared_numbers(self.scenario)
        rows = [
            (key, format_number(value), known[key][0].unit if key in known else "",
             " … ".join(map(format_number, self.ranges.get(key, ()))))
            for key, value in self.parameters.items()
        ]  # fmt: skip
        heads = ("parameter", "winner", "unit", "candidates as good")
        return f"<p><b>{escape(self._summary)}</b></p>{html_table(heads, rows)}"

    def __rich__(self) -> Any:
        """Return the winner's parameters and what its flights say, for a terminal."""
        rows = [
            (key, f"{value:.4g}", " … ".join(f"{end:.3g}" for end in self.ranges.get(key, ())))
            for key, value in self.parameters.items()
        ]
        title = f"{self.scenario.name}: {self.fitness:.4f} ± {self.sd:.2g} on {self.seeds} fresh seeds"
        return result_group(
            result_table(title, "*parameter; >best; >working range", rows),
            f"95 % interval {self.low:.4f} … {self.high:.4f}; luckiest of the search {self.largest:.4f}; "
            f"{self.above} of {self.candidate_count} candidates reach the mean; {self.failed} failed",
            *(f"failed flights: {count}; {reason}" for reason, count in self.reasons.items()),
            *map(limit_report_line, self.limits),
            *(f"in {name}: {mean:.4f} ({low:.4f} … {high:.4f})" for name, (mean, low, high) in self.scenarios.items()),
            None if self.dead_reason else f"fly it: airflock run {self.folder / BEST_FILE}",
        )

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
        several = [
            {"scenario": name, "mean": mean, "low": low, "high": high}
            for name, (mean, low, high) in self.scenarios.items()
        ]
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
            **({"scenarios": several} if several else {}),
            "working_ranges": {
                "candidates": self.candidate_count,
                "failed": self.failed,
                **({"reasons": dict(self.reasons)} if self.reasons else {}),
                "above_mean": self.above,
                "range": {key: list(span) for key, span in self.ranges.items()},
            },
        }


def best_files(study: Study) -> list[str]:
    """Return the names of the winner's files: best.toml, and best_2.toml and so on for further scenarios."""
    return [BEST_FILE, *(f"best_{place}.toml" for place in range(2, len(study.scenarios) + 1))]


def further_best_files(folder: Path) -> list[Path]:
    """Files of the winner in the further scenarios of a study's folder, in their order."""
    found = (folder / f"best_{place}.toml" for place in itertools.count(2))
    return list(itertools.takewhile(Path.is_file, found))


def document_with_numbers(
    scenario: Scenario, entries: Mapping[str, Mapping[str, Any]], title: str, **sections: Any
) -> dict[str, Any]:
    """Return a scenario file with some numbers of its own, each with its source, by key; `sections` replace others."""
    document = {formats.KEY: formats.FORMAT, **to_toml_values(scenario.document), **sections}
    document.pop("published", None)
    for key, entry in entries.items():
        section, _, name = key.rpartition(".")
        (document.setdefault(section, {}) if section else document)[name] = dict(entry)
    return {**document, "title": title}


def best_document(
    study: Study, parameters: dict[str, float], result: EvolveResult, folder: Path, scenario_index: int = 0
) -> dict[str, Any]:
    """Return a scenario file with the winner's parameters and their source; copy a law in a file of its own.

    scenario_index : which of the study's scenarios
    """
    scenario, sections = study.scenarios[scenario_index], {}
    model = to_toml_values(scenario.document).get("model", {})
    law = Path(scenario.name).parent / str(model.get("kind", ""))
    if law.suffix == ".py" and law.is_file():
        atomic.write_file(folder / law.name, law.read_bytes())
        sections = {"model": {**model, "kind": law.name}}
    source = f"evolved: {study.search.algorithm}, {result.candidate_count} evaluations, seed {study.whole('seed')}"
    units = {axis.key: {"unit": axis.unit} for axis in study.space.axes}
    entries = {k: {"value": value, **units.get(k, {}), "source": source} for k, value in parameters.items()}
    title = f"evolved from {scenario.name}: {study.objectives[0].name} {result.fitness:.4f}"
    return document_with_numbers(scenario, entries, title, **sections)


DURATION_COLUMN = "duration"  # key of the scenario that short flights set, column of their table
FLOWN = "duration_flown"  # that column beside `duration`, the time that a flight took
KEY = ["stage", "run", "generation", "candidate"]


def candidate_table(store: FlightStore, objectives: Sequence[str]) -> pd.DataFrame:
    """Return one row a candidate of the search: its parameters by key, then its fitness by objective; nan: failed."""
    rows = store.rows(
        "SELECT run, generation, candidate, parameters, fitness FROM candidate WHERE stage='search' "
        "AND fitness IS NOT NULL ORDER BY run, generation, candidate"
    )
    found = []
    for run, generation, candidate, parameters, fitness in rows:
        place = {"run": run, "generation": generation, "candidate": candidate}
        # A store may be damaged or come from elsewhere: the error names the row.
        with as_error(f"{store.path}: candidate {candidate} of generation {generation}", StudyError):
            fitnesses = dict(zip(objectives, _fitness(fitness, len(objectives)), strict=True))
            found.append({**place, **parse_values(parameters), **fitnesses})
    return pd.DataFrame(found)


def flight_table(store: FlightStore) -> pd.DataFrame:
    """Return one row a flight: parameters, seed, order parameters, why it failed, duration (s), worker, versions.

    A flight of another length than the scenario's has it as `duration_flown` (s, simulated).
    """
    rows = store.rows(
        "SELECT f.stage, f.run, f.generation, f.candidate, f.repeat, f.seed, c.parameters, f.scores, f.reason, "
        "f.duration, f.worker, s.versions FROM flight f JOIN candidate c USING (stage, run, generation, candidate) "
        "LEFT JOIN session s USING (session) ORDER BY f.stage, f.run, f.generation, f.candidate, f.repeat"
    )
    found = []
    for *key, parameters, scores, reason, duration, worker, versions in rows:
        place = dict(zip([*KEY, "repeat", "seed"], key, strict=True))
        about = {"reason": reason, "duration": duration, "worker": worker, "versions": versions}
        with as_error(f"{store.path}: a flight of {' '.join(map(str, key))}", StudyError):
            values = {name: v for name, v in parse_values(scores or "{}").items() if not isinstance(v, list)}
            given = {FLOWN if key == DURATION_COLUMN else key: value for key, value in parse_values(parameters).items()}
            found.append({**place, **given, **values, **about})
    return pd.DataFrame(found)


def _fitness(text: Any, count: int) -> list[float]:
    """Decode the fitness of a row, one number for each objective; nan: failed."""
    found = parse_json(text)
    sound = isinstance(found, list) and len(found) == count
    if not sound or not all(value is None or isinstance(value, (int, float)) for value in found):
        raise FormatError(f"fitness is not a list of {count} numbers")
    return [math.nan if value is None else float(value) for value in found]


def export(store: FlightStore, folder: Path, scenarios: Sequence[str] = ()) -> list[Path]:
    """Write all flights as evaluations.csv, and as evaluations.parquet where pyarrow is installed.

    scenarios : labels of the study's scenarios; with several, each row has its own
    """
    table = flight_table(store)
    if len(scenarios) > 1:
        table["scenario"] = [scenarios[repeat % len(scenarios)] for repeat in table["repeat"]]
    written = [folder / "evaluations.csv"]
    try:
        atomic.write_file(written[0], table.to_csv(index=False))
        if find_spec("pyarrow"):
            written.append(folder / "evaluations.parquet")
            with atomic.atomic_path(written[1]) as temporary:
                table.to_parquet(temporary, index=False)
    except OSError as error:
        raise StudyError(f"{folder}: tables cannot be written: {error.strerror or error}") from error
    return written


def sort_by_fitness(table: pd.DataFrame, objective: str, maximise: bool) -> Any:
    """Return the candidates without the failed ones, the best first; of equals the earlier."""
    sound = table[table[objective].notna()]
    return sound.sort_values(objective, ascending=not maximise, kind="stable")


def full_length_candidates(table: pd.DataFrame, growing: bool) -> pd.DataFrame:
    """Return the candidates of whole flights; fitness of short flights is on another scale."""
    return table[table[DURATION_COLUMN].isna()] if growing and DURATION_COLUMN in table else table


def mean_interval(values: Sequence[float]) -> tuple[float, float, float, float]:
    """Mean, SD, and Student's 95 % interval of the mean."""
    x = np.array(values, float)
    mean, sd = float(x.mean()), float(x.std(ddof=1)) if len(x) > 1 else 0.0
    # By Student: a few fresh flights know little of their own spread.
    half = float(stats.t.ppf(0.975, len(x) - 1)) * sd / len(x) ** 0.5 if len(x) > 1 else 0.0
    return mean, sd, mean - half, mean + half


def draw_study(study: Study, store: FlightStore, result: EvolveResult, folder: Path) -> list[Path]:
    """Draw convergence, fitness against parameters, slices of pairs and, with several objectives, the front."""
    from airflock.view import convergence, fitness_scatter, pareto, save_figure, slices

    first = study.objectives[0]
    names = [objective.name for objective in study.objectives]
    table = full_length_candidates(candidate_table(store, names), study.search.flights == "growing")
    units = {axis.key: axis.unit for axis in study.space.axes}
    bounds = {axis.key: (axis.low, axis.high) for axis in study.space.axes}
    name = study.scenario.name
    figures = {
        "convergence": convergence(table, first.name, maximise=first.maximise, what=name),
        "scatter": fitness_scatter(table, units, first.name, result.parameters, what=name),
    }
    if len(bounds) > 1:
        figures["slices"] = slices(table, bounds, first.name, result.parameters, maximise=first.maximise, what=name)
    if len(names) > 1:
        sound = table.dropna(subset=names).reset_index(drop=True)
        signs = [-1.0 if objective.maximise else 1.0 for objective in study.objectives]
        figures["pareto"] = pareto(sound, pareto_front(sound[names].to_numpy() * signs).tolist(), names, what=name)
    return [save_figure(figure, folder / f"{key}.png") for key, figure in figures.items()]
