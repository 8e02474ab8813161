"""A part of a paper flown whole again: its verdicts must be those of the committed pages.

In a clone, `python -m airflock_papers.again NAME PART` prints each claim whose verdict is another, and ends with status
1 if there is one. `airflock paper all --quick` asks the same of the small form of every part.
"""

import argparse
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from airflock.errors import AirflockError
from airflock_papers.campaign import Key, verdicts
from airflock_papers.catalogue import find
from airflock_papers.claims import Claim


def changed(name: str, before: Mapping[Key, str], flown: Iterable[Claim]) -> list[str]:
    """A line for each claim of a paper that was flown whose verdict is not that of its page (`campaign.verdicts`)."""
    found = [(claim, before.get((name, claim.id), "on no page")) for claim in flown]
    return [f"{claim.id}: {was} is now {claim.verdict}" for claim, was in found if was != claim.verdict]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Fly a part of a paper whole, and compare its verdicts with its page.")
    parser.add_argument("name", help="of the paper, for instance vasarhelyi_2018")
    parser.add_argument("part", help="for instance rounding")
    asked = parser.parse_args()
    try:
        paper, before = find(asked.name), verdicts(Path("papers"))
        if not before:
            raise AirflockError("papers: holds no pages with verdicts; call this in a clone of Airflock")
        claims = paper.run(only=asked.part)
    except AirflockError as fault:
        parser.error(str(fault))
    lines = changed(asked.name, before, claims)
    for line in lines:
        print(line)
    print(f"{len(claims)} claims flown whole, {len(lines)} of another verdict than their page")
    sys.exit(1 if lines else 0)
