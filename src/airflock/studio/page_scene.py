"""Scene of a flight page: solids, and the flocks of all panes frame by frame: darts, trails, links, collisions."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.core import Radio, arrival_probability
from airflock.parts.metrics import scalar_names
from airflock.studio import page_measures as measures
from airflock.studio.browser_view import FOLLOW_NOTHING, AgentScene, BrowserView
from airflock.studio.flight_pane import ABSENT_HEIGHT, FlightPane
from airflock.studio.player import Player
from airflock.view import (
    MOTION_COLOURINGS,
    AgentColours,
    SceneGeometry,
    SceneLines,
    SceneSolid,
    agent_colours,
    cluster_distance,
    cluster_labels,
    scenario_geometry,
    varied_number_units,
)

MAX_KEPT = 2000  # collisions that are remembered; of more the latest
MAX_LISTED = 40  # that are listed: the latest
BOTH_PANES = -1  # side of what happened before a fork: it belongs to both
AgentPair = tuple[int, int]


class Collision(NamedTuple):
    """Two agents nearer than a collision: begin, s, pane, and agents."""

    time: float
    side: int
    first: int
    second: int


class CollisionList:
    """All collisions up to now, as a page saw them from frame to frame.

    A pair that stays near is one collision. What lies ahead of an earlier moment is forgotten when
    the flight goes back to it, for another future may follow; a pair that touches again is a
    collision again.
    """

    def __init__(self) -> None:
        self._last_seen: dict[Collision, float] = {}  # in the order of their begin; when each was last seen, s
        self._ongoing: dict[tuple[int, AgentPair], Collision] = {}

    @property
    def listed(self) -> list[Collision]:
        """Return the latest collisions, newest first."""
        return sorted(self._last_seen, reverse=True)[:MAX_LISTED]

    def add_frame(self, time: float, pane: int, touching: Iterable[AgentPair]) -> None:
        """Add the pairs of a pane that are nearer than a collision at a time, s."""
        pairs = set(touching)
        for key in [key for key in self._ongoing if key[0] == pane and key[1] not in pairs]:
            del self._ongoing[key]
        for pair in sorted(pairs):
            found = self._ongoing.setdefault((pane, pair), Collision(time, pane, *pair))
            self._last_seen[found] = time
        # A dict keeps the order of insertion, so the first entry is the oldest collision.
        while len(self._last_seen) > MAX_KEPT:
            del self._last_seen[next(iter(self._last_seen))]

    def go_back(self, time: float, pane_count: int) -> None:
        """Drop collisions that began after a time, s, and those of closed panes; the rest may continue."""
        kept = {c: min(last, time) for c, last in self._last_seen.items() if c.time <= time and c.side < pane_count}
        # Pairs that touched at that moment are still the same collision when the flight goes on
        # from there.
        still = [c for c, last in self._last_seen.items() if c in kept and last >= time]
        self._last_seen = kept
        self._ongoing = {
            (side, c[2:]): c for c in still for side in (range(pane_count) if c.side == BOTH_PANES else [c.side])
        }

    def fork(self) -> None:
        """Give a second pane the collisions of the first."""
        self._renamed({0: BOTH_PANES, BOTH_PANES: BOTH_PANES})

    def join(self, pane: int) -> None:
        """Keep the collisions of one pane."""
        self._renamed({pane: 0, BOTH_PANES: 0})

    def _renamed(self, names: dict[int, int]) -> None:
        going = {c: key for key, c in self._ongoing.items()}
        self._last_seen = {
            c._replace(side=names[c.side]): last for c, last in self._last_seen.items() if c.side in names
        }
        self._ongoing = {}
        for c, (_, pair) in going.items():
            if c.side in names:
                new = c._replace(side=names[c.side])
                self._ongoing |= {(side, pair): new for side in ((0, 1) if new.side == BOTH_PANES else (0,))}

    def clear(self) -> None:
        """Drop all: other flights."""
        self._last_seen, self._ongoing = {}, {}


UPDATE_FRAMES = 6  # frames; what changes slowly is looked at so often
MEASURED_COLOURINGS = {"nearest agent": "m", "position error": "m"}  # numbers of every flock, with their units
DRAG_COLOURING = "induced drag"
DRAG_ROWS = ("shared_power_drag", "shared_model_drag")  # where a driver keeps it


class AgentColouring:
    """Colouring of the agents.

    way : its name, one of `available_colourings`; shown : the last shade, whose key stands on the
          page
    """

    def __init__(self) -> None:
        self.name, self.shown = "speed", agent_colours.individual_colours(0)
        self._frames = 0

    def of(
        self, flocks: Sequence["DrawnFlock"], velocity: NDArray[Any], max_speed: float, height: tuple[float, float]
    ) -> AgentColours:
        """Return the colours of the agents of all flocks; velocity (agent, 3), m/s; top: of the scale of speeds,
        m/s.
        """
        way = self.name
        own = np.vstack([flock.position for flock in flocks])
        if way in MOTION_COLOURINGS:
            self.shown = agent_colours.motion_colours(way, own, velocity, max_speed, height)
            return self.shown
        self._frames += 1
        if self._frames % UPDATE_FRAMES and self.shown.name == way and len(self.shown.values) == len(own):
            return self.shown
        parts = [self._flock_colours(way, flock) for flock in flocks]
        if any(part is None for part in parts):  # another flight has no such value
            self.name = "speed"
            return self.of(flocks, velocity, max_speed, height)
        self.shown = joined_colours([part for part in parts if part is not None])
        return self.shown

    def _flock_colours(self, name: str, flock: "DrawnFlock") -> AgentColours | None:
        """Return the colours of one flock; None where it has no such value."""
        side, count = flock.side, len(flock.position)
        flight, scenario = side.flight, side.scenario
        if name == "agent":
            return agent_colours.individual_colours(count)
        if name == "cluster":
            box = None if flock.period is None else np.array([length or 1e9 for length in flock.period])
            return agent_colours.cluster_colours(cluster_labels(flock.position, cluster_distance(scenario), box))
        if name == "group":
            return agent_colours.group_colours(scenario.groups, count)
        if name == "fault":
            return agent_colours.fault_colours(flight.faults, flight.time, count)
        if name == "nearest agent":
            return agent_colours.number_colours(name, flock.pairs.apart(), "m") if count > 1 else None
        if name == "position error":
            off = (flight.measured - flight.state)[: scenario.dimensions]
            return agent_colours.number_colours(name, np.sqrt((off**2).sum(axis=0)), "m")
        if name == DRAG_COLOURING:
            memory = flight.snapshot().state
            known = [row for row in DRAG_ROWS if row in memory.driver.ROWS]
            return agent_colours.number_colours(name, memory.rows(known[:1])[0].astype(float), "N") if known else None
        return (
            agent_colours.varied_colours(scenario, name, flight.seed) if name in varied_number_units(scenario) else None
        )


def available_colourings(flocks: Sequence["DrawnFlock"]) -> tuple[str, ...]:
    """Return the names of the colourings of flocks."""
    found = [
        *MOTION_COLOURINGS,
        "agent",
        "cluster",
        *(["group"] if all(f.side.scenario.groups for f in flocks) else []),
        "fault",
    ]
    found += [way for way in MEASURED_COLOURINGS if all(len(f.position) > 1 for f in flocks)]
    if all(set(DRAG_ROWS) & set(f.side.flight.snapshot().state.driver.ROWS) for f in flocks):
        found.append(DRAG_COLOURING)
    numbers = [varied_number_units(flock.side.scenario) for flock in flocks]
    return (*found, *(key for key in numbers[0] if all(key in own for own in numbers)))


def joined_colours(parts: Sequence[AgentColours]) -> AgentColours:
    """Join the colours of several flocks: on one scale, with one list of names."""
    first = parts[0]
    if len(parts) == 1:
        return first
    names = tuple(dict.fromkeys(name for part in parts for name in part.names))
    values = [np.asarray(part.values) for part in parts]
    if names:
        values = [np.array([names.index(part.names[v]) if v >= 0 else -1 for v in part.values]) for part in parts]
    return first._replace(
        values=np.concatenate(values), names=names, low=min(part.low for part in parts),
        high=max(part.high for part in parts), note=" and ".join(dict.fromkeys(part.note for part in parts)),
    )  # fmt: skip


OPEN_WORLD_SECONDS = 8.0  # s; half of what is seen of an open world is at least the way flown in this time
DARTS_PER_HALF_WIDTH = 20.0  # a dart of a flock of a hundred is so many times smaller than half the picture
TWO_PANE_SHARE = 0.8  # of the half width of two sides must fit the height of a page, which is broader than high
PANE_DISTANCE = 2.3  # half widths between the middles of two sides
FOLLOW_CHOICES = (FOLLOW_NOTHING, "the flock", "the selected agent")
LINK_CHOICES = ("none", "three nearest", "radio")
PANE_NAMES = "AB"
FLASH_FRAMES = 15  # frames for which a collision is shown
LOST_LINK_GREY = 240.0  # of a link on which no packet arrives


class DrawnFlock:
    """Flock of one pane as it is drawn: position of its scene, and agents that collide."""

    def __init__(self, side: FlightPane, offset: NDArray[Any]):
        self.side, self.offset = side, offset
        measured, scenario = side.scenario.resolved_metrics(), side.scenario
        counts = {"n_coll", "phi_coll", "collisions"} & set(scalar_names(scenario.metrics.rule, measured))
        self.near = float(measured.r_coll) if counts else 0.0  # fish have no collisions
        self.period = measures.world_period(scenario)
        self._take(*side.motion)

    def _take(self, position: NDArray[Any], velocity: NDArray[Any]) -> None:
        self.position, self.velocity = position, velocity
        self.pairs = measures.AgentPairs(position, self.period)

    def look(self) -> None:
        """Take the present moment; for a flight that stopped, keep the last one that can be drawn."""
        motion = self.side.motion
        # A diverged flight keeps its last finite picture: nan would spread through the meshes of
        # the page.
        if np.isfinite(motion).all():
            self._take(*motion)

    def links(self, kind: str) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Return lines between agents, and their colours: paler where a packet is more likely lost."""
        tone = np.array(agent_colours.LINE_STYLES["links"][0])
        if kind == "radio":
            k = self.side.scenario.radio.numbers
            pairs, length = self.pairs.nearest_pairs_within(min(k.range, 1e8))
            arrives = np.interp(length, *arrival_curve(self.side.scenario.radio.rule, k))
            points = self.position[pairs]
            tones = LOST_LINK_GREY - arrives[:, None] * (LOST_LINK_GREY - 0.8 * tone)
        else:
            points = self.pairs.neighbours() if kind == LINK_CHOICES[1] else np.zeros((0, 2, 3))
            tones = np.tile(tone, (len(points), 1))
        # Agents that left are parked far below; no line may lead to them.
        seen = (points[..., 2] > 0.5 * ABSENT_HEIGHT).all(axis=1)
        return points[seen] + self.offset, np.asarray(tones, np.uint8).reshape(-1, 3)[seen]


