"""Panels of a flight page: base class, playback, actions on the world, and opening of scenarios."""

import html
import math
from collections.abc import Callable, Sequence
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.scenarios import presets
from airflock.studio.flight_pane import FlightPane, free_path
from airflock.studio.page_scene import (
    BOTH_PANES,
    FOLLOW_CHOICES,
    LINK_CHOICES,
    PANE_NAMES,
    Collision,
    PageScene,
    available_colourings,
)
from airflock.support import (
    MAX_BYTES,
    AirflockError,
    FormatError,
    StudioError,
    TextError,
    atomic,
    parse_toml,
    printable,
)

if TYPE_CHECKING:
    from airflock.studio.flight_page import FlightPage

# ---- Base of all panels


class PagePanel:
    """One panel of a page.

    page : which it belongs to
    """

    def __init__(self, page: "FlightPage"):
        self.page, self.player, self.view = page, page.player, page.view
        self.widgets, self.scene = page.view.panel, page.scene

    def rebuild(self) -> None:
        """Show other flights than before: another one began, or a second one joined or left."""

    def refresh(self) -> None:
        """Show the present moment; a few times a second."""

    def ask(self, action: Callable[[], Any]) -> Callable[[], None]:
        """Queue an action for the next frame."""
        return lambda: self.player.ask(lambda: (action(), None)[1])


def small_print_html(text: str) -> str:
    """Return small print of a panel, as HTML."""
    return f"<div style='padding:0 0.75em;font-size:0.85em'>{text}</div>"


def status_html(text: str, is_error: bool) -> str:
    """Return the status above a page's tabs, as HTML, with a margin; red for an error."""
    look = f"padding:0 0.75em 0.6em;font-size:0.85em;color:{'#b00020' if is_error else '#555'}"
    return f"<div style='{look}'>{html.escape(text)}</div>" if text else ""


# ---- Playback

BACK_SECONDS = 10  # s; how far one press goes back
SECONDS_BEFORE_COLLISION = 1.0  # s; a jump to a collision ends so long before it
SPEED_CHOICES = {
    "0.1 ×": 0.1,
    "0.5 ×": 0.5,
    "1 ×": 1.0,
    "2 ×": 2.0,
    "5 ×": 5.0,
    "20 ×": 20.0,
    "as fast as possible": 1e9,
}
NO_JUMP_TEXT = "jump to …"


