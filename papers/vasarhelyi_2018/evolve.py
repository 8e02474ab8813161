"""Evolve Table S1 of Vásárhelyi et al. 2018 and rewrite evolved.toml and EVOLVED.md in this folder.

Takes hours on two cores; ended and run again it goes on where it was. `python evolve.py 1` flies one run a speed.
"""

import sys
from pathlib import Path

from airflock.papers.claims import print_claims
from airflock.papers.vasarhelyi_2018.evolved import reproduce
from airflock.papers.vasarhelyi_2018.table_s1 import RUNS

if __name__ == "__main__":
    most = int(sys.argv[1]) if len(sys.argv) > 1 else max(RUNS.values())
    print_claims(reproduce(Path(__file__).parent, {v: min(n, most) for v, n in RUNS.items()}))
