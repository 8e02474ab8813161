"""Drawing: what stands, and the flocks of all sides frame by frame: darts, trails, links, collisions."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core.radio import Radio
from airflock.core.reception import share
from airflock.parts.metrics.registry import numbers_of
from airflock.studio import measures
from airflock.studio.collisions import Collisions
from airflock.studio.player import Player
from airflock.studio.shading import Shading
from airflock.studio.side import BELOW, Side
from airflock.studio.trails import Trails
from airflock.studio.view import View
from airflock.view.stage import colours
from airflock.view.stage.scene import Lines, Solid, Stage, stage_of, turned

OPEN = 8.0  # s; half of what is seen of an open world is at least the way flown in this time
MARGIN = 20.0  # a dart of a flock of a hundred is so many times smaller than half the picture
BROAD = 0.8  # of the half width of two sides must fit the height of a page, which is broader than high
APART = 2.3  # half widths between the middles of two sides
FOLLOWED = ("nothing", "the flock", "the selected agent")
LINKS = ("none", "three nearest", "radio")
NAMES = "AB"
FLASH = 15  # frames for which a collision is shown
PALE = 240.0  # of a link on which no packet arrives


class Flock:
    """One side as it is drawn: where its scene lies, and who collides."""

    def __init__(self, side: Side, offset: NDArray[Any]):
        self.side, self.offset = side, offset
        measured, scenario = side.scenario.measured_by(), side.scenario
        counts = {"n_coll", "phi_coll", "collisions"} & set(numbers_of(scenario.measures, measured))
        self.near = float(measured.r_coll) if counts else 0.0  # fish have no collisions
        self.period = measures.period_of(scenario)
        self.position, self.velocity = side.motion
        self.pairs = measures.Pairs(self.position, self.period)

    def look(self) -> None:
        """Take the present moment; of a flight that stopped flying the last one that can be drawn stays."""
        position, velocity = self.side.motion
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            return
        self.position, self.velocity = position, velocity
        self.pairs = measures.Pairs(self.position, self.period)

    def links(self, kind: str) -> tuple[NDArray[Any], NDArray[np.uint8]]:
        """Lines between agents, and their colours: paler where a packet is more likely lost."""
        tone = np.array(colours.LINES["links"][0])
        if kind == "radio":
            k = self.side.scenario.radio
            pairs, length = self.pairs.linked(min(k.range, 1e8))
            arrives = np.interp(length, *arrival(self.side.scenario.transceiver, k))
            points = self.position[pairs]
            tones = PALE - arrives[:, None] * (PALE - 0.8 * tone)
        else:
            points = self.pairs.neighbours() if kind == LINKS[1] else np.zeros((0, 2, 3))
            tones = np.tile(tone, (len(points), 1))
        seen = (points[..., 2] > 0.5 * BELOW).all(axis=1)
        return points[seen] + self.offset, np.asarray(tones, np.uint8).reshape(-1, 3)[seen]


@lru_cache(maxsize=16)
def arrival(radio: Radio, k: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Distances, m, and the probability that one packet of each rate arrives over them where nobody else sends."""
    far = np.linspace(0.0, min(k.range, 4.0 * max(k.loss_at, getattr(k, "far", 0.0))), 129)
    return far, np.array([share(radio, k, r) for r in far.tolist()])


