"""Browser view: everything that uses viser: charts, panel, and the scene with solids, lines, agents and cameras."""

import secrets
import socket
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import rich
import viser
from numpy.typing import NDArray
from viser import uplot

from airflock.studio.access_token import require_token
from airflock.studio.flight_pane import ParameterControl
from airflock.support import StudioError
from airflock.view import SceneLines, SceneSolid, agent_colours, dart_mesh, velocity_quaternions

ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)  # times a power of ten
PARTS_PER_SPAN = 4  # an axis ends within a part, so large, of the span that is shown
MIN_RELATIVE_SPAN = 1e-9  # a span below this share of its ends is none
ZERO_BELOW = 1e-12  # values nearer to 0 are drawn as 0
FLAT_SHARE = 1e-4  # of values, which are numbers of seven digits


def round_ends(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return round ends of an axis that holds all values, which ascend: from the first to the last, and a little
    more.
    """
    low, high = (float(values[0]), float(values[-1])) if len(values) else (0.0, 0.0)
    span = high - low
    if not span > MIN_RELATIVE_SPAN * max(abs(low), abs(high), 1.0):
        return low, high + 1.0
    power = 10.0 ** np.floor(np.log10(span / PARTS_PER_SPAN))
    part = next(power * step for step in ROUND_STEPS if PARTS_PER_SPAN * power * step >= span * (1.0 - 1e-9))
    return float(np.floor(low / part + 1e-9) * part), float(np.ceil(high / part - 1e-9) * part)


def axis_ranges(columns: tuple[NDArray[np.float64], ...]) -> dict[str, tuple[float, float]]:
    """Return the axis ranges that must be sent to a page: always x, and y where the page cannot find it itself.

    That is where a value is missing (nan), and where all are the same but for rounding, as the
    speeds of fish.
    """
    found = {"x": round_ends(columns[0])}
    values = np.concatenate([column[np.isfinite(column)] for column in columns[1:]])
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
    size = max(abs(low), abs(high))
    if high - low <= FLAT_SHARE * size or size < ZERO_BELOW:
        far = round_ends(np.array([0.0, 1.5 * size]))[1] if size >= ZERO_BELOW else 1.0
        return {**found, "y": (-far, 0.0) if low < -ZERO_BELOW else (0.0, far)}
    return found if len(values) == sum(map(len, columns[1:])) else {**found, "y": round_ends(np.array([low, high]))}


class Chart:
    """Chart of viser whose axis ranges are set.

    Left alone, the page scales the axis of new values by that of the last ones. A chart that was
    made while it was hidden, or drawn too slowly, has none yet, and then shows the first second for
    ever (viser 1.1). An axis that is set is never scaled; setting it draws a new picture, so it is
    done only where a round end is passed. The other axis scales itself unless a value is not a
    number, with which it would end nowhere and nothing would be drawn, or all are the same but for
    rounding, at which the page looks for ticks until its memory is full.
    """

    def __init__(self, handle: Any):
        self._handle = handle
        self._axis_ranges: dict[str, tuple[float, float]] = {}

    @property
    def data(self) -> tuple[NDArray[np.float64], ...]:
        """Set the data: (time or another axis, *values), one array a line, all of one length."""
        return tuple(self._handle.data)

    @data.setter
    def data(self, columns: tuple[NDArray[np.float64], ...]) -> None:
        if (ranges := axis_ranges(columns)) != self._axis_ranges:
            self._axis_ranges = ranges
            self._handle.scales = {axis: uplot.Scale(time=False, range=given) for axis, given in ranges.items()}
        self._handle.data = columns

    def remove(self) -> None:
        """Remove the chart from the page."""
        self._handle.remove()


CHART_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#000000")


class Widgets:
    """Panel of one page.

    server : of viser
    """

    def __init__(self, server: viser.ViserServer):
        self.server = server

    def add_tabs(self, *names: str) -> list[Any]:
        """Add tabs; each is a context in which controls are made."""
        group = self.server.gui.add_tab_group()
        return [group.add_tab(name) for name in names]

    def folder(self, name: str, is_open: bool = True) -> Any:
        """Add a folder, a context in which controls are made."""
        return self.server.gui.add_folder(name, expand_by_default=is_open)

    def text(self, content: str = "") -> Any:
        """Add HTML that can be rewritten: `.content`."""
        return self.server.gui.add_html(content)

    def add_button(self, label: str, action: Callable[[], None], hint: str = "") -> Any:
        """Add a button; `.label` can be rewritten."""
        handle = self.server.gui.add_button(label, hint=hint or None)
        handle.on_click(lambda _: action())
        return handle

    def row(self, actions: dict[str, Callable[[], None]]) -> None:
        """Add small buttons side by side."""
        self.server.gui.add_button_group("", tuple(actions)).on_click(lambda event: actions[event.target.value]())

    def command(self, label: str, key: Any, action: Callable[[], None]) -> None:
        """Bind a key to an action."""
        self.server.gui.add_command(label, hotkey=key).on_trigger(lambda _: action())

    def add_checkbox(self, label: str, value: bool, action: Callable[[bool], None]) -> Any:
        """Add a switch; its state is `.value`."""
        return _when_moved(self.server.gui.add_checkbox(label, value), action)

    def add_menu(
        self, label: str, options: Sequence[str], value: str, action: Callable[[str], None], hint: str = ""
    ) -> Any:
        """Add a menu; the chosen entry is `.value`."""
        return _when_moved(
            self.server.gui.add_dropdown(label, tuple(options), initial_value=value, hint=hint or None), action
        )

    def number(self, label: str, value: int, low: int, high: int, action: Callable[[int], None], hint: str = "") -> Any:
        """Add a field for a whole number; beyond its ends it is ignored until the field is left, then set to the
        end.
        """
        return _when_moved(
            self.server.gui.add_number(label, value, min=low, max=high, step=1, hint=hint or None),
            lambda typed: action(int(typed)) if low <= typed <= high else None,
        )

    def field(self, label: str, hint: str = "") -> Any:
        """Add a field for a line of text: `.value`."""
        return self.server.gui.add_text(label, "", hint=hint or None)

    def add_upload_button(self, label: str, ending: str, action: Callable[[str, bytes], None], hint: str = "") -> Any:
        """Add a button that takes a file from the reader's machine; `action` gets its name and content."""
        handle = self.server.gui.add_upload_button(label, mime_type=ending, hint=hint or None)
        handle.on_upload(lambda event: action(event.target.value.name, event.target.value.content))
        return handle

    def add_control(self, control: ParameterControl, action: Callable[[str, Any], None]) -> Any:
        """Add a slider or a menu for a parameter."""
        c = control
        if c.options:
            return self.add_menu(c.label, c.options, c.value, lambda v: action(c.key, v), c.hint)
        slider = self.server.gui.add_slider(c.label, c.low, c.high, c.step, c.value, hint=c.hint or None)
        return _when_moved(slider, lambda v: action(c.key, float(v)))

    def add_chart(self, title: str, names: Sequence[str], band: bool = False, across: str = "t (s)") -> Chart:
        """Add a chart: `.data` is (time or `across`, *values). With a band, the last two are its ends, shaded."""
        series: list[Any] = [uplot.Series(label=across)]
        for number, name in enumerate(names):
            edge = band and number >= len(names) - 2
            stroke, width = ("#E69F00", 0.7) if edge else (CHART_COLOURS[number], 2.0)
            points = uplot.Series_Points(show=False)
            series.append(uplot.Series(label=name, points=points, stroke=stroke, width=width))
        shade = (uplot.Band(series=(len(names) - 1, len(names)), fill="rgba(230,159,0,0.2)"),) if band else None
        zero = np.zeros(2)
        return Chart(self.server.gui.add_uplot(
            (zero, *[zero] * len(names)), tuple(series), title=title, aspect=2.1, bands=shade, padding=(8, 8, 0, 0),
            scales={"x": uplot.Scale(time=False, range=(0.0, 1.0))}, legend=uplot.Legend(show=True),
            axes=tuple(uplot.Axis(stroke=agent_colours.AXIS_COLOUR, size=size) for size in (28, 46)),
        ))  # fmt: skip

    def notify(self, title: str, body: str, is_error: bool = False) -> None:
        """Show a notice on every open page."""
        for client in self.server.get_clients().values():
            client.add_notification(title, body, color="red" if is_error else "blue", auto_close_seconds=8.0)


def _when_moved(handle: Any, action: Callable[[Any], None]) -> Any:
    """Call `action` with the value of a control when a reader moves it, not when the program sets it."""
    handle.on_update(lambda event: action(event.target.value) if event.client is not None else None)
    return handle


TRAIL_PIECES = 40  # nodes, rewritten in turn: a trail is so many frames long
FLAT_FIELD_OF_VIEW = 0.12  # rad; field of view for what is flat, seen from far above: there is no orthographic camera
SPACE_FIELD_OF_VIEW = 0.8
SETTLING_SECONDS = 2.0  # s; a page that was just opened or pointed elsewhere is not led yet
FULL_ASPECT = 1.2  # width by height from which on a page shows a field beside its panel
MIN_ASPECT_CHANGE = 0.02  # by which width by height differs when a telephone is turned, and not when a bar slides away
FIRST_SEGMENTS = 32  # segments of a kind of lines at first
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)


