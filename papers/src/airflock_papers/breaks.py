"""Breaks: each claim names a change under which it must turn red; here the changes are made and flown.

A claim that no change could break would say nothing. Its `breaks` are keys of a scenario that are set in every flight
of its part: of two sides that are compared, both have the same value then. It is flown with few seeds, as it is and
changed: the bound has to hold before and fail after.

The result of every change is committed in breaks.csv. `airflock paper all --breaks` flies all of them and compares;
`python -m airflock_papers.breaks FOLDER` flies all of them and writes the table. Both keep each finished part in a
folder with a hash of all texts that decide a flight, so that a run that was cut off goes on where it stopped. The row
of a new claim, and that a claim is red as it is, are entered by hand: the tests name each row that does not fit.

Each row names the kind of processor that flew it, since another kind flies other flights of the same seeds. Whether a
claim holds beforehand may then be another by chance. That its change breaks it must be seen on every kind.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from airflock.support import AirflockError, TextError, atomic, parse_json_object, processor_kind, read_text
from airflock_papers import committed as tables
from airflock_papers.catalogue import find
from airflock_papers.claims import VERDICTS, Measured, judge
from airflock_papers.flights import Flights
from airflock_papers.paper import Paper
from airflock_papers.progress import Progress, progress_bar, teller
from airflock_papers.statements import Statement, load
from airflock_papers.texts import texts

COMMITTED = "breaks.csv"
GOOD = {kind: verdicts[0] for kind, verdicts in VERDICTS.items()}
RED = "turned red"
GREEN = "still holds"  # a claim that its own change does not break
UNSHOWN = "does not hold with so few flights"  # so that its turning red would say nothing
UNMEASURED = "is not measured in the small form"  # it asks for more than a quick flight gives
ALREADY = "is red as it is"  # its page does not count it as reproduced, so that there is nothing to break
RESULTS = (RED, GREEN, ALREADY, UNSHOWN, UNMEASURED)
# flights per number where those of the quick form are too few to show that a claim holds beforehand
SEEDS = {
    ("vasarhelyi_2018", "s2"): 40,
    ("vasarhelyi_2018", "fig1"): 10,
    ("vasarhelyi_2018", "fig34"): 10,
    ("vasarhelyi_2018", "optima"): 40,
    ("vasarhelyi_2018", "pressure"): 20,
    ("vasarhelyi_2018", "limits"): 40,
    ("vasarhelyi_2018", "tuning"): 40,
    ("vasarhelyi_2018", "real"): 10,
    ("zapotecatl_2016", "sequential"): 15,
    ("kidger", "alone"): 10,
    ("kidger", "conduct"): 10,
    ("kidger", "tuning"): 40,
}


class Break(NamedTuple):
    """One claim under its change.

    id, part : of the claim; change : what was set, in words; result : one of RESULTS
    ours, changed : the measured value as it is, and under the change; nan if it is not measured
    """

    id: str
    part: str
    change: str
    result: str
    ours: float
    changed: float


class Row(NamedTuple):
    """A row of the committed table: fields as of `Break`, numbers to four digits.

    processor : its kind, on which the change was flown; empty where that was not kept, or nothing was flown
    """

    paper: str
    part: str
    id: str
    change: str
    result: str
    ours: str = ""
    changed: str = ""
    processor: str = ""


class Worse(NamedTuple):
    """A claim that its change does not break, or no longer does, as it is now.

    elsewhere : the kind of processor on which it was seen red, if it is another and the claim does not hold beforehand
                with the few flights of this one: not judged
    """

    row: Row
    elsewhere: str = ""


def fly(
    paper: Paper,
    *,
    only: str | None = None,
    seeds: int | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
    ids: Collection[str] | None = None,
) -> list[Break]:
    """Make the change of each claim of a paper that names one, and judge it again.

    A change is flown where a claim that names it holds without it: what is red already cannot turn red.

    only : one part; seeds : flights per number, else those of the quick form; threads : flights side by side
    ids : of the claims whose changes are made, else all
    progress : called with (title, flights done, flights in all), else a bar

    Raises AirflockError if the paper, or the part of it, has no claim with a change.
    """
    if progress is None:
        with progress_bar() as bar:
            return fly(paper, only=only, seeds=seeds, threads=threads, progress=bar, ids=ids)
    statements = [s for s in load(paper.package).values() if ids is None or s.id in ids]
    return of(paper, statements, only, Flights(True, seeds, threads, progress))


def of(paper: Paper, statements: Iterable[Statement], only: str | None, flights: Flights) -> list[Break]:
    """The same of a paper and its statements; flights: how to fly."""
    by_part: dict[str, list[Statement]] = {}
    for statement in statements:
        if statement.breaks:
            by_part.setdefault(part_of(statement), []).append(statement)
    chosen = {only: by_part.get(only, [])} if only else by_part
    if not any(chosen.values()):
        known = ", ".join(by_part) or "none"
        raise AirflockError(f"{paper.title}: no claim of {only or 'it'} names a change; parts that do: {known}")
    found = []
    for part, members in chosen.items():
        plain = _measured(paper, part, flights, {}, members)
        for changes in _different([statement.breaks for statement in members]):
            named = [statement for statement in members if statement.breaks == changes]
            after: dict[str, Measured] = {}
            if any(_holds(statement, plain.get(statement.id)) for statement in named):
                after = _measured(paper, part, flights, changes, named)
            found += [_broken(s, part, plain.get(s.id), after.get(s.id)) for s in named]
    return found


def _measured(
    paper: Paper, part: str, flights: Flights, changes: Mapping[str, Any], asked: Iterable[Statement]
) -> dict[str, Measured]:
    """Measurements of one part under changes, by id; a part may leave out what is not asked for."""
    told, progress = in_words(changes) or "as it is", flights.progress

    def tell(title: str, done: int, total: int) -> None:
        if progress:
            progress(f"{part}, {told}: {title}", done, total)

    wanted = frozenset(statement.id for statement in asked)
    how = replace(flights, progress=tell, changes=changes, wanted=wanted)
    return {found.id: found for found in paper.fly((part,), how)[0]}


def part_of(statement: Statement) -> str:
    """Part of the paper that measures a statement."""
    return statement.part or statement.id.split(".")[0]


def in_words(changes: Mapping[str, Any]) -> str:
    """A change as one reads it: `model.p_rep = 0`, `model.r0_rep times 0.5`."""
    return ", ".join(
        f"{key} {v}" if isinstance(v, str) and v.startswith("times ") else f"{key} = {v}" for key, v in changes.items()
    )


def _different(found: list[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Each change once, in the order of the statements."""
    return list({in_words(changes): changes for changes in found}.values())


