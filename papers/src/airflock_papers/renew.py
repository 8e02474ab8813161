"""Renew a committed page: its statements as they stand now, and the parts that are named flown again.

`python -m airflock_papers.renew NAME [PART ...]` keeps what was measured for every other claim, if its quantity and
place are still those of the statement, and judges it again. The header says which texts flew the parts. Words and
pictures of the page stay; `reproduce.py` beside it writes them anew.
"""

import re
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from airflock.errors import AirflockError
from airflock_papers import claims as records
from airflock_papers import page
from airflock_papers.catalogue import find
from airflock_papers.claims import Claim, Measured, judge, judged_again, unflown
from airflock_papers.flights import Flights
from airflock_papers.progress import progress_bar
from airflock_papers.statements import Statement, load
from airflock_papers.texts import texts

PAGES = {"README.md": ("claims.toml", "report"), "EVOLVED.md": ("evolved.toml", "evolved")}  # claims, and its module


def renewed(
    statements: Mapping[str, Statement],
    old: Sequence[Claim],
    found: Sequence[Measured],
    command: str,
    new: Collection[str] = (),
) -> list[Claim]:
    """Claims of a page in the order of the statements: those that were measured, and those of before, judged again.

    new : statements that stand on no page yet and come to this one
    A number that came out the same keeps what was said of it, such as a working range, if nothing else is said now.
    """
    kept = {claim.id: claim for claim in old}
    fresh = {claim.id: claim for claim in judge(statements, found)}
    claims = []
    for name, statement in statements.items():
        if name in fresh:
            claims.append(_noted(fresh[name], kept.get(name)))
        elif name in kept:
            same = (kept[name].quantity, kept[name].at) == (statement.quantity, statement.at)
            if same and kept[name].ours is not None:
                claims.append(judged_again(statement, kept[name]))
            elif statement.quantity:
                claims += unflown({name: statement}, [], kept[name].command or command)
            else:
                claims.append(Claim(**asdict(statement)))
        elif name in new:
            claims += unflown({name: statement}, [], command) if statement.quantity else [Claim(**asdict(statement))]
    return claims


def _noted(claim: Claim, before: Claim | None) -> Claim:
    """A claim with the note of before, if it has none and its number, as it is written, is the same."""
    if before is None or claim.note or records.number(claim.ours, 6) != records.number(before.ours, 6):
        return claim
    return replace(claim, note=before.note)


def words(text: str, title: str) -> str:
    """Words of a section of a page, above its pictures and claims; empty if it has none."""
    found = re.search(rf"^## {re.escape(title)}\n\n(.*?)(?=^!\[|^\| claim \||^## |\Z)", text, re.S | re.M)
    return found[1].strip() if found else ""


def above(text: str) -> str:
    """What a page says above its headline and its sections, without the command."""
    found = re.search(r"computes this page again\.(.*?)(?=^\*\*\d+ \w+|^## |\Z)", text, re.S | re.M)
    return found[1].strip() if found else ""


def renew(
    name: str, parts: Sequence[str], folder: Path, file: str = "README.md", threads: int | None = None
) -> list[Claim]:
    """Fly some parts of a paper and write its page; folder: papers/NAME, file: README.md or EVOLVED.md."""
    paper, (table, module) = find(name), PAGES[file]
    unknown = [part for part in parts if part not in (*paper.parts, *paper.long)]
    if unknown:
        raise AirflockError(f"{unknown[0]}: unknown part; known: {', '.join((*paper.long, *paper.parts))}")
    place = f"airflock_papers.{name}.{module}"
    sections: Any = getattr(import_module(place), "SECTIONS", ()) if find_spec(place) else ()
    header, old = records.read_claims(folder / table)
    text = (folder / file).read_text(encoding="utf-8")
    found: list[Measured] = []
    for part in parts:
        with progress_bar() as bar:
            found += paper.fly((part,), Flights(threads=threads, progress=bar))[0]
    statements = load(paper.package)
    tables = folder.glob("*.toml") if table == "claims.toml" else ()
    new = set(statements) - {claim.id for path in tables for claim in records.read_claims(path)[1]} if tables else set()
    claims = renewed(statements, old, found, str(header["command"]), new)
    sections = [replace(s, words=words(text, s.title) or s.words) for s in sections]
    told = {key: value for key, value in header.items() if key not in ("paper", "command", "seeds")}
    if parts:
        before = [
            each for each in str(header.get("renewed", "")).split("; ") if each and each.split(":")[0] not in parts
        ]
        told["renewed"] = "; ".join([*before, *(f"{part}: {texts()}" for part in parts)])
        flown = {each.split(":")[0] for each in told["renewed"].split("; ")}
        if table == "claims.toml" and set(paper.parts) <= flown:
            told["texts"] = page.PART_BY_PART
    page.write(
        folder, header["paper"], header["command"], claims, sections, above(text), header["seeds"], (table, file), told
    )
    return claims


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python -m airflock_papers.renew NAME [EVOLVED.md] [PART ...], in a clone")
    chosen = [word for word in sys.argv[2:] if word not in PAGES]
    pages = [word for word in sys.argv[2:] if word in PAGES]
    records.print_claims(renew(sys.argv[1], chosen, Path("papers") / sys.argv[1], pages[0] if pages else "README.md"))
