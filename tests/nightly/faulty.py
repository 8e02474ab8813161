"""Collisions per flock hour of a preset with faults: without them, with each kind alone, and with all of them.

    python tests/nightly/faulty.py FOLDER [HOURS] [PRESET]

PRESET is vasarhelyi_2018/faulty by default, or vasarhelyi_2018/faulty_evolved. Each line flies as many flights of
600 s as HOURS (300 by default) take, on the seeds from 0 on, the same for all lines.
What is done stands in FOLDER/flights.csv, so that a run that was cut off goes on. Prints the table in Markdown: means
with 95 % intervals by bootstrap over flights, or where nothing collided the exact upper bound of Poisson. A kind whose
paired difference to the flights without faults has an interval that holds 0 changes nothing that these hours can tell.
"""

import csv
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

import airflock
from airflock.engine import fly_world

PRESET = "vasarhelyi_2018/faulty"
FIELDS = ("line", "seed", "n_coll", "r_min")
DRAWS = 2000


def lines(preset: str) -> dict[str, Any]:
    """Scenario of each line of the table."""
    whole = airflock.load(preset)
    entries = list(whole.document["faults"])
    found = {"none": airflock.load(preset, {"faults": []})}
    found |= {entry["kind"]: airflock.load(preset, {"faults": [entry]}) for entry in entries}
    return found | {"all": whole}


def done(table: Path) -> dict[str, dict[int, float]]:
    """Collisions by line and seed, as far as they were flown."""
    found: dict[str, dict[int, float]] = defaultdict(dict)
    if table.exists():
        with table.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if row["r_min"]:  # a row that was cut off has none
                    found[row["line"]][int(row["seed"])] = float(row["n_coll"])
    return found


def flown(folder: Path, hours: float, preset: str) -> dict[str, dict[int, float]]:
    """Fly what is not done yet."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "flights.csv"
    found, begun = done(table), table.exists()
    with table.open("a", newline="", encoding="utf-8") as file:
        rows = csv.DictWriter(file, FIELDS)
        if not begun:
            rows.writeheader()
        for line, scenario in lines(preset).items():
            for seed in range(round(hours * 3600.0 / scenario.flight.duration)):
                if seed not in found[line]:
                    values = fly_world(scenario, seed).values
                    found[line][seed] = values["n_coll"]
                    rows.writerow({"line": line, "seed": seed, "n_coll": values["n_coll"], "r_min": values["r_min"]})
            file.flush()
            print(f"{line}: {len(found[line])} flights, {sum(found[line].values()):g} collisions", flush=True)
    return found


def interval(values: NDArray[np.float64], hours: float) -> tuple[float, float]:
    """95 % interval of a mean per hour, by bootstrap over flights; hours : of one flight."""
    rng = np.random.default_rng(1)
    if not values.any():
        return 0.0, float(chi2.ppf(0.975, 2) / 2.0 / (hours * len(values)))
    means = [values[rng.integers(0, len(values), len(values))].mean() for _ in range(DRAWS)]
    low, high = np.percentile(means, (2.5, 97.5))
    return float(low / hours), float(high / hours)


def table_of(found: dict[str, dict[int, float]], hours: float) -> str:
    """The table in Markdown; hours : of one flight."""
    text = ["| fault | flock hours | collisions an hour | 95 % | changes |", "|---|---|---|---|---|"]
    plain = found["none"]
    for line, own in found.items():
        values = np.array([own[seed] for seed in sorted(own)])
        low, high = interval(values, hours)
        both = sorted(set(own) & set(plain))
        ends = interval(np.array([own[seed] - plain[seed] for seed in both]), hours) if line != "none" else (0.0, 0.0)
        told = "nothing measurable" if ends[0] <= 0.0 <= ends[1] else f"{ends[0]:+.2g} to {ends[1]:+.2g}"
        told = "" if line == "none" else told
        rate = values.mean() / hours
        text.append(f"| `{line}` | {len(values) * hours:.0f} | {rate:.3g} | {low:.2g} to {high:.2g} | {told} |")
    return "\n".join(text)


def main(folder: Path, hours: str = "300", preset: str = PRESET) -> int:
    """Fly what is missing and print the table."""
    found = flown(folder, float(hours), preset)
    print(table_of(found, airflock.load(preset).flight.duration / 3600.0))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1]), *sys.argv[2:4]))