class PlaybackPanel(PagePanel):
    """Controls of time and of the drawing."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        panel, player, drawing = self.widgets, self.player, self.scene
        self.pause = panel.add_button("Pause", self.ask(player.toggle_pause), "or the key P")
        panel.row(
            {
                "Step": self.ask(player.step),
                f"Back {BACK_SECONDS} s": self.ask(self.go_back),
                "Reset": self.ask(self.reset),
            }
        )
        self.moment_field = panel.field("moment (s)", "any time already flown; everything after it is discarded")
        panel.row({"Go to this moment": self.ask(self._go)})
        panel.add_menu("speed", tuple(SPEED_CHOICES), "1 ×", lambda chosen: self._speed(SPEED_CHOICES[chosen]))
        self.seed = panel.number("seed", player.seed, 0, 2**31, lambda seed: player.ask(lambda: self.reset(seed)))
        most = max(1000, player.flight.agents)
        self.agents = panel.number(
            "agents", player.flight.agents, 1, most, lambda n: player.ask(lambda: self.reset(agents=n)),
            "another number starts another flight",
        )  # fmt: skip
        self.colouring_menu = panel.add_menu(
            "colour by",
            available_colourings(drawing.flocks),
            drawing.colouring.name,
            lambda way: setattr(drawing.colouring, "name", way),
        )
        self.key = panel.text()
        panel.add_checkbox("trails", True, action=lambda on: player.ask(lambda: drawing.trails.show(on)))
        panel.add_menu(
            "links", LINK_CHOICES, drawing.links, lambda kind: setattr(drawing, "links", kind),
            "to the three nearest, or to all in radio range; paler where packets are lost",
        )  # fmt: skip
        self.follow_menu = panel.add_menu("follow", FOLLOW_CHOICES, FOLLOW_CHOICES[0], self._follow)
        self.collision_menu = panel.add_menu(
            "collisions", (NO_JUMP_TEXT,), NO_JUMP_TEXT, self._jump, "goes back to one second before it"
        )
        self.listed = panel.text()
        self._listed_collisions: list[Collision] = []
        self._camera_scenario = ""  # which scenario the camera is set for
        for key, label, action in (
            ("P", "Pause or fly", player.toggle_pause), ("N", "Step", player.step), ("R", "Reset", self.reset),
            ("B", "Back", self.go_back),
        ):  # fmt: skip
            panel.command(label, key, self.ask(action))

    def rebuild(self) -> None:
        """List the colourings of these flights; in a new scenario, set which agent the camera follows."""
        player = self.player
        self._show_seed_and_agents()
        if self._camera_scenario != player.side.origin.where:
            self._camera_scenario = player.side.origin.where
            free = player.scenario.world.arena == "none" and not self.scene.stages[0].solids
            self.follow_menu.value = self.scene.follow_choice = FOLLOW_CHOICES[1 if free else 0]
        known = available_colourings(self.scene.flocks)
        if tuple(self.colouring_menu.options) != known:
            self.colouring_menu.options = known
            self.scene.colouring.name = self.scene.colouring.name if self.scene.colouring.name in known else known[0]
            self.colouring_menu.value = self.scene.colouring.name

    def _show_seed_and_agents(self) -> None:
        """Show seed and number of agents of the flight."""
        self.seed.value, self.agents.value = self.player.seed, self.player.flight.agents

    def _follow(self, choice: str) -> None:
        self.scene.follow_choice = choice

    def _go(self) -> None:
        """Go to the typed time."""
        try:
            time = float(self.moment_field.value)
        except ValueError:
            time = math.nan
        if not 0.0 <= time <= self.player.time:
            raise StudioError(
                f"moment = {self.moment_field.value or 'nothing'}: give a time from 0 to {self.player.time:g} s"
            )
        self.go_back(time)

    def _speed(self, speed: float) -> None:
        self.player.clock.speed = speed

    def go_back(self, time: float | None = None) -> None:
        """Go back to a time, s, or by ten seconds."""
        self.player.go_back(self.player.time - BACK_SECONDS if time is None else time)
        self.page.on_time_changed()

    def reset(self, seed: int | None = None, agents: int | None = None) -> None:
        """Begin another flight; if it is refused, the fields show the present one."""
        try:
            self.player.reset(seed, {} if agents is None else {"agents": agents})
        except AirflockError:
            self._show_seed_and_agents()
            raise
        self.scene.collisions.clear()
        self.page.rebuild()

    def _jump(self, choice: str) -> None:
        when = next((c.time for c in self._listed_collisions if self._collision_text(c) == choice), None)
        if when is not None:
            self.player.ask(lambda: self.go_back(max(when - SECONDS_BEFORE_COLLISION, 0.0)))

    def _collision_text(self, c: Collision) -> str:
        side = f", {PANE_NAMES[c.side]}" if len(self.player.sides) > 1 and c.side != BOTH_PANES else ""
        return f"t = {c.time:.1f} s: {c.first} and {c.second}{side}"

    def refresh(self) -> None:
        """Update the button's label, the key to the colours, and the list of collisions."""
        label = "Fly" if self.player.is_paused else "Pause"
        if self.pause.label != label:
            self.pause.label = label
        drawing = self.scene
        self.key.content = drawing.colouring.shown.key
        if self.colouring_menu.value != drawing.colouring.name:
            self.colouring_menu.value = drawing.colouring.name
        collisions = drawing.collisions.listed
        if collisions != self._listed_collisions:
            self._listed_collisions = collisions
            self.collision_menu.options = (NO_JUMP_TEXT, *dict.fromkeys(map(self._collision_text, collisions)))
            self.collision_menu.value = NO_JUMP_TEXT
            few = "<br>".join(self._collision_text(c) for c in collisions[:8])
            self.listed.content = small_print_html(f"<b>Pairs that collided</b><br>{few}") if collisions else ""


