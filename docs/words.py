"""Check the words of the documentation and of messages: one spelling for each term, one wording for each kind of fault,
no sentence of more than 35 words in the documentation.

python docs/words.py          # tells file, line and what is wrong; exit status 1 if anything is
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parent
SOURCE = DOCS.parent / "src" / "airflock"
LONGEST = 35  # words of a sentence
# what not to write → what the glossary, or plain English as we spell it, has instead
SPELLINGS = {
    r"neighbors?": "neighbour", r"behaviors?": "behaviour", r"colors?": "colour", r"optimi[z]\w*": "optimise",
    r"minimi[z]\w*": "minimise", r"maximi[z]\w*": "maximise", r"centers?": "centre", r"flight logs?": "recording",
    r"latency": "delay", r"crash(?:es)?": "collision", r"time lag": "delay", r"shilling": "shill agent",
    r"order-parameters?": "order parameter", r"hyper-?parameters?": "parameter", r"swarm law": "law",
    r"ruleset": "law", r"random seed": "seed", r"trajector(?:y|ies) file": "recording", r"config(?: file)?": "scenario",
    r"parameter file": "scenario", r"utili[sz]e": "use", r"leverage": "use", r"in order to": "to",
}  # fmt: skip
ALLOWED = {
    "glossary.md": {"latency", "flight logs"}, "tracks.md": {"flight logs"}, "README.md": {"flight logs"},
    "CHANGELOG.md": {"flight log", "flight logs", "crashes"},
}  # fmt: skip
BESIDE = (
    "README.md", "CHANGELOG.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md",
    "paper/paper.md",
)  # fmt: skip
# what no message says → how each kind of fault is worded
WORDINGS = {
    r"\bis no key\b|\bno such (?:key|order parameter|paper|option|model|section|metric|part)\b": "NAME: unknown KIND",
    r"(?<!there )\bis no (?:number|table|list|name|model|body|scenario|recording|file|law)\b": "VALUE is not a KIND",
    r"\bis not one of\b|\bmust be one of\b|\bis not among\b|\bis not in\b \[": "= VALUE is none of A, B, C",
    r"\bout of (?:range|bounds)\b|\bmust (?:lie in|be between|be in)\b": "= VALUE lies outside [LOW, HIGH]",
    r"\bmust be positive\b": "= VALUE must be above 0",
    r"\b[Ff]ile not found\b|\bfile does not exist\b|\bcannot be found\b": "FILE: no such file",
    r"\b(?:could not|can't|can not|failed to|unable to) (?:read|write|open|load)\b": "FILE: cannot be read: WHY",
    r"\bwhich is not installed\b|\bneeds the package\b": "WHAT needs PACKAGE: pip install",
    r"\b(?:invalid|illegal|bad) (?:value|key|option|argument|parameter)\b": "one of the wordings above",
}  # fmt: skip


def main() -> int:
    """Print every fault; 1 if there is one."""
    faults = [fault for path in pages() for fault in faults_of(path)]
    faults += [fault for path in sorted(SOURCE.rglob("*.py")) for fault in wording_faults(path)]
    for fault in faults:
        print(fault)
    return int(bool(faults))


def pages() -> list[Path]:
    """Texts written by hand: pages, and examples with their comments."""
    scripts = [path for folder in ("gallery", "notebooks", "tours") for path in sorted((DOCS / folder).glob("*.py"))]
    beside = [DOCS.parent / name for name in BESIDE if (DOCS.parent / name).is_file()]
    own = [path for folder in (".", "equations", "decisions") for path in sorted((DOCS / folder).glob("*.md"))]
    return [*own, *scripts, *beside]


def faults_of(path: Path) -> Iterator[str]:
    """Faults of one text, each with file and line."""
    allowed = ALLOWED.get(path.name, set())
    for line, text in paragraphs(path):
        for wrong, right in SPELLINGS.items():
            for match in re.finditer(rf"\b{wrong}\b", text, re.IGNORECASE):
                if match[0].lower() not in allowed:
                    yield f"{told(path)}:{line}: {match[0]!r}: write {right}"
        for sentence in re.split(r"(?<=[.!?:;])\s+", text):
            count = len(re.findall(r"[A-Za-zÀ-ž0-9][\w'’.-]*", sentence))
            if count > LONGEST:
                yield f"{told(path)}:{line}: a sentence of {count} words: {sentence[:60]} ..."


def told(path: Path) -> str:
    """A path as messages name it: from the documentation, or from the repository."""
    return str(path.relative_to(DOCS if path.is_relative_to(DOCS) else DOCS.parent))


def wording_faults(path: Path) -> Iterator[str]:
    """Messages of one source file that word a fault otherwise than the others do; docstrings are no messages."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str) or id(node) in told:
            continue
        for wrong, right in WORDINGS.items():
            match = re.search(wrong, node.value)
            if match is not None:
                yield f"{path.name}:{node.lineno}: {match[0]!r}: write {right}"


def paragraphs(path: Path) -> Iterator[tuple[int, str]]:
    """Line number and text of each paragraph, without code, equations and markup; a glossary's fence is no code."""
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
    """The docstring and the comments of a script, line by line; code becomes an empty line."""
    docstring = ast.get_docstring(ast.parse(text), clean=True) or ""
    head = list(enumerate(docstring.splitlines(), 2))
    body = [
        (number, line[2:] if line.startswith("# ") and not line.startswith("# %%") else "")
        for number, line in enumerate(text.splitlines(), 1)
        if number > len(head) + 1
    ]
    return [(n, "" if re.fullmatch(r"[=-]{3,}", line) else line) for n, line in [*head, (0, ""), *body]]


def _plain(text: str) -> str:
    """Text without code, equations and targets of links."""
    text = re.sub(r"`[^`]*`", "x", text)
    text = re.sub(r"\$[^$]*\$", "x", text)
    return re.sub(r"\]\([^)]*\)", "]", text)


if __name__ == "__main__":
    sys.exit(main())
