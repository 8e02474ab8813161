"""League: laws × robots × worlds. Each law is tuned by the same search, and judged on the same held-out seeds.

A cell is one law on one robot in one world: a study in a folder of its own, then flights of its
winner on seeds that no study flies. All laws of a robot in a world fly the same seeds, so that they
are compared in pairs.
"""

import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from importlib import resources
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from airflock import __version__
from airflock.runs import (
    RESULT_FILE,
    CandidateBatch,
    Flight,
    Interrupted,
    OnProgress,
    ProgressTally,
    ScenarioTask,
    declared_numbers,
    held_request,
    make_executor,
    open_folder,
    open_run,
    program_versions,
    read_request,
    read_toml_file,
    run_place,
    to_toml_values,
    with_parameters,
    write_toml_file,
)
from airflock.scenarios import Scenario, load, scenario_variant, schema
from airflock.search.evolution import run_study, study_executor
from airflock.search.generations import NothingFliesError
from airflock.search.study import SearchSettings, Study, make_study
from airflock.search.study_result import mean_interval
from airflock.search.tune_report import STYLE
from airflock.support import (
    ErrorCollector,
    FlightError,
    RuleError,
    ScenarioError,
    StudyError,
    as_error,
    atomic,
    expand_path,
    holm_correction,
    is_number,
    result_group,
    result_table,
    suggest,
    to_identifier,
)

SHIPPED = "league_1.toml"  # the league that comes with the package
PAGE, PICTURE, CELLS, REPLAY = "league.html", "league.png", "cells", "replay.html"
KEYS = ("title", "version", "scenario", "held_out", "set", "robots", "worlds", "laws", "search")
LAW_KEYS = ("file", "set", "space")
METRICS = "metrics.kind"
COMMON = ("metrics.v_flock", "metrics.r_cluster", "start.separation")  # keys whose defaults are those of a law
TUNED_BY, JUDGED_BY = "vasarhelyi", "swarmlab"  # of one fitness; the latter measures more, at a cost
HELD_OUT = CandidateBatch("held_out", 0, 0)
PURPOSE = 5  # of held-out seeds; those of a study are 0 to 4
LEVEL = 0.05  # of all comparisons of a league together, by Holm
SHOWN = {  # columns of the tables
    "fitness": "fitness", "order": "order", "safety": "safety", "union": "union", "connectivity": "connectivity",
    "phi_vel": "speed, m/s",
}  # fmt: skip


class Cell(NamedTuple):
    """One law on one robot in one world."""

    law: str
    robot: str
    world: str

    def __str__(self) -> str:
        return f"{self.law} on {self.robot} in {self.world}"


@dataclass(frozen=True)
class League:
    """A league as its file says it.

    table  : title, version, scenario, held_out, set, robots, worlds and search, as plain values
    laws   : name of each law → its `file`, if it is no law of the package, and its tables `set` and
             `space`; a folder may get further laws
    source : file of a computed league whose rows are taken over, "" for none
    """

    table: Mapping[str, Any]
    laws: Mapping[str, Mapping[str, Any]]
    source: str = ""
    kind = "league"

    def document(self) -> dict[str, Any]:
        """Return all that decides the result of a law, as plain values: the request in its folder."""
        return {"airflock": __version__, **self.table}

    @property
    def also(self) -> dict[str, Any]:
        """The laws, which a folder may hold more of than it began with."""
        return {"laws": dict(self.laws), **({"source": self.source} if self.source else {})}

    @property
    def cells(self) -> list[Cell]:
        """All cells, robot by robot and world by world."""
        robots, worlds = self.table["robots"], self.table["worlds"]
        return [Cell(law, robot, world) for robot in robots for world in worlds for law in self.laws]

    @property
    def held_out(self) -> int:
        """Number of held-out flights of each cell."""
        return int(self.table["held_out"])

    def scenario(self, cell: Cell, metrics: str, *, trust: bool) -> Scenario:
        """Return the scenario of a cell, with its law's own settings last."""
        table = self.table
        own = self.laws[cell.law]
        settings = {**table.get("set", {}), **table["robots"][cell.robot], **table["worlds"][cell.world]}
        settings |= {**own.get("set", {}), METRICS: metrics}
        scenario = load(table["scenario"], settings, own.get("file", cell.law), trust=trust)
        return _at_speed(scenario, cell.law)

    def study(self, cell: Cell, *, trust: bool) -> Study | str:
        """Return the study by which a cell is tuned, or why its law cannot fly at all."""
        scenario = self.scenario(cell, TUNED_BY, trust=trust)
        space = self.laws[cell.law].get("space")
        tables = {} if space is None else {"space": space}
        try:
            return make_study(tables, cell.law, search=self.table.get("search"), scenario=scenario, trust=trust)
        except RuleError as error:
            return str(error).partition("\n")[0]


