"""Drawing: what stands, and the flocks of all sides frame by frame: darts, trails, links, collisions."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import Radio, arrival_probability
from airflock.parts.metrics import scalar_names
from airflock.studio import measures
from airflock.studio.collisions import CollisionList
from airflock.studio.player import Player
from airflock.studio.shading import AgentColouring
from airflock.studio.side import ABSENT_HEIGHT, FlightPane
from airflock.studio.trails import Trails
from airflock.studio.view import BrowserView
from airflock.view import SceneGeometry, SceneLines, SceneSolid, colours, scenario_geometry, velocity_quaternions

OPEN_WORLD_SECONDS = 8.0  # s; half of what is seen of an open world is at least the way flown in this time
DARTS_PER_HALF_WIDTH = 20.0  # a dart of a flock of a hundred is so many times smaller than half the picture
TWO_PANE_SHARE = 0.8  # of the half width of two sides must fit the height of a page, which is broader than high
PANE_DISTANCE = 2.3  # half widths between the middles of two sides
FOLLOW_CHOICES = ("nothing", "the flock", "the selected agent")
LINK_CHOICES = ("none", "three nearest", "radio")
PANE_NAMES = "AB"
FLASH_FRAMES = 15  # frames for which a collision is shown
LOST_LINK_GREY = 240.0  # of a link on which no packet arrives


class DrawnFlock:
    """One side as it is drawn: where its scene lies, and who collides."""

    def __init__(self, side: FlightPane, offset: NDArray[Any]):
        self.side, self.offset = side, offset
        measured, scenario = side.scenario.resolved_metrics(), side.scenario
        counts = {"n_coll", "phi_coll", "collisions"} & set(scalar_names(scenario.measures, measured))
        self.near = float(measured.r_coll) if counts else 0.0  # fish have no collisions
        self.period = measures.world_period(scenario)
        self.position, self.velocity = side.motion
        self.pairs = measures.AgentPairs(self.position, self.period)

    def look(self) -> None:
        """Take the present moment; of a flight that stopped flying the last one that can be drawn stays."""
        position, velocity = self.side.motion
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            return
        self.position, self.velocity = position, velocity
        self.pairs = measures.AgentPairs(self.position, self.period)

    def links(self, kind: str) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Lines between agents, and their colours: paler where a packet is more likely lost."""
        tone = np.array(colours.LINE_STYLES["links"][0])
        if kind == "radio":
            k = self.side.scenario.radio
            pairs, length = self.pairs.nearest_pairs_within(min(k.range, 1e8))
            arrives = np.interp(length, *arrival_curve(self.side.scenario.transceiver, k))
            points = self.position[pairs]
            tones = LOST_LINK_GREY - arrives[:, None] * (LOST_LINK_GREY - 0.8 * tone)
        else:
            points = self.pairs.neighbours() if kind == LINK_CHOICES[1] else np.zeros((0, 2, 3))
            tones = np.tile(tone, (len(points), 1))
        seen = (points[..., 2] > 0.5 * ABSENT_HEIGHT).all(axis=1)
        return points[seen] + self.offset, np.asarray(tones, np.uint8).reshape(-1, 3)[seen]


