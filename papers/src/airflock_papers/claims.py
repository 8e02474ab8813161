"""Claims: a statement, what we measured for it, and the verdict that follows from its bound."""

import math
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from airflock.support import AirflockError, atomic
from airflock_papers import bounds
from airflock_papers.counts import headline
from airflock_papers.statements import Statement
from airflock_papers.statistics import Estimate

SEEDS = "0 to n - 1 of each scenario, n flights"  # as `Flights.score` counts them
VERDICTS = {  # by kind: the bound holds, it does not, there is none
    "paper": ("reproduced", "not reproduced", "qualitative only"),
    "program": ("agrees", "differs", "finding"),
    "ours": ("holds", "does not hold", "finding"),
}
UNFLOWN = "not flown yet"


@dataclass(frozen=True)
class Measured:
    """A measurement for the statement with the same id.

    quantity, at : what was measured and where, made from the numbers that were used; they must be the statement's
    value        : our value with its SD and 95 % interval; p: of the test that the bound asks for
    note         : what else was seen
    reference    : what it is compared with and no paper prints (runs of a program, theory): value and SD
    """

    id: str
    quantity: str
    at: str
    value: Estimate
    note: str = ""
    p: float | None = None
    reference: tuple[float, float | None] | None = None


@dataclass(frozen=True, kw_only=True)
class Claim(Statement):
    """A statement with our measurement: fields of both, see `Statement` and `Measured`.

    The verdict is that of the bound, or the statement's own if it has no bound; any other is refused.
    """

    ours: float | None = None
    sd: float | None = None
    low: float | None = None
    high: float | None = None
    runs: int = 0
    p: float | None = None
    reference: float | None = None
    reference_sd: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        wanted = verdict_of(self)
        if self.verdict != wanted:
            raise AirflockError(f"claim {self.id}: verdict = {self.verdict!r}, but its bound says {wanted!r}")

    def stored(self) -> dict[str, Any]:
        """The claim as plain values, without what it does not have."""
        return {key: value for key, value in asdict(self).items() if value not in (None, "", {})}

    def as_dict(self) -> dict[str, Any]:
        """The same for JSON, which knows no number that is not finite."""
        return {key: value for key, value in self.stored().items() if not _lost(value)}


def verdict_of(claim: "Claim") -> str:
    """Verdict that a claim's fields give."""
    holds, fails, none = VERDICTS[claim.kind]
    measured = isinstance(claim, Claim) and claim.ours is not None
    if claim.quantity and not measured and claim.verdict in ("", UNFLOWN, *VERDICTS[claim.kind]):
        if not claim.command:
            raise AirflockError(f"claim {claim.id}: has no measurement and no command that would fly it")
        return UNFLOWN
    if not claim.bound:
        return claim.verdict or none
    return holds if bounds.holds(claim.bound, asdict(claim)) else fails


def judge(statements: Mapping[str, Statement], measured: Iterable[Measured]) -> list[Claim]:
    """Claims of what was measured, in the order of the statements.

    Raises AirflockError if something else was measured than a statement is about.
    """
    by_id = {found.id: found for found in measured}
    unknown = sorted(set(by_id) - set(statements))
    if unknown:
        raise AirflockError(f"measured without a statement: {', '.join(unknown)}")
    return [_judged(statements[name], by_id[name]) for name in statements if name in by_id]


def unmeasured(statements: Mapping[str, Statement]) -> list[Claim]:
    """Claims of the statements that nothing measures, with the reason that they give."""
    return [Claim(**asdict(s)) for s in statements.values() if s.verdict and not s.quantity]


def unflown(statements: Mapping[str, Statement], claims: Iterable[Claim], command: str) -> list[Claim]:
    """Claims of the statements that were not measured this time, with the command that would measure them."""
    flown = {claim.id for claim in claims}
    rest = [s for s in statements.values() if s.id not in flown and s.quantity]
    return [Claim(**asdict(s) | {"verdict": s.verdict or UNFLOWN, "command": command}) for s in rest]


def _judged(statement: Statement, found: Measured) -> Claim:
    for key in ("quantity", "at"):
        told, used = getattr(statement, key), getattr(found, key)
        if told != used:
            raise AirflockError(f"claim {statement.id}: is about {key} {told!r}, but {used!r} was measured")
    values = asdict(statement)
    values |= {**found.value._asdict(), "p": found.p, "note": found.note}
    values["reference"], values["reference_sd"] = found.reference or (None, None)
    holds, fails, none = VERDICTS[statement.kind]
    if not statement.bound:
        return Claim(**values | {"verdict": statement.verdict or none})
    return Claim(**values | {"verdict": holds if bounds.holds(statement.bound, values) else fails})


def header(paper: str, command: str, seeds: int | None = None, told: str = SEEDS) -> dict[str, str]:
    """What stands above committed claims: how they are made again.

    seeds : flights per number, if others than the paper's; told : which seeds they are
    """
    from airflock import __version__
    from airflock_papers.texts import texts

    whole = command + (f" --seeds {seeds}" if seeds else "")
    return {
        "paper": paper,
        "command": whole,
        "seeds": told,
        "version": __version__,
        "texts": texts(),
        "precision": "32 bits",
    }


