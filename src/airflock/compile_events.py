"""Numba's passes as they begin, to hear Ctrl-C and to say what is waited for. Imported once something may compile."""

import time
from collections.abc import Callable

from numba.core.event import Event, Listener

from airflock.threads import heed


class Heeding(Listener):  # type: ignore[misc]  # Numba has no types
    """Each thread that compiles hears of its own passes."""

    def on_start(self, event: Event) -> None:
        """Give up the work of this thread if it was interrupted. Raises GivenUp."""
        heed()

    def on_end(self, event: Event) -> None:
        """Nothing; the next pass is asked."""


class Telling(Listener):  # type: ignore[misc]  # Numba has no types
    """Calls `tell` once, when compiling has taken longer than `patience`, s."""

    def __init__(self, tell: Callable[[], None], patience: float = 1.0):
        self.tell, self.patience = tell, patience
        self.begun: float | None = None
        self.told = False

    def on_start(self, event: Event) -> None:
        """Look at the clock as a pass begins."""
        self.begun = time.monotonic() if self.begun is None else self.begun
        if not self.told and time.monotonic() - self.begun >= self.patience:
            self.told = True
            self.tell()

    def on_end(self, event: Event) -> None:
        """Nothing; the next pass is asked."""
