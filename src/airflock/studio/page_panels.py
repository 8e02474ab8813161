"""Panels of a flight page: playback, actions, opening of scenarios, measurements, tuning and the selected agent."""

import html
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import AgentView as Seen, Model, argument_names
from airflock.engine import DriverState as Memory
from airflock.parts import FAULTS as KINDS_OF_FAULT
from airflock.scenarios import (
    FIXED_KEYS,
    TOP_LEVEL_KEYS,
    FlightWorld,
    GoalCourse,
    Scenario,
    expand_short_keys,
    is_fault_key,
    presets,
)
from airflock.search import shipped_study_axes
from airflock.studio import page_measures as measures
from airflock.studio.browser_view import next_selected
from airflock.studio.flight_pane import (
    FlightPane,
    ParameterControl,
    fault_controls,
    free_path,
    scenario_controls,
    scenario_value,
)
from airflock.studio.page_measures import difference_table_html, score_table_html
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
    ErrorCollector,
    FormatError,
    ScenarioError,
    StudioError,
    TextError,
    as_error,
    atomic,
    parse_toml,
    parse_toml_value,
    printable,
)
from airflock.view import agent_colours, arrow_lines, rays_and_command, term_name_and_unit, vector_values

if TYPE_CHECKING:
    from airflock.studio.flight_page import FlightPage


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
        panel.add_menu("speed", tuple(SPEED_CHOICES), "1 ×", self._speed)
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

    def _speed(self, chosen: str) -> None:
        self.player.clock.speed = SPEED_CHOICES[chosen]

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


BAND_NAMES = ("paper +", "paper −")


