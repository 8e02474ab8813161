"""Campaign: the change of every claim made and flown, part by part; what came of it stands committed beside this file.

A part that is done is kept in a folder with a hash of all texts that decide a flight, so that a campaign that was cut
off goes on where it stopped. In a clone, `python -m airflock_papers.campaign FOLDER` flies everything and commits what
it finds after each part; with `--open` only claims that nobody has seen red so far, with names of parts
(`kidger.tuning`) only these. `airflock paper all --breaks` compares.

Each row names the kind of processor that flew it, since another kind flies other flights of the same seeds. Whether a
claim holds beforehand may then be another by chance. That its change breaks it must be seen on every kind.
"""

import argparse
import json
import sys
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from airflock import atomic
from airflock.errors import AirflockError
from airflock.machine import kind
from airflock.untrusted import TextError, json_object, read_text
from airflock_papers import PAPERS, breaks
from airflock_papers import committed as tables
from airflock_papers.catalogue import find
from airflock_papers.claims import VERDICTS, read_claims
from airflock_papers.progress import teller
from airflock_papers.statements import Statement, load
from airflock_papers.texts import texts

COMMITTED = "breaks.csv"
UNMADE = "not made yet"  # in the table: a change that nobody has flown so far
OPEN = (UNMADE, breaks.UNSHOWN, breaks.UNMEASURED)  # results of claims that nobody has seen red
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
Key = tuple[str, str]  # paper and claim, or paper and part


