"""Evolve Table S1 of Vásárhelyi et al. 2018 and rewrite evolved.toml and EVOLVED.md here, and the presets evolved_*.

Takes hours on two cores; ended and run again it goes on where it was. `python evolve.py 4 6 6` flies one run at 4 m/s
and two at 6 m/s.
"""

import sys
from collections import Counter
from pathlib import Path

from airflock_papers.claims import print_claims
from airflock_papers.vasarhelyi_2018.evolved import reproduce
from airflock_papers.vasarhelyi_2018.table_s1 import RUNS

if __name__ == "__main__":
    here = Path(__file__).parent
    runs = Counter(int(v) for v in sys.argv[1:]) or RUNS
    print_claims(reproduce(here, runs, presets=here.parents[1] / "src" / "airflock" / "presets" / here.name))
