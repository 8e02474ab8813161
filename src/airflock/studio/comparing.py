"""Comparing: a second flight beside the first, on the same clock, with the same noise; what sets them apart."""

import html
from typing import TYPE_CHECKING, Any

from airflock.studio.drawing import PANE_NAMES
from airflock.studio.room import PagePanel, small_print_html
from airflock.studio.score_tables import difference_table_html, score_table_html

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage

NO_COMPARISON_TEXT = (
    "“Fork here” starts a second flight beside this one, from now on and with the same noise. The controls then act "
    "on B: they differ only in what you change."
)


class ComparisonPanel(PagePanel):
    """Fork, choose which side the controls act on, and read the differences."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self.widgets.row({"Fork here": self.ask(self._fork), "End comparison": self.ask(self._end_comparison)})
        self.text = self.widgets.text()
        self._pane_menu: Any = None

    def _fork(self) -> None:
        collisions, hand = self.scene.collisions, self.player.hand
        self.player.fork()
        collisions.join(hand)
        collisions.fork()
        self.page.rebuild()

    def _end_comparison(self) -> None:
        hand = self.player.hand
        self.player.join()
        self.scene.collisions.join(hand)
        self.page.rebuild()

    def _ask_for_pane(self, name: str) -> None:
        self.player.ask(lambda: self._taken(PANE_NAMES.index(name)))

    def _taken(self, index: int) -> None:
        self.player.hand = min(index, len(self.player.sides) - 1)
        self.page.tuning.rebuild()

    def rebuild(self) -> None:
        """A menu of which side is in hand, where there are two."""
        if self._pane_menu is not None:
            self._pane_menu.remove()
            self._pane_menu = None
        if len(self.player.sides) > 1:
            with self.tab:
                self._pane_menu = self.widgets.add_menu(
                    "controls act on", tuple(PANE_NAMES), PANE_NAMES[self.player.hand], self._ask_for_pane
                )

    def refresh(self) -> None:
        """One table of what differs: parameters and order parameters."""
        sides = self.player.sides
        if len(sides) < 2:
            self.text.content = small_print_html(NO_COMPARISON_TEXT)
            return
        first, second = (side.origin for side in sides)
        other = second.beside(first) if second is not first else "forked from A"
        names = [f"<b>A</b> {html.escape(first.where)}", f"<b>B</b> {html.escape(other)}"]
        same = difference_table_html(sides[0].scenario, sides[1].scenario)
        scores = score_table_html([side.flight for side in sides], self.page.measurement.scores)
        self.text.content = small_print_html("<br>".join(names)) + same + scores
