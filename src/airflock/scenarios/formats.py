"""Formats of the files that last: each file carries a number, and an older file is read with its old meaning.

A scenario or study without the key `format` is of format 1, as version 0.1 wrote them. A change
that would give an older file another meaning raises the number and adds a step to MIGRATIONS; a
newer file is refused in one line.
"""

from collections.abc import Callable, Mapping
from typing import Any

from airflock.support import ScenarioError

KEY = "format"
FORMAT = 1  # of scenarios and studies
MIGRATIONS: tuple[Callable[[Mapping[str, Any]], Mapping[str, Any]], ...] = ()  # step i reads format i + 1 as i + 2


def to_current_format(document: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """Convert a document of any known format to the current one, without its key `format`."""
    number = document.get(KEY, 1)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise ScenarioError(
            [f"{where}: {KEY} = {number!r} is not a number of a format; leave it out, or give {FORMAT}"]
        )
    if number > FORMAT:
        raise ScenarioError([f"{where}: {KEY} = {number} is newer than this Airflock, which reads up to {FORMAT}"])
    for step in MIGRATIONS[number - 1 :]:
        document = step(document)
    return {key: value for key, value in document.items() if key != KEY}


def numbered(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document of the current format with its number, so that no step reads it once more."""
    # Format 1 goes without: recordings, certificates and studies hold scenarios as version 0.1 wrote them.
    return {**document, KEY: FORMAT} if FORMAT > 1 else dict(document)
