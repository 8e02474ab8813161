"""Page of a running fleet: positions, phases, links and faults of its drones, and a list of events. It sends
nothing.
"""

import html
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.drones import HEARD_WITHIN, STANDING_PHASES, MissionPhase, Peer
from airflock.fleets import INJECTED_KINDS, FleetObserver, scenario_fault_name
from airflock.parts import FAULTS
from airflock.studio import page_measures as measures
from airflock.studio.browser_view import (
    CHARTS_PER_SECOND,
    FOLLOW_NOTHING,
    AgentScene,
    BrowserView,
    LivePage,
    next_selected,
)
from airflock.studio.flight_pane import ABSENT_HEIGHT, ABSENT_SPACING
from airflock.studio.page_measures import MAX_CHART_POINTS, AgentPairs
from airflock.studio.page_panels import small_print_html, status_html
from airflock.studio.player import ActionQueue
from airflock.view import AgentColours, agent_colours, card_scene

MAX_NOTES = 14  # notes
MAX_ROWS = 60  # drones that have a row of their own
MIN_REFUSED = 10  # datagrams of other keys after which it is said that none fits
REFUSAL_REASONS = {
    "signature": "signed with a different key than this card's mission uses",
    "clock": "from another time: the clocks differ by more than the card allows, or the card's limit is too small",
    "card": "from another card",
    "mission": "from another mission",
    "stranger": "from systems that are not members",
}
FAULT_TEXTS = {  # of faults whose amount the channel does not report
    "loss": "some packets to these drones are lost",
    "jitter": "packets to these drones are late",
    "duplicate": "some packets to these drones arrive twice",
    "corrupt": "some packets to these drones arrive with a wrong bit",
    "rogue": "somebody without the key sends packets as these drones, from another place",
    "impostor": "somebody with the key sends packets as these drones, from another place",
    "battery": "the battery reports a wrong level",
    "clock": "the node's clock is wrong",
}
TABLE_TAG = "<table style='width:100%;font-size:0.8em;border-collapse:collapse;text-align:right'>"