def _at_speed(scenario: Scenario, law: str) -> Scenario:
    """Return the scenario with the law at the speed that fitness asks for (metrics.v_flock).

    Raises ScenarioError where no number of the law is its preferred speed.
    """
    # A search leaves the speed alone, so a law with a default of its own would lose without a word.
    own, speed = scenario.model.speed(scenario.parameters), scenario.metrics.v_flock
    if not own or speed is None or own == speed:
        return scenario
    numbers = (
        key for key, (_, value) in declared_numbers(scenario).items() if key.startswith("model.") and value == own
    )
    for key in numbers:
        varied = scenario_variant(scenario, {key: speed})
        if varied.model.speed(varied.parameters) == speed:
            return varied
    advice = f"set its speed under [laws.{law}.set]"
    raise ScenarioError([f"{law}: flies at {own:g} m/s, but metrics.v_flock = {speed:g} m/s; {advice}"])


@dataclass(frozen=True)
class LeagueResult:
    """A league that has been flown.

    rows        : one for each cell: law, robot, world; either the reason why it does not flock, or
                  parameters, means of the order parameters with Student's 95 % intervals, and the
                  fitness of each held-out flight
    comparisons : one for each two laws that flock on one robot in one world: the mean paired
                  difference of fitness, its interval, and p, corrected by Holm over all of them
    """

    folder: Path
    league: League
    rows: tuple[Mapping[str, Any], ...]
    comparisons: tuple[Mapping[str, Any], ...]

    def __repr__(self) -> str:
        return f"<League {self.folder}: {len(self.league.laws)} laws, {len(self.rows)} cells>"

    def __rich__(self) -> Any:
        """Return a table for each robot in each world, for a terminal."""
        heads = "|law; |ranks; |>fitness; >" + "; >".join([*SHOWN.values()][1:])
        tables = [result_table(title, heads, rows, min_width=6) for title, rows in self.tables(("fitness",))]
        reasons = [f"{_name(row)}: {row['reason']}" for row in self.rows if row["reason"]]
        return result_group(*tables, *reasons, f"saved {self.folder}: {RESULT_FILE}, {PAGE}, {PICTURE}")

    def document(self) -> dict[str, Any]:
        """Return the league as plain values, for result.toml and --json."""
        return {
            "league": {**to_toml_values(self.league.table), "laws": to_toml_values(self.league.laws)},
            "versions": program_versions(),
            "rows": [dict(row) for row in self.rows],
            "comparisons": [dict(each) for each in self.comparisons],
        }

    def ranks(self, row: Mapping[str, Any]) -> tuple[int, int] | None:
        """Return the best and the worst rank that a law may have in its cell; None where it does not flock."""
        if row["reason"]:
            return None
        here = [each for each in self.comparisons if (each["robot"], each["world"]) == (row["robot"], row["world"])]
        own = [each for each in here if row["law"] in (each["law"], each["other"])]
        apart = [each for each in own if each["p"] < LEVEL]
        better = sum((each["difference"] < 0.0) == (each["law"] == row["law"]) for each in apart)
        return 1 + better, 1 + better + len(own) - len(apart)

    def tables(self, with_interval: Iterable[str] = SHOWN) -> Iterable[tuple[str, list[tuple[str, ...]]]]:
        """Yield title and lines (law, ranks, order parameters) for each robot in each world, the best law first.

        with_interval : order parameters that are shown with their intervals
        """
        for block in dict.fromkeys((row["robot"], row["world"]) for row in self.rows):
            rows = [row for row in self.rows if (row["robot"], row["world"]) == block]
            rows.sort(key=lambda row: -row.get("values", {}).get("fitness", {}).get("mean", -1.0))
            yield f"{block[0]}, {block[1]}", [self._line(row, with_interval) for row in rows]

    def _line(self, row: Mapping[str, Any], with_interval: Iterable[str]) -> tuple[str, ...]:
        span = self.ranks(row)
        ranks = "none" if span is None else f"{span[0]}" if span[0] == span[1] else f"{span[0]} to {span[1]}"
        values = {name: row.get("values", {}).get(name) for name in SHOWN}
        numbers = (f"{value['mean']:.3f}" if value else "" for value in values.values())
        # Student's interval is symmetric about the mean.
        spreads = (f" ± {v['high'] - v['mean']:.3f}" if v and k in with_interval else "" for k, v in values.items())
        return (row["law"], ranks, *map("".join, zip(numbers, spreads, strict=True)))


