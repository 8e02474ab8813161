"""Verb paper: recompute what a publication reports."""

from typing import Annotated

import typer

from airflock.cli import options, tables


def paper(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A publication, for instance vasarhelyi_2018.")],
    only: Annotated[
        str | None, typer.Option(help="One part only, for instance s2 or fig1.", show_default="all")
    ] = None,
    quick: Annotated[bool, typer.Option(help="A coarse form with few seeds.")] = False,
    seeds: Annotated[int | None, typer.Option(min=2, help="Flights per number.", show_default="the paper's")] = None,
    threads: options.Threads = None,
    as_json: options.Json = False,
) -> None:
    """Recompute a paper's numbers and figures; print each claim with its verdict.

    Example: airflock paper vasarhelyi_2018 --quick --only s2
    """
    from airflock.papers.recompute import paper as recompute

    claims = recompute(name, only=only, quick=quick, seeds=seeds, threads=threads)
    if as_json:
        tables.emit_json([claim.as_dict() for claim in claims])
        return
    from airflock.papers.claims import print_claims

    print_claims(claims)
