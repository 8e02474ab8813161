"""Spelling: which of the known words was meant by one that is not known."""

from collections.abc import Iterable
from difflib import get_close_matches


def meant(word: object, known: Iterable[str], otherwise: str = "", *, lead: str = "", cutoff: float = 0.5) -> str:
    """A question for the nearest of the known words; where none is near, what is said otherwise.

    lead   : stands before the question
    cutoff : how alike two words must be, from 0 to 1, as in `difflib`

    >>> meant("vasarhely", ["viragh", "vasarhelyi"])
    'did you mean vasarhelyi?'
    >>> meant("xyz", ["viragh", "vasarhelyi"], "known: viragh, vasarhelyi")
    'known: viragh, vasarhelyi'
    """
    near = get_close_matches(str(word), list(known), n=1, cutoff=cutoff)
    return f"{lead}did you mean {near[0]}?" if near else otherwise