# ---- Actions

GUST_SECONDS = 3.0  # s of a gust
WIND_DIRECTIONS = {"east": 0.0, "north": 90.0, "west": 180.0, "south": 270.0}  # deg
OBSTACLE_WIDTH = 6.0  # darts; of an obstacle
MAX_HANDLES = 20  # goals that are shown with handles


class ActionPanel(PagePanel):
    """Controls that act on the world, in all panes equally."""

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
        """Enable dragging where there are goals."""
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
        """Put a handle on each goal of each pane, while goals may be dragged."""
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
    """Return True if a pane has goals that can be dragged."""
    return any(side.scenario.goals.kind in ("points", "scene") for side in panes)


# ---- Opening and saving

NO_CHOICE_TEXT = "a preset …"


class OpeningPanel(PagePanel):
    """Menu of presets, and a button that takes a scenario file."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        with self.widgets.folder("Open another scenario", is_open=False):
            self.preset_menu = self.widgets.add_menu(
                "preset", (NO_CHOICE_TEXT, *sorted(presets())), NO_CHOICE_TEXT, self._chosen
            )
            self.widgets.add_upload_button(
                "Open a file (.toml)",
                ".toml",
                self._ask_for_file,
                "it is saved in the folder where airflock watch runs",
            )
            self.message = self.widgets.text()

    def _chosen(self, name: str) -> None:
        if name != NO_CHOICE_TEXT:
            self.player.ask(lambda: self._opened(name))

    def _ask_for_file(self, name: str, content: bytes) -> None:
        self.player.ask(lambda: self.take(name, content))

    def take(self, name: str, content: bytes) -> None:
        """Open an uploaded scenario file; code that it names does not run. Raises AirflockError, and keeps nothing.

        name : of the file on the reader's machine; content : its bytes
        """
        text, path = read_scenario_text(name, content), free_path(Path(PureWindowsPath(name).name))
        atomic.write_file(path, text)
        try:
            self._opened(str(path))
        except Exception:
            path.unlink()
            raise
        self.player.fault(f"saved {path.absolute()}")

    def _opened(self, name: str) -> None:
        self.player.open(name)
        self.scene.collisions.clear()
        self.page.rebuild()
        self.message.content = small_print_html("")

    def rebuild(self) -> None:
        """Set the menu to the preset that flies, if it is one."""
        where = self.player.side.origin.where
        self.preset_menu.value = where if where in presets() else NO_CHOICE_TEXT


def read_scenario_text(name: str, content: bytes) -> str:
    """Decode an uploaded scenario file. Raises StudioError, with the reason, if it is not TOML."""
    try:
        if len(content) > MAX_BYTES:
            raise TextError(f"is larger than {MAX_BYTES / 1e6:g} MB, more than any file of this kind needs")
        text = content.decode("utf-8-sig")
        parse_toml(text)
    except UnicodeDecodeError as error:
        wrong = f"is not text in UTF-8: byte {error.start} is 0x{content[error.start]:02x}"
        raise StudioError(f"{name}: is not a scenario file (TOML): {wrong}") from error
    except FormatError as error:
        raise StudioError(f"{name}: is not a scenario file (TOML): {error}") from error
    except TextError as error:
        raise StudioError(f"{name}: {error}") from error
    if "\0" in name:
        raise StudioError(f"{printable(name)}: holds a character (NUL) that no file name may have")
    if not name.lower().endswith(".toml"):
        raise StudioError(f"{name}: is not a scenario file; its name must end with .toml")
    return text
