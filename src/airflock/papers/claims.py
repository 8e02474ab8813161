"""Claims: what a publication states, what we measure, and whether the two agree."""

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from airflock import atomic
from airflock.errors import AirflockError

SEEDS = "0 to n - 1 of each scenario, n flights"  # as `Flights.score` counts them
VERDICTS = ("reproduced", "not reproduced", "finding")


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One published number or statement beside our measurement of it.

    id           : part and quantity, for instance s2.phi_vel.4ms
    statement    : what is claimed, in one sentence
    source       : table, figure, column or page of the paper, or the program that it is compared with
    test         : how the verdict follows from the numbers
    published, published_sd : the reported value and its SD over runs, if it is a number
    ours, sd     : our value and the SD over our runs; low, high: its 95 % interval
    runs         : flights behind our value
    verdict      : reproduced, not reproduced, or finding (nothing printed to agree with)
    reason       : why it is not reproduced, measured; or what was found
    """

    id: str
    statement: str
    source: str
    test: str
    verdict: str
    published: float | None = None
    published_sd: float | None = None
    ours: float | None = None
    sd: float | None = None
    low: float | None = None
    high: float | None = None
    runs: int = 0
    reason: str = ""

    def __post_init__(self) -> None:
        if self.verdict not in VERDICTS:
            raise AirflockError(f"claim {self.id}: verdict = {self.verdict!r} is none of {', '.join(VERDICTS)}")
        if self.verdict != "reproduced" and not self.reason:
            raise AirflockError(f"claim {self.id}: {self.verdict} without a reason")

    def as_dict(self) -> dict[str, Any]:
        """The claim as plain values, without what it does not have."""
        return {key: value for key, value in asdict(self).items() if value not in (None, "") and not _lost(value)}


def judged(holds: bool, reason: str = "") -> dict[str, Any]:
    """Verdict and reason of a test that holds or does not."""
    return {"verdict": "reproduced" if holds else "not reproduced", "reason": reason}


def header(paper: str, command: str, seeds: int | None = None, told: str = SEEDS) -> dict[str, str]:
    """What stands above committed claims: how they are made again.

    seeds : flights per number, if others than the paper's; told : which seeds they are
    """
    from airflock import __version__

    whole = command + (f" --seeds {seeds}" if seeds else "")
    return {"paper": paper, "command": whole, "seeds": told, "version": __version__, "precision": "32 bits"}


def write_claims(path: Path, claims: Iterable[Claim], above: Mapping[str, Any]) -> None:
    """Write claims.toml, complete or not at all; above: as of `header`, and what else made them."""
    import tomlkit

    document = tomlkit.document()
    document.add(tomlkit.comment("Written by the command below; numbers in SI units, intervals are 95 %."))
    for key, value in above.items():
        document.add(key, value)
    table = tomlkit.aot()
    for claim in claims:
        entry = tomlkit.table()
        for key, value in claim.as_dict().items():
            entry.add(key, _rounded(value))
        table.append(entry)
    document.add("claim", table)
    try:
        atomic.write(path, tomlkit.dumps(document))
    except OSError as fault:
        raise AirflockError(f"{path}: cannot be written: {fault.strerror or fault}; nothing was saved") from fault


def read_claims(path: Path) -> tuple[dict[str, Any], list[Claim]]:
    """Header and claims of a claims.toml."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = document.pop("claim", [])
        known = {field.name for field in fields(Claim)}
        for entry in entries:
            unknown = set(entry) - known
            if unknown:
                raise AirflockError(f"{path}: claim {entry.get('id')}: {', '.join(sorted(unknown))} is no key")
        return document, [Claim(**entry) for entry in entries]
    except (OSError, tomllib.TOMLDecodeError, TypeError) as fault:
        raise AirflockError(f"{path}: {fault}") from fault


def number(value: float | None, digits: int = 4) -> str:
    """A number for a person: few digits, nothing where there is none."""
    return "" if value is None else f"{value:.{digits}g}"


def _spread(value: float | None, sd: float | None) -> str:
    return number(value) + (f" ± {number(sd, 2)}" if sd is not None else "")


def cells(claim: Claim) -> tuple[str, ...]:
    """Claim as the cells of a table: id, statement, published, ours, 95 % interval, runs, verdict."""
    published, ours = _spread(claim.published, claim.published_sd), _spread(claim.ours, claim.sd)
    interval = "" if claim.low is None or claim.high is None else f"{number(claim.low)} … {number(claim.high)}"
    return claim.id, claim.statement, published, ours, interval, str(claim.runs or ""), claim.verdict


HEADINGS = ("claim", "statement", "published", "ours", "95 % interval", "runs", "verdict")


def markdown(claims: Sequence[Claim], reasons: bool = True) -> str:
    """Claims as a Markdown table, and below it the reason of each that is not simply reproduced."""
    rows = [HEADINGS, ("---",) * len(HEADINGS), *(cells(claim) for claim in claims)]
    text = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows) + "\n"
    notes = [f"* `{claim.id}`: {claim.reason}" for claim in claims if claim.reason] if reasons else []
    return text + ("\n" + "\n".join(notes) + "\n" if notes else "")


def write_page(
    folder: Path,
    title: str,
    command: str,
    claims: Sequence[Claim],
    names: tuple[str, str] = ("claims", "README"),
    told: str = SEEDS,
) -> None:
    """Write claims.toml and README.md, or files of other names, for claims without figures; told: as of `header`."""
    write_claims(folder / f"{names[0]}.toml", claims, header(title, command, told=told))
    atomic.write(folder / f"{names[1]}.md", f"# {title}\n\n`{command}` recomputes this page.\n\n{markdown(claims)}")


def print_claims(claims: Sequence[Claim]) -> None:
    """Print claims as a table, then their reasons and a count of verdicts."""
    from rich.console import Console
    from rich.table import Table

    colour = {"reproduced": "green", "not reproduced": "red", "finding": "yellow"}
    table = Table(*HEADINGS)
    for claim in claims:
        *most, verdict = cells(claim)
        table.add_row(*most, f"[{colour[verdict]}]{verdict}[/]")
    console = Console()
    console.print(table)
    for claim in claims:
        if claim.reason:
            console.print(f"{claim.id}: {claim.reason}", markup=False, highlight=False)
    count = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    console.print(", ".join(f"{n} {verdict}" for verdict, n in count.items()))


def _lost(value: Any) -> bool:
    """Not finite: the ratio to a count of 0, say, which TOML readers and JSON do not agree on."""
    return isinstance(value, float) and not math.isfinite(value)


def _rounded(value: Any) -> Any:
    """Six significant digits: more would be noise in a diff."""
    return float(f"{value:.6g}") if isinstance(value, float) else value
