"""Requests: what other threads want done by the thread that flies, in the order in which they asked."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Event

Action = Callable[[], None]


class Asked:
    """A queue with a bell: the thread that flies waits for the next frame or the next wish, whichever comes first."""

    def __init__(self) -> None:
        self._actions: SimpleQueue[Action] = SimpleQueue()
        self._bell = Event()

    def put(self, action: Action) -> None:
        """Ask for something; from any thread."""
        self._actions.put(action)
        self._bell.set()

    def rung(self, seconds: float) -> bool:
        """Wait for some seconds of real time at most. Whether something was asked for."""
        if not self._bell.wait(max(seconds, 0.0)):
            return False
        self._bell.clear()
        return True

    def answer(self, do: Callable[[Action], None]) -> bool:
        """Hand everything that was asked for to `do`. Whether there was anything."""
        done = False
        while True:
            try:
                action = self._actions.get_nowait()
            except Empty:
                return done
            done = True
            do(action)