class MeasurementPanel(PagePanel):
    """Charts of one pane, or of two in one picture."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self._charts: list[Any] = []
        self._score_names: list[str] = []
        self.scores: list[dict[str, Any]] = []
        self.name = ""  # of the order parameter that is drawn

    def rebuild(self) -> None:
        """Start again, for as many panes as there are."""
        player = self.player
        scores = player.sides[0].flight.scores()
        self._score_names = [name for name, value in scores.items() if isinstance(value, (int, float))]
        if self.name not in self._score_names:
            self.name = measures.default_score(dict.fromkeys(self._score_names), player.sides[0].scenario.published)
        far = 1e-6  # one axis for both panes
        for side, flock in zip(player.sides, self.scene.flocks, strict=True):
            cluster, apart = float(side.scenario.resolved_metrics().r_cluster or 1.0), flock.pairs.apart()
            far = max(far, min(cluster, 4.0 * float(np.median(apart))) if len(apart) else cluster)
        self.sides = [measures.PaneChartData(self.scene.top, far, self.name) for _ in player.sides]
        self._make_charts()

    def _make_charts(self) -> None:
        """Make menu, charts and table."""
        panel, player = self.widgets, self.player
        for chart in self._charts:
            chart.remove()
        two = len(player.sides) > 1
        tags = [f" {name}" for name in PANE_NAMES] if two else [""]
        bands = BAND_NAMES if self.name in player.sides[0].scenario.published else ()

        def chart_of(title: str, *lines: str, across: str = "t (s)") -> Any:
            return panel.add_chart(title, [f"{line}{tag}" for tag in tags for line in lines], across=across)

        with self.tab:
            self.score_menu = panel.add_menu(
                "order parameter", self._score_names, self.name, lambda n: player.ask(lambda: self._choose(n))
            )
            values = [f"value{tag}" for tag in tags]
            self.score_chart = panel.add_chart("since the last change", [*values, *bands], band=bool(bands))
            self.speed_chart = chart_of("speed (m/s)", *(("mean",) if two else ("mean", "slowest", "fastest")))
            self.nearest = chart_of("smallest distance (m)", "nearest pair")
            speeds = chart_of("speeds since the last change", "share", across="m/s")
            distances = chart_of("distance to the nearest", "share", across="m")
            self.table = panel.text()
        self.histogram_charts = {"speed_histogram": speeds, "distance_histogram": distances}
        self._charts = [
            self.score_menu, self.score_chart, self.speed_chart, self.nearest, speeds, distances, self.table,
        ]  # fmt: skip

    def _choose(self, name: str) -> None:
        """Draw another order parameter from now on; with a band only where the paper reports its value."""
        self.name = name
        for side in self.sides:
            side.name = name
            side.score_course.clear()
        self._make_charts()

    def clear(self) -> None:
        """Clear the charts: the flight is at another time."""
        for side in self.sides:
            side.clear()

    def refresh(self) -> None:
        """Add the present moment and draw everything."""
        flocks, two = self.scene.flocks, len(self.sides) > 1
        for side in self.sides:
            if side.speed_histogram.edges[-1] < self.scene.top:
                side.speed_histogram = measures.Histogram(self.scene.top)
        flights = [flock.side.flight for flock in flocks]
        self.scores = [
            side.note(flock.side.flight, flock.velocity, flock.pairs)
            for side, flock in zip(self.sides, flocks, strict=True)
        ]
        instants = [np.array(side.instants) for side in self.sides]
        count = min(map(len, instants))
        parts = [part[len(part) - count :] for part in instants]
        columns = (1,) if two else (1, 2, 3)
        time = np.ascontiguousarray(parts[0][:, 0])
        self.speed_chart.data = time, *(np.ascontiguousarray(part[:, c]) for part in parts for c in columns)
        self.nearest.data = time, *(np.ascontiguousarray(part[:, 4]) for part in parts)
        self._draw_course()
        for name, chart in self.histogram_charts.items():
            (values, share), *others = (getattr(side, name).steps for side in self.sides)
            chart.data = values, share, *(other for _, other in others)
        self.table.content = score_table_html(flights, self.scores)

    def _draw_course(self) -> None:
        courses = [np.array(side.score_course).reshape(-1, 2) for side in self.sides]
        longest = max(courses, key=len)
        if not len(longest):
            return
        time = longest[:, 0].copy()
        values = [
            np.interp(time, course[:, 0], course[:, 1], left=math.nan) if len(course) else np.full(len(time), math.nan)
            for course in courses
        ]
        published = self.player.sides[0].scenario.published
        edges = []
        if self.name in published:
            mean, spread = published[self.name]
            edges = [np.full(len(time), mean + sign * (spread or 0.0)) for sign in (1.0, -1.0)]
        self.score_chart.data = time, *values, *edges


NO_COMPARISON_TEXT = (
    "“Fork here” starts a second flight beside this one, from now on and with the same noise. The controls then act "
    "on B: they differ only in what you change."
)


class ComparisonPanel(PagePanel):
    """Controls to fork, to choose the active pane, and to read the differences."""

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
        """Show a menu of the active pane, if there are two."""
        if self._pane_menu is not None:
            self._pane_menu.remove()
            self._pane_menu = None
        if len(self.player.sides) > 1:
            with self.tab:
                self._pane_menu = self.widgets.add_menu(
                    "controls act on", tuple(PANE_NAMES), PANE_NAMES[self.player.hand], self._ask_for_pane
                )

    def refresh(self) -> None:
        """Show one table of the differences: parameters and order parameters."""
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


KEY_EXAMPLE = "radio.delay = 400 ms, or goals.points = [[0, 50, 0]]"
RESTART_HINTS = {"agents": "“agents” under Play starts another flight", "dt": "write it into the scenario file"}


class TuningPanel(PagePanel):
    """Sliders of one pane."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self._handles: dict[str, tuple[Any, ParameterControl]] = {}
        self._folders: list[Any] = []
        self._controls_for: Any = None
        self._fault_folders: list[Any] = []
        self._fault_names: Any = None
        panel, player = self.widgets, self.player
        panel.row(
            {
                "Undo": self.ask(lambda: self.show_on_controls(player.side.undo())),
                "Back to preset": self.ask(lambda: self.show_on_controls(player.side.undo_all())),
            }
        )
        panel.row(
            {
                "Save scenario (.toml)": self.ask(lambda: self._save(player.save_toml, "_tuned.toml")),
                "Save flight (.nc)": self.ask(lambda: self._save(player.save_recording, f"_seed{player.seed}.nc")),
                "Save replay (.html)": self.ask(lambda: self._save(player.save_replay, f"_seed{player.seed}.html")),
            }
        )
        self.command = panel.text()
        self.setting_field = panel.field("any key", f"for instance {KEY_EXAMPLE}")
        panel.row({"Set": self.ask(self._set)})

    def rebuild(self) -> None:
        """Make the controls of the active pane; again only for another law or pane."""
        preset, two = self.player.preset, len(self.player.sides) > 1
        made_for = preset.model, preset.records.keys(), self.player.side.origin.where, self.player.hand if two else None
        if made_for != self._controls_for:
            for folder in [*self._folders, *self._fault_folders]:
                folder.remove()
            self._fault_folders, self._fault_names, self._handles, self._controls_for = [], None, {}, made_for
            self._folders = self._made(scenario_controls(preset, shipped_study_axes(preset)))
        self.show_values()

    def _rebuild_faults(self) -> None:
        """Make the controls of faults again when other faults are in force: some may be begun by hand."""
        entries = self.player.scenario.faults
        faults = [entry.fault.name for entry in entries]
        if faults != self._fault_names:
            for folder in self._fault_folders:
                folder.remove()
            self._handles = {key: made for key, made in self._handles.items() if not is_fault_key(key)}
            self._fault_folders, self._fault_names = self._made(fault_controls(entries)), faults

    def _made(self, controls: Mapping[str, list[ParameterControl]]) -> list[Any]:
        """Make folders of controls, by section."""
        folders = []
        with self.tab:
            for section, own in controls.items():
                name = f"{PANE_NAMES[self.player.hand]}: {section}" if len(self.player.sides) > 1 else section
                folder = self.widgets.folder(name, section.startswith("model"))
                folders.append(folder)
                with folder:
                    for control in own:
                        self._handles[control.key] = self.widgets.add_control(control, self._ask_to_change), control
        return folders

    def show_values(self) -> None:
        """Show the values in force, of faults that there are by now: one begun by hand may have been given up."""
        self._rebuild_faults()
        values = {key: scenario_value(self.player.scenario, key) for key in self._handles}
        self.show_on_controls({key: value for key, value in values.items() if value != self._handles[key][0].value})

    def show_on_controls(self, values: dict[str, Any]) -> None:
        """Show values on their controls."""
        for key, value in values.items():
            if key in self._handles:
                self._handles[key][0].value = value

    def _ask_to_change(self, key: str, value: Any) -> None:
        self.player.ask(lambda: self._changed(key, value))

    def _changed(self, key: str, value: Any) -> None:
        try:
            self.player.change(key, value)
        except AirflockError:
            self.show_on_controls({key: scenario_value(self.player.scenario, key)})
            raise

    def _set(self) -> None:
        """Set a key by its name, as --set does; also one without a slider, or beyond the ends of its slider."""
        key, value = parse_setting(self.setting_field.value, self.player.scenario)
        self.player.change(key, value)
        self.setting_field.value = ""
        self.show_values()

    def _save(self, save: Callable[[Path], Path], ending: str) -> None:
        """Save to a free name in the folder where the page was opened, after the file of the active pane."""
        stem = Path(self.player.side.origin.where).with_suffix("").name
        path = save(free_path(Path(f"{stem}{ending}")))
        self.player.note = f"saved {path.absolute()}"
        self.player.fault(self.player.note)
        self.widgets.notify("Saved", str(path.absolute()))

    def refresh(self) -> None:
        """Show the command that opens this scenario again, with a button that copies it, and controls of new
        faults.
        """
        self._rebuild_faults()
        command = html.escape(self.player.command, quote=True)
        self.command.content = small_print_html(f"<code>{command}</code><br>{copy_button_html(command)}")


