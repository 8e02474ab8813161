"""Acting: what a hand can do to the world of a flight: a gust, an obstacle, a goal that is dragged."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.studio.drawing import Drawing
from airflock.studio.room import Room, note
from airflock.studio.side import Side

if TYPE_CHECKING:
    from airflock.studio.page import Page

BLOWS = 3.0  # s of a gust
TOWARDS = {"east": 0.0, "north": 90.0, "west": 180.0, "south": 270.0}  # deg
WIDTH = 6.0  # darts; of an obstacle
FEW = 20  # goals that are shown with handles


class Acting(Room):
    """Hands on the world; what they do reaches all sides alike."""

    def __init__(self, page: "Page"):
        super().__init__(page)
        self.aiming = False
        panel = self.panel
        with panel.folder("Act on the world", is_open=False):
            self.strength = panel.number("gust (m/s)", 8, 1, 50, lambda _: None, f"blows for {BLOWS:g} s")
            self.towards = panel.menu("towards", tuple(TOWARDS), "east", lambda _: None)
            panel.row({"Gust": self.ask(self.gust), "Throw an obstacle in": self.ask(self._aim)})
            self.dragging = False
            self.drags = panel.checkbox("drag goals", False, action=lambda on: self.player.ask(lambda: self._drag(on)))
            self.said = panel.text()
        self.drawing.handles = self._handles
        self._handles(self.drawing)

    def rebuild(self) -> None:
        """Goals can be dragged where there are any."""
        self.drags.visible = has_goals(self.player.sides)
        self.drags.value = self.dragging = self.dragging and self.drags.visible

    def gust(self) -> None:
        """Let the wind blow for three seconds."""
        angle, strength = math.radians(TOWARDS[self.towards.value]), float(self.strength.value)
        east, north = (round(strength * c, 6) for c in (math.cos(angle), math.sin(angle)))
        self.player.gust(east, north, BLOWS)

    def _drag(self, on: bool) -> None:
        self.dragging = on
        self.drawing.rebuild_worlds()

    def _aim(self) -> None:
        self.aiming = not self.aiming
        self.said.content = note("click the place where it should stand" if self.aiming else "")

    def at(self, origin: NDArray[Any], way: NDArray[Any]) -> None:
        """Throw an obstacle to where a ray meets the plane of the flock."""
        self._aim()
        level = float(self.drawing.stages[0].centre[2])
        share = (level - origin[2]) / (way[2] if abs(way[2]) > 1e-9 else 1e-9)
        if share <= 0.0:
            return
        place = origin + share * way
        away = [np.linalg.norm((place - flock.position.mean(0) - flock.offset)[:2]) for flock in self.drawing.flocks]
        flock = self.drawing.flocks[int(np.argmin(away))]
        x, y = (float(c) for c in (place - flock.offset)[:2])
        self.player.throw(round(x, 3), round(y, 3), round(WIDTH * self.drawing.size, 3))
        self.drawing.rebuild_if_changed()

    def _handles(self, drawing: Drawing) -> None:
        """A handle on each goal of each side, while goals may be dragged."""
        if not self.dragging:
            return
        for flock in drawing.flocks:
            scenario = flock.side.scenario
            goals = scenario.waypoints() if scenario.goals.kind in ("points", "scene") else []
            for number, goal in enumerate(goals[:FEW]):
                self.view.handle(
                    f"{'AB'[drawing.flocks.index(flock)]}/goal_{number}", np.asarray(goal) + flock.offset,
                    2.0 * drawing.size, drawing.flat, self._dragged(number, flock.offset),
                )  # fmt: skip

    def _dragged(self, number: int, offset: NDArray[Any]) -> Any:
        def moved(place: NDArray[Any]) -> None:
            spot = [round(float(c), 3) for c in place - offset]
            self.player.ask(lambda: self.player.move_goal(number, spot))

        return moved


def has_goals(sides: Sequence[Side]) -> bool:
    """Whether a side has goals that can be dragged."""
    return any(side.scenario.goals.kind in ("points", "scene") for side in sides)
