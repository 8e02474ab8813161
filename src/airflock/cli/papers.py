"""airflock.paper and its verb: recompute papers, which are a distribution of their own: airflock-papers."""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

from airflock.cli import terminal
from airflock.cli.command import verb
from airflock.support import AirflockError, cache_folder

PACKAGE = "airflock_papers"  # imported when a paper is recomputed: Airflock flies without it


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
    name : str (NAME)
        A publication, for instance vasarhelyi_2018; for a command also all.
    only : str, optional
        Recompute only this part, for instance s2 or fig1; by default all.
    quick : bool
        Use the small form, with few seeds.
    seeds : int in [2, inf], optional
        Flights per number; by default the paper's.
    threads : int in [1, inf], optional
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
    """Return the publication of this name.

    Raises AirflockError if airflock-papers is not installed, or there is no such paper.
    """
    require_papers()
    return import_module(f"{PACKAGE}.catalogue").find(name)


def require_papers() -> None:
    """Raise AirflockError, with what to install, unless airflock-papers is there."""
    try:
        import_module(PACKAGE)
    except ModuleNotFoundError as error:
        raise AirflockError("papers need airflock-papers: pip install -e ./papers in a clone of Airflock") from error


@verb("Look something up", "airflock.paper", "breaks keep json", name="paper")
def paper_verb(o: SimpleNamespace) -> Any:
    """Recompute a paper's numbers and figures; print each claim with its verdict.

    Needs airflock-papers; in a clone of the repository: pip install -e ./papers

    `all --quick` flies the small form of every paper, and fails if a verdict differs from the one committed for this
    kind of processor. `all --breaks` makes the change of every claim, and fails if a claim still holds under its
    change, or does not hold without it, unless it was seen to turn red on another kind of processor.

    Example: airflock paper vasarhelyi_2018 --quick --only s2
    """
    if o.name == "all":
        return _all(o)
    publication = find_paper(o.name)
    if o.breaks:
        breaks = import_module(f"{PACKAGE}.breaks")
        return breaks.report(breaks.fly(publication, only=o.only, seeds=o.seeds, threads=o.threads))
    claims = publication.run(only=o.only, quick=o.quick, seeds=o.seeds, threads=o.threads)
    if o.json:
        return [claim.as_dict() for claim in claims]
    return import_module(f"{PACKAGE}.claims").print_claims(claims)


def _all(o: SimpleNamespace) -> Any:
    """Recompute every paper: in its small form, or every claim under its change, against the committed verdicts."""
    require_papers()
    wrong = [option for option, given in (("--only", o.only), ("--seeds", o.seeds)) if given]
    if wrong or o.quick == o.breaks:
        message = "takes days; add --quick or --breaks, or name one paper"
        message = "give --quick or --breaks, not both" if o.quick else message
        raise AirflockError(f"all: {', '.join(wrong)} is of one paper; name it" if wrong else f"all: {message}")
    stage = "breaks" if o.breaks else "quick"
    flying, folder = import_module(f"{PACKAGE}.{stage}"), o.keep or cache_folder() / "papers" / stage
    return flying.report_all(folder, terminal.print_message, o.threads)