class Drawing:
    """The scene of a page."""

    def __init__(self, player: Player, view: View):
        self.player, self.view = player, view
        self.shading, self.links, self.follow = Shading(), LINKS[0], FOLLOWED[0]
        self.trails = Trails(view)
        self.collisions = Collisions()
        self.handles: Any = None  # is asked for goals that can be dragged: (player, drawing) → None
        self.rebuild()

    # ----------------------------------------------------------------------------------------------- what stands

    def rebuild(self) -> None:
        """Draw the worlds of all sides anew, with their agents as they are."""
        view, sides = self.view, self.player.sides
        self.stages = [self._stage(side) for side in sides]
        self.span = max(stage.span for stage in self.stages)
        self.flat = sides[0].scenario.dimensions == 2
        step = np.array([APART * self.span, 0.0, 0.0])
        middle = self.stages[0].centre
        self.flocks = [
            Flock(side, number * step + (middle - stage.centre) * (1.0, 1.0, 0.0) * bool(number))
            for number, (side, stage) in enumerate(zip(sides, self.stages, strict=True))
        ]
        self.top = max(1.5 * usual_speed(side) for side in sides)
        count = sum(len(flock.position) for flock in self.flocks)
        self.size = self.span * min(1.0, (100.0 / count) ** 0.25) / MARGIN
        with view.atomic():
            view.clear()
            self._build()
            view.agents(count, self.size, colours.LINES)
        wide = self.span + 0.5 * float(step[0]) * (len(sides) - 1)
        beside = 0.3 * wide * np.array([1.0, 0.0 if self.flat else 0.3, 0.0])  # of the panel
        share = 1.0 if len(sides) == 1 else BROAD
        view.look_at(middle + 0.5 * step * (len(sides) - 1) + beside, share * wide, self.flat)
        self.trails.restart()
        self._alert = np.zeros(count, int)
        self._drawn = list(sides)

    def _stage(self, side: Side) -> Stage:
        stage = stage_of(side.scenario, side.motion[0][side.flight.present])
        if side.scenario.world.arena == "none" and not stage.solids:
            stage = stage._replace(span=max(stage.span, OPEN * usual_speed(side)))
        return stage

    def _build(self) -> None:
        """Everything that stands, each side at its place."""
        view = self.view
        self._worlds = [_world(side) for side in self.player.sides]
        middle = np.mean([s.centre + f.offset for s, f in zip(self.stages, self.flocks, strict=True)], axis=0)
        view.ground("ground", self.span * len(self.stages), self.stages[0].height[0], middle)
        for number, (stage, flock) in enumerate(zip(self.stages, self.flocks, strict=True)):
            mark, shift = NAMES[number], flock.offset
            for solid in stage.solids:
                view.solid(Solid(f"{mark}/{solid.name}", solid.vertices + shift, solid.faces, solid.colour))
            for lines in stage.lines:
                view.lines(Lines(f"{mark}/{lines.name}", lines.points + shift, lines.colour))
            if len(self.stages) > 1:
                view.label(mark, stage.centre + shift + [0.0, 1.08 * self.span, 0.0])
        if self.handles is not None:
            self.handles(self)

    def rebuild_if_changed(self) -> None:
        """Draw what stands anew where it has changed: an obstacle was thrown in, a goal moved, a fork begun."""
        if self._sides_changed() or [_world(side) for side in self.player.sides] != self._worlds:
            self.rebuild_worlds()

    def rebuild_worlds(self) -> None:
        """Draw what stands anew, with the camera and the flocks as they are; of other sides than before, everything."""
        if self._sides_changed():
            self.rebuild()
            return
        self.stages = [self._stage(side)._replace(span=old.span, centre=old.centre)
                       for side, old in zip(self.player.sides, self.stages, strict=True)]  # fmt: skip
        with self.view.atomic():
            self.view.clear(moving=False)
            self._build()

    def _sides_changed(self) -> bool:
        sides, drawn = self.player.sides, self._drawn
        return len(sides) != len(drawn) or any(a is not b for a, b in zip(sides, drawn, strict=True))

    def forget(self) -> None:
        """Forget trails, and collisions that lie ahead: the flight went elsewhere."""
        self.trails.forget()
        self.collisions.back(self.player.time, len(self.player.sides))

    # -------------------------------------------------------------------------------------------------- frames

    def frame(self, chosen: int | None) -> None:
        """Draw the present moment; `chosen` counts through the agents of all sides."""
        flocks = self.flocks
        for flock in flocks:
            flock.look()
        position = np.vstack([flock.position + flock.offset for flock in flocks]).astype(np.float32)
        velocity = np.vstack([flock.velocity for flock in flocks])
        usual = float(np.quantile(np.sqrt((velocity**2).sum(1)), 0.95))
        self.top = max(self.top, 1.3 * usual if usual > self.top else 0.0)  # a start from rest says little
        tone = self.shading.of(flocks, velocity, self.top, self.stages[0].height).tones
        self._flash(tone)
        trail = tone.copy()
        if chosen is not None:
            tone[chosen] = colours.CHOSEN
        self.view.move(position, turned(velocity), tone)
        self.trails.draw(position, trail, lambda before: self._begin(before, position))
        there = np.concatenate([flock.side.flight.present for flock in flocks])
        if self.follow == FOLLOWED[1] and there.any():
            self.view.follow(position[there].mean(axis=0).astype(float))
        elif self.follow == FOLLOWED[2] and chosen is not None and there[chosen]:
            self.view.follow(position[chosen].astype(float))
        links = [flock.links(self.links) for flock in flocks]
        self.view.extra("links", np.vstack([points for points, _ in links]), np.vstack([tones for _, tones in links]))

    def _begin(self, before: NDArray[Any], position: NDArray[Any]) -> NDArray[Any]:
        """Where a piece of trail begins: where the agent was, or here if it went through a periodic face."""
        begin, first = before.copy(), 0
        for flock in self.flocks:
            part = slice(first, first + len(flock.position))
            if flock.period is not None:
                half = 0.5 * np.array([side or np.inf for side in flock.period])
                far = (np.abs(position[part] - begin[part]) > half).any(axis=1)
                begin[part][far] = position[part][far]
            first = part.stop
        gone = (position[:, 2] <= 0.5 * BELOW) | (begin[:, 2] <= 0.5 * BELOW)
        begin[gone] = position[gone]
        return begin

    def _flash(self, tone: NDArray[np.uint8]) -> None:
        """Colour who collides, for half a second at least, and list new collisions."""
        first = 0
        self._alert = np.maximum(self._alert - 1, 0)
        for number, flock in enumerate(self.flocks):
            touching = flock.pairs.within(flock.near)
            self._alert[first + touching.ravel()] = FLASH
            self.collisions.see(flock.side.flight.time, number, map(tuple, np.sort(touching, axis=1).tolist()))
            first += len(flock.position)
        tone[self._alert > 0] = colours.ALERT

    def whose(self, chosen: int) -> tuple[int, int]:
        """Side and number of an agent counted through all sides."""
        for number, flock in enumerate(self.flocks):
            if chosen < len(flock.position):
                return number, chosen
            chosen -= len(flock.position)
        raise IndexError(chosen)

    @property
    def places(self) -> NDArray[Any]:
        """Places in the scene of the agents of all sides, (agent, 3) m."""
        return np.vstack([flock.position + flock.offset for flock in self.flocks])


def usual_speed(side: Side) -> float:
    """Speed at which a flock may be expected to fly, m/s: what its law prefers, or at least what it flies at now."""
    scenario = side.scenario
    known = scenario.model.preferred_speed or (lambda _: scenario.metrics.v_flock or 0.0)
    now = float(np.sqrt((side.motion[1] ** 2).sum(1)).max()) / 1.3
    return max(float(known(scenario.parameters)), now) or float(scenario.measured_by().v_flock or 1.0)


def _world(side: Side) -> Any:
    """What tells whether a side's world looks as it was drawn."""
    scenario = side.scenario
    return scenario.world, scenario.scene, scenario.goals
