"""Comparing: a second flight beside the first, on the same clock, with the same noise; what sets them apart."""

import html
from typing import TYPE_CHECKING, Any

from airflock.studio.drawing import NAMES
from airflock.studio.room import Room, note
from airflock.studio.score_tables import difference_table, score_table

if TYPE_CHECKING:
    from airflock.studio.page import Page

ALONE = (
    "“Fork here” starts a second flight beside this one, from now on and with the same noise. The controls then act "
    "on B: they differ only in what you change."
)


class Comparing(Room):
    """Fork, choose which side the controls act on, and read the differences."""

    def __init__(self, page: "Page", tab: Any):
        super().__init__(page)
        self.tab = tab
        self.panel.row({"Fork here": self.ask(self._fork), "End comparison": self.ask(self._join)})
        self.text = self.panel.text()
        self._menu: Any = None

    def _fork(self) -> None:
        collisions, hand = self.drawing.collisions, self.player.hand
        self.player.fork()
        collisions.join(hand)
        collisions.fork()
        self.page.rebuild()

    def _join(self) -> None:
        hand = self.player.hand
        self.player.join()
        self.drawing.collisions.join(hand)
        self.page.rebuild()

    def _take(self, name: str) -> None:
        self.player.ask(lambda: self._taken(NAMES.index(name)))

    def _taken(self, hand: int) -> None:
        self.player.hand = min(hand, len(self.player.sides) - 1)
        self.page.tuning.rebuild()

    def rebuild(self) -> None:
        """A menu of which side is in hand, where there are two."""
        if self._menu is not None:
            self._menu.remove()
            self._menu = None
        if len(self.player.sides) > 1:
            with self.tab:
                self._menu = self.panel.menu("controls act on", tuple(NAMES), NAMES[self.player.hand], self._take)

    def refresh(self) -> None:
        """One table of what differs: parameters and order parameters."""
        sides = self.player.sides
        if len(sides) < 2:
            self.text.content = note(ALONE)
            return
        first, second = (side.origin for side in sides)
        other = second.beside(first) if second is not first else "forked from A"
        names = [f"<b>A</b> {html.escape(first.where)}", f"<b>B</b> {html.escape(other)}"]
        same = difference_table(sides[0].scenario, sides[1].scenario)
        scores = score_table([side.flight for side in sides], self.page.measuring.scores)
        self.text.content = note("<br>".join(names)) + same + scores