def _broken(statement: Statement, part: str, plain: Measured | None, after: Measured | None) -> Break:
    """How a statement is judged as it is and under its change."""
    ours, changed = (each.value.ours if each else math.nan for each in (plain, after))
    if plain and not _holds(statement, plain):
        result = UNSHOWN
    elif plain and after:
        result = GREEN if _holds(statement, after) else RED
    else:
        result = UNMEASURED
    return Break(statement.id, part, in_words(statement.breaks), result, ours, changed)


def _holds(statement: Statement, measured: Measured | None) -> bool:
    """Whether the bound of a statement holds for what was measured; not if nothing was."""
    return measured is not None and judge({statement.id: statement}, [measured])[0].verdict == GOOD[statement.kind]


def committed() -> list[Row]:
    """Read the committed table.

    Raises AirflockError if there is none.
    """
    return [Row(**row) for row in tables.read(COMMITTED, "python -m airflock_papers.breaks")]


def fly_all(folder: Path, say: Callable[[str], None], threads: int | None = None) -> list[Row]:
    """Fly every change of the committed table, except those of claims that are red as they are.

    Returns the rows of the table with the new results. The folder keeps finished parts and a log of the progress.
    """
    folder.mkdir(parents=True, exist_ok=True)
    now = f"{texts()} on {processor_kind()}"
    rows = committed()
    todo: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        if row.result != ALREADY:
            todo.setdefault((row.paper, row.part), set()).add(row.id)
    new: dict[tuple[str, str], Row] = {}
    for number, ((name, part), ids) in enumerate(todo.items(), 1):
        path = folder / f"{name}.{part}.breaks.json"
        flown = _kept(path, now, ids)
        if flown is None:
            tell = teller(folder / "log.txt", say, f"{number}/{len(todo)} {name} {part}")
            results = fly(find(name), only=part, seeds=SEEDS.get((name, part)), threads=threads, progress=tell, ids=ids)
            flown = [
                Row(name, part, b.id, b.change, b.result, f"{b.ours:.4g}", f"{b.changed:.4g}", processor_kind())
                for b in results
            ]
            atomic.write_file(path, json.dumps({"texts": now, "rows": flown}))
        new |= {(row.paper, row.id): row for row in flown}
    return [new.get((row.paper, row.id), row) for row in rows]


