"""Trails behind agents, drawn in pieces of some frames each."""

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from airflock.studio.view import BrowserView

FRAMES_PER_PIECE = 6  # frames of one piece
Positions = NDArray[Any]


class Trails:
    """The trails of a scene.

    shown : whether they are drawn; `show` changes it
    """

    def __init__(self, view: BrowserView):
        self._view, self.shown = view, True
        self.restart()

    def restart(self) -> None:
        """Begin again on a scene that has none yet."""
        self._piece_start: Positions | None = None
        self._frame_count = 0

    def forget(self) -> None:
        """Take away what is drawn: agents are elsewhere."""
        self._view.no_trails()
        self._piece_start = None

    def show(self, on: bool) -> None:
        """Draw trails from here on, or take them away."""
        self.shown = on
        self.forget()

    def draw(
        self,
        position: Positions,
        colours: Positions,
        start_of: Callable[[Positions], Positions] = lambda before: before,
    ) -> None:
        """Draw the newest piece up to positions (agent, 3), m, in the colours of the agents (agent, 3).

        start_of : where the agents were when the piece began → where it is drawn from, both (agent, 3)
        """
        done = False
        if self._piece_start is not None and self.shown:
            self._frame_count += 1
            done = self._frame_count % FRAMES_PER_PIECE == 0
            self._view.trail(start_of(self._piece_start), position, colours, done)
        if self._piece_start is None or done:
            self._piece_start = position
