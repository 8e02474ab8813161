"""Threads of one large flight: how long they wait awake for the next loop.

GNU's OpenMP lets a thread that has nothing to do look for work 300,000 times before it sleeps. A motion step of a large
flock has several loops over threads. Where another process needs one of the processors, each of them waits until the
system takes a processor away from a thread that only waits, and a flight takes up to 100 times as long.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

# 4,000 boids beside one busy process take 404 ms at the library's 300,000, 55 ms at 30,000, and 6
# ms if threads sleep at once, which costs up to three times as much alone.
LOOKS = "30000"  # as fast as 300,000 where nobody else needs a processor, and 4 to 7 times as fast where somebody does
NAME = "GOMP_SPINCOUNT"
CHOSEN = NAME, "OMP_WAIT_POLICY"


@contextmanager
def short_spin() -> Iterator[None]:
    """Around what loads the library of threads, which reads its environment once; what a user has chosen stands."""
    if any(name in os.environ for name in CHOSEN):
        yield
        return
    os.environ[NAME] = LOOKS
    try:
        yield
    finally:
        os.environ.pop(NAME, None)
