"""Selecting: the agent that was clicked, what it perceives, and a push."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.parts.faults import KINDS as KINDS_OF_FAULT
from airflock.studio.drawing import PANE_NAMES
from airflock.studio.perceiving import PerceptDrawing, PerceptLines
from airflock.studio.room import PagePanel, small_print_html
from airflock.view import colours

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage

AGENT_LINE_KINDS = tuple(kind for kind in colours.LINE_STYLES if kind != "links")
NOTHING_SELECTED_TEXT = small_print_html("click an agent, or press S")


class SelectionPanel(PagePanel):
    """Whoever is selected, counted through the agents of all sides."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        self.chosen: int | None = None
        self.percept_lines = PerceptLines()
        with self.widgets.folder("Selected agent"):
            self.about = self.widgets.text(NOTHING_SELECTED_TEXT)
            self.widgets.row(
                {
                    "Previous": self.ask(lambda: self.select_next(-1)),
                    "Next": self.ask(lambda: self.select_next(1)),
                    "Push": self.ask(self.push),
                    "None": self.ask(lambda: self.select(None)),
                }
            )
            self.fault = self.widgets.add_menu(
                "fault", tuple(KINDS_OF_FAULT), "motor", lambda _: None, "begins at once"
            )
            self.widgets.row({"Let it fail": self.ask(self.begin_fault)})
        self.widgets.command("Next agent", "S", self.ask(lambda: self.select_next(1)))

    def rebuild(self) -> None:
        """Nobody is selected in another flight."""
        self.chosen, self.percept_lines = None, PerceptLines()

    def select(self, agent: int | None) -> None:
        """Select an agent, or nobody."""
        self.chosen = agent
        self.page.frame(True)

    def select_next(self, count: int) -> None:
        """Select an agent some numbers on."""
        many = len(self.scene.positions)
        self.select(((-1 if self.chosen is None and count > 0 else self.chosen or 0) + count) % many)

    def at(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        """Select the agent nearest to a ray, if it is near."""
        away = self.scene.positions - origin
        along = np.maximum(away @ direction, 0.0)
        off = np.linalg.norm(away - along[:, None] * direction, axis=1)
        best = int(off.argmin())
        self.select(best if off[best] < 2.0 * self.scene.size else None)

    def push(self) -> None:
        """Push the selected agent, at twice the flock's speed."""
        if self.chosen is not None:
            side, agent = self.scene.pane_and_agent(self.chosen)
            self.player.push(agent, 2.0 * self.scene.top / 1.5, side)

    def refresh(self) -> None:
        """What the selected agent perceives and commands."""
        if self.chosen is None:
            self.about.content = NOTHING_SELECTED_TEXT
            for kind in AGENT_LINE_KINDS:
                self.view.extra(kind, np.zeros((0, 2, 3)))
            return
        if self.player.failure_message:
            return  # what it perceived last stays
        number, agent = self.scene.pane_and_agent(self.chosen)
        flock = self.scene.flocks[number]
        if not flock.side.flight.present[agent]:
            self._show(PerceptDrawing({}, f"<b>agent {agent}</b> has left"), flock.offset, number)
            return
        drawn = self.percept_lines.of(flock.side, agent, self.scene.size, self.scene.top)
        self._show(drawn, flock.offset, number)

    def _show(self, drawn: PerceptDrawing, offset: NDArray[Any], side: int) -> None:
        for kind in AGENT_LINE_KINDS:
            points, tones = drawn.lines.get(kind, (np.zeros((0, 2, 3)), None))
            self.view.extra(kind, points + offset, tones)
        where = f" of {PANE_NAMES[side]}" if len(self.player.sides) > 1 else ""
        self.about.content = small_print_html(drawn.html.replace("</b>", f"{where}</b>", 1))

    def begin_fault(self) -> None:
        """Let the fault that the menu names begin in the selected agent."""
        if self.chosen is not None:
            side, agent = self.scene.pane_and_agent(self.chosen)
            self.player.sides[side].flight.fault(self.fault.value, agent, wait=False)
