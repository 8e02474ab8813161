"""A part of a paper flown whole again: its verdicts must be those of the committed pages.

In a clone, `python -m airflock_papers.again NAME PART` prints each claim whose verdict is another, and ends with status
1 if there is one. `airflock paper all --quick` asks the same of the small form of every part.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

from airflock.errors import AirflockError
from airflock_papers.catalogue import find
from airflock_papers.claims import Claim, read_claims


def pages(folder: Path) -> list[Claim]:
    """Claims of all pages of a paper; folder: papers/NAME.

    Raises AirflockError if there are none.
    """
    found = [claim for path in sorted(folder.glob("*.toml")) for claim in read_claims(path)[1]]
    if not found:
        raise AirflockError(f"{folder}: no page of a paper; run this in a clone")
    return found


def changed(before: Iterable[Claim], flown: Iterable[Claim]) -> list[str]:
    """A line for each claim that was flown whose verdict is not that of its page."""
    verdicts = {claim.id: claim.verdict for claim in before}
    return [
        f"{claim.id}: {verdicts.get(claim.id, 'on no page')} is now {claim.verdict}"
        for claim in flown
        if verdicts.get(claim.id) != claim.verdict
    ]


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python -m airflock_papers.again NAME PART, in a clone")
    try:
        before = pages(Path("papers") / sys.argv[1])  # told before anything flies
        claims = find(sys.argv[1]).run(only=sys.argv[2])
    except AirflockError as error:
        sys.exit(str(error))
    lines = changed(before, claims)
    for line in lines:
        print(line)
    print(f"{len(claims)} claims flown whole, {len(lines)} of another verdict than their page")
    sys.exit(1 if lines else 0)