def league(
    source: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    law: Sequence[str] = (),
    resume: bool = False,
    scheduler: str | None = None,
    threads: int | None = None,
    watch: OnProgress | None = None,
    trust: bool = False,
) -> LeagueResult:
    """Compare laws on robots in worlds: each is tuned by the same flights and judged on the same held-out seeds.

    Parameters
    ----------
    source : str or path (FILE), optional
        The file of a league, or the result.toml of one, whose rows are taken over; by default the league of the
        package.
    out : str or path (DIR)
        Folder of the league: every flight as it lands, result.toml, and a page with table, picture and replays.
    law : sequence of str (LAW|FILE.py)
        A further law, by its name or its file, whose numbers are searched about its defaults; repeatable.
    resume : bool
        Continue the league in the folder, or add laws to it.
    scheduler : str, optional
        Address of a dask scheduler; by default flights fly in this process.
    threads : int, optional
        Flights side by side; by default one per core.
    watch : callable, optional
        Called with an `airflock.runs.RunProgress` after each flight.
    trust : bool
        Whether code that the file names may run; a law that is given by `law` may.

    Returns
    -------
    LeagueResult
        Rows, comparisons and ranks; the same stands in the folder as result.toml.

    Raises
    ------
    ScenarioError, StudyError
        If the file, one of its scenarios or the folder cannot be used.
    Interrupted
        At Ctrl-C; what has flown is kept.

    Notes
    -----
    Measures of swarms: Soria, Schiano and Floreano 2020. Ranks: paired t-tests, corrected by Holm over the league.

    Examples
    --------
    >>> import airflock
    >>> airflock.league("legue.toml", "table")
    Traceback (most recent call last):
    airflock.support.errors.StudyError: legue.toml: no such file
    """
    folder, errors = run_place(out), ErrorCollector()
    request = errors.read(read_league, source, law, folder if resume else None, trust=trust)
    errors.raise_errors()
    # Errors of cells come before anything flies; those of several cells are one line.
    known = {_name(row): row for row in _computed(request)}
    studies = {cell: errors.read(request.study, cell, trust=trust) for cell in request.cells if str(cell) not in known}
    errors.raise_errors("" if source is None else str(source))
    open_folder(folder, request, resume=resume)
    rows = []
    for number, cell in enumerate(request.cells, 1):
        place = _folder(folder / CELLS, cell._asdict())
        where = f"cell {number} of {len(request.cells)}, {cell}"
        row = known.get(str(cell))
        rows.append(row or fly_cell(request, cell, studies[cell], place, where, scheduler, threads, watch))
    result = LeagueResult(folder, request, tuple(rows), tuple(compare_laws(rows)))
    _save_page(result)
    # last: a folder with a result is complete
    write_toml_file(folder / RESULT_FILE, result.document(), f"League: {request.table['title']}.")
    return result


