"""Sentences of a paper: papers/NAME/sentences.csv holds one row for each, and this checks it against the text.

The texts are not part of this project. `python -m airflock_papers.sentences FOLDER` takes a folder with NAME.txt of
each paper and tells which sentences have no row of their own, which rows and quotes are in no text, and which claims
and tests do not exist. A row begins its sentence with five words, or with as many as tell it from all others.
"""

import csv
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

from airflock.support import AirflockError
from airflock_papers.statements import load

WHY = (
    "definition",
    "method",
    "other people's work",
    "opinion",
    "motivation",
    "future work",
    "pointer",
    "hardware",
    "table",
    "heading",
)
IDENTITY = "identity"  # true by construction: a test is named in place of claims
# parts of each text that are listed: from and up to these words
PARTS: dict[str, tuple[tuple[str, str], ...]] = {
    "vasarhelyi_2018": (
        ("We address a fundamental issue", "INTRODUCTION"),
        ("Flocking model instantiation through", "MATERIALS AND METHODS"),
        ("Fig. 6. Visual explanation", "front of agent"),
        ("Fig. 7. Three different types", "algorithms such as the CMA-ES (38, 53)"),
        ("Fig. 8. Probability distribution", "SUPPLEMENTARY MATERIALS\n"),
        ("- Movie S1.", "REFERENCES AND NOTES"),
        ("Supplementary Movies", "Supplementary Tables"),
        ("Table S1: Optimized model parameter values and working ranges in simulation. F", "\x00"),
    ),
    "zapotecatl_2016": (
        ("Measurements of coordinated motion", "Introduction"),
        ("Figure 1: Figure (a)", "The set of"),
        ("model was implemented and run", "Acknowledgements"),
    ),
    "dimock_2003": (
        ("Natural aggregation processes", "Introduction"),
        ("Fig. 1 Flocking rules", "variable and the only"),
        ("Fig. 2 Discrete vortex system", "Chord line"),
        ("Fig. 3 Induced drag", "comprehensive discussion"),
        ("Fig. 4 Induced downwash", "I (_Pw"),
        ("The fitness evaluation simulation", "\x00"),
    ),
    "kidger": (
        ("The management of drone swarms", "2 – Introduction"),
        ("Without any underlying rules", "8 – References"),
        ("Throughout development, I ran", "\x00"),
    ),
}
SHORT = 4  # words: shorter pieces are captions' numbers, cells and code
ABBREVIATIONS = ("fig", "figs", "eq", "eqs", "i.e", "e.g", "ie", "et al", "ref", "vs", "approx", "no", "min")
ABBREVIATED = re.compile(r"(?:^|[^a-z])(?:" + "|".join(map(re.escape, ABBREVIATIONS)) + r")\.*$")  # a word, not its end


class Row(NamedTuple):
    """A sentence: where it stands, how it begins, claims about it (patterns, by blanks), or why there is none.

    An identity names the tests that show it instead, as `tests/unit/test_x.py::test_y`.
    """

    where: str
    begins: str
    claims: str
    why: str