def members_html(observer: FleetObserver, now: float) -> str:
    """Return a table with a row for each drone: phase, height, speed, battery, drones heard, age of its last
    packet.
    """
    heads = ("", "phase", "m", "m/s", "%", "hears", "s ago")
    rows = [f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"]
    members = observer.card.members
    for member in members[:MAX_ROWS]:
        rows.append(_member_row(member, observer.peers[member], now))
    more = small_print_html(f"and {len(members) - MAX_ROWS} more") if len(members) > MAX_ROWS else ""
    return f"<div style='padding:0 0.75em'>{TABLE_TAG}{''.join(rows)}</table></div>{more}"


def _member_row(member: int, peer: Peer, now: float) -> str:
    if peer.status is None or peer.state is None:
        said = "another card" if peer.has_other_card else "not heard"
        return f"<tr style='color:#777'><th>{member}</th><td>{said}</td>{'<td>–</td>' * 5}</tr>"
    s, age = peer.state, now - peer.heard_at
    speed = (s.vx * s.vx + s.vy * s.vy + s.vz * s.vz) ** 0.5
    tone = " style='color:#b00020'" if age > HEARD_WITHIN else ""
    cells = (peer.phase.name.lower(), f"{s.z:.1f}", f"{speed:.1f}", f"{peer.status.battery}", f"{peer.status.peers}",
             f"{age:.1f}")  # fmt: skip
    return f"<tr{tone}><th>{member}</th>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def drone_html(observer: FleetObserver, member: int, now: float) -> str:
    """Return everything that one drone reports about itself."""
    peer = observer.peers[member]
    if peer.status is None or peer.state is None:
        return small_print_html(f"<b>drone {member}</b>: not heard yet")
    s, data = peer.state, peer.status
    hears = [b if a == member else a for a, b in observer.links(now) if member in (a, b)]
    linked = f"; packets between it and {', '.join(map(str, sorted(hears)))}" if hears else ""
    others, age = len(observer.card.members) - 1, now - peer.heard_at
    return small_print_html(
        f"<b>drone {member}</b>: {peer.phase.name.lower()}, {'in the air' if data.is_airborne else 'on the ground'}<br>"
        f"at east {s.x:.1f}, north {s.y:.1f}, {s.z:.1f} m above the site, known to {data.accuracy:.1f} m<br>"
        f"flies {s.vx:.1f}, {s.vy:.1f}, {s.vz:.1f} m/s; battery {data.battery} %; clock off by {data.clock_error:.2f} s"
        f"<br>hears {data.peers} of {others}{linked}; last packet {age:.1f} s ago"
    )


def faults_html(observer: FleetObserver) -> str:
    """Return the active faults and their effects."""
    said = (
        INJECTED_KINDS
        | FAULT_TEXTS
        | {scenario_fault_name(kind): _first_sentence(fault.doc) for kind, fault in FAULTS.items()}
    )
    lines = [
        f"<b>{html.escape(kind)}</b>, {observer.named(who)}: {said.get(kind, 'a kind that this page does not know')}"
        for kind, who in observer.faults.items()
    ]
    return small_print_html("<br>".join(lines)) if lines else ""


def _first_sentence(doc: str) -> str:
    """Return the first sentence of a fault's description."""
    return doc.partition(": ")[2].partition(".")[0]


def notes_html(observer: FleetObserver) -> str:
    """Return the events, newest first."""
    lines = []
    for note in list(observer.notes)[: -MAX_NOTES - 1 : -1]:
        who = f"drone {note.member}: " if note.member else ""
        lines.append(f"{note.time - observer.begun:.1f} s · {who}{html.escape(note.text)}")
    return small_print_html("<br>".join(lines))


def fleet_warning(observer: FleetObserver, now: float) -> str:
    """Return a warning for the whole fleet: no packets arrive, or their signatures are not valid."""
    refused = observer.refused
    most = max(refused, key=refused.__getitem__, default="")
    if not observer.accepted_count and sum(refused.values()) >= MIN_REFUSED:
        return f"{sum(refused.values())} packets were refused, and none believed: {REFUSAL_REASONS.get(most, most)}"
    if not observer.accepted_count:
        return "nothing has been heard yet" if now - observer.begun > HEARD_WITHIN else ""
    return "" if observer.heard(now) else "no drone is heard any more"


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
FLEET_FOLLOW_CHOICES = (FOLLOW_NOTHING, "the fleet", "the selected drone")
DARTS_PER_HALF_WIDTH = 26.0  # darts in half the picture
PANEL_OFFSET = np.array([0.2, 0.1, 0.0])  # half widths; the panel stands there
ONE_WAY_GREY = 225  # grey of a link on which packets arrive one way only


class FleetScene(AgentScene):
    """Scene of a page that watches a fleet.

    colouring : what its control says; shown : the last shade, whose key stands on the page
    """

    follow_choices = FLEET_FOLLOW_CHOICES

    def __init__(self, observer: FleetObserver, view: BrowserView):
        super().__init__(view, FLEET_LINK_CHOICES[0])
        self.observer, self.colouring = observer, FLEET_COLOURINGS[0]
        self.members = observer.card.members
        self.field = card_scene(observer.card)
        self.size = self.field.span * min(1.0, (100.0 / len(self.members)) ** 0.25) / DARTS_PER_HALF_WIDTH
        self.shown = agent_colours.individual_colours(0)
        self._build()

    def _build(self) -> None:
        view, field = self.view, self.field
        with view.atomic():
            view.ground("ground", field.span, 0.0, field.centre * (1.0, 1.0, 0.0))
            for solid in field.solids:
                view.solid(solid)
            for lines in field.lines:
                view.lines(lines)
            view.agents(
                len(self.members), self.size, {kind: agent_colours.LINE_STYLES[kind] for kind in ("links", "heard")}
            )
        view.look_at(field.centre + field.span * PANEL_OFFSET, field.span, False)

    def frame(self, now: float, selected: int | None) -> None:
        """Draw the fleet as it is known now; `chosen`: index of a drone among the members."""
        position, velocity, known = self._motion(now)
        self.shown = self._agent_colours(now, velocity, position)
        tone = self.shown.colours
        # Silent drones turn grey in every colouring, so that they cannot be overlooked.
        tone[self._silent(now)] = agent_colours.NO_VALUE_COLOUR
        self.draw_agents(
            position, velocity, tone, known, selected,
            lambda before: np.where((before[:, 2] <= 0.5 * ABSENT_HEIGHT)[:, None], position, before),
        )  # fmt: skip
        self._lines(now, position, known, selected)

    def positions(self, now: float) -> NDArray[np.float64]:
        """Return the positions of all members (drone, 3), m; drones never heard lie far below."""
        return self._motion(now)[0].astype(float)

    def _motion(self, now: float) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Return positions and velocities (drone, 3), and a mask of the drones that were ever heard."""
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
        # A drone that was never heard has no place to draw a line to.
        links = {pair: both for pair, both in links.items() if known[list(pair)].all()}
        heard = np.zeros((0, 2, 3), np.float32)
        if selected is not None:
            heard = position[[pair for pair in links if selected in pair]].reshape(-1, 2, 3)
        points, tones = np.zeros((0, 2, 3), np.float32), np.zeros((0, 3), np.uint8)
        if self.links == FLEET_LINK_CHOICES[0] and links:
            points = position[list(links)]
            dark = np.array(agent_colours.LINE_STYLES["links"][0])
            tones = np.array([dark if both else (ONE_WAY_GREY,) * 3 for both in links.values()], np.uint8)
        elif self.links == FLEET_LINK_CHOICES[1] and known.sum() > 1:
            points = measures.AgentPairs(position[known]).neighbours()
            tones = np.tile(np.array(agent_colours.LINE_STYLES["links"][0], np.uint8), (len(points), 1))
        self.view.extra("links", points, tones)
        self.view.extra("heard", heard)

    def _agent_colours(self, now: float, velocity: NDArray[np.float32], position: NDArray[np.float32]) -> AgentColours:
        peers, card, way = [self.observer.peers[member] for member in self.members], self.observer.card, self.colouring
        if way == "phase":
            values = [-1 if peer.phase in STANDING_PHASES else AIR_PHASES.index(peer.phase) for peer in peers]
            names = tuple(phase.name.lower() for phase in AIR_PHASES)
            return AgentColours(
                way, agent_colours.CATEGORIES, np.array(values), names=names, note="on the ground, or silent"
            )
        if way == "fault":
            faults = self.observer.faults
            values = [next((k for k, who in enumerate(faults.values()) if m in who), -1) for m in self.members]
            return AgentColours(
                way, agent_colours.CATEGORIES, np.array(values), names=tuple(faults), note="none, or silent"
            )
        if way == "drone":
            return agent_colours.individual_colours(len(peers))
        if way in agent_colours.MOTION_COLOURINGS:
            return agent_colours.motion_colours(way, position, velocity, card.safety.speed_max, (0.0, card.high))
        reports = [peer.status for peer in peers]
        if way == "battery":
            return AgentColours(
                way, agent_colours.NUMBERS, _with_nan([s and s.battery for s in reports]), 0.0, 100.0, "%"
            )
        if way == "neighbours heard":
            most = max(len(peers) - 1.0, 1.0)
            return AgentColours(way, agent_colours.NUMBERS, _with_nan([s and s.peers for s in reports]), 0.0, most)
        return AgentColours(
            way, agent_colours.NUMBERS, np.array([now - peer.at for peer in peers]), 0.0, HEARD_WITHIN, "s"
        )


def _with_nan(values: list[int | None]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in values], float)


class FleetPage(LivePage):
    """Page that listens to a fleet.

    observer : of the fleet; listen : gives the datagrams that have arrived; clock : the own clock
               of both, s
    """

    def __init__(
        self, observer: FleetObserver, view: BrowserView, read_datagrams: Callable[[], Iterable[bytes]],
        clock: Callable[[], float] = time.monotonic,
    ):  # fmt: skip
        self._asked = ActionQueue()
        super().__init__(view, self._listen, lambda seconds: self._asked.answer(lambda action: action(), seconds))
        self.observer, self._read_datagrams, self._clock = observer, read_datagrams, clock
        self.chosen: int | None = None  # place of the selected drone among the members
        self.scene = drawing = FleetScene(observer, view)
        panel = view.panel
        self.title, self.warning_text = panel.text(), panel.text()
        fleet, measure = panel.add_tabs("Fleet", "Measure")
        with fleet:
            panel.add_menu(
                "colour by", FLEET_COLOURINGS, FLEET_COLOURINGS[0], lambda way: setattr(drawing, "colouring", way)
            )
            self.key = panel.text()
            panel.add_menu(
                "links", FLEET_LINK_CHOICES, FLEET_LINK_CHOICES[0], lambda kind: setattr(drawing, "links", kind),
                "packets that arrive (known only for fleets in software); pale where they arrive one way only",
            )  # fmt: skip
            panel.add_checkbox("trails", True, action=lambda on: self.ask(lambda: self.scene.trails.show(on)))
            panel.add_menu(
                "follow",
                FLEET_FOLLOW_CHOICES,
                FLEET_FOLLOW_CHOICES[0],
                lambda choice: setattr(drawing, "follow_choice", choice),
            )
            with panel.folder("Selected drone"):
                self.about = panel.text()
                panel.row(
                    {
                        "Previous": lambda: self.ask(lambda: self.select_next(-1)),
                        "Next": lambda: self.ask(lambda: self.select_next(1)),
                        "None": lambda: self.ask(lambda: self.select(None)),
                    }
                )
            with panel.folder("Drones"):
                self.members = panel.text()
            with panel.folder("Faults and notes"):
                self.faults, self.notes = panel.text(), panel.text()
        with measure:
            self.speed_chart = panel.add_chart("speed (m/s)", ["mean", "slowest", "fastest"])
            self.nearest = panel.add_chart("smallest distance in the air (m)", ["nearest pair"])
            self.arrival_chart = panel.add_chart("packets per second and drone", ["heard here"])
        panel.command("Next drone", "S", lambda: self.ask(lambda: self.select_next(1)))
        self._chart_rows: deque[tuple[float, ...]] = deque(maxlen=MAX_CHART_POINTS)
        self._accepted_counts: deque[tuple[float, int]] = deque(maxlen=round(2.0 * CHARTS_PER_SECOND))
        view.on_click(lambda origin, way: self.ask(lambda: self._clicked(np.asarray(origin), np.asarray(way))))
        self.frame(True)

    def ask(self, action: Callable[[], None]) -> None:
        """Queue an action for the next frame; from any thread."""
        self._asked.put(action)

    def _listen(self, _: float) -> bool:
        """Take what was heard; drones are carried on between their packets, so that something always moves."""
        for datagram in self._read_datagrams():
            self.observer.take(datagram, self._clock())
        return True

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        now = self._clock()
        with self.view.atomic():
            self.scene.frame(now, self.chosen)
            if refresh:
                self.observer.look(now)
                self._show_status(now)
                self._measure(now)

    def select(self, number: int | None) -> None:
        """Select a drone by its index among the members, or none."""
        self.chosen = number

    def select_next(self, count: int) -> None:
        """Select a drone some indices on."""
        self.select(next_selected(self.chosen, count, len(self.observer.card.members)))

    def _clicked(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        """Select the drone nearest to a ray, if it is near."""
        self.select(self.scene.nearest_to_ray(self.scene.positions(self._clock()), origin, direction))

    def _show_status(self, now: float) -> None:
        card, observer = self.observer.card, self.observer
        heard, count = len(observer.heard(now)), len(card.members)
        self.title.content = (
            f"<div style='padding:0 0.75em'><b>{html.escape(card.name)}</b><br><small>{heard} of {count} drones heard, "
            f"{len(observer.flying(now))} fly · mission {card.mission} · card {card.hash[:8]}</small></div>"
        )
        self.warning_text.content = status_html(fleet_warning(observer, now), is_error=True)
        self.key.content = self.scene.shown.key
        self.members.content = members_html(observer, now)
        self.faults.content, self.notes.content = faults_html(observer), notes_html(observer)
        if self.chosen is None:
            self.about.content = small_print_html("click a drone, or press S")
        else:
            self.about.content = drone_html(observer, card.members[self.chosen], now)

    def _measure(self, now: float) -> None:
        """Add the present moment to the charts, once any drone was heard."""
        observer, flying = self.observer, self.observer.flying(now)
        if not observer.accepted_count:
            return
        places = np.array([observer.place(member, now) for member in flying], float).reshape(-1, 3)
        motion = np.array([peer.state[3:] for m in flying if (peer := observer.peers[m]).state]).reshape(-1, 3)
        speed = np.linalg.norm(motion, axis=1) if len(motion) else np.full(1, np.nan)
        gap = AgentPairs(places).nearest() if len(places) > 1 else np.nan
        self._accepted_counts.append((now, observer.accepted_count))
        since, before = self._accepted_counts[0]
        rate = (
            (observer.accepted_count - before) / len(observer.card.members) / (now - since) if now > since else np.nan
        )
        self._chart_rows.append((now - observer.begun, speed.mean(), speed.min(), speed.max(), gap, rate))
        columns = np.array(self._chart_rows).T
        time_, mean, slowest, fastest, nearest, rates = (np.ascontiguousarray(column) for column in columns)
        self.speed_chart.data = time_, mean, slowest, fastest
        self.nearest.data = time_, nearest
        self.arrival_chart.data = time_, rates
