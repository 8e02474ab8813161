"""Statements: sentences of a paper, each with the quantity, the place and the bound by which it is judged.

They stand in statements.toml beside the part that measures them. A statement names no verdict that a measurement could
give; `airflock_papers.claims` computes it. A row of a table is a statement with `each`, a list of values for the
names in braces.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from importlib import resources
from typing import Any

from airflock.support import AirflockError
from airflock_papers import bounds
from airflock_papers.quantities import QUANTITIES

KINDS = ("paper", "program", "ours")
UNTESTED = ("qualitative only", "not testable", "not flown yet")
LONGEST = 25  # words of a quote
OF_A_ROW = ("published", "published_sd", "bound", "reason", "changed")  # what a row of `each` gives as it is
# a number with its unit of time or its kind of place, as quotes and `at` write it
TIMES = {
    "generation": r"generations?\s+(?P<a>\d+)|(?P<b>\d+)\s+generations?",
    "m/s": r"(?P<a>\d+(?:\.\d+)?)\s*m/s(?!/)",
    "s": r"(?P<a>\d+(?:\.\d+)?)\s*(?:s|sec)\b",
    "(r_s, r_a)": r"r_s ?= ?(?P<a>\d+) ?cm,? (?:and )?r_a ?= ?\d+ ?cm",
}


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One sentence and how it is judged.

    id        : part and quantity, for instance s2.phi_vel.4ms
    kind      : paper (a sentence of the paper), program (agreement with the authors' program) or ours
    quote     : of a paper, at most 25 words; `…` joins what stands apart
    statement : of another kind, or what a short quote leaves out, in our words
    where     : page, section, table or figure; of a program: which, and how it was run
    quantity  : what is measured, a name of `airflock_papers.quantities`
    at        : where and when: speed, generation, configuration, number of flights
    bound     : condition that is asked for, on the names of `airflock_papers.bounds`
    published, published_sd : what the quote prints, and nothing else
    unit      : of the numbers, if not SI
    fails_if  : a change of a rule, a number or a time under which the bound is missed, in words
    breaks    : the same as keys of a scenario, set in every flight of the part, as `airflock_papers.breaks` flies it;
                `times 0.5` halves a number, keys of `search` change an evolution
    part      : which part of the paper measures it; else the first word of the id
    verdict   : of a statement without a bound: qualitative only, not testable or not flown yet
    reason    : why it has none, or why what was measured misses the bound; command : what would fly it
    changed   : what was judged before, with date and reason
    """

    id: str
    kind: str
    where: str
    quote: str = ""
    statement: str = ""
    quantity: str = ""
    at: str = ""
    bound: str = ""
    published: float | None = None
    published_sd: float | None = None
    unit: str = ""
    fails_if: str = ""
    breaks: Mapping[str, Any] = field(default_factory=dict)
    part: str = ""
    verdict: str = ""
    reason: str = ""
    command: str = ""
    changed: str = ""


def load(package: str) -> dict[str, Statement]:
    """Statements of a paper by id, in the order of its statements.toml; package: airflock_papers.NAME.

    Raises AirflockError that lists every fault of the file.
    """
    text = resources.files(package).joinpath("statements.toml").read_text(encoding="utf-8")
    return read(text, f"{package}: statements.toml")


def read(text: str, name: str) -> dict[str, Statement]:
    """Statements of a file's text; name: of the file, for errors."""
    try:
        entries = tomllib.loads(text)["statement"]
    except (tomllib.TOMLDecodeError, KeyError) as fault:
        raise AirflockError(f"{name}: {fault}") from fault
    known = {each.name for each in fields(Statement)}
    found: dict[str, Statement] = {}
    wrong: list[str] = []
    for entry in _expanded(entries):
        unknown = set(entry) - known
        if unknown or not {"id", "kind", "where"} <= set(entry):
            wrong.append(f"{entry.get('id', '?')}: unknown key {', '.join(sorted(unknown))}" if unknown else str(entry))
            continue
        statement = Statement(**entry)
        wrong += [f"{statement.id}: {fault}" for fault in faults(statement)]
        wrong += [f"{statement.id}: stands there twice"] if statement.id in found else []
        found[statement.id] = statement
    if wrong:
        raise AirflockError(f"{name}: " + "; ".join(wrong))
    return found