@lru_cache(maxsize=16)
def arrival_curve(radio: Radio, k: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return distances, m, and the probability that a packet of each rate arrives if no other agent sends."""
    far = np.linspace(0.0, min(k.range, 4.0 * max(k.loss_at, getattr(k, "far", 0.0))), 129)
    return far, np.array([arrival_probability(radio, k, r) for r in far.tolist()])


class PageScene(AgentScene):
    """Scene of a page."""

    follow_choices = FOLLOW_CHOICES

    def __init__(self, player: Player, view: BrowserView):
        super().__init__(view, LINK_CHOICES[0])
        self.player, self.colouring, self.collisions = player, AgentColouring(), CollisionList()
        self.draw_handles: Any = None  # draws handles on goals that can be dragged: (player, drawing) → None
        self.rebuild()

    def rebuild(self) -> None:
        """Draw the worlds of all panes again, with their agents as they are."""
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
            view.agents(count, self.size, agent_colours.LINE_STYLES)
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
        """Draw all solids, each pane at its place."""
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
        """Draw the solids again if they changed: an obstacle was thrown in, a goal moved, a fork begun."""
        if self._panes_changed() or [_world_state(side) for side in self.player.sides] != self._worlds:
            self.rebuild_worlds()

    def rebuild_worlds(self) -> None:
        """Draw the solids again, keeping camera and flocks; for other panes than before, draw everything."""
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
        """Drop trails, and collisions that lie ahead: the flight is at another time."""
        self.trails.forget()
        self.collisions.go_back(self.player.time, len(self.player.sides))

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
        there = np.concatenate([flock.side.flight.present for flock in flocks])
        self.draw_agents(position, velocity, tone, there, selected, lambda before: self._trail_starts(before, position))
        links = [flock.links(self.links) for flock in flocks]
        self.view.extra("links", np.vstack([points for points, _ in links]), np.vstack([tones for _, tones in links]))

    def _trail_starts(self, before: NDArray[Any], position: NDArray[Any]) -> NDArray[Any]:
        """Return the begin of a trail piece: the last position, or this one after a periodic face."""
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
        """Colour colliding agents, for half a second at least, and list new collisions."""
        first = 0
        self._flash_frames_left = np.maximum(self._flash_frames_left - 1, 0)
        for number, flock in enumerate(self.flocks):
            touching = flock.pairs.within(flock.near)
            self._flash_frames_left[first + touching.ravel()] = FLASH_FRAMES
            self.collisions.add_frame(flock.side.flight.time, number, map(tuple, np.sort(touching, axis=1).tolist()))
            first += len(flock.position)
        tone[self._flash_frames_left > 0] = agent_colours.COLLISION_COLOUR

    def pane_and_agent(self, selected: int) -> tuple[int, int]:
        """Return pane and number of an agent counted through all panes."""
        for number, flock in enumerate(self.flocks):
            if selected < len(flock.position):
                return number, selected
            selected -= len(flock.position)
        raise IndexError(selected)

    @property
    def positions(self) -> NDArray[Any]:
        """Return positions in the scene of the agents of all panes, (agent, 3) m."""
        return np.vstack([flock.position + flock.offset for flock in self.flocks])


def expected_speed(pane: FlightPane) -> float:
    """Return the expected speed of a flock, m/s: the one its law prefers, at least the present one."""
    scenario = pane.scenario
    known = scenario.model.preferred_speed or (lambda _: scenario.metrics.v_flock or 0.0)
    now = float(np.sqrt((pane.motion[1] ** 2).sum(1)).max()) / 1.3
    return max(float(known(scenario.parameters)), now) or float(scenario.resolved_metrics().v_flock or 1.0)


def _world_state(side: FlightPane) -> Any:
    """Return values that change when a pane's world must be drawn again."""
    scenario = side.scenario
    return scenario.world, scenario.scene, scenario.goals