class BrowserView:
    """Page at an address of its own.

    host : localhost, unless the page is to be seen from elsewhere; port : 0 for any free one
    Raises StudioError where the port is in use.
    """

    def __init__(self, host: str, port: int, title: str):
        # Also where a port is given: a host that is not this machine is an error of its own.
        free = _free_port(host, 0, f"host = {host}", "a name or IPv4 address of this machine, or 0.0.0.0")
        another = "another port with --port, or --port 0 for any free one"
        port = _free_port(host, port or free, f"{host}:{port or free}", another)
        token = secrets.token_urlsafe(12)
        console = rich.get_console()
        console.quiet = True  # viser prints panels of its own
        warnings.filterwarnings("ignore", "Queued a .* on a closed connection")  # to a page that has just gone
        with require_token(token, port):
            self.server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        # viser silently takes the next port when another program was faster.
        if self.server.get_port() != port:
            self.server.stop()
            raise StudioError(f"port {port} is in use; give another one with --port, or --port 0 for any free one")
        shown = "localhost" if host in ("127.0.0.1", "0.0.0.0", "::", "") else host
        self.address = f"http://{shown}:{port}/?token={token}"
        gui, scene = self.server.gui, self.server.scene
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=(0, 114, 178), control_width="medium")
        scene.set_up_direction("+z")
        scene.configure_environment_map(None)
        scene.configure_default_lights(True, cast_shadow=False)
        scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(185, 185, 194), intensity=1.0)
        self.panel = Widgets(self.server)
        self._standing: list[Any] = []
        self._moving: list[Any] = []
        self._aim: dict[str, Any] = {}
        self._met: dict[int, float] = {}
        self._narrow: dict[int, float] = {}  # by page: width by height, at most BREADTH
        self.server.on_client_connect(self._meet)
        self._turn = 0

    @property
    def clients(self) -> int:
        """Open pages."""
        return len(self.server.get_clients())

    def atomic(self) -> Any:
        """Let everything that is sent inside appear at once."""
        return self.server.atomic()

    def stop(self) -> None:
        """Close the page at once."""
        self.server.stop()

    def clear(self, moving: bool = True) -> None:
        """Remove the scene, and the agents with all that is drawn about them."""
        for node in [*self._standing, *(self._moving if moving else [])]:
            node.remove()
        self._standing = []
        if moving:
            self._moving = []

    def look_at(self, centre: NDArray[Any], span: float, flat: bool) -> None:
        """Put every camera where `span` m around a centre fill it: straight above, or from the south."""
        field = FLAT_FIELD_OF_VIEW if flat else SPACE_FIELD_OF_VIEW
        far = (1.15 if flat else 1.45) * span / np.tan(0.5 * field)
        offset = np.array([0.0, -0.001, 1.0]) if flat else np.array([0.25, -0.8, 0.55])
        place = centre + offset / np.linalg.norm(offset) * far
        self._aim = {
            "position": tuple(place), "look_at": tuple(centre), "fov": field, "near": 0.01 * far, "far": 20.0 * far,
        }  # fmt: skip
        self._point(self.server.initial_camera)
        for client in self.server.get_clients().values():
            self._welcome(client)

    def _meet(self, client: Any) -> None:
        """Point the camera of a page that opens, and listen for its size."""
        self._welcome(client)
        client.camera.on_update(lambda _: self._sized(client))

    def _sized(self, client: Any) -> None:
        """Point the camera again when a page becomes narrow or wide: pages report their size with their camera."""
        narrow = min(client.camera.aspect, FULL_ASPECT)
        if abs(narrow - self._narrow.get(client.client_id, FULL_ASPECT)) > MIN_ASPECT_CHANGE:
            self._narrow[client.client_id] = narrow
            self._welcome(client)

    def _point(self, camera: Any, aspect: float = FULL_ASPECT) -> None:
        for name, value in camera_for_aspect(self._aim, aspect).items():  # the position first: it takes look_at along
            setattr(camera, name, value)

    def _welcome(self, client: Any) -> None:
        """Point the camera of one page; camera messages from before its answer are outdated."""
        self._met[client.client_id] = time.monotonic()
        self._point(client.camera, self._narrow.get(client.client_id, FULL_ASPECT))

    def ground(self, name: str, span: float, height: float, centre: NDArray[Any]) -> None:
        """Draw a grid of 20 by 20 squares."""
        cell = _round_length(span / 5.0)
        self._standing.append(
            self.server.scene.add_grid(
                f"/world/{name}", 40.0 * cell, 40.0 * cell, plane="xy", cell_size=cell, section_size=5.0 * cell,
                cell_color=(225, 228, 232), section_color=(200, 205, 212), fade_distance=1e6, fade_strength=0.0,
                position=(float(centre[0]), float(centre[1]), height - 0.01 * span),
            )
        )  # fmt: skip

    def follow(self, target: NDArray[Any]) -> None:
        """Let the camera of every open page look at a place, m, from where it looks now."""
        for client in self.server.get_clients().values():
            if time.monotonic() - self._met.get(client.client_id, 0.0) < SETTLING_SECONDS:
                continue
            camera = client.camera  # what it says of itself is late, so only the difference is taken from it
            offset = np.asarray(camera.position) - np.asarray(camera.look_at)
            camera.position = tuple(target + offset)
            camera.look_at = tuple(target)

    def solid(self, solid: SceneSolid, opacity: float | None = None) -> None:
        """Draw a solid."""
        self._standing.append(
            self.server.scene.add_mesh_simple(
                f"/world/{solid.name}", solid.vertices.astype(np.float32), solid.faces, color=solid.colour,
                flat_shading=True, side="double", opacity=opacity, cast_shadow=False,
            )
        )  # fmt: skip

    def lines(self, lines: SceneLines, width: float = 2.0) -> None:
        """Draw lines that stay."""
        self._standing.append(self._segments(f"/world/{lines.name}", lines.points, lines.colour, width))

    def label(self, text: str, position: NDArray[Any]) -> None:
        """Write words at a place, m."""
        self._standing.append(self.server.scene.add_label(f"/world/label_{text}", text, position=_to_tuple(position)))

    def handle(
        self, name: str, position: NDArray[Any], size: float, flat: bool, on_move: Callable[[NDArray[Any]], None]
    ) -> None:
        """Add a handle of a size, m, by which something is dragged; the callback gets the place where it was
        dropped.
        """
        made = self.server.scene.add_transform_controls(
            f"/world/{name}", scale=size, disable_rotations=True, active_axes=(True, True, not flat),
            position=_to_tuple(position), depth_test=False,
        )  # fmt: skip

        @made.on_update
        def _(event: Any) -> None:
            if event.phase == "end":
                on_move(np.array(event.target.position, float))

        self._standing.append(made)

    def _segments(self, name: str, points: NDArray[Any], colour: Any, width: float) -> Any:
        return self.server.scene.add_line_segments(
            name, points.astype(np.float32), colour, thickness=width, thickness_units="screen"
        )

    def agents(self, count: int, size: float, lines: Mapping[str, tuple[Any, float]]) -> None:
        """Make so many darts of a size, m; their trails; and kinds of lines about them by name: colour and width."""
        vertices, faces = dart_mesh(size)
        at = np.zeros((count, 3), np.float32)
        self._agents = self.server.scene.add_batched_meshes_simple(
            "/agents", vertices, faces, batched_wxyzs=np.tile(np.array(NO_ROTATION, np.float32), (count, 1)),
            batched_positions=at, batched_colors=np.full((count, 3), 128, np.uint8), flat_shading=True, lod="off",
            cast_shadow=False,
        )  # fmt: skip
        blank = np.zeros((count, 2, 3), np.float32)
        tones = np.zeros((count, 2, 3), np.uint8)
        self._trails = [self._segments(f"/trails/{t}", blank, tones, 1.5) for t in range(TRAIL_PIECES)]
        # a page takes colours of single segments only where the first ones had colours of their own
        few = np.zeros((FIRST_SEGMENTS, 2, 3), np.float32), np.zeros((FIRST_SEGMENTS, 2, 3), np.uint8)
        self._extra = {name: self._segments(f"/{name}", *few, width) for name, (_, width) in lines.items()}
        self._tone = {name: np.array(colour) for name, (colour, _) in lines.items()}
        self._bare = set(self._extra)
        self._room = dict.fromkeys(self._extra, FIRST_SEGMENTS)  # segments that each kind holds
        self._moving += [self._agents, *self._trails, *self._extra.values()]

    def move(self, position: NDArray[Any], turn: NDArray[Any], colour: NDArray[Any]) -> None:
        """Move all agents: positions (agent, 3) m, quaternions (agent, 4), colours (agent, 3)."""
        self._agents.batched_positions = position
        self._agents.batched_wxyzs = turn
        self._agents.batched_colors = _linear_light(colour)

    def trail(self, begin: NDArray[Any], end: NDArray[Any], colour: NDArray[Any], is_complete: bool) -> None:
        """Rewrite the newest piece of every trail; once it is complete, the next call reuses the oldest piece."""
        node = self._trails[self._turn % TRAIL_PIECES]
        self._turn += is_complete
        node.points = np.stack([begin, end], 1)
        # Trails are mixed with the background instead of being transparent: segments of viser have
        # no opacity each.
        pale = _linear_light(0.45 * colour + 0.55 * 235)
        node.colors = np.repeat(pale[:, None], 2, axis=1)

    def no_trails(self) -> None:
        """Remove all trails."""
        blank = np.zeros((self._trails[0].points.shape[0], 2, 3), np.float32)
        for node in self._trails:
            node.points = blank

    def extra(self, name: str, points: NDArray[Any], colour: NDArray[Any] | None = None) -> None:
        """Draw lines of a kind: (segment, 2, 3) m, each in its own colour (segment, 3) if given; none clears them."""
        node = self._extra[name]
        if not len(points) and name in self._bare:
            return
        (self._bare.discard if len(points) else self._bare.add)(name)
        # a page that gets more places than colours draws the rest pale: both keep one size, which
        # seldom grows
        room = self._room[name] = max(self._room[name], 1 << (max(len(points), 1) - 1).bit_length())
        places, tones = np.zeros((room, 2, 3), np.float32), np.zeros((room, 2, 3), np.uint8)
        places[: len(points)] = points
        if len(points):
            places[len(points) :] = points[0, 0]
            given = self._tone[name] if colour is None else np.asarray(colour)
            tones[: len(points)] = np.broadcast_to(_linear_light(given), (len(points), 3))[:, None]
        node.colors, node.points = tones, places

    def on_click(self, callback: Callable[[NDArray[Any], NDArray[Any]], None]) -> None:
        """Call back with each click into the scene: origin and direction of its ray."""

        @self.server.scene.on_click()
        def _(event: Any) -> None:
            callback(np.array(event.ray_origin), np.array(event.ray_direction))