def read_league(
    source: str | os.PathLike[str] | None, laws: Sequence[str], folder: Path | None, *, trust: bool
) -> League:
    """Read a league from a file, from the result of one, or (`source` None) from the folder that is resumed.

    laws : further ones
    Raises ScenarioError with one line for each error, StudyError for a file or folder that cannot
    be read.
    """
    held = None if folder is None else read_request(folder, League.kind)
    before = (held or {}).get("also", {})
    if source is None and folder is not None:
        held = held_request(folder, League.kind, {})
        where, table, origin = str(folder), {key: held[key] for key in KEYS if key in held}, before.get("source", "")
    else:
        path = Path(str(resources.files(__package__) / SHIPPED)) if source is None else expand_path(source)
        where, table = str(source or SHIPPED), read_toml_file(path)
        is_result = isinstance(table.get("league"), dict) and "rows" in table
        table, origin = (table["league"], str(path.absolute())) if is_result else (table, before.get("source", ""))
    _check_league(table, where)
    of_file = {name: dict(entry) for name, entry in table.pop("laws", {}).items()}
    for entry in of_file.values():
        if "file" in entry:
            entry["file"] = str(path.parent.absolute() / expand_path(entry["file"]))
    added = dict(_added_law(name) for name in laws)
    known = {**before.get("laws", {}), **of_file}
    errors = ErrorCollector()
    for name, entry in added.items():
        if known.setdefault(name, entry) != entry and entry:
            errors.add(f"law = {entry['file']!r}: another law of the league is called {name}; rename the file")
    # A law of the command line is given, so it may run; one that a file names needs consent.
    for name, entry in known.items():
        if "file" in entry and name not in added and not trust:
            errors.add(f"laws.{name}: would run the code in {entry['file']}; if you trust it, add --trust")
    if not known:
        errors.add("laws is missing; write a table [laws.NAME] for each law, or give --law")
    errors.raise_errors(where)
    return League({"title": "League", "version": 1, **table}, known, origin)


def _added_law(name: str) -> tuple[str, dict[str, str]]:
    """Return name and entry of a law of the command line."""
    if not name.endswith(".py"):
        return name, {}
    path = expand_path(name).absolute()
    return to_identifier(path.stem), {"file": str(path)}


def _check_league(table: Mapping[str, Any], where: str) -> None:
    """Raise ScenarioError for keys and values of a league's file that cannot be used, all errors together."""
    hint = f"known: {', '.join(KEYS)}"
    errors = ErrorCollector(f"{key}: unknown key; {suggest(key, KEYS, hint)}" for key in table if key not in KEYS)
    if not isinstance(table.get("scenario"), str):
        errors.add('scenario is missing; write scenario = "NAME", the preset or file that all cells share')
    flights: Any = table.get("held_out")
    if not (is_number(flights) and 2 <= flights <= 1e6 and flights == int(flights)):
        errors.add(f"held_out = {flights!r} is not a whole number of flights in [2, 1e6]")
    schema.read_section("search", table.get("search", {}), SearchSettings, errors)
    for key in ("set", "robots", "worlds", "laws"):
        entries = table.get(key, {})
        if not isinstance(entries, Mapping):
            errors.add(f"{key} = {entries!r} is not a table")
            continue
        if key in ("robots", "worlds") and not entries:
            errors.add(f"{key} is missing; write a table [{key}.NAME] of keys of the scenario for each")
        for name, entry in entries.items() if key in ("robots", "worlds", "laws") else ():
            if not isinstance(entry, Mapping):
                errors.add(f"{key}.{name} = {entry!r} is not a table")
                continue
            if not re.fullmatch(r"[\w-]+", name):
                errors.add(f"{key}.{name}: a name is made of letters, digits, _ and -; it becomes that of a folder")
            settings = entry.get("set", {}) if key == "laws" else entry
            unknown = [word for word in entry if key == "laws" and word not in LAW_KEYS]
            errors.add(*(f"laws.{name}.{word}: unknown key; known: {', '.join(LAW_KEYS)}" for word in unknown))
            if not isinstance(settings, Mapping):
                errors.add(f"laws.{name}.set = {settings!r} is not a table")
            elif METRICS in settings:
                errors.add(f"{key}.{name}: {METRICS} is that of the league; leave it out")
            if not isinstance(entry.get("file", ""), str):
                errors.add(f"laws.{name}.file = {entry['file']!r} is not the name of a file")
    common = table.get("set", {})
    if isinstance(common, Mapping):
        errors.add(*(f"set.{METRICS} is that of the league; leave it out" for _ in {METRICS} & set(common)))
        missing = [key for key in COMMON if key not in common]
        why = "by default it differs from law to law, so that they would not be judged by one measure; give a number"
        errors.add(*(f'set."{key}" is missing: {why}' for key in missing))
    errors.raise_errors(where)


def _name(row: Mapping[str, Any]) -> str:
    """Return the name of the cell of a row."""
    return str(Cell(row["law"], row["robot"], row["world"]))


def _folder(cells: Path, row: Mapping[str, Any]) -> Path:
    """Return the folder of a cell among those of all cells."""
    return cells / f"{row['law']}_{row['robot']}_{row['world']}"


