"""Add a copy of one part of each kind to a copy of the package, as one file or folder, and show that it works.

    python tests/nightly/add_one.py       # adds, flies, lists, checks and documents each copy; status 1 if one fails
    python tests/nightly/add_one.py --remove topologies    # lists the imports that removing a kind breaks

Nothing else is edited: what a copy needs beside its file or folder would fail here.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "airflock"
# kind → what is copied, and what the copy is called; a number of its own is added where the file has a record
COPIES = {
    "laws": ("viragh_2014", "copied_law"),
    "bodies": ("direct.py", "copied_body.py"),
    "sensors": ("langevin.py", "copied_sensor.py"),
    "radios": ("bursts.py", "copied_radio.py"),
    "topologies": ("nearest.py", "copied_topology.py"),
    "faults": ("motor.py", "copied_fault.py"),
    "metrics": ("milling.py", "copied_metric.py"),
    "metric_sets": ("order.py", "copied_set.py"),
}
FLIGHTS = {  # kind → how its copy is flown
    "laws": ({}, {"law": "copied_law"}),
    "bodies": ({"body.kind": "copied_body"}, {}),
    "sensors": ({"sensors.kind": "copied_sensor"}, {}),
    "radios": ({"radio.kind": "copied_radio"}, {}),
    "topologies": ({"topology.kind": "copied_topology", "topology.k": 2.0}, {}),
    "faults": ({"faults": [{"kind": "copied_fault", "at": 0.4}]}, {}),
    "metrics": ({}, {"metrics": ["speed", "copied_metric"]}),
    "metric_sets": ({"metrics.kind": "copied_set"}, {}),
}
TRIAL = """
import sys
import airflock
from airflock.parts import KINDS

folder, name, keys, parts = {folder!r}, {name!r}, {keys!r}, {parts!r}
(kind,) = [kind for kind in KINDS if kind.folder.endswith("." + folder)]
assert name in kind and not [line for line in kind.errors.values() if "has none of" not in line]
usual = {{"duration": 2.0, "agents": 4, "start.radius": 30.0}}
scenario = airflock.load("vasarhelyi_2018/4ms", {{**usual, **keys}}, **parts)
scores = airflock.score(scenario, [1], device="python")
print("flies:", len(scores.columns), "order parameters")
listed = [key for key in airflock.keys() if name in (key.of, *key.options)]
if folder != "metrics":  # sets name metrics; no key does
    assert listed
    print("keys:", ", ".join(sorted({{key.name for key in listed}})))
check = getattr(airflock, kind.check)
print("checked:", check(kind[name]).name)
sys.path[:0] = [{docs!r}]
import kinds, pages, writing
texts = []
for module in (kinds, pages):
    module.put = lambda path, text: texts.append(text)
page = {{"laws": lambda: pages.models(False), "faults": kinds.faults, "topologies": kinds.topologies,
        "metrics": lambda: pages.order_parameters(False), "metric_sets": lambda: pages.order_parameters(False)}}
pages.LAWS = writing.LAWS = pages.pictures.LAWS = airflock.__path__[0] + "/parts/laws"
from pathlib import Path
pages.LAWS = pages.pictures.LAWS = Path(pages.LAWS)
page.get(folder, pages.robots)()
assert any(name in text for text in texts)
print("documented")
"""


def copied(original: Path, copy: Path) -> None:
    """Lay the copy of a file or folder beside it; order parameters get names of their own."""
    if original.is_dir():
        shutil.copytree(original, copy)
        return
    text = re.sub(r"^NAME = .*\n", "", original.read_text(encoding="utf-8"), flags=re.M)
    text = re.sub(r"\bmilling\b", "copied_metric", text) if original.stem == "milling" else text
    copy.write_text(text, encoding="utf-8")


def add() -> int:
    """Add a copy of each kind, one after another; return the number of those that do not work."""
    failed = 0
    for folder, (original, copy) in COPIES.items():
        with tempfile.TemporaryDirectory() as place:
            shutil.copytree(SOURCE, Path(place) / "airflock", ignore=shutil.ignore_patterns("__pycache__"))
            home = Path(place) / "airflock" / "parts" / folder
            copied(home / original, home / copy)
            keys, parts = FLIGHTS[folder]
            code = TRIAL.format(
                folder=folder, name=copy.removesuffix(".py"), keys=keys, parts=parts, docs=str(ROOT / "docs" / "_ext")
            )
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join([place, str(ROOT / "papers" / "src")])}
            done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
        lines = "; ".join(done.stdout.splitlines()) if done.returncode == 0 else done.stderr.strip()
        print(f"{'added' if done.returncode == 0 else 'FAILS'} {folder}/{copy}: {lines}")
        failed += done.returncode != 0
    return failed


def places(folder: str) -> list[str]:
    """Return the places outside the files of a kind that name it, its members or its contract: file and line."""
    word = {"topologies": "topolog", "faults": "fault", "laws": "law"}.get(folder, folder.rstrip("s"))
    own = {SOURCE / "core" / f"{word.replace('topolog', 'topology')}.py"}
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        if path in own or (SOURCE / "parts" / folder) in path.parents:
            continue
        text = path.read_text(encoding="utf-8")
        imports = re.findall(rf"^(?:from|import) .*{word}.*|^    \w*{word}\w*(?: as \w+)?,$", text, re.M | re.I)
        found += [f"{path.relative_to(ROOT)}: {line.strip()}" for line in imports]
    return found


def main() -> int:
    """Add copies, or list what removing a kind breaks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--remove", metavar="KIND", choices=COPIES, help="list the imports that removing a kind breaks")
    options = parser.parse_args()
    if options.remove:
        found = places(options.remove)
        print("\n".join([*found, f"{len(found)} imports in {len({line.split(':')[0] for line in found})} files"]))
        return 0
    return add()


if __name__ == "__main__":
    sys.exit(main())