def _to_tuple(position: NDArray[Any]) -> tuple[float, float, float]:
    x, y, z = (float(c) for c in position)
    return x, y, z


def _linear_light(colour: NDArray[Any]) -> NDArray[np.uint8]:
    """Decode sRGB (IEC 61966-2-1) colours of many meshes or segments, which viser takes as linear light."""
    share = np.asarray(colour, float) / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.round(255.0 * light), np.uint8)


def _free_port(host: str, port: int, subject: str, instead: str) -> int:
    """Return a port, 0 for any free one. Raise StudioError where nothing can listen; viser would take the next one."""
    with socket.socket() as probe:
        # A port that a page has just left may be used again at once, as viser does.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise StudioError(f"{subject}: {error.strerror or error}; give {instead}") from error
        return int(probe.getsockname()[1])


def _round_length(length: float) -> float:
    """Return 1, 2 or 5 times a power of ten near a length, m."""
    power = 10.0 ** np.floor(np.log10(max(length, 1e-9)))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(digit * power - length)) * power)


def camera_for_aspect(camera_aim: Mapping[str, Any], aspect: float) -> dict[str, Any]:
    """Move a camera for a page of an aspect (width by height), so that a narrow page sees as far sideways.

    The field of view is that of the height, so the camera of a telephone draws back until the width
    shows as much.
    """
    if not camera_aim or not 0.0 < aspect < FULL_ASPECT:
        return dict(camera_aim)
    # The field of view is that of the height: a narrow page would cut off the sides.
    closer = aspect / FULL_ASPECT
    target = np.asarray(camera_aim["look_at"])
    place = target + (np.asarray(camera_aim["position"]) - target) / closer
    return {
        **camera_aim,
        "position": tuple(place),
        "near": camera_aim["near"] / closer,
        "far": camera_aim["far"] / closer,
    }


