"""Guard: this source tree against an earlier one, by ratios of the least processor times of interleaved runs.

    python benchmarks/guard.py                           against the last tag, or the commit of the history's last rows
    python benchmarks/guard.py 4870486 --note            against a commit, a tag or a checkout; rows for the history
    python benchmarks/guard.py --table --plot guard.svg  the history, without measuring anything

Each version flies in a process of its own, on one thread; they take turns, flight by flight, so that whatever else the
machine does meets both. Each set is a pair of new processes: where code and arrays lie in memory decides a few percent.
A ratio above 1 says that this tree is slower. The status is 1 where a ratio exceeds BOUND.
"""

import argparse
import csv
import datetime
import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
HISTORY = Path(__file__).with_suffix(".csv")
COLUMNS = ("date", "commit", "against", "flight", "ms", "ms_against", "ratio")
BOUND = 1.02  # of every ratio

# name: preset, settings; what both versions fly from start to end. A choice that an older version does not know is left
# out there: before the separation of the city could be chosen it was normalised, and with another one boids fly apart.
ROWS = {
    "4ms, 100 drones": ("vasarhelyi_2018/4ms", {"duration": 40.0}),
    "4ms, 30 drones": ("vasarhelyi_2018/4ms", {"agents": 30, "duration": 120.0}),
    "two lossy links, 30 drones": ("vasarhelyi_2018/real_gnss", {"agents": 30, "duration": 60.0}),
    "obstacles": ("vasarhelyi_2018/obstacles", {"duration": 40.0}),
    "50 boids in turn": ("zapotecatl_2016/best", {"duration": 2.0}),
    "2000 boids by cells": ("zapotecatl_2016/best", {"agents": 2000, "update": "synchronous", "duration": 0.5}),
    "kidger, city": ("kidger/city", {"duration": 2.0, "model.separation": "normalised"}),
    "couzin, torus": ("couzin_2002/torus", {"duration": 60.0}),
    "vicsek": ("vicsek_1995/ordered", {"duration": 20.0}),
    "lifting lines": ("dimock_2003/published", {"duration": 10.0}),
}


def child() -> None:
    """Fly what standard input names (preset, settings, seed or none), and answer with seconds; one line each."""
    from airflock.engine.cpu import fly_on_cpu
    from airflock.engine.plan import plan_of
    from airflock.engine.tables import world_tables
    from airflock.scenarios.files import load, presets
    from airflock.support.errors import ScenarioError

    ready = {}
    for line in sys.stdin:
        preset, settings, *seed = json.loads(line)
        key = line
        if key not in ready:
            if preset not in presets():
                print("nan", flush=True)
                continue
            try:
                scenario = load(preset, settings)
            except ScenarioError:
                scenario = load(preset, {key: value for key, value in settings.items() if "." not in key})
            plan = plan_of(scenario)
            ready[key] = plan, world_tables(scenario, plan, *(seed or [1]))
            fly_on_cpu(*ready[key])  # compiled, and loaded into the caches
        begun = time.process_time()
        fly_on_cpu(*ready[key])
        print(time.process_time() - begun, flush=True)


