"""Search inside the digits of Table S1 and write ROUNDING.md; goes on where it was stopped.

python papers/vasarhelyi_2018/rounding.py [SPEED ...]
"""

import sys
from pathlib import Path

from airflock_papers.claims import print_claims
from airflock_papers.vasarhelyi_2018.published import SPEEDS
from airflock_papers.vasarhelyi_2018.rounding_claims import reproduce

if __name__ == "__main__":
    print_claims(reproduce(Path(__file__).parent, speeds=[int(v) for v in sys.argv[1:]] or SPEEDS))
