"""Processor time of `airflock infer` on many individuals: fish of Couzin et al., four laws, 20 flights of the best.

python benchmarks/infer_large.py [--agents 100] [--seconds 1000] [--seed 21]

The tracks are `couzin 1` of tests/nightly/infer.py with more individuals, which start within 10 m, for longer: by
default 100 of them in 10,001 frames. Asked: at most 600 s of processor.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "nightly"))

import infer as nightly


def main():
    """One case; a line of JSON."""
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--agents", type=int, default=100)
    ask.add_argument("--seconds", type=float, default=1000.0)
    ask.add_argument("--seed", type=int, default=21)
    given = ask.parse_args()
    case = nightly.CASES["couzin 1"]
    case |= {"agents": given.agents, "duration": given.seconds, "start": case["start"] | {"radius": 10.0}}
    print(json.dumps(nightly.run("couzin 1", seed=given.seed)))


if __name__ == "__main__":
    main()
