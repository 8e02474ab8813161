"""The door to the papers, which are a distribution of their own: airflock-papers."""

from importlib import import_module
from typing import Any

from airflock.support import AirflockError

PACKAGE = "airflock_papers"  # looked for when it is asked for: Airflock flies without it


def paper(
    name: str,
    *,
    only: str | None = None,
    quick: bool = False,
    seeds: int | None = None,
    threads: int | None = None,
) -> list[Any]:
    """Recompute a paper's numbers and compare them with what it prints.

    Needs airflock-papers: in a clone of the repository, `pip install -e ./papers`.

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
    list of airflock_papers.claims.Claim
        Each with the printed number, ours, and the verdict.

    Raises
    ------
    AirflockError
        If airflock-papers is not installed, or there is no such paper or part; names the nearest paper.

    Examples
    --------
    >>> import airflock
    >>> airflock.paper("vasarhely_2018")
    Traceback (most recent call last):
    airflock.support.errors.AirflockError: vasarhely_2018: unknown paper; did you mean vasarhelyi_2018?
    """
    found: list[Any] = find_paper(name).run(only=only, quick=quick, seeds=seeds, threads=threads)
    return found


def find_paper(name: str) -> Any:
    """The publication of this name.

    Raises AirflockError if airflock-papers is not installed, or there is no such paper.
    """
    require_papers()
    return import_module(f"{PACKAGE}.catalogue").find(name)


def require_papers() -> None:
    """Raise AirflockError, with what to install, unless airflock-papers is there."""
    try:
        import_module(PACKAGE)
    except ModuleNotFoundError as fault:
        raise AirflockError("papers need airflock-papers: pip install -e ./papers in a clone of Airflock") from fault