class Row(NamedTuple):
    """What came of the change of one claim: as of `breaks.Break`, numbers to four digits.

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


def parts(rows: Iterable[Row]) -> list[Key]:
    """Papers and parts of some rows, in their order."""
    return list(dict.fromkeys((row.paper, row.part) for row in rows))


def fly(folder: Path, say: Callable[[str], None], threads: int | None = None) -> list[Row]:
    """What came of every change, those of claims that are red as they are left out.

    What is done is kept in the folder, with a log of the progress.
    """
    rows = committed()
    for found in in_parts(folder, say, [row for row in rows if row.result != breaks.ALREADY], threads):
        rows = replaced(rows, found)
    return rows


def in_parts(
    folder: Path, say: Callable[[str], None], wanted: Sequence[Row], threads: int | None = None
) -> Iterable[list[Row]]:
    """What came of the changes of some rows, part by part, as soon as one is flown."""
    folder.mkdir(parents=True, exist_ok=True)
    now = f"{texts()} on {kind()}"
    todo = parts(wanted)
    for number, (name, part) in enumerate(todo, 1):
        path = folder / f"{name}.{part}.breaks.json"
        ids = {row.id for row in wanted if (row.paper, row.part) == (name, part)}
        rows = _kept(path, now, ids)
        if rows is None:
            tell = teller(folder / "log.txt", say, f"{number}/{len(todo)} {name} {part}")
            flown = breaks.fly(
                find(name), only=part, seeds=SEEDS.get((name, part)), threads=threads, progress=tell, ids=ids
            )
            rows = [
                Row(name, part, b.id, b.change, b.result, f"{b.ours:.4g}", f"{b.changed:.4g}", kind()) for b in flown
            ]
            atomic.write(path, json.dumps({"texts": now, "rows": rows}))
        yield rows


def _kept(path: Path, now: str, ids: Collection[str]) -> list[Row] | None:
    """Rows of a part that was flown with these texts; of a file that lacks some, is not there, or is damaged, none."""
    try:
        document = json_object(read_text(path))
        rows = [Row(*map(str, row)) for row in document["rows"]] if document.get("texts") == now else []
    except (OSError, TextError, LookupError, TypeError, ValueError):
        return None
    found = [row for row in rows if row.id in ids]
    return found if {row.id for row in found} == set(ids) else None


def committed() -> list[Row]:
    """What is committed.

    Raises AirflockError if there is nothing.
    """
    return [Row(**row) for row in tables.read(COMMITTED, "python -m airflock_papers.campaign")]


def replaced(rows: Iterable[Row], found: Iterable[Row]) -> list[Row]:
    """Rows, with those that were found in place of older ones."""
    new = {(row.paper, row.id): row for row in found}
    return [new.get((row.paper, row.id), row) for row in rows]


def as_stated(rows: Iterable[Row], statements: Mapping[str, Iterable[Statement]]) -> list[Row]:
    """One row for each claim with a change, by papers, parts and statements; new ones are not made yet.

    Of a sentence of a paper the change may stand in words alone, as long as it is red as it is.
    """
    old = {(row.paper, row.id): row for row in rows}
    found = []
    for name, every in statements.items():
        for s in (s for s in every if s.breaks or (s.kind == "paper" and s.bound)):
            plain = Row(name, breaks.part_of(s), s.id, breaks.in_words(s.breaks) or s.fails_if, UNMADE)
            before = old.get((name, s.id), plain)
            found.append(before if before[:4] == plain[:4] else plain)
    order = {key: place for place, key in enumerate(parts(found))}
    return sorted(found, key=lambda row: order[row.paper, row.part])


def as_judged(rows: Iterable[Row], verdicts: Mapping[Key, str]) -> list[Row]:
    """Rows, of which those of claims that their page does not count as reproduced have nothing to break.

    verdicts : of the committed pages, by paper and claim
    """
    _, fails, _ = VERDICTS["paper"]
    found = []
    for row in rows:
        red = verdicts.get((row.paper, row.id)) == fails
        if red:  # also one that few flights had seen turn red
            row = row._replace(result=breaks.ALREADY)
        elif row.result == breaks.ALREADY:
            row = row._replace(result=UNMADE)
        found.append(row)
    return found


def verdicts(papers: Path) -> dict[Key, str]:
    """Verdicts of the committed pages, by paper and claim; papers: the folder of the pages."""
    return {
        (name, claim.id): claim.verdict
        for name in PAPERS
        for path in sorted((papers / name).glob("*.toml"))
        for claim in read_claims(path)[1]
    }


def worse(before: Iterable[Row], after: Iterable[Row]) -> list[Worse]:
    """Claims that their change does not break, or no longer does, as they are now.

    One that still holds under its change is a fault on every kind of processor. One that does not hold beforehand is
    none where it was seen red on another kind; what is not known to be another is judged.
    """
    red = {(row.paper, row.id): row.processor for row in before if row.result == breaks.RED}
    found = []
    for row in after:
        seen = red.get((row.paper, row.id))
        if row.result == breaks.GREEN:
            found.append(Worse(row))
        elif seen is not None and row.result != breaks.RED:
            found.append(Worse(row, seen if row.processor not in ("", seen) else ""))
    return found


def renew(
    folder: Path,
    papers: Path,
    path: Path,
    chosen: Collection[str] = (),
    only_open: bool = False,
    threads: int | None = None,
) -> None:
    """Fly changes and commit what comes of them after each part; the rows of other claims stay.

    Raises AirflockError outside a clone, or for an unknown part.

    folder : where what is done is kept; papers : the folder of the pages; path : of the table
    chosen : parts, as `kidger.tuning`, in their order, else all; threads : flights side by side
    """
    pages = verdicts(papers)
    if not pages:  # else every claim that is red as it is would be entered as not made yet
        raise AirflockError(f"{papers}: holds no pages with verdicts; call this in a clone of Airflock")
    rows = as_judged(as_stated(committed(), {name: load(find(name).package).values() for name in PAPERS}), pages)
    tables.write(Row._fields, rows, path)
    unknown = sorted(set(chosen) - {".".join(key) for key in parts(rows)})
    if unknown:
        raise AirflockError(f"{unknown[0]}: no such part; known: {', '.join('.'.join(key) for key in parts(rows))}")
    wanted = [row for row in rows if row.result in OPEN or (row.result != breaks.ALREADY and not only_open)]
    wanted = [row for row in wanted if not chosen or f"{row.paper}.{row.part}" in chosen]
    wanted.sort(key=lambda row: list(chosen).index(f"{row.paper}.{row.part}") if chosen else 0)
    for found in in_parts(folder, lambda line: print(line, file=sys.stderr), wanted, threads):
        rows = as_judged(replaced(rows, found), pages)
        tables.write(Row._fields, rows, path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Make the change of every claim and commit what comes of it.")
    parser.add_argument("folder", type=Path, help="where what is done is kept")
    parser.add_argument("part", nargs="*", help="PAPER.PART, for instance kidger.tuning; all if none is named")
    parser.add_argument("--open", action="store_true", help="only claims that nobody has seen red so far")
    parser.add_argument("--threads", type=int, help="flights side by side; as many as cores if not given")
    asked = parser.parse_intermixed_args()
    place = Path(str(resources.files("airflock_papers"))) / COMMITTED
    try:
        renew(asked.folder, Path("papers"), place, asked.part, asked.open, asked.threads)
    except AirflockError as fault:
        parser.error(str(fault))
