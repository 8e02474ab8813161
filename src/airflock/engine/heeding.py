"""Ctrl-C while Numba compiles: heard as each of its passes begins. Imported once something compiles."""

from numba.core.event import Event, Listener

from airflock.threads import heed


class Heeding(Listener):  # type: ignore[misc]  # Numba has no types
    """Each thread that compiles hears of its own passes."""

    def on_start(self, event: Event) -> None:
        """Give up the work of this thread if it was interrupted. Raises GivenUp."""
        heed()

    def on_end(self, event: Event) -> None:
        """Nothing; the next pass is asked."""
