"""Seeds: which numbers can be one. A seed is the key of the random numbers, two words of 32 bits."""

import operator
from collections.abc import Iterable
from typing import Any

from airflock.support import ParameterError

LARGEST = 2**64 - 1
MOST = 10_000_000  # flights at a time


def check_seed(seed: Any) -> int:
    """A seed as a plain integer; any other number would fly as if it were another seed."""
    try:
        found = operator.index(seed)
    except TypeError:
        raise ParameterError(f"seed = {seed!r} is not a whole number in [0, 2^64 - 1]") from None
    if not 0 <= found <= LARGEST:
        raise ParameterError(f"seed = {found} lies outside [0, 2^64 - 1]")
    return found


def check_seeds(seeds: int | Iterable[int]) -> list[int]:
    """Seeds of several flights: so many of them from 0 on, or those that are given."""
    if isinstance(seeds, Iterable):
        found = [check_seed(seed) for seed in seeds]
    else:
        try:
            count = operator.index(seeds)
            if count > MOST:
                raise ParameterError(f"seeds = {count}: more than {MOST} flights at a time")
            found = list(range(count))
        except TypeError:
            raise ParameterError(f"seeds = {seeds!r} is neither a whole number nor a list of seeds") from None
    if not found:
        raise ParameterError(f"seeds = {seeds!r}: no flight would be flown; give at least 1")
    return found
