"""What is claimed of the rounding of Table S1, its committed page ROUNDING.md, and the map of its digits."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock_papers import page, statistics
from airflock_papers.claims import Claim, Measured, judge, unflown
from airflock_papers.flights import Flights
from airflock_papers.page import Section
from airflock_papers.progress import progress_bar
from airflock_papers.statements import load
from airflock_papers.vasarhelyi_2018.published import COLUMNS, SPEEDS, program_runs
from airflock_papers.vasarhelyi_2018.rounding import (
    ALPHA,
    NAMES,
    PRINTED,
    SURE,
    Target,
    box,
    judged,
    measured_as,
    printed,
)
from airflock_papers.vasarhelyi_2018.rounding_search import (
    QUICK,
    Budget,
    Point,
    effects,
    fresh,
    kept,
    screened,
)

COMMAND = "airflock paper vasarhelyi_2018 --only rounding"
TITLE = "The rounding of Table S1 of Vásárhelyi et al. 2018"
AVERAGES = {"eq15": "F_wall by Eq. 15", "program": "F_wall by the program's average"}
MAPPED = tuple(row for row in COLUMNS if row not in SURE)


class Column(NamedTuple):
    """One column: what was flown for the map, by whose points; the sets of the search; and the judged sets."""

    trajectories: NDArray[np.float64]
    screen: Sequence[Point]
    near: Sequence[Point]
    judged: Mapping[Target, Point]


Data = Mapping[int, Column]


def fly(flights: Flights, speeds: Sequence[int] = SPEEDS) -> Data:
    """Search and judge the columns of some speeds, m/s."""
    budget = QUICK if flights.quick else Budget()
    found = {}
    for v in speeds:
        store = kept(v)
        last = fresh(store, v, flights, budget)
        near = [point for point in store.points if point.stage == "near" and point.key.startswith(f"{budget} ")]
        found[v] = Column(*screened(store, v, flights, budget), near, last)
    return found


def measured(data: Data) -> list[Measured]:
    """The joint p of every column by each target, and what is left where it is rejected."""
    return [_joint(v, target, point) for v, column in data.items() for target, point in column.judged.items()]


def _joint(v: int, target: Target, point: Point) -> Measured:
    joint, rows = judged(v, {name: np.array(values) for name, values in point.rows.items()}, target)
    runs = len(point.rows["fitness"])
    low, high = box(v).T
    values = low + np.array(point.x) * (high - low)
    coarse = ", ".join(
        f"{name} = {values[NAMES.index(name)]:.4g}" for name in ("p_rep", "c_frict", "v_frict", "r0_rep")
    )
    missed = ", ".join(f"{row} (p = {p:.1g})" for row, p in rows.items() if p < ALPHA)
    note = f"{coarse}; rejected: {missed or 'no row'}"
    words = f"{v} m/s, {AVERAGES[target.wall]}"
    return Measured(f"rounding.{target.name}.{v}ms", "joint p", words, statistics.one(joint, runs), note)


def reproduce(folder: Path, threads: int | None = None, speeds: Sequence[int] = SPEEDS) -> list[Claim]:
    """Search the columns of some speeds and write the report; what is kept is not flown again."""
    with progress_bar() as bar:
        data = fly(Flights(threads=threads, progress=bar), speeds)
    statements = {key: s for key, s in load(__package__).items() if key.startswith("rounding.")}
    claims = judge(statements, measured(data))
    claims += unflown(statements, claims, COMMAND)
    write(folder, claims, data)
    return claims


def write(folder: Path, claims: list[Claim], data: Data) -> None:
    """Write rounding.toml, ROUNDING.md and the figure of the map."""
    if data:
        draw(folder / "figures", data)
    budget = Budget()
    about = (
        "Table S1 prints two or three digits of each parameter; a set within half of the last digit of all eleven is "
        "inside them. A set reproduces a column of Table S2 if none of its 11 rows is rejected: Welch's test of 100 "
        "fresh flights, corrected by Holm's method over the column; the least corrected p is the joint p, the bound "
        "0.05. Lines with `digits` let a printed mean stand for every number that rounds to it. The rule was written "
        f"down before anything was flown. Search: {budget.trajectories} trajectories of Morris' screening with "
        f"{budget.flights} flights a point, then {budget.rounds} rounds of {budget.near} flights for the best set of "
        f"each line by a polynomial of all flights; each line is judged once.\n\n{_counted(claims)}"
    )
    told = "search 1000000 to 2999999, judged 3000000 to 3003099"
    parts = (
        Section("left", "What is left", residual(data)),
        Section("map", "The map of the digits", MAP if data else "", ("rounding",) if data else ()),
    )
    page.write(folder, TITLE, COMMAND, claims, parts, about, told, ("rounding.toml", "ROUNDING.md"))


LEFT = (
    "Every row that is rejected (p below 0.05, corrected) in the sets that are judged. Printed and ours are means ± SD "
    "of 100 flights; the gap is in printed SDs. `search` is the span of the means of all sets that the search flew, "
    "each of 20 flights: an entry of Table S2 outside it is out of reach of the digits. `program` is the authors' "
    "program with Table S1 as printed (program_runs.csv; F_wall by Eq. 15)."
)


def residual(data: Data) -> str:
    """Rows of Table S2 that no set inside the digits reproduced, as a table; empty if there is none."""
    lines = []
    for v, column in data.items():
        for target, point in column.judged.items():
            flown = {name: np.array(values) for name, values in point.rows.items()}
            for row, p in judged(v, flown, target)[1].items():
                if p < ALPHA:
                    lines.append(_left(v, row, target, flown[measured_as(row, target)], column.near, p))
    if not lines:
        return ""
    head = ("column", "read as", "row", "printed", "ours", "gap", "p", "search", "program")
    return "\n".join([LEFT, "", _row(head), _row(["---"] * len(head)), *lines])


def _left(v: int, row: str, target: Target, ours: NDArray[np.float64], near: Sequence[Point], p: float) -> str:
    mean, sd = printed(v, row)
    found = [float(np.mean(each.rows[measured_as(row, target)])) for each in near]
    runs = program_runs(v)
    theirs = f"{runs[row].mean():.3g} ± {runs[row].std():.2g} ({len(runs)} runs)" if row in runs else ""
    gap = f"{(ours.mean() - mean) / sd:+.2f}" if sd > 0.0 else ""
    told = f"{v} m/s", f"`{target.name}`", f"`{row}`", f"{mean:.4g} ± {sd:.2g}"
    return _row([*told, f"{ours.mean():.4g} ± {ours.std(ddof=1):.2g}", gap, f"{p:.1g}", _span(found), theirs])


def _span(values: Sequence[float]) -> str:
    return f"{min(values):.3g} to {max(values):.3g}" if values else ""


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _counted(claims: Sequence[Claim]) -> str:
    """How many columns hold, and in which way."""
    judged_ = [c for c in claims if c.verdict in ("holds", "does not hold")]
    columns = {c.id.rsplit(".", 1)[1] for c in judged_}
    good = [c for c in judged_ if c.verdict == "holds"]
    exact = {c.id.rsplit(".", 1)[1] for c in good if ".digits." not in c.id}
    every = {c.id.rsplit(".", 1)[1] for c in good}
    return (
        f"**{len(columns)} of {len(SPEEDS)} columns were searched. {len(exact)} of them hold with the printed means as "
        f"they stand, {len(every)} with what rounds to them.**"
    )


MAP = (
    "Effect of each digit, from its lowest to its highest value inside the rounding, on each row, in standard errors "
    "of the difference between two means of 100 flights: Morris' mean effect by SALib, over all other digits."
)


def draw(folder: Path, data: Data) -> None:
    """One figure: rows of Table S2 against digits of Table S1, a panel for each speed."""
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, len(data), figsize=(2.0 + 2.6 * len(data), 4.2), sharey=True, squeeze=False)
    for axis, (v, column) in zip(axes[0], data.items(), strict=True):
        table = np.array([_standard(column, row) for row in MAPPED])
        image = axis.imshow(table, cmap="RdBu_r", vmin=-6.0, vmax=6.0, aspect="auto")
        texts = [PRINTED[name][SPEEDS.index(v)] for name in NAMES]
        axis.set_xticks(range(len(NAMES)), [f"{n} {t}" for n, t in zip(NAMES, texts, strict=True)], rotation=90)
        axis.set_yticks(range(len(MAPPED)), MAPPED)
        axis.set_title(f"{v} m/s")
    figure.colorbar(image, ax=axes[0], label="effect of the digit, standard errors", shrink=0.8)
    figure.savefig(folder / "rounding.png", dpi=110, bbox_inches="tight")
    plt.close(figure)


def _standard(column: Column, row: str) -> NDArray[np.float64]:
    """Mean effects of the digits on a row, in standard errors of the difference of two means of 100 flights."""
    within = float(np.mean([np.var(point.rows[row], ddof=1) for point in column.screen]))
    effect = effects(column.trajectories, column.screen, row)["mu"]
    return effect / (0.02 * within) ** 0.5 if within > 0.0 else np.zeros(len(NAMES))
