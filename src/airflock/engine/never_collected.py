"""What stays as long as the process does: modules of the compiler, kept out of the garbage collector's way.

Numba brings 150,000 objects. A full collection looks at each of them, which takes a tenth of a second and halts every
thread: a flight beside a compiler, a live page, a node. Python has a place for what is never to be looked at again.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def never_collected() -> Iterator[None]:
    """Around imports: what they bring stays for good, and nobody looks for garbage meanwhile.

    What is garbage already goes first. To be entered by one thread at a time.
    """
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collecting:
            gc.enable()