def _expanded(entries: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Entries, those with `each` once for every set of values."""
    found = []
    for entry in entries:
        plain = {key: value for key, value in entry.items() if key != "each"}
        for values in entry.get("each", [{}]):
            filled = {k: _filled(v, values) if values else v for k, v in plain.items()}
            found.append(filled | {k: v for k, v in values.items() if k in OF_A_ROW})
    return found


def _filled(value: Any, values: Mapping[str, Any]) -> Any:
    """A text, or the texts of a table, with names in braces replaced."""
    if isinstance(value, Mapping):
        return {key: _filled(each, values) for key, each in value.items()}
    return value.format(**values) if isinstance(value, str) else value


def faults(s: Statement) -> list[str]:
    """What is wrong with a statement, each in words."""
    wrong = []
    if s.kind not in KINDS:
        wrong.append(f"kind = {s.kind!r} is none of {', '.join(KINDS)}")
    if s.kind == "paper" and not s.quote:
        wrong.append("a claim of a paper needs a quote")
    if s.kind != "paper" and (s.quote or not s.statement):
        wrong.append(f"kind {s.kind} has a statement in our words and no quote")
    if len(s.quote.replace("…", " ").split()) > LONGEST:
        wrong.append(f"the quote has more than {LONGEST} words")
    if s.verdict and s.verdict not in UNTESTED:
        wrong.append(f"verdict = {s.verdict!r} may only be one of {', '.join(UNTESTED)}; others are computed")
    if s.bound and s.verdict:
        wrong.append("has a bound and a verdict; the bound gives the verdict")
    if not s.bound and s.kind == "paper" and not s.verdict:
        wrong.append("has neither a bound nor a verdict that says why")
    if s.verdict and not s.reason:
        wrong.append(f"{s.verdict} without a reason")
    if s.verdict == "not flown yet" and not s.command:
        wrong.append("not flown yet without the command that would fly it")
    return wrong + (_of_bound(s) if s.bound else []) + (_of_quote(s) if s.quote else [])


def _of_bound(s: Statement) -> list[str]:
    wrong = [f"a bound needs {key}" for key in ("quantity", "at") if not getattr(s, key)]
    if s.kind == "paper" and not s.fails_if:
        wrong.append("a bound needs fails_if, a change under which it is missed")
    try:
        if not bounds.refutable(s.bound, {"published": s.published, "published_sd": s.published_sd}):
            wrong.append(f"bound {s.bound!r} holds whatever is measured")
    except AirflockError as fault:
        wrong.append(str(fault))
    return wrong


def _of_quote(s: Statement) -> list[str]:
    """Quantity, time and number must be those of the quote."""
    wrong = []
    if s.quantity and s.quantity not in QUANTITIES:
        wrong.append(f"quantity {s.quantity!r} is not listed in quantities.py")
    elif s.quantity and not any(word.lower() in s.quote.lower() for word in QUANTITIES[s.quantity]):
        wrong.append(f"quantity {s.quantity!r} is not what the quote speaks of ({', '.join(QUANTITIES[s.quantity])})")
    for name, pattern in TIMES.items():
        told, measured = _numbers(pattern, s.quote), _numbers(pattern, s.at)
        if s.bound and told and measured and not measured <= told:
            wrong.append(f"at {s.at!r} is another {name} than the quote's {', '.join(sorted(told))}")
        if s.bound and told and not measured and name != "s":
            wrong.append(f"at {s.at!r} does not name the quote's {name} {', '.join(sorted(told))}")
    if s.published is not None and not any(_same(s.published, n) for n in re.findall(r"\d+(?:\.\d+)?", s.quote)):
        wrong.append(f"published = {s.published:g} does not stand in the quote")
    return wrong


def _numbers(pattern: str, text: str) -> set[str]:
    return {next(g for g in found.groups() if g) for found in re.finditer(pattern, text)}


def _same(value: float, printed: str) -> bool:
    """A printed number, also as a percentage or in millionths."""
    return any(
        abs(value - float(printed) * scale) <= 1e-9 * max(1.0, abs(value)) * scale for scale in (1.0, 0.01, 1e-6)
    )