def rows(path: Path) -> list[Row]:
    """Rows of a sentences.csv."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [Row(**row) for row in csv.DictReader(file)]
    except (OSError, TypeError) as fault:
        raise AirflockError(f"{path}: {fault}") from fault


def without_margins(text: str) -> str:
    """A text without cells of one word, which are what a scan leaves of the margin of a table."""
    return re.sub(r"(?m)(?:^|(?<=\t))[^\W\d]+(?=\t)", "", text)


def letters(text: str) -> str:
    """Small letters and digits of a text: what is left of it in any typesetting."""
    plain = re.sub(r"\\[a-zA-Z]+|<\|[^|]*\|[^>]*>", "", without_margins(text))
    return re.sub(r"[^a-z0-9]", "", plain.lower())


def sentences(text: str) -> Iterator[str]:
    """Sentences of a text, cells of tables and code left out."""
    plain = re.sub(r"\n*<\|[^|]*\|[^>]*>\n*", "\n", text)
    plain = re.sub(r"```.*?```", "\n\n", plain, flags=re.S)
    plain = re.sub(r"\$\$.*?\$\$", " ", plain, flags=re.S)
    plain = re.sub(r"-\n(?=[a-z])", "", plain)
    for paragraph in re.split(r"\n\s*\n|\n(?=\t)|\n(?=[-*] |[|] |⇒)", plain):
        begun = ""
        for piece in re.split(r"(?<=[.!?:])[\])]?\s+(?=[“\"(\[A-Z0-9])", " ".join(paragraph.split())):
            begun = f"{begun} {piece}".strip()
            if not ABBREVIATED.search(begun.lower()):
                if len(re.findall(r"[A-Za-z]{2,}", begun)) >= SHORT:
                    yield begun
                begun = ""
        if len(re.findall(r"[A-Za-z]{2,}", begun)) >= SHORT:
            yield begun


def part_of(text: str, begin: str, end: str) -> str:
    """The text from some words up to others.

    Raises AirflockError if the first are not there.
    """
    start = text.find(begin)
    if start < 0:
        raise AirflockError(f"{begin!r} is not in the text")
    stop = text.find(end, start + len(begin))
    return text[start : stop if stop > 0 else len(text)]


def faults(name: str, folder: Path, text: str | None) -> list[str]:
    """What is wrong with the list of one paper; folder: papers/NAME; text: of the paper, if at hand."""
    table = rows(folder / "sentences.csv")
    statements = load(f"airflock_papers.{name}")
    paper = {key: s for key, s in statements.items() if s.kind == "paper"}
    wrong = [f"{row.begins}: neither claim nor reason" for row in table if not row.claims and row.why not in WHY]
    wrong += [
        f"{row.begins}: both a claim and a reason" for row in table if row.claims and row.why not in ("", IDENTITY)
    ]
    proofs = [proof for row in table if row.why == IDENTITY for proof in row.claims.split()]
    wrong += [f"{proof}: no such test" for proof in proofs if not _is_a_test(folder.parents[1], proof)]
    patterns = [pattern for row in table if row.why != IDENTITY for pattern in row.claims.split()]
    wrong += [f"{p}: no such claim" for p in patterns if not any(fnmatchcase(key, p) for key in statements)]
    wrong += [f"{key}: no sentence names this claim" for key in paper if not any(fnmatchcase(key, p) for p in patterns)]
    return (
        wrong
        if text is None
        else wrong + _in_text(table, {key: s.quote for key, s in paper.items()}, text, PARTS[name])
    )


def _is_a_test(root: Path, proof: str) -> bool:
    """Whether a place like tests/unit/test_x.py::test_y is there; root: of the repository."""
    path, _, test = proof.partition("::")
    return (root / path).is_file() and f"def {test}(" in (root / path).read_text(encoding="utf-8")


def _in_text(table: Sequence[Row], quotes: Mapping[str, str], text: str, parts: Iterable[tuple[str, str]]) -> list[str]:
    """Rows and quotes that are not in the text, and sentences of its parts that have no row of their own."""
    whole, with_margins = letters(text), letters(" ".join(text.split()))
    wrong = [f"{row.begins}: not in the text" for row in table if letters(row.begins) not in whole + " " + with_margins]
    for key, quote in quotes.items():
        lost = [part for part in quote.split("…") if letters(part) not in whole]
        wrong += [f"{key}: not in the text: {part.strip()}" for part in lost]
        wrong += [f"{key}: not in this order in the text: {quote}"] * (not lost and not in_order(quote, whole))
    every = dict.fromkeys(s for begin, end in parts for s in sentences(part_of(text, begin, end)))
    return wrong + without_row(every, [row.begins for row in table])


def in_order(quote: str, whole: str) -> bool:
    """Whether the parts of a quote follow one another somewhere in the letters of a text."""
    return bool(re.search(".*".join(letters(part) for part in quote.split("…")), whole))


def without_row(every: Iterable[str], begins: Iterable[str]) -> list[str]:
    """Faults of a list: sentences that no row begins, and rows that begin more than one sentence."""
    starts = [letters(words) for words in begins]
    wrong = [f"{start}: two rows begin so" for start, count in Counter(starts).items() if count > 1]
    taken: dict[str, str] = {}
    for sentence in every:
        mine = [start for start in starts if letters(sentence).startswith(start)]
        if not mine:
            wrong.append(f"no row: {sentence[:90]}")
            continue
        longest = max(mine, key=len)
        if letters(taken.get(longest, sentence)) != letters(sentence):
            wrong.append(f"no row of its own: {sentence[:90]}")
        taken.setdefault(longest, sentence)
    return wrong


def main(arguments: Sequence[str]) -> int:
    """Check all lists; the folder of the texts is the first argument, that of papers/ the second."""
    if not arguments:
        print("usage: python -m airflock_papers.sentences FOLDER_OF_TEXTS [PAPERS]", file=sys.stderr)
        return 2
    texts, papers = Path(arguments[0]), Path(arguments[1] if len(arguments) > 1 else "papers")
    count = 0
    for name in PARTS:
        path = texts / f"{name}.txt"
        text = path.read_text(encoding="utf-8") if path.is_file() else None
        found = faults(name, papers / name, text)
        count += len(found)
        told = "" if text else f" ({path} is not there: only rows and claims were checked)"
        print(f"{name}: {len(rows(papers / name / 'sentences.csv'))} rows, {len(found)} faults{told}")
        for fault in found:
            print(f"  {fault}")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