def _computed(request: League) -> list[Mapping[str, Any]]:
    """Return the rows of a computed league. Raises StudyError for a damaged one, and for other sizes."""
    if not request.source:
        return []
    held = read_toml_file(Path(request.source))
    with as_error(request.source, StudyError):
        theirs = {key: value for key, value in held["league"].items() if key != "laws"}
        if theirs != to_toml_values(request.table):
            raise StudyError(f"{request.source}: is the result of another league; give another --out")
        rows = [row for row in held["rows"] if row["law"] in request.laws]
        if any(not row["reason"] and len(row["held_out"]) != request.held_out for row in rows):
            raise StudyError(f"{request.source}: is damaged: a row has not {request.held_out} held-out flights")
        for row in (row for row in rows if not row["reason"]):
            if not math.isclose(np.mean(row["held_out"]), row["values"]["fitness"]["mean"], rel_tol=1e-9):
                raise StudyError(f"{request.source}: is damaged: {row['law']}: its fitness is not that of its flights")
        if version := held["versions"]["airflock"] if held["versions"]["airflock"] != __version__ else "":
            raise StudyError(
                f"{request.source}: was computed by Airflock {version}, this is {__version__}; compute it again"
            )
    return rows


def fly_cell(
    request: League, cell: Cell, study: Study | str, place: Path, where: str, scheduler: str | None,
    threads: int | None, watch: OnProgress | None,
) -> dict[str, Any]:  # fmt: skip
    """Tune a law in its folder and judge it; return its row, with the reason where it does not flock."""
    row: dict[str, Any] = {**cell._asdict(), "reason": ""}
    if isinstance(study, str):
        return row | {"reason": study}
    row["notes"] = [*study.scenario.notes, *study.notes]
    # Errors of the folder end the league: they say nothing of the law.
    open_folder(place, study)
    stage = watch and (lambda p: watch(replace(p, stage=f"{where}: {p.stage}")))
    try:
        tuned = run_study(study, place, study_executor(study, scheduler, threads), stage)
        if tuned.dead_reason:
            return row | {"reason": tuned.dead_reason}
        judged = request.scenario(cell, JUDGED_BY, trust=True)
        executor = make_executor(
            [ScenarioTask(judged, int(study.search.precision))], scheduler=scheduler, threads=threads
        )
        tally = ProgressTally("held-out flights", request.held_out, stage)
        seeds = [study.seed(PURPOSE, j) for j in range(request.held_out)]
        flights = [Flight(0, j, tuned.parameters, seed) for j, seed in enumerate(seeds)]
        with open_run(place, executor) as store:
            flown = store.fly_missing(executor, HELD_OUT, flights, lambda: tally.note(True))
            (tuning,) = store.rows("SELECT count(*) FROM flight WHERE stage <> ?", (HELD_OUT.stage,))[0]
        scores = [flown[0, j] for j in range(request.held_out)]
        _save_replay(place, with_parameters(judged, tuned.parameters), seeds[0])
    except Interrupted:
        raise
    except (RuleError, FlightError, NothingFliesError) as error:
        return row | {"reason": str(error).partition("\n")[0]}
    fitness = [float(each["fitness"]) for each in scores]
    intervals = {name: _interval([each[name] for each in scores]) for name in scores[0]}
    if not all(map(math.isfinite, fitness)):
        return row | {
            "reason": f"fitness is no finite number in {sum(not math.isfinite(f) for f in fitness)} held-out flights"
        }
    return row | {
        "tuning_flights": int(tuning),
        "parameters": dict(tuned.parameters),
        "values": {name: values for name, values in intervals.items() if values},
        "held_out": fitness,
    }


def _interval(values: Sequence[Any]) -> dict[str, float]:
    """Return the mean and Student's 95 % interval of an order parameter; empty where it is not a number throughout."""
    if not all(is_number(value) and math.isfinite(value) for value in values):
        return {}
    mean, _, low, high = mean_interval(values)
    return {"mean": mean, "low": low, "high": high}


