"""A publication by its name."""

from difflib import get_close_matches
from importlib import import_module

from airflock.errors import AirflockError
from airflock_papers import PAPERS
from airflock_papers.paper import Paper


def find(name: str) -> Paper:
    """The publication of this name; raises AirflockError with the nearest name if there is none."""
    if name not in PAPERS:
        near = get_close_matches(name, PAPERS, n=1)
        raise AirflockError(
            f"{name}: unknown paper; {f'did you mean {near[0]}?' if near else 'known: ' + ', '.join(PAPERS)}"
        )
    found: Paper = import_module(f"airflock_papers.{name}").PAPER
    return found
