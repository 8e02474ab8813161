"""airflock.paper and its verb: recompute papers, which are a distribution of their own: airflock-papers."""

from collections import Counter
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import typer

from airflock import support
from airflock.cli import terminal
from airflock.cli.command import verb
from airflock.support import AirflockError

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
def paper_verb(o: SimpleNamespace) -> None:
    """Recompute a paper's numbers and figures; print each claim with its verdict.

    Needs airflock-papers; in a clone of the repository: pip install -e ./papers

    `all --quick` flies the small form of every paper, and fails if a verdict differs from the one committed for this
    kind of processor. `all --breaks` makes the change of every claim, and fails if a claim still holds under its
    change, or does not hold without it, unless it was seen to turn red on another kind of processor.

    Example: airflock paper vasarhelyi_2018 --quick --only s2
    """
    if o.name == "all":
        return _all(o.quick, o.breaks, o.keep, o.threads, o.json, {"--only": o.only, "--seeds": o.seeds})
    if o.breaks:
        return _breaks(o.name, o.only, o.seeds, o.threads, o.json)

    claims = paper(o.name, only=o.only, quick=o.quick, seeds=o.seeds, threads=o.threads)
    if o.json:
        return terminal.print_json([claim.as_dict() for claim in claims])
    from airflock_papers.claims import print_claims

    return print_claims(claims)


def _all(
    quick: bool, breaks: bool, keep: Path | None, threads: int | None, as_json: bool, others: dict[str, object]
) -> None:
    """Recompute every paper: in its small form, or every claim under its change, against the committed verdicts."""
    require_papers()
    from airflock_papers import quick as tier

    wrong = [option for option, given in others.items() if given]
    if wrong or quick == breaks:
        message = "takes days; add --quick or --breaks, or name one paper"
        message = "give --quick or --breaks, not both" if quick else message
        raise AirflockError(f"all: {', '.join(wrong)} is of one paper; name it" if wrong else f"all: {message}")
    if breaks:
        _all_breaks(keep or support.cache_folder() / "papers" / "breaks", threads, as_json)
        return
    before = tier.committed()
    rows = tier.fly(keep or support.cache_folder() / "papers" / "quick", terminal.print_message, threads)
    changed = tier.changed(before, rows)
    if as_json:
        terminal.print_json({"claims": [row._asdict() for row in rows], "changed": [row._asdict() for row in changed]})
    else:
        for row in changed:
            message = f"{row.committed or 'not committed'} is now {row.found or 'not flown'}"
            why = f" (not judged: committed as flown on {row.elsewhere})" if row.elsewhere else ""
            typer.echo(f"{row.paper} {row.id}: {message}{why}")
        typer.echo(f"{len(rows)} claims in their small form, {len(changed)} of another verdict than the committed one")
        if any(row.elsewhere for row in changed):
            typer.echo("On another kind of processor the same seeds give other flights; a few verdicts may differ.")
    if not all(row.elsewhere for row in changed):
        raise typer.Exit(1)


def _all_breaks(folder: Path, threads: int | None, as_json: bool) -> None:
    """Check every claim of every paper under its change, against the committed verdicts."""
    from airflock_papers import breaks

    before = breaks.committed()
    rows = breaks.fly_all(folder, terminal.print_message, threads)
    worse = breaks.worse(before, rows)
    if as_json:
        listed = [each.row._asdict() | {"elsewhere": each.elsewhere} for each in worse]
        terminal.print_json({"claims": [row._asdict() for row in rows], "worse": listed})
    else:
        for row, elsewhere in worse:
            why = f" (not judged: turned red on {elsewhere})" if elsewhere else ""
            typer.echo(f"{row.paper} {row.id}: {row.result} with {row.change} ({row.ours}, then {row.changed}){why}")
        message = ", ".join(f"{number} {result}" for result, number in Counter(row.result for row in rows).items())
        typer.echo(f"{len(rows)} claims under their changes: {message}")
    if not all(each.elsewhere for each in worse):
        raise typer.Exit(1)


def _breaks(name: str, only: str | None, seeds: int | None, threads: int | None, as_json: bool) -> None:
    """Check each claim under the change that must break it."""
    publication = find_paper(name)
    from airflock_papers import breaks

    rows = breaks.fly(publication, only=only, seeds=seeds, threads=threads)
    if as_json:
        terminal.print_json([row._asdict() for row in rows])
    else:
        for row in rows:
            typer.echo(f"{row.id}: {row.result} with {row.change} ({row.ours:.4g}, then {row.changed:.4g})")
        count = {result: sum(row.result == result for row in rows) for result in breaks.RESULTS}
        typer.echo(", ".join(f"{number} {result}" for result, number in count.items()))
    if any(row.result == breaks.GREEN for row in rows):
        raise typer.Exit(1)
