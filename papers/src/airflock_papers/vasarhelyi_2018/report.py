"""The committed report: claims.toml, README.md and figures in papers/vasarhelyi_2018/."""

from pathlib import Path
from typing import Any

from airflock_papers import page
from airflock_papers.claims import Claim
from airflock_papers.page import Section
from airflock_papers.vasarhelyi_2018 import PAPER

COMMAND = "airflock paper vasarhelyi_2018"
ABOUT = (
    "`python papers/vasarhelyi_2018/reproduce.py` also rewrites this folder. The evolution of Table S1 stands on "
    "[a page of its own](EVOLVED.md), what the authors' program says on [another](../programs.md).\n\n"
    "The largest part of what is not reproduced stands in Table S2, and hangs on digits that Table S1 does not print. "
    "The authors' program, given the printed digits, misses the same entries; each line says by how much. Inside the "
    "rounding of Table S1 there are sets that reproduce whole columns: 4 and 16 m/s as printed, 32 m/s with F_wall as "
    "the authors' program averages it, 8 m/s within the rounding of Table S2, too. At 6 m/s the printed number of "
    "collisions is out of reach ([the search](ROUNDING.md)). The rest is mostly of real drones, which are simulated "
    "here, and of causes in Tables S3 and S4 that pairs of flights do not show."
)
SECTIONS = (
    Section(
        "s2.",
        "Table S2",
        "Mean ± SD over 100 flights of 600 s a column, with the parameters as Table S1 prints them; Welch's test "
        "against the printed mean and SD of 100 evaluations, p corrected by Holm's method over the 55 entries. "
        "An entry that a test of its own would reject says so.",
        ("s2",),
    ),
    Section("fig1.", "Fig. 1: algorithm A (Virágh et al. 2014) against B", "", ("fig1",)),
    Section(
        "fig2.",
        "Fig. 2: range and delay of the radio at 32 m/s",
        "The map is of 20 flights a bin, the safe region (dashed) of 40.",
        ("fig2",),
    ),
    Section(
        "fig3.",
        "Fig. 3: 30 drones with the parameters that flew outdoors",
        "Look-alikes of outdoor flights; where obstacles stand is ours. Middle five minutes, 20 flights each. Shown is "
        "the flight of each scene whose mean φ_LAP is nearest 0.",
        ("fig34",),
    ),
    Section("fig4.", "Fig. 4: patterns"),
    Section("pressure.", "30 to 1000 drones", "At 4 m/s, side of the arena 250 m · sqrt(N/100).", ("pressure",)),
    Section(
        "limits.",
        "What keeps the fitness below 1",
        "Optima of Table S1; 40 pairs of flights on the same seeds. In turns: in the quarter of instants in which the "
        "mean velocity of the flock turns fastest, less the quarter in which it turns slowest, in 10 recorded flights "
        "from 100 s on.",
    ),
    Section(
        "model.",
        "Sentences on the model",
        "Wall term: Eqs 8 and 9, m/s, mean over drones that any wall acts on; 10 recorded flights a side.",
    ),
    Section("drones.", "Sentences on the real drones"),
    Section(
        "tuning.",
        "Tables S3 and S4: what each parameter does",
        "Paired flights on the same seeds, 40 scored and 10 recorded a side: the changed side less the other. "
        "`s1` is Table S1, `s4` Table S4; the cases stand in `vasarhelyi_2018/tuning.py`, with how oscillation (m/s), "
        "agility (1/s) and reach (m) are measured.",
    ),
)


def write(folder: Path, claims: list[Claim], flown: dict[str, Any]) -> None:
    """Write claims.toml, README.md and the figures into a folder."""
    from airflock_papers.vasarhelyi_2018.figures import draw

    draw(folder / "figures", flown)
    page.write(folder, PAPER.title, COMMAND, claims, SECTIONS, ABOUT)


def reproduce(folder: Path, threads: int | None = None) -> list[Claim]:
    """Fly everything and write the report."""
    claims, flown = PAPER.recompute(None, False, None, threads, None)
    write(folder, claims, flown)
    return claims