def compare_laws(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Compare each two laws that flock on one robot in one world, in pairs of held-out flights of one seed.

    Two laws whose difference is the same in all flights are not distinguished: it has no spread to
    judge it by.
    """
    flying = [row for row in rows if not row["reason"]]
    pairs = [(a, b) for a, b in combinations(flying, 2) if (a["robot"], a["world"]) == (b["robot"], b["world"])]
    gaps = [np.subtract(a["held_out"], b["held_out"]) for a, b in pairs]
    # Paired by seed: both fly the same start and the same noise, so most of the spread between seeds cancels.
    raw = [float(stats.ttest_1samp(gap, 0.0).pvalue) if np.ptp(gap) > 1e-12 else math.nan for gap in gaps]
    corrected = [1.0 if math.isnan(p) else p for p in holm_correction(raw)]
    return [
        {"robot": a["robot"], "world": a["world"], "law": a["law"], "other": b["law"], "p": p}
        | dict(zip(("difference", "low", "high"), np.delete(mean_interval(gap), 1).tolist(), strict=True))
        for (a, b), gap, p in zip(pairs, gaps, corrected, strict=True)
    ]


def _save_replay(place: Path, scenario: Scenario, seed: int) -> None:
    """Save the replay of the first held-out flight, once."""
    from airflock.recordings import simulate
    from airflock.view import replay

    if not (place / REPLAY).is_file():
        replay(simulate(scenario, seed)).save(place / REPLAY)


def _save_page(result: LeagueResult) -> None:
    """Write the page with its picture beside it."""
    table, title = result.league.table, escape(str(result.league.table["title"]))
    search = SearchSettings(**table.get("search", {}))
    _draw(result)
    body = [
        f"<h1>{title}</h1><p>Version {table['version']}, Airflock {__version__}. Each law was tuned by "
        f"{search.generations:g} generations of {search.population:g} candidates and a final, then flown on "
        f"{result.league.held_out} seeds that chose nothing, the same for all laws. ±: 95 % interval of the mean. "
        "Ranks are those that paired differences of fitness allow, at "
        f"{100.0 * LEVEL:g} % for the whole league (Holm).</p>"
        f'<img alt="Fitness of each law, with 95 % intervals" src="{PICTURE}">',
    ]
    heads = "".join(f"<th>{escape(text)}</th>" for text in ("law", "ranks", *SHOWN.values()))
    for heading, lines in result.tables():
        rows = ("".join(f"<td>{escape(text)}</td>" for text in line) for line in lines)
        rows_html = "".join(f"<tr>{row}</tr>" for row in rows)
        body.append(f"<h2>{escape(heading)}</h2><table><tr>{heads}</tr>{rows_html}</table>")
    body.append("<h2>Cells</h2>")
    for row in result.rows:
        file = _folder(Path(CELLS), row) / REPLAY
        link = f': <a href="{escape(file.as_posix())}">watch</a>' if (result.folder / file).is_file() else ""
        remarks = "".join(f"<li>{escape(text)}</li>" for text in (row["reason"], *row.get("notes", ())) if text)
        body.append(f"<p>{escape(_name(row))}{link}</p><ul>{remarks}</ul>")
    body.append("<p>A law of your own: <code>airflock league result.toml --out DIR --law mine.py</code></p>")
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title>'
    atomic.write_file(result.folder / PAGE, f"{head}<style>{STYLE}</style><body>{''.join(body)}</body></html>\n")


def _draw(result: LeagueResult) -> None:
    """Draw the fitness of each law with its interval, one panel for each robot in each world."""
    from matplotlib.figure import Figure

    from airflock.view import save_figure

    blocks = list(dict.fromkeys((row["robot"], row["world"]) for row in result.rows))
    names = list(result.league.laws)
    figure = Figure(figsize=(2.0 + 2.2 * len(blocks), 1.2 + 0.3 * len(names)), layout="constrained")
    for axes, block in zip(figure.subplots(1, len(blocks), sharey=True, squeeze=False)[0], blocks, strict=True):
        for row in result.rows:
            if (row["robot"], row["world"]) == block and not row["reason"]:
                value, place = row["values"]["fitness"], names.index(row["law"])
                axes.plot([value["low"], value["high"]], [place, place], color="#0072B2")
                axes.plot(value["mean"], place, "o", color="#0072B2")
        axes.set_title(", ".join(block), fontsize=9.0)
        axes.set_xlim(0.0, 1.0)
        axes.set_xlabel("fitness")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    save_figure(figure, result.folder / PICTURE)
