"""The committed report on Table S1: evolved.toml and EVOLVED.md in papers/vasarhelyi_2018/."""

import re
from collections.abc import Mapping
from pathlib import Path

from airflock import atomic
from airflock.papers import claims as records
from airflock.papers import statistics
from airflock.papers.claims import Claim
from airflock.papers.flights import Flights, progress_bar
from airflock.papers.vasarhelyi_2018 import table_s1
from airflock.papers.vasarhelyi_2018.published import optimum
from airflock.papers.vasarhelyi_2018.table_s1 import COARSE, COLUMNS, RUNS, Data

COMMAND = "airflock paper vasarhelyi_2018 --only s1"
TITLE = "Table S1 of Vásárhelyi et al. 2018, evolved again"


def reproduce(
    folder: Path, runs: Mapping[int, int] = RUNS, threads: int | None = None, presets: Path | None = None
) -> list[Claim]:
    """Evolve what is not evolved yet and write the report.

    runs : independent runs by speed (m/s); presets : folder of the presets of Table S1, where ours are written too
    """
    with progress_bar() as bar:
        data = table_s1.fly(Flights(threads=threads, progress=bar), runs)
    claims = table_s1.claims(data)
    write(folder, claims, data)
    if presets is not None:
        for v in data.runs:
            text = (presets / f"{v}ms.toml").read_text(encoding="utf-8")
            atomic.write(presets / f"evolved_{v}ms.toml", preset(v, data, text))
    return claims


def write(folder: Path, claims: list[Claim], data: Data) -> None:
    """Write evolved.toml and EVOLVED.md."""
    steps = ", ".join(f"{key} = {value:g}" for key, value in COARSE.items())
    pairs = len(next(iter(data.ours.values())))
    header = records.header(TITLE, COMMAND, told=f"studies 0, 1, ...; paired flights 0 to {pairs - 1}") | {
        "runs": ", ".join(f"{len(runs)} at {v} m/s" for v, runs in data.runs.items()),
        "search": f"15,000 evaluations a run with {steps}; paired flights with the steps of the paper",
    }
    records.write_claims(folder / "evolved.toml", claims, header)
    claims = records.read_claims(folder / "evolved.toml")[1]
    lines = [f"# {TITLE}", "", f"`{COMMAND}` evolves all this again. Runs: {header['runs']}; {header['search']}.", ""]
    lines += [records.markdown(claims), "## Optima and working ranges", ""]
    lines += ["Printed | ours [range of all evaluations that reach our optimum's mean fitness].", ""]
    lines += _optima(data)
    atomic.write(folder / "EVOLVED.md", "\n".join(lines) + "\n")


def preset(v: int, data: Data, text: str) -> str:
    """A preset with our optimum from that of Table S1; text: of the preset vasarhelyi_2018/{v}ms."""
    gap = statistics.mean(data.ours[v]["fitness"] - data.published[v]["fitness"])
    told = f"{len(data.ours[v])} paired flights {gap.ours:.3f} ({gap.low:.3f} to {gap.high:.3f})"
    source = "evolved: papers/vasarhelyi_2018/evolved.toml"
    for name in COLUMNS:
        value = float(f"{data.runs[v][0].parameters[f'model.{name}']:.6g}")
        text = re.sub(rf'(?m)^({name} = {{ value = )[^,]+(, .*source = )".*"', rf'\g<1>{value!r}\g<2>"{source}"', text)
    text = re.sub(
        r'(?m)^title = ".*"',
        f'title = "Vásárhelyi et al. 2018 at {v} m/s, parameters evolved here instead of Table S1"',
        text,
    )
    note = f"# Found by the study vasarhelyi_2018/{v}ms; on {told} fitter than Table S1.\n"
    text = text.replace("[model]\n", f"{note}[model]\n")
    return text.split("\n# Table S2, 100 stochastic evaluations")[0].rstrip() + "\n"


def _optima(data: Data) -> list[str]:
    """Rows of a table: parameters by speed."""
    speeds = list(data.runs)
    lines = ["| parameter | " + " | ".join(f"{v} m/s" for v in speeds) + " |", "|---" * (len(speeds) + 1) + "|"]
    for name in COLUMNS:
        row = []
        for v in speeds:
            best, key = data.runs[v][0], f"model.{name}"
            low, high = best.ranges[key]
            row.append(
                f"{getattr(optimum(v).parameters, name):.3g} \\| {best.parameters[key]:.3g} [{low:.3g}, {high:.3g}]"
            )
        lines.append(f"| `{name}` | " + " | ".join(row) + " |")
    return lines
