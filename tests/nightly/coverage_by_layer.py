"""Run the tests with line coverage, and hold each layer of the package to a floor.

    python tests/nightly/coverage_by_layer.py FOLDER [PYTEST OPTIONS]

A layer is a folder of src/airflock (files at its top: "top"). Its floor, a percentage of lines, stands in
coverage_floors.toml beside this file; a layer without one fails, too. Child processes are counted. Engine stages are a
layer of their own: they are specialised from their text and then compiled or interpreted, so that few of their lines
run as they stand, and the tests of syntax trees and of drivers against the reference hold them instead.
"""

import json
import os
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FLOORS = HERE / "coverage_floors.toml"
STAGES = "engine/stages"


def by_layer(report):
    """Lines and lines that ran of each layer of a report of coverage.py (`coverage json`)."""
    lines, ran = Counter(), Counter()
    for file, found in report["files"].items():
        parts = Path(file).parts[Path(file).parts.index("airflock") + 1 :]
        layer = STAGES if parts[:2] == tuple(STAGES.split("/")) else parts[0] if len(parts) > 1 else "top"
        lines[layer] += found["summary"]["num_statements"]
        ran[layer] += found["summary"]["covered_lines"]
    return {layer: (lines[layer], ran[layer]) for layer in sorted(lines) if lines[layer]}


def short_of(found, floors):
    """What lies below its floor, or has none, in words."""
    wrong = [f"{layer}: no floor in {FLOORS.name}" for layer in found if layer not in floors]
    wrong += [f"{layer}: no such layer, but a floor" for layer in floors if layer not in found]
    for layer, (lines, ran) in found.items():
        if layer in floors and 100.0 * ran < floors[layer] * lines:
            wrong.append(f"{layer}: {100.0 * ran / lines:.1f} % of {lines} lines, floor {floors[layer]} %")
    return wrong


def main():
    """Status 0 if the tests pass and every layer stands on its floor."""
    folder = Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob(".coverage*"):
        old.unlink()
    settings = folder / "coveragerc"
    settings.write_text(
        f"[run]\nsource_pkgs = airflock\nparallel = true\npatch = subprocess\ndata_file = {folder / '.coverage'}\n"
        + ("core = sysmon\n" if sys.version_info >= (3, 12) else "")
    )
    known = os.environ | {"COVERAGE_RCFILE": str(settings)}

    def call(*words):
        return subprocess.run([sys.executable, "-m", *words], cwd=ROOT, env=known).returncode

    passed = call("coverage", "run", "-m", "pytest", "-n", "2", *sys.argv[2:])
    out = folder / "coverage.json"
    if call("coverage", "combine", "--quiet") or call("coverage", "json", "--quiet", "-o", str(out)):
        print("coverage: nothing was measured")
        return 1
    report = json.loads(out.read_text())
    found = by_layer(report)
    floors = tomllib.loads(FLOORS.read_text())["percent"]
    for layer, (lines, ran) in found.items():
        print(f"{layer:12} {100.0 * ran / lines:5.1f} % of {lines:5d} lines, floor {floors.get(layer, 'none')}")
    wrong = short_of(found, floors)
    for line in wrong:
        print(line)
    total = report["totals"]["percent_covered"]
    print(f"{total:.1f} % of {report['totals']['num_statements']} lines, {len(wrong)} layers below their floor")
    return 1 if passed or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
