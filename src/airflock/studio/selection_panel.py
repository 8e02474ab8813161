"""Selection panel: the clicked agent, its percepts, and a push."""

import html
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import AgentView as Seen, Model, argument_names
from airflock.engine import DriverState as Memory
from airflock.parts.faults import KINDS as KINDS_OF_FAULT
from airflock.scenarios import FlightWorld, GoalCourse, Scenario
from airflock.studio.flight_pane import FlightPane
from airflock.studio.page_panels import PagePanel, small_print_html
from airflock.studio.page_scene import PANE_NAMES
from airflock.view import agent_colours, arrow_lines, rays_and_command, term_name_and_unit, vector_values

if TYPE_CHECKING:
    from airflock.studio.flight_page import FlightPage

# ---- Percepts of the selected agent

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

        Terms of a law have units of their own, so each is as long as it is beside the strongest of its kind so far.
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

    A law with one vector for all that a neighbour does has two here: repulsion, which a neighbour of equal velocity
    would cause, too, and alignment, which is the rest.
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


# ---- Panel

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
