"""Selecting: the agent that was clicked, what it perceives, and a push."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.parts.faults.registry import KINDS as KINDS_OF_FAULT
from airflock.studio.drawing import NAMES
from airflock.studio.perceiving import Drawn, Perceiving
from airflock.studio.room import Room, note
from airflock.view.stage import colours

if TYPE_CHECKING:
    from airflock.studio.page import Page

KINDS = tuple(kind for kind in colours.LINES if kind != "links")
NOBODY = note("click an agent, or press S")


class Selecting(Room):
    """Whoever is selected, counted through the agents of all sides."""

    def __init__(self, page: "Page"):
        super().__init__(page)
        self.chosen: int | None = None
        self.eyes = Perceiving()
        with self.panel.folder("Selected agent"):
            self.about = self.panel.text(NOBODY)
            self.panel.row(
                {
                    "Previous": self.ask(lambda: self.by(-1)),
                    "Next": self.ask(lambda: self.by(1)),
                    "Push": self.ask(self.push),
                    "None": self.ask(lambda: self.choose(None)),
                }
            )
            self.fault = self.panel.menu("fault", tuple(KINDS_OF_FAULT), "motor", lambda _: None, "begins at once")
            self.panel.row({"Let it fail": self.ask(self.fail)})
        self.panel.command("Next agent", "S", self.ask(lambda: self.by(1)))

    def rebuild(self) -> None:
        """Nobody is selected in another flight."""
        self.chosen, self.eyes = None, Perceiving()

    def choose(self, agent: int | None) -> None:
        """Select an agent, or nobody."""
        self.chosen = agent
        self.page.frame(True)

    def by(self, count: int) -> None:
        """Select an agent some numbers on."""
        many = len(self.drawing.places)
        self.choose(((-1 if self.chosen is None and count > 0 else self.chosen or 0) + count) % many)

    def at(self, origin: NDArray[Any], way: NDArray[Any]) -> None:
        """Select the agent nearest to a ray, if it is near."""
        away = self.drawing.places - origin
        along = np.maximum(away @ way, 0.0)
        off = np.linalg.norm(away - along[:, None] * way, axis=1)
        best = int(off.argmin())
        self.choose(best if off[best] < 2.0 * self.drawing.size else None)

    def push(self) -> None:
        """Push the selected agent, at twice the flock's speed."""
        if self.chosen is not None:
            side, agent = self.drawing.whose(self.chosen)
            self.player.push(agent, 2.0 * self.drawing.top / 1.5, side)

    def refresh(self) -> None:
        """What the selected agent perceives and commands."""
        if self.chosen is None:
            self.about.content = NOBODY
            for kind in KINDS:
                self.view.extra(kind, np.zeros((0, 2, 3)))
            return
        if self.player.failure:
            return  # what it perceived last stays
        number, agent = self.drawing.whose(self.chosen)
        flock = self.drawing.flocks[number]
        if not flock.side.flight.present[agent]:
            self._show(Drawn({}, f"<b>agent {agent}</b> has left"), flock.offset, number)
            return
        drawn = self.eyes.of(flock.side, agent, self.drawing.size, self.drawing.top)
        self._show(drawn, flock.offset, number)

    def _show(self, drawn: Drawn, offset: NDArray[Any], side: int) -> None:
        for kind in KINDS:
            points, tones = drawn.lines.get(kind, (np.zeros((0, 2, 3)), None))
            self.view.extra(kind, points + offset, tones)
        where = f" of {NAMES[side]}" if len(self.player.sides) > 1 else ""
        self.about.content = note(drawn.words.replace("</b>", f"{where}</b>", 1))

    def fail(self) -> None:
        """Let the fault that the menu names begin in the selected agent."""
        if self.chosen is not None:
            side, agent = self.drawing.whose(self.chosen)
            self.player.sides[side].flight.fault(self.fault.value, agent, wait=False)