def _kept(path: Path, now: str, ids: Collection[str]) -> list[Row] | None:
    """Return the rows of a part that was flown with these texts, or None if the file lacks some or cannot be read."""
    try:
        document = parse_json_object(read_text(path))
        rows = [Row(*map(str, row)) for row in document["rows"]] if document.get("texts") == now else []
    except (OSError, TextError, LookupError, TypeError, ValueError):
        return None
    rows = [row for row in rows if row.id in ids]
    return rows if {row.id for row in rows} == set(ids) else None


def worse(before: Iterable[Row], after: Iterable[Row]) -> list[Worse]:
    """List the claims that their change does not break, or no longer does.

    One that still holds under its change is listed on every kind of processor. One that does not hold beforehand is not
    judged where it was seen red on another kind; a kind that is not known is taken for this one.
    """
    red = {(row.paper, row.id): row.processor for row in before if row.result == RED}
    listed = []
    for row in after:
        seen = red.get((row.paper, row.id))
        if row.result == GREEN:
            listed.append(Worse(row))
        elif seen is not None and row.result != RED:
            listed.append(Worse(row, seen if row.processor not in ("", seen) else ""))
    return listed


if __name__ == "__main__":
    tables.renew("Make the change of every claim and commit the results.", COMMITTED, Row._fields, fly_all)


def report_all(folder: Path, say: Callable[[str], None], threads: int | None = None) -> tables.Report:
    """Check every claim of every paper under its change; it fails where one held that was seen to turn red."""
    before = committed()
    rows = fly_all(folder, say, threads)
    lost = worse(before, rows)
    lines = []
    for row, elsewhere in lost:
        why = f" (not judged: turned red on {elsewhere})" if elsewhere else ""
        lines.append(f"{row.paper} {row.id}: {row.result} with {row.change} ({row.ours}, then {row.changed}){why}")
    message = ", ".join(f"{number} {result}" for result, number in Counter(row.result for row in rows).items())
    lines.append(f"{len(rows)} claims under their changes: {message}")
    listed = [each.row._asdict() | {"elsewhere": each.elsewhere} for each in lost]
    content = {"claims": [row._asdict() for row in rows], "worse": listed}
    return tables.Report(lines, content, all(each.elsewhere for each in lost))


def report(rows: Sequence[Break]) -> tables.Report:
    """Report the claims of one paper under their changes; it fails where one still holds."""
    lines = [f"{r.id}: {r.result} with {r.change} ({r.ours:.4g}, then {r.changed:.4g})" for r in rows]
    lines.append(", ".join(f"{sum(row.result == result for row in rows)} {result}" for result in RESULTS))
    return tables.Report(lines, [row._asdict() for row in rows], all(row.result != GREEN for row in rows))
