"""Counts: how many claims on how many quotes of a paper hold. One quote flown at three speeds is three claims."""

from collections.abc import Sequence
from typing import NamedTuple

from airflock_papers.statements import Statement

COUNTED = ("reproduced", "not reproduced", "qualitative only", "not testable", "not flown yet")


class Counts(NamedTuple):
    """Claims of a paper by verdict, and its quotes.

    quotes : different ones; judged : those of which a claim is judged by a bound
    whole  : those judged of which no claim is not reproduced
    """

    verdicts: dict[str, int]
    quotes: int
    judged: int
    whole: int


def count(claims: Sequence[Statement]) -> Counts:
    """Counts of the claims that are the paper's own."""
    paper = [claim for claim in claims if claim.kind == "paper"]
    verdicts = {verdict: sum(claim.verdict == verdict for claim in paper) for verdict in COUNTED}
    good, bad = ({claim.quote for claim in paper if claim.verdict == verdict} for verdict in COUNTED[:2])
    return Counts(verdicts, len({claim.quote for claim in paper}), len(good | bad), len(good - bad))


def headline(claims: Sequence[Statement]) -> str:
    """Counts in words; empty if no claim is the paper's own."""
    found = count(claims)
    told = ", ".join(f"{n} {verdict}" for verdict, n in found.verdicts.items() if n)
    line = f"{sum(found.verdicts.values())} claims on {found.quotes} quotes of the paper: {told}"
    if found.judged:
        line += f"; of {found.judged} judged quotes {found.whole} in all their claims"
    return line if told else ""
