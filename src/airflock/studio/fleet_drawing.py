"""Drawing of a running fleet: its field, each drone where its packets say that it is, trails, links, colours."""

import numpy as np
from numpy.typing import NDArray

from airflock.drones.onboard.mission import Phase
from airflock.drones.onboard.peers import FRESH
from airflock.fleets.observer import Observer, on_ground
from airflock.studio import measures
from airflock.studio.side import BELOW, SPACED
from airflock.studio.trails import Trails
from airflock.studio.view import View
from airflock.view.stage import colours, shades
from airflock.view.stage.field import field_of
from airflock.view.stage.scene import turned
from airflock.view.stage.shades import Shade

# phases in the air, in the order of their colours; on the ground a drone is grey
PHASES = (
    Phase.FLOCK, Phase.GATHER, Phase.RETURN, Phase.TAKEOFF, Phase.GOTO, Phase.HOLD, Phase.MANUAL, Phase.LAND,
    Phase.FAULT,
)  # fmt: skip
WAYS = ("phase", "speed", "heading", "height", "battery", "neighbours heard", "packet age", "fault", "drone")
LINKS = ("packets that arrive", "three nearest", "none")
FOLLOWED = ("nothing", "the fleet", "the selected drone")
MARGIN = 26.0  # darts in half the picture
BESIDE = np.array([0.2, 0.1, 0.0])  # half widths; the panel stands there
ONE_WAY = 225  # grey of a link on which packets arrive one way only


class FleetDrawing:
    """The scene of a page that watches a fleet.

    way, links, follow : what its controls say; trails : behind the drones
    shown : the last shade, whose key stands on the page
    """

    def __init__(self, observer: Observer, view: View):
        self.observer, self.view = observer, view
        self.way, self.links, self.follow, self.trails = WAYS[0], LINKS[0], FOLLOWED[0], Trails(view)
        self.members = observer.card.members
        self.field = field_of(observer.card)
        self.size = self.field.span * min(1.0, (100.0 / len(self.members)) ** 0.25) / MARGIN
        self.shown = shades.of_agents(0)
        self._build()

    def _build(self) -> None:
        view, field = self.view, self.field
        with view.atomic():
            view.ground("ground", field.span, 0.0, field.centre * (1.0, 1.0, 0.0))
            for solid in field.solids:
                view.solid(solid)
            for lines in field.lines:
                view.lines(lines)
            view.agents(len(self.members), self.size, {kind: colours.LINES[kind] for kind in ("links", "heard")})
        view.look_at(field.centre + field.span * BESIDE, field.span, False)

    def frame(self, now: float, chosen: int | None) -> None:
        """Draw the fleet as it is known now; `chosen`: place of a drone among the members."""
        position, velocity, known = self._motion(now)
        self.shown = self._shade(now, velocity, position)
        tone = self.shown.tones
        tone[self._silent(now)] = shades.BLANK
        trail = tone.copy()
        if chosen is not None:
            tone[chosen] = colours.CHOSEN
        self.view.move(position, turned(velocity), tone)
        self.trails.draw(
            position, trail, lambda before: np.where((before[:, 2] <= 0.5 * BELOW)[:, None], position, before)
        )
        self._lines(now, position, known, chosen)
        if self.follow == FOLLOWED[1] and known.any():
            self.view.follow(position[known].mean(axis=0).astype(float))
        elif self.follow == FOLLOWED[2] and chosen is not None and known[chosen]:
            self.view.follow(position[chosen].astype(float))

    def places(self, now: float) -> NDArray[np.float64]:
        """Places of all members (drone, 3), m; far below who was never heard."""
        return self._motion(now)[0].astype(float)

    def _motion(self, now: float) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Positions and velocities (drone, 3), and who was ever heard."""
        count = len(self.members)
        position, velocity, known = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32), []
        for number, member in enumerate(self.members):
            place, peer = self.observer.place(member, now), self.observer.peers[member]
            known.append(place is not None)
            position[number] = (SPACED * number, 0.0, BELOW) if place is None else place
            if peer.state is not None:
                velocity[number] = peer.state[3:]
        return position, velocity, np.array(known)

    def _silent(self, now: float) -> list[int]:
        heard = set(self.observer.heard(now))
        return [number for number, member in enumerate(self.members) if member not in heard]

    def _lines(self, now: float, position: NDArray[np.float32], known: NDArray[np.bool_], chosen: int | None) -> None:
        index = {member: number for number, member in enumerate(self.members)}
        links = {(index[a], index[b]): both for (a, b), both in self.observer.links(now).items()}
        links = {pair: both for pair, both in links.items() if known[list(pair)].all()}
        heard = np.zeros((0, 2, 3), np.float32)
        if chosen is not None:
            heard = position[[pair for pair in links if chosen in pair]].reshape(-1, 2, 3)
        points, tones = np.zeros((0, 2, 3), np.float32), np.zeros((0, 3), np.uint8)
        if self.links == LINKS[0] and links:
            points = position[list(links)]
            dark = np.array(colours.LINES["links"][0])
            tones = np.array([dark if both else (ONE_WAY,) * 3 for both in links.values()], np.uint8)
        elif self.links == LINKS[1] and known.sum() > 1:
            points = measures.Pairs(position[known]).neighbours()
            tones = np.tile(np.array(colours.LINES["links"][0], np.uint8), (len(points), 1))
        self.view.extra("links", points, tones)
        self.view.extra("heard", heard)

    def _shade(self, now: float, velocity: NDArray[np.float32], position: NDArray[np.float32]) -> Shade:
        peers, card, way = [self.observer.peers[member] for member in self.members], self.observer.card, self.way
        if way == "phase":
            values = [-1 if on_ground(peer.phase) else PHASES.index(peer.phase) for peer in peers]
            names = tuple(phase.name.lower() for phase in PHASES)
            return Shade(way, shades.NAMES, np.array(values), names=names, told="on the ground, or silent")
        if way == "fault":
            faults = self.observer.faults
            values = [next((k for k, who in enumerate(faults.values()) if m in who), -1) for m in self.members]
            return Shade(way, shades.NAMES, np.array(values), names=tuple(faults), told="none, or silent")
        if way == "drone":
            return shades.of_agents(len(peers))
        if way in shades.MOTION:
            return shades.of_motion(way, position, velocity, card.safety.speed_max, (0.0, card.high))
        told = [peer.status for peer in peers]
        if way == "battery":
            return Shade(way, shades.SCALE, _numbers([s and s.battery for s in told]), 0.0, 100.0, "%")
        if way == "neighbours heard":
            most = max(len(peers) - 1.0, 1.0)
            return Shade(way, shades.SCALE, _numbers([s and s.peers for s in told]), 0.0, most)
        return Shade(way, shades.SCALE, np.array([now - peer.at for peer in peers]), 0.0, FRESH, "s")


def _numbers(values: list[int | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], float)