def write_claims(path: Path, claims: Iterable[Claim], above: Mapping[str, Any]) -> None:
    """Write claims.toml, complete or not at all; above: as of `header`, and what else made them."""
    import tomlkit

    document = tomlkit.document()
    document.add(
        tomlkit.comment(
            "Written by the command below; SI units unless a unit is given, intervals low to high are 95 %."
        )
    )
    for key, value in above.items():
        document.add(key, value)
    table = tomlkit.aot()
    for claim in claims:
        entry = tomlkit.table()
        for key, value in claim.stored().items():
            entry.add(key, _inline(value) if isinstance(value, Mapping) else _rounded(value))
        table.append(entry)
    document.add("claim", table)
    try:
        atomic.write_file(path, tomlkit.dumps(document))
    except OSError as fault:
        raise AirflockError(f"{path}: cannot be written: {fault.strerror or fault}; nothing was saved") from fault


def read_claims(path: Path) -> tuple[dict[str, Any], list[Claim]]:
    """Header and claims of a claims.toml; a verdict that does not follow from its bound is refused."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = document.pop("claim", [])
        known = {field.name for field in fields(Claim)}
        for entry in entries:
            unknown = set(entry) - known
            if unknown:
                raise AirflockError(f"{path}: claim {entry.get('id')}: unknown key {', '.join(sorted(unknown))}")
        return document, [Claim(**entry) for entry in entries]
    except (OSError, tomllib.TOMLDecodeError, TypeError) as fault:
        raise AirflockError(f"{path}: {fault}") from fault


def number(value: float | None, digits: int = 4) -> str:
    """A number for a person: few digits, nothing where there is none."""
    return "" if value is None else f"{value:.{digits}g}"


def _spread(value: float | None, sd: float | None) -> str:
    return number(value) + (f" ± {number(sd, 2)}" if sd is not None else "")


def sentence(claim: Claim) -> str:
    """What is claimed: the paper's words in quotation marks, or ours."""
    return f"“{claim.quote}”" + (f" {claim.statement}" if claim.statement else "") if claim.quote else claim.statement


def asked(claim: Claim) -> str:
    """What is measured, where, and the bound, in one line."""
    told = ", ".join(part for part in (f"`{claim.quantity}`" if claim.quantity else "", claim.at) if part)
    p = f" (p = {number(claim.p, 2)})" if claim.p is not None else ""
    return told + (f": {claim.bound}{p}" if claim.bound else "")


def cells(claim: Claim) -> tuple[str, ...]:
    """Claim as the cells of a table: see HEADINGS."""
    ours, published = _spread(claim.ours, claim.sd), _spread(claim.published, claim.published_sd)
    published = published or _spread(claim.reference, claim.reference_sd)
    unit = f" {claim.unit}" if claim.unit and ours else ""
    interval = "" if claim.low is None or claim.high is None else f"{number(claim.low)} … {number(claim.high)}"
    about = f"{sentence(claim)} ({claim.where})"
    return claim.id, about, asked(claim), published, ours + unit, interval, str(claim.runs or ""), claim.verdict


HEADINGS = ("claim", "sentence", "judged by", "printed or reference", "ours", "95 % interval", "runs", "verdict")


def markdown(claims: Sequence[Claim]) -> str:
    """Claims as a Markdown table, and below it what is to be said of each."""
    rows = [HEADINGS, ("---",) * len(HEADINGS), *(cells(claim) for claim in claims)]
    text = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows) + "\n"
    notes = [f"* `{claim.id}`: {told}" for claim in claims if (told := remark(claim))]
    return text + ("\n" + "\n".join(notes) + "\n" if notes else "")


def remark(claim: Claim) -> str:
    """Reason, note, the command that would fly it, and what was judged before."""
    command = f"`{claim.command}` would fly it" if claim.command else ""
    return ". ".join(part.rstrip(".") for part in (claim.reason, claim.note, command, claim.changed) if part)


def print_claims(claims: Sequence[Claim]) -> None:
    """Print each claim with its verdict, what was measured and what is to be said of it; then the headline."""
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    good, bad = ({verdicts[k] for verdicts in VERDICTS.values()} for k in (0, 1))
    console = Console(highlight=False)
    for claim in claims:
        colour = "green" if claim.verdict in good else "red" if claim.verdict in bad else "yellow"
        console.print(Text.assemble((claim.id, "bold"), "  ", (claim.verdict, colour)))
        for line in (f"{sentence(claim)} ({claim.where})", _numbers(claim), remark(claim)):
            if line:
                console.print(Padding(Text(line), (0, 0, 0, 2)))
    told = ", ".join(f"{n} {verdict}" for verdict, n in Counter(c.verdict for c in claims if c.kind != "paper").items())
    for line in (headline(claims), f"not of the paper: {told}" if told else ""):
        if line:
            console.print(line)


def _numbers(claim: Claim) -> str:
    """What was measured, in one line: nothing of a sentence that nothing tests."""
    _, _, question, printed, ours, interval, runs, _ = cells(claim)
    if not ours:
        return ""
    against = f"; {'printed' if claim.published is not None else 'reference'} {printed}" if printed else ""
    return f"{question}; ours {ours}" + f" ({interval})" * bool(interval) + f", {runs} runs" * bool(runs) + against


def _lost(value: Any) -> bool:
    """Not finite: the ratio to a count of 0, say."""
    return isinstance(value, float) and not math.isfinite(value)


def _inline(value: Mapping[str, Any]) -> Any:
    import tomlkit

    table = tomlkit.inline_table()
    table.update(value)
    return table


def _rounded(value: Any) -> Any:
    """Six significant digits: more would be noise in a diff."""
    return float(f"{value:.6g}") if isinstance(value, float) else value