def copy_button_html(command: str) -> str:
    """Return a button that copies a command, escaped here; the page's script (`access_token`) copies it."""
    look = "border:1px solid #0072B2;border-radius:4px;background:none;color:#0072B2;cursor:pointer;margin-top:0.3em"
    return f"<button type='button' style='{look}' data-copy=\"{command}\">Copy command</button>"


def parse_setting(text: str, scenario: Scenario) -> tuple[str, Any]:
    """Return key and value of a line such as `radio.delay = 400 ms`; raises ScenarioError for an unknown key."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise ScenarioError([f"{text.strip() or 'any key'}: write KEY = VALUE, for instance model.p_rep = 0.14"])
    with as_error(key):
        found = parse_toml_value(value)
    if "." in key:
        return key, found
    if key in FIXED_KEYS:
        raise ScenarioError([f"{key} = {value}: {FIXED_KEYS[key]} cannot change in flight; {RESTART_HINTS[key]}"])
    if key in TOP_LEVEL_KEYS:
        raise ScenarioError([f"{key}: cannot be changed while a flock flies; write it into the scenario file"])
    records = {section: type(record) for section, record in scenario.records.items()}
    errors = ErrorCollector()
    whole = expand_short_keys({key: found}, records, errors)
    errors.raise_errors()
    return next(iter(whole.items()))


NO_LINES = np.zeros((0, 2, 3))
WAKE_SPANS = 6.0  # spans of a wake that are drawn
LONGEST_ARROW = 5.0  # darts; length of the longest arrow
VELOCITY_ARGUMENTS = {"dvx", "dvy", "dvz", "dv"}  # arguments of a rule that aligns velocities
FREE_RAY_COLOUR, HIT_RAY_COLOUR = agent_colours.GREEN, agent_colours.RED


class PerceptDrawing(NamedTuple):
    """Lines about one agent by kind (`LINE_STYLES`): segments (segment, 2, 3) m, their colours, and words.

    Kinds that are not named show nothing.
    """

    lines: dict[str, tuple[NDArray[Any], NDArray[Any] | None]]
    html: str


class PerceptLines:
    """Percepts of the selected agent as lines; keeps the world last seen, and the strongest value of each term."""

    def __init__(self) -> None:
        self._world: tuple[Scenario, FlightWorld] | None = None
        self._strongest: dict[str, float] = {}

    def of(self, pane: FlightPane, agent: int, dart_length: float, max_speed: float) -> PerceptDrawing:
        """Return the percepts of an agent.

        size : of a dart, m; top : speed that gives the longest arrow, m/s
        """
        seen, scenario = pane.flight.look(agent), pane.scenario
        own = np.array(seen.true[:3])
        lines = _neighbour_lines(seen, own, dart_length, pane.flight.measured)
        wish = np.zeros(3)
        wish[: len(seen.command)] = seen.command
        lines["command"] = arrow_lines(own, own + wish * (LONGEST_ARROW * dart_length / max(max_speed, 1e-9))), None
        points, tones, named = self._term_arrows(seen, own, dart_length, scenario.model)
        lines["terms"] = points, tones
        words = [*_agent_words(seen, scenario), *named]
        memory = pane.flight.snapshot().state
        if scenario.model.sight is not None:
            found, said = self._ray_lines(scenario, memory, seen)
            lines["rays"] = found
            words.append(said)
        if "model.circulation" in memory.arrays or "power.circulation" in memory.arrays:
            lines["wake"] = _wake_segments(scenario, pane.motion), None
            words.append(_drag_text(memory, agent))
        return PerceptDrawing(lines, "<br>".join(words))

    def _term_arrows(
        self, seen: Seen, own: NDArray[Any], size: float, model: Model
    ) -> tuple[NDArray[Any], NDArray[Any], list[str]]:
        """Return arrows of the law's terms: of all neighbours, of each, and of all surfaces.

        Terms of a law have units of their own, so each is as long as it is beside the strongest of
        its kind so far.
        """
        pieces, tones, words = [], [], []
        for number, (name, vector, parts) in enumerate(_named_vectors(seen, model)):
            strength = float(np.linalg.norm(vector))
            longest = max([strength, *(float(np.linalg.norm(part)) for part in parts)])
            # Terms have units of their own: each is scaled by the strongest of its kind so far.
            most = self._strongest[name] = max(self._strongest.get(name, 0.0), longest)
            tone, scale = (
                agent_colours.TERM_COLOURS[number % len(agent_colours.TERM_COLOURS)],
                LONGEST_ARROW * size / max(most, 1e-9),
            )
            shafts = np.vstack(
                [arrow_lines(own, own + vector * scale), *([[own, own + part * scale]] for part in parts)]
            )
            pieces.append(shafts)
            tones.append(np.tile(tone, (len(shafts), 1)))
            words.append(f"{_colour_mark_html(tone)} {html.escape(name)} {strength:.3g}, at most {most:.3g}")
        if not pieces:
            return NO_LINES, np.zeros((0, 3)), []
        return np.vstack(pieces), np.vstack(tones), words

    def _ray_lines(
        self, scenario: Scenario, memory: Memory, seen: Seen
    ) -> tuple[tuple[NDArray[Any], NDArray[Any]], str]:
        """Return the fan of rays that the agent casts: green where free, red up to the hit."""
        if self._world is None or self._world[0] is not scenario:
            self._world = scenario, FlightWorld(scenario)
        place, course = self._world[1], GoalCourse(scenario)
        if len(memory.arrays["later"]):
            # Obstacles that appear in flight are hidden in the driver's own copy until they appear.
            place.shapes[:] = memory.arrays["shapes"].astype(float).tolist()
        if course.points and scenario.goals.kind != "own":
            x, y, z = memory.arrays["aim"][:3].astype(float).tolist()
            course.at = x, y, z
        rays, _ = rays_and_command(scenario, place, course, seen.own, seen.heard, seen.time, seen.agent)
        at = np.array(seen.own[:3])
        ends = np.array([[ray.free * ray.x, ray.free * ray.y, ray.free * ray.z] for ray in rays]).reshape(-1, 3)
        free = np.array([ray.free >= ray.length for ray in rays], bool)
        tones = np.where(free[:, None], FREE_RAY_COLOUR, HIT_RAY_COLOUR)
        rays_cast = "1 ray" if len(free) == 1 else f"{len(free)} rays"
        said = f"casts {rays_cast}: {_colour_mark_html(FREE_RAY_COLOUR)} {int(free.sum())} free, "
        said += f"{_colour_mark_html(HIT_RAY_COLOUR)} {int((~free).sum())} met something"
        return (np.stack([np.broadcast_to(at, ends.shape), at + ends], 1), tones), said


def _named_vectors(view: Seen, model: Model) -> list[tuple[str, NDArray[Any], list[NDArray[Any]]]]:
    """Return the law's vectors by its own words: each with the part of each neighbour; then the surfaces.

    A law with one vector for all that a neighbour does has two here: repulsion, which a neighbour
    of equal velocity would cause, too, and alignment, which is the rest.
    """
    found: list[tuple[str, NDArray[Any], list[NDArray[Any]]]] = []
    for name, vector in (vector_values(view.sums) if view.sums else {}).items():
        parts = [vector_values(term)[name] for term in view.terms]
        if (
            name
            or model.terms
            or model.neighbour is None
            or not VELOCITY_ARGUMENTS & set(argument_names(model.neighbour, "neighbour"))
        ):
            found.append((term_name_and_unit(model, name)[0], vector, parts))
            continue
        # The rule evaluated with equal velocities is the repulsion; the remainder is the alignment.
        resting = [vector_values(term)[name] for term in view.alike]
        moving = [part - same for part, same in zip(parts, resting, strict=True)]
        found += [
            (word, sum(terms, np.zeros(3)), terms) for word, terms in (("repulsion", resting), ("alignment", moving))
        ]
    if view.walls:
        found += [(f"walls {name}".strip(), vector, []) for name, vector in vector_values(view.walls).items()]
    return found


def _neighbour_lines(view: Seen, own: NDArray[Any], size: float, measured: NDArray[Any]) -> dict[str, Any]:
    """Return lines to the neighbours that the law uses; crosses at their measured and believed positions.

    measured : (component, agent), what each believes of itself, m and m/s
    """
    at = np.array([other.state[:3] for other in view.heard]).reshape(-1, 3)
    noticed = at[np.array(_noticed_neighbours(view), bool)]
    believed = np.zeros((1 + len(at), 3))
    who = [view.agent, *(other.who for other in view.heard)]
    axes = len(measured) // 2
    believed[:, :axes] = measured[:axes, who].T
    believed[0] = view.own[:3]
    ghosts = np.vstack([cross_segments(believed[:1], 0.7 * size), cross_segments(believed[1:], 0.25 * size)])
    # Without sensor errors belief and truth are the same, and the crosses would only hide the
    # agents.
    off = float(np.linalg.norm(believed[0] - own)) > 0.0
    return {
        "heard": (np.stack([np.broadcast_to(own, noticed.shape), noticed], 1), None),
        "ghosts": (cross_segments(at, 0.5 * size), None),
        "measured": (ghosts if off else NO_LINES, None),
    }


def _noticed_neighbours(view: Seen) -> list[bool]:
    """Return a mask of the heard neighbours that change the law's result; all if it has no rule of one neighbour."""
    return [any(term) for term in view.terms] if view.terms else [True] * len(view.heard)


