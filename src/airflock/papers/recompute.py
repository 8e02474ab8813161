"""The public door to the papers: recompute one by its name."""

from difflib import get_close_matches
from importlib import import_module

from airflock.errors import AirflockError
from airflock.papers import PAPERS
from airflock.papers.claims import Claim


def paper(
    name: str,
    *,
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
) -> list[Claim]:
    """Recompute a paper's numbers and compare them with what it prints.

    Parameters
    ----------
    name : str
        A publication, for instance "vasarhelyi_2018".
    only : str, optional
        One part only, for instance "s2".
    quick : bool
        A coarse form with few seeds.
    seeds : int, optional
        Flights per number; by default the paper's.
    threads : int, optional
        Flights side by side; by default one per core.

    Returns
    -------
    list of Claim
        Each with the printed number, ours, and the verdict.

    Raises
    ------
    AirflockError
        If there is no such paper or part; names the nearest one.

    Examples
    --------
    >>> import airflock
    >>> airflock.paper("vasarhely_2018")
    Traceback (most recent call last):
    airflock.errors.AirflockError: vasarhely_2018: no such paper; did you mean vasarhelyi_2018?
    """
    claims: list[Claim] = import_module(f"airflock.papers.{known(name)}").PAPER.run(
        only=only, quick=quick, seeds=seeds, threads=threads
    )
    return claims


def known(name: str) -> str:
    """The name of a paper, if there is one; raises AirflockError with the nearest one."""
    if name not in PAPERS:
        near = get_close_matches(name, PAPERS, n=1)
        raise AirflockError(
            f"{name}: unknown paper; {f'did you mean {near[0]}?' if near else 'known: ' + ', '.join(PAPERS)}"
        )
    return name
