"""Evolve what the paper speaks of beyond Table S1, and commit the optima to beyond.csv in airflock_papers.

Takes an hour on two cores; ended and run again it goes on where it was. `python beyond.py fast` evolves one case.
"""

import sys

from airflock_papers.flights import Flights
from airflock_papers.progress import progress_bar
from airflock_papers.vasarhelyi_2018 import beyond

if __name__ == "__main__":
    with progress_bar() as bar:
        beyond.write(beyond.evolve(Flights(progress=bar), sys.argv[1:] or tuple(beyond.CASES)))
