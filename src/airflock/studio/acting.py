"""Acting: what a hand can do to the world of a flight: a gust, an obstacle, a goal that is dragged."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.studio.drawing import PageScene
from airflock.studio.room import PagePanel, small_print_html
from airflock.studio.side import FlightPane

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage

GUST_SECONDS = 3.0  # s of a gust
WIND_DIRECTIONS = {"east": 0.0, "north": 90.0, "west": 180.0, "south": 270.0}  # deg
OBSTACLE_WIDTH = 6.0  # darts; of an obstacle
MAX_HANDLES = 20  # goals that are shown with handles


class ActionPanel(PagePanel):
    """Hands on the world; what they do reaches all sides alike."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        self.is_aiming = False
        panel = self.widgets
        with panel.folder("Act on the world", is_open=False):
            self.strength_field = panel.number("gust (m/s)", 8, 1, 50, lambda _: None, f"blows for {GUST_SECONDS:g} s")
            self.direction_menu = panel.add_menu("towards", tuple(WIND_DIRECTIONS), "east", lambda _: None)
            panel.row({"Gust": self.ask(self.gust), "Throw an obstacle in": self.ask(self._aim)})
            self.is_dragging = False
            self.drag_checkbox = panel.add_checkbox(
                "drag goals", False, action=lambda on: self.player.ask(lambda: self._drag(on))
            )
            self.message = panel.text()
        self.scene.draw_handles = self._handles
        self._handles(self.scene)

    def rebuild(self) -> None:
        """Goals can be dragged where there are any."""
        self.drag_checkbox.visible = has_goals(self.player.sides)
        self.drag_checkbox.value = self.is_dragging = self.is_dragging and self.drag_checkbox.visible

    def gust(self) -> None:
        """Let the wind blow for three seconds."""
        angle, strength = math.radians(WIND_DIRECTIONS[self.direction_menu.value]), float(self.strength_field.value)
        east, north = (round(strength * c, 6) for c in (math.cos(angle), math.sin(angle)))
        self.player.gust(east, north, GUST_SECONDS)

    def _drag(self, on: bool) -> None:
        self.is_dragging = on
        self.scene.rebuild_worlds()

    def _aim(self) -> None:
        self.is_aiming = not self.is_aiming
        self.message.content = small_print_html("click the place where it should stand" if self.is_aiming else "")

    def at(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        """Throw an obstacle to where a ray meets the plane of the flock."""
        self._aim()
        level = float(self.scene.stages[0].centre[2])
        share = (level - origin[2]) / (direction[2] if abs(direction[2]) > 1e-9 else 1e-9)
        if share <= 0.0:
            return
        place = origin + share * direction
        away = [np.linalg.norm((place - flock.position.mean(0) - flock.offset)[:2]) for flock in self.scene.flocks]
        flock = self.scene.flocks[int(np.argmin(away))]
        x, y = (float(c) for c in (place - flock.offset)[:2])
        self.player.throw_obstacle(round(x, 3), round(y, 3), round(OBSTACLE_WIDTH * self.scene.size, 3))
        self.scene.rebuild_if_changed()

    def _handles(self, drawing: PageScene) -> None:
        """A handle on each goal of each side, while goals may be dragged."""
        if not self.is_dragging:
            return
        for flock in drawing.flocks:
            scenario = flock.side.scenario
            goals = scenario.waypoints() if scenario.goals.kind in ("points", "scene") else []
            for number, goal in enumerate(goals[:MAX_HANDLES]):
                self.view.handle(
                    f"{'AB'[drawing.flocks.index(flock)]}/goal_{number}", np.asarray(goal) + flock.offset,
                    2.0 * drawing.size, drawing.flat, self._move_goal_callback(number, flock.offset),
                )  # fmt: skip

    def _move_goal_callback(self, number: int, offset: NDArray[Any]) -> Any:
        def moved(place: NDArray[Any]) -> None:
            spot = [round(float(c), 3) for c in place - offset]
            self.player.ask(lambda: self.player.move_goal(number, spot))

        return moved


def has_goals(panes: Sequence[FlightPane]) -> bool:
    """Whether a side has goals that can be dragged."""
    return any(side.scenario.goals.kind in ("points", "scene") for side in panes)
