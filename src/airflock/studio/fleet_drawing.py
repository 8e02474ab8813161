"""Drawing of a running fleet: its field, each drone where its packets say that it is, trails, links, colours."""

import numpy as np
from numpy.typing import NDArray

from airflock.drones import HEARD_WITHIN, MissionPhase
from airflock.fleets import FleetObserver, is_on_ground
from airflock.studio import measures
from airflock.studio.side import ABSENT_HEIGHT, ABSENT_SPACING
from airflock.studio.trails import Trails
from airflock.studio.view import BrowserView
from airflock.view import AgentColours, card_scene, colours, shades, velocity_quaternions

# phases in the air, in the order of their colours; on the ground a drone is grey
AIR_PHASES = (
    MissionPhase.FLOCK,
    MissionPhase.GATHER,
    MissionPhase.RETURN,
    MissionPhase.TAKEOFF,
    MissionPhase.GOTO,
    MissionPhase.HOLD,
    MissionPhase.MANUAL,
    MissionPhase.LAND,
    MissionPhase.FAULT,
)
FLEET_COLOURINGS = (
    "phase",
    "speed",
    "heading",
    "height",
    "battery",
    "neighbours heard",
    "packet age",
    "fault",
    "drone",
)
FLEET_LINK_CHOICES = ("packets that arrive", "three nearest", "none")
FLEET_FOLLOW_CHOICES = ("nothing", "the fleet", "the selected drone")
DARTS_PER_HALF_WIDTH = 26.0  # darts in half the picture
PANEL_OFFSET = np.array([0.2, 0.1, 0.0])  # half widths; the panel stands there
ONE_WAY_GREY = 225  # grey of a link on which packets arrive one way only


