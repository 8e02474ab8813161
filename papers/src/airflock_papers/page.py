"""The committed page of a paper: claims.toml and README.md, its claims first, other lines in tables of their own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airflock.support import atomic
from airflock_papers import claims as records
from airflock_papers.claims import SEEDS, Claim
from airflock_papers.counts import headline

PART_BY_PART = "of each part, below"  # in place of one hash for a whole page


@dataclass(frozen=True)
class Section:
    """Claims whose id begins with `start`, with words and pictures (names in figures/) above them."""

    start: str
    title: str
    words: str = ""
    pictures: tuple[str, ...] = ()


def write(
    folder: Path,
    title: str,
    command: str,
    claims: Sequence[Claim],
    sections: Sequence[Section],
    about: str = "",
    told: str = SEEDS,
    names: tuple[str, str] = ("claims.toml", "README.md"),
    more: Mapping[str, str] | None = None,
) -> None:
    """Write claims and page into a folder.

    about : further words on top; told : which seeds were flown; names : of the files; more : keys of the header
    """
    folder.mkdir(parents=True, exist_ok=True)
    records.write_claims(folder / names[0], claims, records.header(title, command, told=told) | dict(more or {}))
    header, read = records.read_claims(folder / names[0])  # so that both show the same rounded numbers
    atomic.write_file(folder / names[1], page(title, command, read, sections, about, flown_by(header)))


def flown_by(header: Mapping[str, Any]) -> str:
    """Which texts flew a page, in words; header: of its claims.toml."""
    parts = [each.partition(": ")[::2] for each in str(header.get("renewed", "")).split("; ") if each]
    listed = ", ".join(f"{part} `{texts}`" for part, texts in parts)
    later = f", later parts by others: {listed}" if parts else ""
    told = (
        f"Each part by the text of its day: {listed}"
        if header["texts"] == PART_BY_PART
        else f"`{header['texts']}`{later}"
    )
    return (
        f"{told}. Version {header['version']}, {header['precision']}. A hash stands for all rules, the engine, presets "
        "and parts (`airflock_papers.texts`)."
    )


def page(
    title: str, command: str, claims: Sequence[Claim], sections: Sequence[Section], about: str = "", flown: str = ""
) -> str:
    """README.md of a paper; about: words on top; flown: which texts flew it."""
    paper = [claim for claim in claims if claim.kind == "paper"]
    lines = [f"# {title}", "", f"`{command}` computes this page again. {about}".strip(), ""]
    if paper:
        lines += [f"**{headline(claims)}.**", "", *_legend(claims), *_overview(paper, sections)]
    lines += _table("Not reproduced", [claim for claim in paper if claim.verdict == "not reproduced"])
    for section in sections:
        mine = [claim for claim in paper if claim.id.startswith(section.start) and claim.verdict != "not reproduced"]
        pictures = [line for name in section.pictures for line in (f"![{name}](figures/{name}.png)", "")]
        if mine or pictures or section.words:
            lines += [f"## {section.title}", "", *([section.words, ""] if section.words else []), *pictures]
            lines += [records.markdown(mine)] if mine else []
    rest = [c for c in paper if c.verdict != "not reproduced" and not any(c.id.startswith(s.start) for s in sections)]
    lines += _table("Other sentences", rest)
    lines += _table("Agreement with the authors' program", [claim for claim in claims if claim.kind == "program"])
    lines += _table("Ours: targets, extensions and findings", [claim for claim in claims if claim.kind == "ours"])
    lines += ["## The text that flew it", "", flown] if flown else []
    return "\n".join(lines).rstrip() + "\n"


def _legend(claims: Sequence[Claim]) -> list[str]:
    words = (
        "A claim is a quote and one place where it is flown: a sentence at three speeds is three claims. It counts as "
        "reproduced when the bound beside it holds for the quantity, the place and the time that it names. Qualitative "
        "only: it names no number or sign that a bound could be taken from; the reason says where our numbers stand. "
        "Every sentence of the paper, also those without a claim, stands in [sentences.csv](sentences.csv); quotes, "
        "bounds and what would turn each red (`fails_if`) in [claims.toml](claims.toml)."
    )
    others = sum(claim.kind != "paper" for claim in claims)
    return [
        words + (f" {others} further lines, at the end, are not the paper's and are not counted." * bool(others)),
        "",
    ]


def _overview(paper: Sequence[Claim], sections: Sequence[Section]) -> list[str]:
    """How many claims of each section are reproduced; nothing for a page of one section."""
    rows, rest = [], list(paper)
    for section in sections:
        mine = [claim for claim in rest if claim.id.startswith(section.start)]
        rest = [claim for claim in rest if not claim.id.startswith(section.start)]
        rows += [(section.title, mine)] if mine else []
    rows += [("Other sentences", rest)] if rest else []
    if len(rows) < 2:
        return []
    lines = ["| about | reproduced | not reproduced | neither |", "| --- | --- | --- | --- |"]
    for title, mine in rows:
        good, bad = (sum(claim.verdict == verdict for claim in mine) for verdict in records.VERDICTS["paper"][:2])
        lines.append(f"| {title} | {good} | {bad} | {len(mine) - good - bad} |")
    return [*lines, ""]


def _table(title: str, claims: Sequence[Claim]) -> list[str]:
    return [f"## {title}", "", records.markdown(claims)] if claims else []
