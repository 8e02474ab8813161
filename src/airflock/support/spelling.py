"""Spelling: which of the known words was meant by one that is not known."""

import re
import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches


def suggest(
    word: object, known: Iterable[str], fallback: str = "", *, lead: str = "", prefix: str = "", cutoff: float = 0.5
) -> str:
    """A question for the nearest of the known words; where none is near, what is said otherwise.

    lead   : stands before the question; prefix : before the word in it, such as "space."
    cutoff : how alike two words must be, from 0 to 1, as in `difflib`

    >>> meant("vasarhely", ["viragh", "vasarhelyi"])
    'did you mean vasarhelyi?'
    >>> meant("xyz", ["viragh", "vasarhelyi"], "known: viragh, vasarhelyi")
    'known: viragh, vasarhelyi'
    """
    near = get_close_matches(str(word), list(known), n=1, cutoff=cutoff)
    return f"{lead}did you mean {prefix}{near[0]}?" if near else fallback


def describe_error(error: BaseException) -> str:
    """What was raised, in one line, with the attribute that was meant where another one was asked for.

    >>> import math
    >>> try:
    ...     math.sqr(4.0)
    ... except AttributeError as fault:
    ...     raised(fault)
    "AttributeError: module 'math' has no attribute 'sqr'; did you mean sqrt?"
    """
    line = " ".join(f"{type(error).__name__}: {error}".removesuffix(": ").split())
    if isinstance(error, AttributeError) and error.name is not None:
        line += suggest(error.name, (name for name in dir(error.obj) if not name.startswith("_")), lead="; ")
    return line


def to_identifier(text: str) -> str:
    """A text as a name in a program: whatever no name may hold becomes _.

    >>> as_name("my-law 2"), as_name("3law"), as_name("couzin_2002")
    ('my_law_2', '_3law', 'couzin_2002')
    """
    name = re.sub(r"\W", "_", unicodedata.normalize("NFKC", text))
    return name if name.isidentifier() else f"_{name}"
