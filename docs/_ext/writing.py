"""Writing Markdown: pages, tables, and docstrings that Markdown must not read as markup."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parent
LAWS = ROOT / "src" / "airflock" / "parts" / "laws"
OUT = DOCS / "generated"


def put(name: str, text: str) -> None:
    """Write a page, unless it is there with the same text."""
    path = OUT / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def table(heads: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(heads) + " |"]
    lines.append("|" + "---|" * lines[0].count(" | ") + "---|")
    for row in rows:
        lines.append("| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in row) + " |")
    return "\n".join(lines) + "\n"


def key_table(found: Iterable[Any]) -> str:
    """Keys with default, range, meaning and source."""
    return table(
        ("key", "default", "allowed", "meaning", "source"),
        ((f"`{key.name}`", key.standard, key.allowed, plain(key.meaning), plain(key.source)) for key in found),
    )


def plain(text: str) -> str:
    """Text of a docstring that Markdown must not read as markup."""
    return re.sub(r"([*<>$])", r"\\\1", text)


def prose(text: str) -> str:
    """A docstring as Markdown: its lists stay lists, its underlined heads become heads of level 3."""
    lines = text.strip().splitlines()
    result: list[str] = []
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if re.fullmatch(r"-{3,}", line.strip()):
            continue
        if re.fullmatch(r"-{3,}", below.strip()):
            result += ["", f"## {line.strip()}", ""]
            continue
        bullet = line.lstrip().startswith("* ")
        body = plain(line.lstrip()[2:]) if bullet else plain(line)
        if bullet and result and result[-1] and not result[-1].lstrip().startswith("* ") and result[-1][0] != " ":
            result.append("")
        result.append(f"* {body}" if bullet else body)
    return "\n".join(result)
