"""Trails behind agents, drawn in pieces of some frames each."""

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from airflock.studio.view import View

PIECE = 6  # frames of one piece
Places = NDArray[Any]


class Trails:
    """The trails of a scene.

    shown : whether they are drawn; `show` changes it
    """

    def __init__(self, view: View):
        self._view, self.shown = view, True
        self.restart()

    def restart(self) -> None:
        """Begin again on a scene that has none yet."""
        self._before: Places | None = None
        self._pieces = 0

    def forget(self) -> None:
        """Take away what is drawn: agents are elsewhere."""
        self._view.no_trails()
        self._before = None

    def show(self, on: bool) -> None:
        """Draw trails from here on, or take them away."""
        self.shown = on
        self.forget()

    def draw(self, position: Places, tone: Places, begin: Callable[[Places], Places] = lambda before: before) -> None:
        """Draw the newest piece up to positions (agent, 3), m, in the colours of the agents (agent, 3).

        begin : where the agents were when the piece began → where it is drawn from, both (agent, 3)
        """
        done = False
        if self._before is not None and self.shown:
            self._pieces += 1
            done = self._pieces % PIECE == 0
            self._view.trail(begin(self._before), position, tone, done)
        if self._before is None or done:
            self._before = position
