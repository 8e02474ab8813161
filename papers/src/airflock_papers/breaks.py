"""Breaks: each claim names a change under which it must turn red; here the changes are made and flown.

A claim that no change could break would say nothing. Its `breaks` are keys of a scenario that are set in every flight
of its part: of two sides that are compared, both have the same value then. It is flown with few seeds, as it is and
changed: the bound has to hold before and fail after.
"""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from airflock.errors import AirflockError
from airflock_papers.claims import VERDICTS, Measured, judge
from airflock_papers.flights import Flights
from airflock_papers.paper import Paper
from airflock_papers.progress import Progress, progress_bar
from airflock_papers.statements import Statement, load

GOOD = {kind: verdicts[0] for kind, verdicts in VERDICTS.items()}
RED = "turned red"
GREEN = "still holds"  # a claim that its own change does not break
UNSHOWN = "does not hold with so few flights"  # so that its turning red would say nothing
UNMEASURED = "is not measured in the small form"  # it asks for more than a quick flight gives
ALREADY = "is red as it is"  # its page does not count it as reproduced, so that there is nothing to break
RESULTS = (RED, GREEN, ALREADY, UNSHOWN, UNMEASURED)


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
