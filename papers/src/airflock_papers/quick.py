"""Quick: the small form of every page flown again; its verdicts must be those that are committed beside this file.

A part that is done is kept in a folder with a hash of all texts that decide a flight, so that a run that was cut off
goes on where it stopped. `python -m airflock_papers.quick` flies everything and commits what it finds.

Vectors of other lengths add in another order. So another kind of processor flies other flights of the same seeds, which
soon differ whole, and a verdict of few flights may be another by chance: each row names the kind that flew it.
"""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from airflock.support import TextError, atomic, parse_json_object, processor_kind, read_text
from airflock_papers import PAPERS, committed as tables
from airflock_papers.catalogue import find
from airflock_papers.progress import teller
from airflock_papers.texts import texts

COMMITTED = "quick.csv"
LEFT_OUT = {("kidger", "cost"): "measures this machine", ("vasarhelyi_2018", "fig2"): "takes an hour"}
ALSO = {"vasarhelyi_2018": ("optima", "gains", "searches")}  # of the page EVOLVED.md, from the optima that ship


class Verdict(NamedTuple):
    """Verdict on one claim in the small form, and the kind of processor that flew it."""

    paper: str
    part: str
    id: str
    verdict: str
    ours: float
    processor: str


class Changed(NamedTuple):
    """A claim whose verdict is not the committed one; an empty verdict where it is not on one of the lists.

    elsewhere : the kind of processor on which the committed one was flown, if it is another: not judged
    """

    paper: str
    id: str
    committed: str
    found: str
    elsewhere: str = ""


def parts() -> list[tuple[str, str]]:
    """Papers and parts of the small form, in the order in which they fly."""
    found = []
    for name in PAPERS:
        paper = find(name)
        found += [(name, part) for part in (*paper.parts, *ALSO.get(name, ())) if (name, part) not in LEFT_OUT]
    return found


def fly(folder: Path, say: Callable[[str], None], threads: int | None = None) -> list[Verdict]:
    """Verdicts of every part; what is done is kept in the folder, with a log of the progress."""
    folder.mkdir(parents=True, exist_ok=True)
    now = f"{texts()} on {processor_kind()}"
    found: list[Verdict] = []
    todo = parts()
    for number, (name, part) in enumerate(todo, 1):
        path = folder / f"{name}.{part}.json"
        kept = _kept(path, now)
        if kept is None:
            kept = _flown(name, part, threads, teller(folder / "log.txt", say, f"{number}/{len(todo)} {name} {part}"))
            atomic.write_file(path, json.dumps({"texts": now, "verdicts": kept}))
        found += [Verdict(name, part, *row, processor_kind()) for row in kept]
    return found


def _kept(path: Path, now: str) -> list[tuple[str, str, float]] | None:
    """Rows of a part that was flown with these texts; of a file that is not there, or is damaged, none."""
    try:
        document = parse_json_object(read_text(path))
        return (
            [(str(name), str(verdict), float(ours)) for name, verdict, ours in document["verdicts"]]
            if (document.get("texts") == now)
            else None
        )
    except (OSError, TextError, LookupError, TypeError, ValueError):
        return None


def _flown(
    name: str, part: str, threads: int | None, tell: Callable[[str, int, int], None]
) -> list[tuple[str, str, float]]:
    paper = find(name)
    claims = paper.run(only=part, quick=True, threads=threads, progress=tell)
    return [(claim.id, claim.verdict, float(f"{claim.ours or 0.0:.4g}")) for claim in claims]


def committed() -> list[Verdict]:
    """Verdicts that are committed.

    Raises AirflockError if there are none.
    """
    rows = tables.read(COMMITTED, "python -m airflock_papers.quick")
    return [Verdict(**row | {"ours": float(row["ours"])}) for row in rows]  # type: ignore[arg-type]


def changed(before: Iterable[Verdict], after: Iterable[Verdict]) -> list[Changed]:
    """Claims whose verdicts differ, in their order.

    What few flights on another kind of processor do not have at all, such as a time that none of them came to, is not
    judged either.
    """
    old, new = ({(row.paper, row.id): row for row in rows} for rows in (before, after))
    here = {row.part: row.processor for row in new.values()}
    found = []
    for key in (*old, *(key for key in new if key not in old)):
        one, other = old.get(key), new.get(key)
        was, now = (row.verdict if row else "" for row in (one, other))
        if was != now:
            flown_on = other.processor if other else here.get(one.part, "") if one else ""
            found.append(Changed(*key, was, now, one.processor if one and flown_on not in ("", one.processor) else ""))
    return found


if __name__ == "__main__":
    tables.renew("Fly the small form of every page and commit its verdicts.", COMMITTED, Verdict._fields, fly)


def report_all(folder: Path, say: Callable[[str], None], threads: int | None = None) -> tables.Report:
    """Fly the small form of every paper; it fails where a verdict is not the one committed for this processor."""
    before = committed()
    rows = fly(folder, say, threads)
    other = changed(before, rows)
    lines = []
    for row in other:
        message = f"{row.committed or 'not committed'} is now {row.found or 'not flown'}"
        why = f" (not judged: committed as flown on {row.elsewhere})" if row.elsewhere else ""
        lines.append(f"{row.paper} {row.id}: {message}{why}")
    lines.append(f"{len(rows)} claims in their small form, {len(other)} of another verdict than the committed one")
    if any(row.elsewhere for row in other):
        lines.append("On another kind of processor the same seeds give other flights; a few verdicts may differ.")
    content = {"claims": [row._asdict() for row in rows], "changed": [row._asdict() for row in other]}
    return tables.Report(lines, content, all(row.elsewhere for row in other))
