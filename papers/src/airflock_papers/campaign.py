"""Campaign: the change of every claim made and flown, part by part; what came of it stands committed beside this file.

A part that is done is kept in a folder with a hash of all texts that decide a flight, so that a campaign that was cut
off goes on where it stopped. `python -m airflock_papers.campaign FOLDER` flies everything and commits what it finds;
`airflock paper all --breaks` compares.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from airflock import atomic
from airflock.doors import TextError, json_object, read_text
from airflock_papers import PAPERS, breaks
from airflock_papers import committed as tables
from airflock_papers.catalogue import find
from airflock_papers.quick import teller
from airflock_papers.statements import load
from airflock_papers.texts import texts

COMMITTED = "breaks.csv"
UNMADE = "not made yet"  # in the table: a change that nobody has flown so far
# flights per number where those of the quick form are too few to show that a claim holds beforehand
SEEDS = {
    ("vasarhelyi_2018", "s2"): 40,
    ("vasarhelyi_2018", "fig1"): 10,
    ("vasarhelyi_2018", "fig34"): 10,
    ("vasarhelyi_2018", "optima"): 40,
    ("vasarhelyi_2018", "pressure"): 20,
    ("vasarhelyi_2018", "tuning"): 40,
    ("vasarhelyi_2018", "real"): 10,
    ("vasarhelyi_2018", "beyond"): 100,
    ("zapotecatl_2016", "sequential"): 6,
}


class Row(NamedTuple):
    """What came of the change of one claim: as of `breaks.Break`, numbers to four digits."""

    paper: str
    part: str
    id: str
    change: str
    result: str
    ours: str
    changed: str


def parts() -> list[tuple[str, str]]:
    """Papers and parts whose claims name a change, in the order in which they fly."""
    found = []
    for name in PAPERS:
        statements = load(find(name).package).values()
        found += [(name, part) for part in dict.fromkeys(breaks.part_of(s) for s in statements if s.breaks)]
    return found


def fly(
    folder: Path, say: Callable[[str], None], threads: int | None = None, only: Sequence[tuple[str, str]] | None = None
) -> list[Row]:
    """What came of every change; what is done is kept in the folder, with a log of the progress."""
    folder.mkdir(parents=True, exist_ok=True)
    now = texts()
    found: list[Row] = []
    todo = list(only or parts())
    for number, (name, part) in enumerate(todo, 1):
        path = folder / f"{name}.{part}.breaks.json"
        rows = _kept(path, now)
        if rows is None:
            tell = teller(folder / "log.txt", say, f"{number}/{len(todo)} {name} {part}")
            flown = breaks.fly(find(name), only=part, seeds=SEEDS.get((name, part)), threads=threads, progress=tell)
            rows = [Row(name, part, b.id, b.change, b.result, f"{b.ours:.4g}", f"{b.changed:.4g}") for b in flown]
            atomic.write(path, json.dumps({"texts": now, "rows": rows}))
        found += rows
    return found


def _kept(path: Path, now: str) -> list[Row] | None:
    """Rows of a part that was flown with these texts; of a file that is not there, or is damaged, none."""
    try:
        document = json_object(read_text(path))
        return [Row(*map(str, row)) for row in document["rows"]] if document.get("texts") == now else None
    except (OSError, TextError, LookupError, TypeError, ValueError):
        return None


def committed() -> list[Row]:
    """What is committed.

    Raises AirflockError if there is nothing.
    """
    return [Row(**row) for row in tables.read(COMMITTED, "python -m airflock_papers.campaign")]


def worse(before: Iterable[Row], after: Iterable[Row]) -> list[Row]:
    """Claims that their change does not break, or no longer does, as they are now."""
    red = {(row.paper, row.id) for row in before if row.result == breaks.RED}
    return [
        row for row in after
        if row.result == breaks.GREEN or ((row.paper, row.id) in red and row.result != breaks.RED)
    ]  # fmt: skip


if __name__ == "__main__":
    tables.renew("Make the change of every claim and commit what comes of it.", COMMITTED, Row._fields, fly)
