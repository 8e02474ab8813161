"""The committed report: claims.toml, README.md and figures in papers/vasarhelyi_2018/."""

from pathlib import Path
from typing import Any

from airflock import __version__, atomic
from airflock.papers import claims as records
from airflock.papers.claims import VERDICTS, Claim
from airflock.papers.vasarhelyi_2018 import PAPER

COMMAND = "airflock paper vasarhelyi_2018"
SECTIONS = (
    ("s2.", "Table S2", "s2", "Mean ± SD over 100 flights of 600 s a column. Printed parameters of Table S1."),
    (
        "program.",
        "Table S1 flown by the authors' own program",
        "",
        "The rounding of Table S1 cancels here: both sides fly the same digits. Per-run numbers stand in "
        "`src/airflock/papers/vasarhelyi_2018/program_runs.csv`.",
    ),
    ("fig1.", "Fig. 1: algorithm A (Virágh et al. 2014) against B", "fig1", ""),
    (
        "fig2.",
        "Fig. 2: range and delay of the radio at 32 m/s",
        "fig2",
        "20 flights a bin; dashed: the caption's safe region.",
    ),
    (
        "fig3.",
        "Fig. 3: 30 drones with the parameters that flew outdoors",
        "fig34",
        "Look-alikes of outdoor flights; where obstacles stand is ours. Middle five minutes, 20 flights each. "
        "Shown is the flight of each scene whose mean φ_LAP is nearest 0.",
    ),
    ("fig4.", "Fig. 4: patterns", "", ""),
    ("fig7.", "Fig. 7 and Eqs 17-22", "", ""),
    ("pressure.", "Pressure: 30 to 1000 drones", "pressure", "At 4 m/s, side of the arena 250 m · sqrt(N/100)."),
)


def write(folder: Path, claims: list[Claim], flown: dict[str, Any], seeds: int | None = None) -> None:
    """Write claims.toml, README.md and the figures into a folder."""
    from airflock.papers.vasarhelyi_2018.figures import draw

    folder.mkdir(parents=True, exist_ok=True)
    draw(folder / "figures", flown)
    records.write_claims(folder / "claims.toml", claims, records.header(PAPER.title, COMMAND, seeds))
    # from the file, so that both show the same rounded numbers
    atomic.write(folder / "README.md", page(records.read_claims(folder / "claims.toml")[1]))


def reproduce(folder: Path, threads: int | None = None) -> list[Claim]:
    """Fly everything and write the report."""
    claims, flown = PAPER.recompute(None, False, None, threads, None)
    write(folder, claims, flown)
    return claims


def page(claims: list[Claim]) -> str:
    """README.md: verdicts, tables and figures."""
    count = {verdict: sum(claim.verdict == verdict for claim in claims) for verdict in VERDICTS}
    lines = [
        f"# {PAPER.title}",
        "",
        f"`{COMMAND}` flies all this again; `python papers/vasarhelyi_2018/reproduce.py` also rewrites this folder. "
        f"Airflock {__version__}. Tests and sources of each claim stand in [claims.toml](claims.toml). "
        "The evolution of Table S1 stands on [a page of its own](EVOLVED.md).",
        "",
        f"**{count['reproduced']} reproduced, {count['not reproduced']} not reproduced, {count['finding']} findings.** "
        "A finding has nothing printed to agree with.",
        "",
        "## Not reproduced",
        "",
        records.markdown([claim for claim in claims if claim.verdict == "not reproduced"]),
    ]
    for start, title, figure, words in SECTIONS:
        part = [claim for claim in claims if claim.id.startswith(start)]
        if not part:
            continue
        lines += [f"## {title}", ""]
        lines += [words, ""] if words else []
        lines += [f"![{title}](figures/{figure}.png)", ""] if figure else []
        told = [claim for claim in part if claim.reason and claim.verdict != "not reproduced"]
        lines += [records.markdown(part, reasons=False)]
        lines += [*(f"* `{claim.id}`: {claim.reason}" for claim in told), ""] if told else []
    return "\n".join(lines).rstrip() + "\n"
