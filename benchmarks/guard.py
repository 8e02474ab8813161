"""Guard: this source tree against another one, by ratios of the least times of interleaved runs.

    python benchmarks/guard.py OTHER_TREE [--rounds 400] [--only NAME ...] [--json FILE]

OTHER_TREE is a checkout of another version (git worktree add OTHER_TREE TAG). Each version flies in a process of its
own, on one thread; they take turns, flight by flight, so that whatever else the machine does meets both. Each set is a
pair of new processes: where arrays lie in memory decides a few percent. A ratio above 1 says that this tree is slower.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]

# name: preset, settings; what both versions fly from start to end
ROWS = {
    "4ms, 100 drones": ("vasarhelyi_2018/4ms", {"duration": 4.0}),
    "4ms, 30 drones": ("vasarhelyi_2018/4ms", {"agents": 30, "duration": 8.0}),
    "two lossy links, 30 drones": ("vasarhelyi_2018/real_gnss", {"agents": 30, "duration": 4.0}),
    "obstacles": ("vasarhelyi_2018/obstacles", {"duration": 4.0}),
    "50 boids in turn": ("zapotecatl_2016/best", {"duration": 2.0}),
    "2,000 boids by cells": ("zapotecatl_2016/best", {"agents": 2000, "update": "synchronous", "duration": 0.5}),
    "kidger, city": ("kidger/city", {"duration": 2.0}),
    "couzin, torus": ("couzin_2002/torus", {"duration": 10.0}),
    "vicsek": ("vicsek_1995/ordered", {"duration": 20.0}),
    "lifting lines": ("dimock_2003/published", {"duration": 10.0}),
}


def child() -> None:
    """Fly what standard input names, and answer with seconds; one line each."""
    from airflock.engine.cpu import fly
    from airflock.engine.simulate import plan_of
    from airflock.engine.tables import tables
    from airflock.scenarios.files import load, presets

    ready = {}
    for line in sys.stdin:
        preset, settings = json.loads(line)
        key = line
        if key not in ready:
            if preset not in presets():
                print("nan", flush=True)
                continue
            scenario = load(preset, settings)
            plan = plan_of(scenario)
            ready[key] = plan, tables(scenario, plan, 1)
            fly(*ready[key])  # compiled, and loaded into the caches
        begun = time.perf_counter()
        fly(*ready[key])
        print(time.perf_counter() - begun, flush=True)


class Version:
    """One source tree, flying in a process of its own."""

    def __init__(self, tree: Path):
        """Start the process."""
        paths = os.environ | {"PYTHONPATH": str(tree / "src"), "NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        command = [sys.executable, str(Path(__file__).resolve()), "--child"]
        self.process = subprocess.Popen(
            command, env=paths, cwd=tree, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def seconds(self, row: tuple[str, dict]) -> float:
        """Time of one flight, s."""
        self.process.stdin.write(json.dumps(row) + "\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        self.process.stdin.close()
        self.process.wait()


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", type=Path, help="checkout of the version to compare with")
    parser.add_argument("--rounds", type=int, default=100, help="flights of each version in a set of memory")
    parser.add_argument("--sets", type=int, default=5, help="sets of memory, each a pair of new processes")
    parser.add_argument("--only", nargs="*", default=list(ROWS), help="rows by the beginning of their names")
    parser.add_argument("--json", type=Path, help="file for the figures")
    asked = parser.parse_args()
    rows = {name: row for name, row in ROWS.items() if any(name.startswith(word) for word in asked.only)}
    best = {name: [float("inf"), float("inf")] for name in rows}
    for number in range(asked.sets):
        versions = [Version(HERE), Version(asked.other.resolve())]
        for name, row in rows.items():
            for _ in range(asked.rounds):
                for which, version in enumerate(versions):
                    best[name][which] = min(best[name][which], version.seconds(row))
            ours, theirs = best[name]
            print(
                f"set {number + 1}: {name}: {1e3 * ours:.3f} ms, {1e3 * theirs:.3f} ms, ratio {ours / theirs:.3f}",
                flush=True,
            )
        for version in versions:
            version.close()
    print("\n".join(f"{name:<32}{ours / theirs:6.3f}" for name, (ours, theirs) in best.items()))
    if asked.json:
        asked.json.write_text(
            json.dumps({name: ours / theirs for name, (ours, theirs) in best.items()}, indent=2) + "\n"
        )


if __name__ == "__main__":
    child() if "--child" in sys.argv else main()