class Version:
    """One source tree, flying in a process of its own."""

    def __init__(self, tree: Path):
        """Start the process."""
        path = os.pathsep.join([str(tree / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])
        paths = os.environ | {"PYTHONPATH": path, "NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        # Each tree flies by its own copy of this file, which knows how its modules are called.
        command = [sys.executable, str(tree / "benchmarks" / "guard.py"), "--child"]
        self.process = subprocess.Popen(
            command, env=paths, cwd=tree, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def seconds(self, row: tuple[str, dict] | tuple[str, dict, int]) -> float:
        """Processor time of one flight, s."""
        self.process.stdin.write(json.dumps(row) + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        self.process.stdin.close()
        self.process.wait()


def git(*words: str) -> str:
    """What git says; empty where it cannot."""
    found = subprocess.run(("git", *words), cwd=HERE, capture_output=True, text=True, check=False)
    return found.stdout.strip() if found.returncode == 0 else ""


@contextmanager
def checkout(other: str):
    """Folder and commit of another version: a folder as it is, a revision in a worktree for as long as it is needed."""
    if Path(other).is_dir():
        yield Path(other).resolve(), git("-C", str(Path(other).resolve()), "rev-parse", "--short", "HEAD") or other
        return
    commit = git("rev-parse", "--short=7", "--verify", f"{other}^{{commit}}")
    if not commit:
        raise SystemExit(f"guard: {other!r} is neither a folder nor a commit of this repository")
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git("worktree", "add", "--detach", str(tree), commit)
        try:
            yield tree, commit
        finally:
            git("worktree", "remove", "--force", str(tree))


def history() -> list[dict[str, str]]:
    """Rows measured so far, the oldest first."""
    return list(csv.DictReader(HISTORY.open())) if HISTORY.exists() else []


def usual() -> str:
    """What to compare with where nothing is said."""
    tag = git("describe", "--tags", "--abbrev=0", "HEAD~1")
    rows = history()
    if not tag and not rows:
        raise SystemExit("guard: there is no tag and no history; name a commit to compare with")
    return tag or rows[-1]["against"]


def measured(tree: Path, rows: dict[str, tuple[str, dict]], sets: int, rounds: int) -> dict[str, list[float]]:
    """Least seconds of each flight in this tree and in the other; said as it goes."""
    best = {name: [float("inf"), float("inf")] for name in rows}
    for number in range(sets):
        versions = [Version(HERE), Version(tree)]
        for name, row in rows.items():
            for _ in range(rounds):
                for which, version in enumerate(versions):
                    best[name][which] = min(best[name][which], version.seconds(row))
            ours, theirs = best[name]
            print(
                f"set {number + 1}: {name}: {1e3 * ours:.3f} ms, {1e3 * theirs:.3f} ms, ratio {ours / theirs:.3f}",
                flush=True,
            )
        for version in versions:
            version.close()
    return best


def note(best: dict[str, list[float]], against: str) -> None:
    """Put figures behind the history."""
    day, commit = datetime.date.today().isoformat(), git("describe", "--always", "--dirty")
    rows = [
        (day, commit, against, name, f"{1e3 * ours:.3f}", f"{1e3 * theirs:.3f}", f"{ours / theirs:.3f}")
        for name, (ours, theirs) in best.items()
    ]
    begun = HISTORY.exists()
    with HISTORY.open("a", newline="") as file:
        csv.writer(file).writerows(rows if begun else [COLUMNS, *rows])


def told() -> list[tuple[str, str]]:
    """Measurements of the history, as (commit, against), in their order."""
    return list(dict.fromkeys((row["commit"], row["against"]) for row in history()))


def table() -> None:
    """Print the history: a line for each flight, a column for each measurement."""
    ratios = {(row["flight"], row["commit"], row["against"]): row["ratio"] for row in history()}
    print(f"{'flight':<30}" + "".join(f"{commit[:16]:>18}" for commit, _ in told()))
    print(f"{'against':<30}" + "".join(f"{against[:16]:>18}" for _, against in told()))
    for name in dict.fromkeys(row["flight"] for row in history()):
        print(f"{name:<30}" + "".join(f"{ratios.get((name, *each), ''):>18}" for each in told()))


def plot(file: Path) -> None:
    """Draw the history: ratios of each flight over the measurements."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    places = {each: place for place, each in enumerate(told())}
    for name in dict.fromkeys(row["flight"] for row in history()):
        own = [row for row in history() if row["flight"] == name]
        across = [places[row["commit"], row["against"]] for row in own]
        axes.plot(across, [float(row["ratio"]) for row in own], marker="o", label=name)
    axes.axhline(BOUND, color="0.6", linestyle="--")
    axes.set_xticks(list(places.values()), [f"{commit}\nagainst {against}" for commit, against in places])
    axes.set_ylabel("time over that of the earlier version")
    axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(file)


def main() -> int:
    """Measure, print, and keep what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", nargs="?", help="commit, tag or checkout of the version to compare with")
    parser.add_argument("--rounds", type=int, default=40, help="flights of each version in a set")
    parser.add_argument("--sets", type=int, default=5, help="pairs of new processes")
    parser.add_argument("--only", nargs="*", default=list(ROWS), help="flights by the beginning of their names")
    parser.add_argument("--json", type=Path, help="file for the ratios")
    parser.add_argument("--note", action="store_true", help=f"put the figures behind {HISTORY.name}")
    parser.add_argument("--table", action="store_true", help="print the history and measure nothing")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw the history into FILE (.png, .svg, .pdf)")
    asked = parser.parse_args()
    if not asked.table and not (asked.plot and asked.other is None):
        rows = {name: row for name, row in ROWS.items() if any(name.startswith(word) for word in asked.only)}
        if not rows:
            parser.error(f"--only {' '.join(asked.only)}: no such flight; known: {', '.join(ROWS)}")
        with checkout(asked.other or usual()) as (tree, commit):
            best = measured(tree, rows, asked.sets, asked.rounds)
        ratios = {name: ours / theirs for name, (ours, theirs) in best.items()}
        print("\n".join(f"{name:<32}{ratio:6.3f}" for name, ratio in ratios.items()))
        if asked.json:
            asked.json.write_text(json.dumps(ratios, indent=2) + "\n")
        if asked.note:
            note(best, commit)
    else:
        ratios = {}
    if asked.table:
        table()
    if asked.plot:
        plot(asked.plot)
    slower = [name for name, ratio in ratios.items() if ratio > BOUND]
    if ratios:
        print(f"{len(slower)} of {len(ratios)} flights slower than {BOUND}" + "".join(f"; {name}" for name in slower))
    return 1 if slower else 0


if __name__ == "__main__":
    child() if "--child" in sys.argv else sys.exit(main())