class FleetScene:
    """The scene of a page that watches a fleet.

    way, links, follow : what its controls say; trails : behind the drones
    shown : the last shade, whose key stands on the page
    """

    def __init__(self, observer: FleetObserver, view: BrowserView):
        self.observer, self.view = observer, view
        self.colouring, self.links, self.follow_choice, self.trails = (
            FLEET_COLOURINGS[0],
            FLEET_LINK_CHOICES[0],
            FLEET_FOLLOW_CHOICES[0],
            Trails(view),
        )
        self.members = observer.card.members
        self.field = card_scene(observer.card)
        self.size = self.field.span * min(1.0, (100.0 / len(self.members)) ** 0.25) / DARTS_PER_HALF_WIDTH
        self.shown = shades.individual_colours(0)
        self._build()

    def _build(self) -> None:
        view, field = self.view, self.field
        with view.atomic():
            view.ground("ground", field.span, 0.0, field.centre * (1.0, 1.0, 0.0))
            for solid in field.solids:
                view.solid(solid)
            for lines in field.lines:
                view.lines(lines)
            view.agents(len(self.members), self.size, {kind: colours.LINE_STYLES[kind] for kind in ("links", "heard")})
        view.look_at(field.centre + field.span * PANEL_OFFSET, field.span, False)

    def frame(self, now: float, selected: int | None) -> None:
        """Draw the fleet as it is known now; `chosen`: place of a drone among the members."""
        position, velocity, known = self._motion(now)
        self.shown = self._agent_colours(now, velocity, position)
        tone = self.shown.colours
        tone[self._silent(now)] = shades.NO_VALUE_COLOUR
        trail = tone.copy()
        if selected is not None:
            tone[selected] = colours.SELECTED_COLOUR
        self.view.move(position, velocity_quaternions(velocity), tone)
        self.trails.draw(
            position, trail, lambda before: np.where((before[:, 2] <= 0.5 * ABSENT_HEIGHT)[:, None], position, before)
        )
        self._lines(now, position, known, selected)
        if self.follow_choice == FLEET_FOLLOW_CHOICES[1] and known.any():
            self.view.follow(position[known].mean(axis=0).astype(float))
        elif self.follow_choice == FLEET_FOLLOW_CHOICES[2] and selected is not None and known[selected]:
            self.view.follow(position[selected].astype(float))

    def positions(self, now: float) -> NDArray[np.float64]:
        """Places of all members (drone, 3), m; far below who was never heard."""
        return self._motion(now)[0].astype(float)

    def _motion(self, now: float) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Positions and velocities (drone, 3), and who was ever heard."""
        count = len(self.members)
        position, velocity, known = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32), []
        for number, member in enumerate(self.members):
            place, peer = self.observer.place(member, now), self.observer.peers[member]
            known.append(place is not None)
            position[number] = (ABSENT_SPACING * number, 0.0, ABSENT_HEIGHT) if place is None else place
            if peer.state is not None:
                velocity[number] = peer.state[3:]
        return position, velocity, np.array(known)

    def _silent(self, now: float) -> list[int]:
        heard = set(self.observer.heard(now))
        return [number for number, member in enumerate(self.members) if member not in heard]

    def _lines(self, now: float, position: NDArray[np.float32], known: NDArray[np.bool_], selected: int | None) -> None:
        index = {member: number for number, member in enumerate(self.members)}
        links = {(index[a], index[b]): both for (a, b), both in self.observer.links(now).items()}
        links = {pair: both for pair, both in links.items() if known[list(pair)].all()}
        heard = np.zeros((0, 2, 3), np.float32)
        if selected is not None:
            heard = position[[pair for pair in links if selected in pair]].reshape(-1, 2, 3)
        points, tones = np.zeros((0, 2, 3), np.float32), np.zeros((0, 3), np.uint8)
        if self.links == FLEET_LINK_CHOICES[0] and links:
            points = position[list(links)]
            dark = np.array(colours.LINE_STYLES["links"][0])
            tones = np.array([dark if both else (ONE_WAY_GREY,) * 3 for both in links.values()], np.uint8)
        elif self.links == FLEET_LINK_CHOICES[1] and known.sum() > 1:
            points = measures.AgentPairs(position[known]).neighbours()
            tones = np.tile(np.array(colours.LINE_STYLES["links"][0], np.uint8), (len(points), 1))
        self.view.extra("links", points, tones)
        self.view.extra("heard", heard)

    def _agent_colours(self, now: float, velocity: NDArray[np.float32], position: NDArray[np.float32]) -> AgentColours:
        peers, card, way = [self.observer.peers[member] for member in self.members], self.observer.card, self.colouring
        if way == "phase":
            values = [-1 if is_on_ground(peer.phase) else AIR_PHASES.index(peer.phase) for peer in peers]
            names = tuple(phase.name.lower() for phase in AIR_PHASES)
            return AgentColours(way, shades.CATEGORIES, np.array(values), names=names, told="on the ground, or silent")
        if way == "fault":
            faults = self.observer.faults
            values = [next((k for k, who in enumerate(faults.values()) if m in who), -1) for m in self.members]
            return AgentColours(way, shades.CATEGORIES, np.array(values), names=tuple(faults), told="none, or silent")
        if way == "drone":
            return shades.individual_colours(len(peers))
        if way in shades.MOTION_COLOURINGS:
            return shades.motion_colours(way, position, velocity, card.safety.speed_max, (0.0, card.high))
        told = [peer.status for peer in peers]
        if way == "battery":
            return AgentColours(way, shades.NUMBERS, _with_nan([s and s.battery for s in told]), 0.0, 100.0, "%")
        if way == "neighbours heard":
            most = max(len(peers) - 1.0, 1.0)
            return AgentColours(way, shades.NUMBERS, _with_nan([s and s.peers for s in told]), 0.0, most)
        return AgentColours(way, shades.NUMBERS, np.array([now - peer.at for peer in peers]), 0.0, HEARD_WITHIN, "s")


def _with_nan(values: list[int | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], float)