def cross_segments(places: NDArray[Any], half: float) -> NDArray[Any]:
    """Return two strokes at each place (place, 3), m."""
    cross = half * np.array([[[-1, -1, 0], [1, 1, 0]], [[-1, 1, 0], [1, -1, 0]]], float)
    return np.asarray((places[:, None, None] + cross).reshape(-1, 2, 3))


def _agent_words(view: Seen, scenario: Scenario) -> list[str]:
    """Return the text about an agent."""
    oldest = max((other.age for other in view.heard), default=0.0)
    off = math.dist(view.true[:3], view.own[:3])
    wish = ", ".join(f"{part:.2f}" for part in view.command)
    unit = {"velocity": " m/s", "acceleration": " m/s²"}.get(scenario.model.command, "")
    others = "nobody" if not view.heard else "1 other" if len(view.heard) == 1 else f"{len(view.heard)} others"
    heard = f"hears {others}" + (f", at most {oldest:.2g} s old" if view.heard else "")
    if sum(_noticed_neighbours(view)) < len(view.heard):
        heard += f"; its law notices {sum(_noticed_neighbours(view))}"
    crossed = f"{_colour_mark_html(agent_colours.PURPLE, '✕')} where they were heard"
    if off > 0.0:
        crossed += (
            f" {_colour_mark_html(agent_colours.BLUE, '✕')} where each believes to be; this one is {off:.2g} m off"
        )
    return [
        f"<b>agent {view.agent}</b>, {math.hypot(*view.true[3:]):.2f} m/s",
        f"{_colour_mark_html(agent_colours.ORANGE)} {heard}",
        crossed,
        f"{_colour_mark_html(agent_colours.RED)} command ({wish}){unit}",
    ]


