"""Modules of the compiler, kept out of the garbage collector's way for as long as the process runs.

Numba brings 130,000 objects, with the code of a first driver. A full collection looks at each of
them, which takes a tenth of a second and halts every thread: a flight beside a compiler, a live
page, a node. Python has a place for what is never to be looked at again. A program with many
objects of its own waits for these anyway, and may drop some later: there all stay where they are.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

FEW = 100_000  # objects of a program, fewer than Numba brings: with the text of a first driver this package has 70,000


@contextmanager
def frozen_imports() -> Iterator[None]:
    """Around imports: what they bring stays for good where there was little before, and nobody looks for garbage.

    What is garbage already goes first. To be entered by one thread at a time.
    """
    collecting = gc.isenabled()
    gc.collect()
    few = len(gc.get_objects()) < FEW
    gc.disable()
    try:
        yield
    finally:
        if few:
            # A full collection looked at 156,000 objects, 103,000 of them Numba's: 86 to 91 ms.
            # Frozen, it takes 5 to 9 ms.
            gc.freeze()
        if collecting:
            gc.enable()
