"""Requests: what other threads want done by the thread that flies, in the order in which they asked."""

from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Event

QueuedAction = Callable[[], None]


class ActionQueue:
    """A queue with a bell: the thread that flies waits for the next frame or the next wish, whichever comes first."""

    def __init__(self) -> None:
        self._actions: SimpleQueue[QueuedAction] = SimpleQueue()
        self._event = Event()

    def put(self, action: QueuedAction) -> None:
        """Ask for something; from any thread."""
        self._actions.put(action)
        self._event.set()

    def wait(self, seconds: float) -> bool:
        """Wait for some seconds of real time at most. Whether something was asked for."""
        if not self._event.wait(max(seconds, 0.0)):
            return False
        self._event.clear()
        return True

    def answer(self, run: Callable[[QueuedAction], None]) -> bool:
        """Hand everything that was asked for to `do`. Whether there was anything."""
        done = False
        while True:
            try:
                action = self._actions.get_nowait()
            except Empty:
                return done
            done = True
            run(action)
