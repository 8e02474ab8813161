"""Numba's passes as they begin, to hear Ctrl-C; and the message to a user who waits for the compiler."""

import multiprocessing
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener

from airflock.support import check_interrupted

COMPILING = "compiling … (only once for this kind of flight; later flights start at once)"
PATIENCE = 1.0  # s


class InterruptListener(Listener):  # type: ignore[misc]  # Numba has no types
    """Each thread that compiles hears of its own passes."""

    def on_start(self, event: Event) -> None:
        """Give up the work of this thread if it was interrupted. Raises GivenUp."""
        check_interrupted()

    def on_end(self, event: Event) -> None:
        """Do nothing at the end of a pass; the next one checks."""


@contextmanager
def message_if_slow() -> Iterator[None]:
    """Say once that something is compiled, if it takes longer than PATIENCE, to a person who waits for it."""
    if not _watched():
        yield
        return
    timer = threading.Timer(PATIENCE, _say)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _watched() -> bool:
    """True if a person sees what this thread says: at a terminal or in a notebook, and not of one of many workers."""
    main = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    return main and ("ipykernel" in sys.modules or sys.stderr.isatty())


def _say() -> None:
    sys.stderr.write(f"{COMPILING}\n")
    sys.stderr.flush()