def _colour_mark_html(tone: tuple[int, int, int], mark: str = "━") -> str:
    red, green, blue = tone
    return f"<span style='color:#{red:02x}{green:02x}{blue:02x}'>{mark}</span>"


def _wake_segments(scenario: Scenario, motion: tuple[NDArray[Any], NDArray[Any]]) -> NDArray[Any]:
    """Return the two outermost trailing legs of every wing, straight back."""
    position, velocity = (part.astype(float) for part in motion)
    span, ahead = float(scenario.wing.span), np.array([1.0, 0.0, 0.0])
    if scenario.wing.frame == "ground":
        mean = velocity.mean(axis=0) * [1.0, 1.0, 0.0]
        ahead = mean / max(float(np.linalg.norm(mean)), 1e-9)
    across = 0.5 * span * np.array([-ahead[1], ahead[0], 0.0])
    ends = position[:, None] + np.array([-across, across])
    return np.asarray(np.stack([ends, ends - WAKE_SPANS * span * ahead], 2).reshape(-1, 2, 3))


def _drag_text(memory: Memory, agent: int) -> str:
    """Return the drag of a bird, and the effect of the others' wash on it."""
    which = "power" if "shared_power_drag" in memory.driver.ROWS else "model"
    drag = float(memory.rows([f"shared_{which}_drag"])[0, agent])
    said = f"{_colour_mark_html(agent_colours.SKY)} wakes; induced drag {drag:.3g} N"
    if which == "power":
        alone = float(memory.rows(["shared_power_solo"])[0, agent])
        said += f", {100.0 * (drag / max(alone, 1e-9) - 1.0):+.0f} % of a lone bird's"
    return said