@lru_cache(maxsize=16)
def arrival_curve(radio: Radio, k: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Distances, m, and the probability that one packet of each rate arrives over them where nobody else sends."""
    far = np.linspace(0.0, min(k.range, 4.0 * max(k.loss_at, getattr(k, "far", 0.0))), 129)
    return far, np.array([arrival_probability(radio, k, r) for r in far.tolist()])


class PageScene:
    """The scene of a page."""

    def __init__(self, player: Player, view: BrowserView):
        self.player, self.view = player, view
        self.colouring, self.links, self.follow_choice = AgentColouring(), LINK_CHOICES[0], FOLLOW_CHOICES[0]
        self.trails = Trails(view)
        self.collisions = CollisionList()
        self.draw_handles: Any = None  # is asked for goals that can be dragged: (player, drawing) → None
        self.rebuild()

    # ----------------------------------------------------------------------------------------------- what stands

    def rebuild(self) -> None:
        """Draw the worlds of all sides anew, with their agents as they are."""
        view, sides = self.view, self.player.sides
        self.stages = [self._scene_of_pane(side) for side in sides]
        self.span = max(stage.span for stage in self.stages)
        self.flat = sides[0].scenario.dimensions == 2
        step = np.array([PANE_DISTANCE * self.span, 0.0, 0.0])
        middle = self.stages[0].centre
        self.flocks = [
            DrawnFlock(side, number * step + (middle - stage.centre) * (1.0, 1.0, 0.0) * bool(number))
            for number, (side, stage) in enumerate(zip(sides, self.stages, strict=True))
        ]
        self.top = max(1.5 * expected_speed(side) for side in sides)
        count = sum(len(flock.position) for flock in self.flocks)
        self.size = self.span * min(1.0, (100.0 / count) ** 0.25) / DARTS_PER_HALF_WIDTH
        with view.atomic():
            view.clear()
            self._build()
            view.agents(count, self.size, colours.LINE_STYLES)
        wide = self.span + 0.5 * float(step[0]) * (len(sides) - 1)
        beside = 0.3 * wide * np.array([1.0, 0.0 if self.flat else 0.3, 0.0])  # of the panel
        share = 1.0 if len(sides) == 1 else TWO_PANE_SHARE
        view.look_at(middle + 0.5 * step * (len(sides) - 1) + beside, share * wide, self.flat)
        self.trails.restart()
        self._flash_frames_left = np.zeros(count, int)
        self._drawn_panes = list(sides)

    def _scene_of_pane(self, side: FlightPane) -> SceneGeometry:
        stage = scenario_geometry(side.scenario, side.motion[0][side.flight.present])
        if side.scenario.world.arena == "none" and not stage.solids:
            stage = stage._replace(span=max(stage.span, OPEN_WORLD_SECONDS * expected_speed(side)))
        return stage

    def _build(self) -> None:
        """Everything that stands, each side at its place."""
        view = self.view
        self._worlds = [_world_state(side) for side in self.player.sides]
        middle = np.mean([s.centre + f.offset for s, f in zip(self.stages, self.flocks, strict=True)], axis=0)
        view.ground("ground", self.span * len(self.stages), self.stages[0].height[0], middle)
        for number, (stage, flock) in enumerate(zip(self.stages, self.flocks, strict=True)):
            mark, shift = PANE_NAMES[number], flock.offset
            for solid in stage.solids:
                view.solid(SceneSolid(f"{mark}/{solid.name}", solid.vertices + shift, solid.faces, solid.colour))
            for lines in stage.lines:
                view.lines(SceneLines(f"{mark}/{lines.name}", lines.points + shift, lines.colour))
            if len(self.stages) > 1:
                view.label(mark, stage.centre + shift + [0.0, 1.08 * self.span, 0.0])
        if self.draw_handles is not None:
            self.draw_handles(self)

    def rebuild_if_changed(self) -> None:
        """Draw what stands anew where it has changed: an obstacle was thrown in, a goal moved, a fork begun."""
        if self._panes_changed() or [_world_state(side) for side in self.player.sides] != self._worlds:
            self.rebuild_worlds()

    def rebuild_worlds(self) -> None:
        """Draw what stands anew, with the camera and the flocks as they are; of other sides than before, everything."""
        if self._panes_changed():
            self.rebuild()
            return
        self.stages = [self._scene_of_pane(side)._replace(span=old.span, centre=old.centre)
                       for side, old in zip(self.player.sides, self.stages, strict=True)]  # fmt: skip
        with self.view.atomic():
            self.view.clear(moving=False)
            self._build()

    def _panes_changed(self) -> bool:
        sides, drawn = self.player.sides, self._drawn_panes
        return len(sides) != len(drawn) or any(a is not b for a, b in zip(sides, drawn, strict=True))

    def forget(self) -> None:
        """Forget trails, and collisions that lie ahead: the flight went elsewhere."""
        self.trails.forget()
        self.collisions.go_back(self.player.time, len(self.player.sides))

    # -------------------------------------------------------------------------------------------------- frames

    def frame(self, selected: int | None) -> None:
        """Draw the present moment; `chosen` counts through the agents of all sides."""
        flocks = self.flocks
        for flock in flocks:
            flock.look()
        position = np.vstack([flock.position + flock.offset for flock in flocks]).astype(np.float32)
        velocity = np.vstack([flock.velocity for flock in flocks])
        usual = float(np.quantile(np.sqrt((velocity**2).sum(1)), 0.95))
        self.top = max(self.top, 1.3 * usual if usual > self.top else 0.0)  # a start from rest says little
        tone = self.colouring.of(flocks, velocity, self.top, self.stages[0].height).colours
        self._flash(tone)
        trail = tone.copy()
        if selected is not None:
            tone[selected] = colours.SELECTED_COLOUR
        self.view.move(position, velocity_quaternions(velocity), tone)
        self.trails.draw(position, trail, lambda before: self._trail_starts(before, position))
        there = np.concatenate([flock.side.flight.present for flock in flocks])
        if self.follow_choice == FOLLOW_CHOICES[1] and there.any():
            self.view.follow(position[there].mean(axis=0).astype(float))
        elif self.follow_choice == FOLLOW_CHOICES[2] and selected is not None and there[selected]:
            self.view.follow(position[selected].astype(float))
        links = [flock.links(self.links) for flock in flocks]
        self.view.extra("links", np.vstack([points for points, _ in links]), np.vstack([tones for _, tones in links]))

    def _trail_starts(self, before: NDArray[Any], position: NDArray[Any]) -> NDArray[Any]:
        """Where a piece of trail begins: where the agent was, or here if it went through a periodic face."""
        begin, first = before.copy(), 0
        for flock in self.flocks:
            part = slice(first, first + len(flock.position))
            if flock.period is not None:
                half = 0.5 * np.array([side or np.inf for side in flock.period])
                far = (np.abs(position[part] - begin[part]) > half).any(axis=1)
                begin[part][far] = position[part][far]
            first = part.stop
        gone = (position[:, 2] <= 0.5 * ABSENT_HEIGHT) | (begin[:, 2] <= 0.5 * ABSENT_HEIGHT)
        begin[gone] = position[gone]
        return begin

    def _flash(self, tone: NDArray[np.uint8]) -> None:
        """Colour who collides, for half a second at least, and list new collisions."""
        first = 0
        self._flash_frames_left = np.maximum(self._flash_frames_left - 1, 0)
        for number, flock in enumerate(self.flocks):
            touching = flock.pairs.within(flock.near)
            self._flash_frames_left[first + touching.ravel()] = FLASH_FRAMES
            self.collisions.add_frame(flock.side.flight.time, number, map(tuple, np.sort(touching, axis=1).tolist()))
            first += len(flock.position)
        tone[self._flash_frames_left > 0] = colours.COLLISION_COLOUR

    def pane_and_agent(self, selected: int) -> tuple[int, int]:
        """Side and number of an agent counted through all sides."""
        for number, flock in enumerate(self.flocks):
            if selected < len(flock.position):
                return number, selected
            selected -= len(flock.position)
        raise IndexError(selected)

    @property
    def positions(self) -> NDArray[Any]:
        """Places in the scene of the agents of all sides, (agent, 3) m."""
        return np.vstack([flock.position + flock.offset for flock in self.flocks])


def expected_speed(pane: FlightPane) -> float:
    """Speed at which a flock may be expected to fly, m/s: what its law prefers, or at least what it flies at now."""
    scenario = pane.scenario
    known = scenario.model.preferred_speed or (lambda _: scenario.metrics.v_flock or 0.0)
    now = float(np.sqrt((pane.motion[1] ** 2).sum(1)).max()) / 1.3
    return max(float(known(scenario.parameters)), now) or float(scenario.resolved_metrics().v_flock or 1.0)


def _world_state(side: FlightPane) -> Any:
    """What tells whether a side's world looks as it was drawn."""
    scenario = side.scenario
    return scenario.world, scenario.scene, scenario.goals
