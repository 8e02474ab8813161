"""Check the words of the documentation: British spelling, and one word for each notion of the glossary.

python docs/words.py          # prints file, line and the word to write; exit status 1 if there is any
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parent
# what not to write → British spelling, or the word of the glossary
SPELLINGS = {
    r"neighbors?": "neighbour", r"behaviors?": "behaviour", r"colors?": "colour", r"optimi[z]\w*": "optimise",
    r"minimi[z]\w*": "minimise", r"maximi[z]\w*": "maximise", r"centers?": "centre", r"shilling": "shill agent",
    r"order-parameters?": "order parameter", r"hyper-?parameters?": "parameter", r"swarm law": "law",
    r"ruleset": "law", r"random seed": "seed", r"trajector(?:y|ies) file": "recording", r"parameter file": "scenario",
}  # fmt: skip
BESIDE = (
    "README.md", "CHANGELOG.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md",
    "paper/paper.md",
)  # fmt: skip


def main() -> int:
    """Print every wrong word; return 1 if there is one."""
    errors = [error for path in pages() for error in errors_of(path)]
    for error in errors:
        print(error)
    return int(bool(errors))


def pages() -> list[Path]:
    """Return the texts written by hand: pages, and examples with their comments."""
    scripts = [path for folder in ("gallery", "notebooks", "tours") for path in sorted((DOCS / folder).glob("*.py"))]
    beside = [DOCS.parent / name for name in BESIDE if (DOCS.parent / name).is_file()]
    own = [path for folder in (".", "decisions") for path in sorted((DOCS / folder).glob("*.md"))]
    laws = sorted((DOCS.parent / "src" / "airflock" / "parts" / "laws").glob("*/*.md"))
    return [*own, *laws, *scripts, *beside]


def errors_of(path: Path) -> Iterator[str]:
    """Yield the wrong words of one text, each with file and line."""
    name = path.relative_to(DOCS if path.is_relative_to(DOCS) else DOCS.parent)
    for line, text in paragraphs(path):
        for wrong, right in SPELLINGS.items():
            for match in re.finditer(rf"\b{wrong}\b", text, re.IGNORECASE):
                yield f"{name}:{line}: {match[0]!r}: write {right}"


def paragraphs(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and text of each paragraph, without code, equations and markup; a glossary's fence is no code."""
    text = path.read_text(encoding="utf-8")
    lines = _comments(text) if path.suffix == ".py" else list(enumerate(text.splitlines(), 1))
    fenced, begun, gathered = False, 0, []
    for number, line in [*lines, (0, "")]:
        if line.lstrip().startswith("```") and "{glossary}" not in line:
            fenced = not fenced
            continue
        ends = not line.strip() or line.lstrip().startswith(("|", "#", "* ", "$$", ":::", "```"))
        if (ends or fenced) and gathered:
            yield begun, _plain(" ".join(gathered))
            gathered = []
        if fenced or not line.strip() or line.lstrip().startswith(("$$", ":::", "```")):
            continue
        if line.lstrip().startswith("|"):
            for cell in line.strip().strip("|").split(" | "):
                yield number, _plain(cell)
            continue
        begun = begun if gathered else number
        gathered.append(line.strip())


def _comments(text: str) -> list[tuple[int, str]]:
    """Return the docstring and the comments of a script, line by line; code becomes an empty line."""
    docstring = ast.get_docstring(ast.parse(text), clean=True) or ""
    head = list(enumerate(docstring.splitlines(), 2))
    body = [
        (number, line[2:] if line.startswith("# ") and not line.startswith("# %%") else "")
        for number, line in enumerate(text.splitlines(), 1)
        if number > len(head) + 1
    ]
    return [(n, "" if re.fullmatch(r"[=-]{3,}", line) else line) for n, line in [*head, (0, ""), *body]]


def _plain(text: str) -> str:
    """Remove code, equations and targets of links."""
    text = re.sub(r"`[^`]*`", "x", text)
    text = re.sub(r"\$[^$]*\$", "x", text)
    return re.sub(r"\]\([^)]*\)", "]", text)


if __name__ == "__main__":
    sys.exit(main())
