"""Time to compile: this source tree against an earlier one, by ratios of the least processor times of new processes.

    python benchmarks/compile_time.py                    against 4870486, what is asked of compile times
    python benchmarks/compile_time.py TREE --rounds 3    against a commit, a tag or a checkout

A time is that of one process on one thread with an empty cache, from a plan to the end of a flight of 1 s: text, types,
LLVM, machine code, and the flight itself. Numba is imported before. The trees take turns.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from guard import checkout

HERE = Path(__file__).resolve().parents[1]
AGAINST = "4870486"
PRESETS = ("vasarhelyi_2018/4ms", "kidger/city", "zapotecatl_2016/best", "dimock_2003/published")
BOUND = 0.5  # of every ratio, asked


def child(preset: str) -> None:
    """Compile and fly a preset in this process; prints seconds and a hash of what was flown."""
    import hashlib

    import numba  # noqa: F401
    import numpy as np

    from airflock.engine.cpu import fly_on_cpu
    from airflock.engine.plan import plan_of
    from airflock.engine.tables import world_tables
    from airflock.scenarios.files import load

    scenario = load(preset, {"duration": 1.0})
    plan = plan_of(scenario)
    given = world_tables(scenario, plan, 1)
    begun = time.process_time()
    found = fly_on_cpu(plan, given)
    seconds = time.process_time() - begun
    print(json.dumps((seconds, hashlib.sha256(np.ascontiguousarray(found.state).tobytes()).hexdigest()[:12])))


def once(tree: Path, preset: str) -> tuple[float, str]:
    """Seconds of one compilation in a tree, and a hash of the states at the end of its flight."""
    with tempfile.TemporaryDirectory() as cache:
        path = os.pathsep.join([str(tree / "src"), *filter(None, [os.environ.get("PYTHONPATH")])])
        paths = os.environ | {"PYTHONPATH": path, "AIRFLOCK_CACHE": cache, "XDG_CACHE_HOME": cache}
        threads = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        command = [sys.executable, str(Path(__file__).resolve()), "--child", preset]
        said = subprocess.run(
            command, env=paths | threads, cwd=tree, text=True, stdout=subprocess.PIPE, check=True
        ).stdout
    seconds, flown = json.loads(said.splitlines()[-1])
    return seconds, flown


def main() -> int:
    """Measure, and print a row for each preset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("other", nargs="?", default=AGAINST, help="commit, tag or checkout to compare with")
    parser.add_argument("--rounds", type=int, default=3, help="processes of each tree")
    parser.add_argument("--only", nargs="*", default=PRESETS, help="presets")
    asked = parser.parse_args()
    missed = 0
    with checkout(asked.other) as (tree, commit):
        for preset in asked.only:
            best, flown = [float("inf")] * 2, ["", ""]
            for _ in range(asked.rounds):
                for which, where in enumerate((HERE, tree)):
                    seconds, flown[which] = once(where, preset)
                    best[which] = min(best[which], seconds)
            ratio = best[0] / best[1]
            missed += ratio > BOUND
            same = "same" if flown[0] == flown[1] else "other"
            print(f"{preset:24s} {best[0]:7.2f} s {commit} {best[1]:7.2f} s ratio {ratio:.3f} {same} bits", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    child(sys.argv[2]) if "--child" in sys.argv[:2] else sys.exit(main())