AGENT_LINE_KINDS = tuple(kind for kind in agent_colours.LINE_STYLES if kind != "links")
NOTHING_SELECTED_TEXT = small_print_html("click an agent, or press S")


class SelectionPanel(PagePanel):
    """Panel of the selected agent, counted through the agents of all panes."""

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
        """Clear the selection for another flight."""
        self.chosen, self.percept_lines = None, PerceptLines()

    def select(self, agent: int | None) -> None:
        """Select an agent, or none."""
        self.chosen = agent
        self.page.frame(True)

    def select_next(self, count: int) -> None:
        """Select an agent some numbers on."""
        self.select(next_selected(self.chosen, count, len(self.scene.positions)))

    def at(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        """Select the agent nearest to a ray, if it is near."""
        self.select(self.scene.nearest_to_ray(self.scene.positions, origin, direction))

    def push(self) -> None:
        """Push the selected agent, at twice the flock's speed."""
        if self.chosen is not None:
            side, agent = self.scene.pane_and_agent(self.chosen)
            self.player.push(agent, 2.0 * self.scene.top / 1.5, side)

    def refresh(self) -> None:
        """Show percepts and command of the selected agent."""
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
        """Begin the fault that the menu names in the selected agent."""
        if self.chosen is not None:
            side, agent = self.scene.pane_and_agent(self.chosen)
            self.player.sides[side].flight.fault(self.fault.value, agent, wait=False)
