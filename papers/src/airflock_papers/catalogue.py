"""A publication by its name."""

from importlib import import_module

from airflock.support import AirflockError, suggest
from airflock_papers import PAPERS
from airflock_papers.paper import Paper


def find(name: str) -> Paper:
    """The publication of this name; raises AirflockError with the nearest name if there is none."""
    if name not in PAPERS:
        raise AirflockError(
            f"{name}: unknown paper; {suggest(name, PAPERS, 'known: ' + ', '.join(PAPERS), cutoff=0.6)}"
        )
    found: Paper = import_module(f"airflock_papers.{name}").PAPER
    return found