FRAMES_PER_PIECE = 6  # frames of one piece
Positions = NDArray[Any]


class Trails:
    """Trails of a scene.

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
        """Remove the trails: agents are elsewhere."""
        self._view.no_trails()
        self._piece_start = None

    def show(self, on: bool) -> None:
        """Draw trails from here on, or remove them."""
        self.shown = on
        self.forget()

    def draw(
        self,
        position: Positions,
        colours: Positions,
        start_of: Callable[[Positions], Positions] = lambda before: before,
    ) -> None:
        """Draw the newest piece up to positions (agent, 3), m, in the colours of the agents (agent, 3).

        start_of : where the agents were when the piece began → where it is drawn from, both (agent,
                   3)
        """
        done = False
        if self._piece_start is not None and self.shown:
            self._frame_count += 1
            done = self._frame_count % FRAMES_PER_PIECE == 0
            self._view.trail(start_of(self._piece_start), position, colours, done)
        if self._piece_start is None or done:
            self._piece_start = position


FOLLOW_NOTHING = "nothing"  # the first choice of what the camera follows; then all, then the selected one


class AgentScene:
    """Scene with agents, of a flight or of a fleet.

    links, follow_choice : what its controls say; trails : behind the agents; size : of an agent, m
    """

    follow_choices: tuple[str, str, str]

    def __init__(self, view: BrowserView, links: str):
        self.view, self.links, self.follow_choice = view, links, FOLLOW_NOTHING
        self.trails, self.size = Trails(view), 1.0

    def draw_agents(
        self, position: Positions, velocity: Positions, tone: NDArray[np.uint8], present: NDArray[np.bool_],
        selected: int | None, start_of: Callable[[Positions], Positions],
    ) -> None:  # fmt: skip
        """Draw all agents and their trails, and let the camera follow those that are present; (agent, ...) each."""
        trail = tone.copy()
        if selected is not None:
            tone[selected] = agent_colours.SELECTED_COLOUR
        self.view.move(position, velocity_quaternions(velocity), tone)
        self.trails.draw(position, trail, start_of)
        _, everyone, one = self.follow_choices
        if self.follow_choice == everyone and present.any():
            self.view.follow(position[present].mean(axis=0).astype(float))
        elif self.follow_choice == one and selected is not None and present[selected]:
            self.view.follow(position[selected].astype(float))

    def nearest_to_ray(self, position: Positions, origin: NDArray[Any], direction: NDArray[Any]) -> int | None:
        """Return the agent nearest to a ray; None if none is near."""
        away = position - origin
        off = np.linalg.norm(away - np.maximum(away @ direction, 0.0)[:, None] * direction, axis=1)
        best = int(off.argmin())
        return best if off[best] < 2.0 * self.size else None


def next_selected(chosen: int | None, count: int, number: int) -> int:
    """Return the agent that is `count` on from the selected one, of a number of agents."""
    return ((-1 if chosen is None and count > 0 else chosen or 0) + count) % number


FRAMES_PER_SECOND = 30  # per second of real time
CHARTS_PER_SECOND = 5  # per second


class LivePage:
    """Page of a view: call `run` to draw in real time until `stop` or Ctrl-C.

    advance : goes on by some seconds of real time; True if anything moved
    answer  : waits some seconds of real time, or until actions of controls ran; True if any ran
    """

    def __init__(self, view: BrowserView, advance: Callable[[float], bool], answer: Callable[[float], bool]):
        self.view, self._advance, self._answer, self._is_running = view, advance, answer, True

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        raise NotImplementedError

    def stop(self) -> None:
        """End `run` after the frame at hand; from any thread."""
        self._is_running = False

    def run(self) -> None:
        """Go on and draw in real time until the page is stopped."""
        now = drawn = refreshed = time.perf_counter()
        acted = False
        while self._is_running:
            last, now = now, time.perf_counter()
            moved = self._advance(now - last)
            refresh = now - refreshed >= 1.0 / CHARTS_PER_SECOND
            if moved or acted or refresh:
                self.frame(refresh)
            refreshed = now if refresh else refreshed
            # A late frame is not caught up: after a pause of the machine the page goes on at its
            # usual rate.
            drawn = max(drawn + 1.0 / FRAMES_PER_SECOND, now)
            acted = self._answer(0.001)  # the threads of the page's server come first
            while self._is_running and (left := drawn - time.perf_counter()) > 0.0:
                acted = self._answer(left) or acted
