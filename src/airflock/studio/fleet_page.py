"""Page of a running fleet: drones where they are, their phases, links and faults, and what happened. It only looks."""

import html
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.fleets.observer import Observer
from airflock.studio.fleet_drawing import FOLLOWED, LINKS, WAYS, FleetDrawing
from airflock.studio.fleet_tables import about, faults_of, members_table, notes_of, trouble_of
from airflock.studio.measures import KEPT, Pairs
from airflock.studio.requests import Asked
from airflock.studio.room import note, told
from airflock.studio.view import View

FRAMES = 30  # per second
CHARTS = 5  # per second


class FleetPage:
    """One page: call `run` to listen and draw until `stop` or Ctrl-C.

    observer : of the fleet; listen : gives the datagrams that have arrived; clock : the own clock of both, s
    """

    def __init__(
        self, observer: Observer, view: View, listen: Callable[[], Iterable[bytes]],
        clock: Callable[[], float] = time.monotonic,
    ):  # fmt: skip
        self.observer, self.view, self._listen, self._clock = observer, view, listen, clock
        self._running, self._asked = True, Asked()
        self.chosen: int | None = None  # place of the selected drone among the members
        self.drawing = drawing = FleetDrawing(observer, view)
        panel = view.panel
        self.title, self.trouble = panel.text(), panel.text()
        fleet, measure = panel.tabs("Fleet", "Measure")
        with fleet:
            panel.menu("colour by", WAYS, WAYS[0], lambda way: setattr(drawing, "way", way))
            self.key = panel.text()
            panel.menu(
                "links", LINKS, LINKS[0], lambda kind: setattr(drawing, "links", kind),
                "packets that arrive (known only for fleets in software); pale where they arrive one way only",
            )  # fmt: skip
            panel.checkbox("trails", True, action=lambda on: self.ask(lambda: self.drawing.trails.show(on)))
            panel.menu("follow", FOLLOWED, FOLLOWED[0], lambda whom: setattr(drawing, "follow", whom))
            with panel.folder("Selected drone"):
                self.about = panel.text()
                panel.row({
                    "Previous": lambda: self.ask(lambda: self.by(-1)), "Next": lambda: self.ask(lambda: self.by(1)),
                    "None": lambda: self.ask(lambda: self.choose(None)),
                })  # fmt: skip
            with panel.folder("Drones"):
                self.members = panel.text()
            with panel.folder("Faults and notes"):
                self.faults, self.notes = panel.text(), panel.text()
        with measure:
            self.speeds = panel.chart("speed (m/s)", ["mean", "slowest", "fastest"])
            self.nearest = panel.chart("smallest distance in the air (m)", ["nearest pair"])
            self.arrivals = panel.chart("packets per second and drone", ["heard here"])
        panel.command("Next drone", "S", lambda: self.ask(lambda: self.by(1)))
        self._course: deque[tuple[float, ...]] = deque(maxlen=KEPT)
        self._counted: deque[tuple[float, int]] = deque(maxlen=round(2.0 * CHARTS))
        view.on_click(lambda origin, way: self.ask(lambda: self._clicked(np.asarray(origin), np.asarray(way))))
        self.frame(True)

    def ask(self, action: Callable[[], None]) -> None:
        """Do something before the next frame; from any thread."""
        self._asked.put(action)

    def stop(self) -> None:
        """End `run` after the frame at hand; from any thread."""
        self._running = False

    def run(self) -> None:
        """Listen and draw in real time until the page is stopped."""
        drawn = refreshed = self._clock()
        while self._running:
            now = self._clock()
            for datagram in self._listen():
                self.observer.take(datagram, now)
            refresh = now - refreshed >= 1.0 / CHARTS
            refreshed = now if refresh else refreshed
            self.frame(refresh)
            drawn = max(drawn + 1.0 / FRAMES, now)
            self._asked.rung(max(drawn - self._clock(), 0.001))
            self._asked.answer(lambda action: action())

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        now = self._clock()
        with self.view.atomic():
            self.drawing.frame(now, self.chosen)
            if refresh:
                self.observer.look(now)
                self._show_status(now)
                self._measure(now)

    # -------------------------------------------------------------------------------------------------- selecting

    def choose(self, number: int | None) -> None:
        """Select a drone by its place among the members, or none."""
        self.chosen = number

    def by(self, count: int) -> None:
        """Select a drone some places on."""
        now = -1 if self.chosen is None and count > 0 else self.chosen or 0
        self.choose((now + count) % len(self.observer.card.members))

    def _clicked(self, origin: NDArray[Any], way: NDArray[Any]) -> None:
        """Select the drone nearest to a ray, if it is near."""
        away = self.drawing.places(self._clock()) - origin
        off = np.linalg.norm(away - np.maximum(away @ way, 0.0)[:, None] * way, axis=1)
        best = int(off.argmin())
        self.choose(best if off[best] < 2.0 * self.drawing.size else None)

    # ---------------------------------------------------------------------------------------------------- telling

    def _show_status(self, now: float) -> None:
        card, observer = self.observer.card, self.observer
        heard, count = len(observer.heard(now)), len(card.members)
        self.title.content = (
            f"<div style='padding:0 0.75em'><b>{html.escape(card.name)}</b><br><small>{heard} of {count} drones heard, "
            f"{len(observer.flying(now))} fly · mission {card.mission} · card {card.hash[:8]}</small></div>"
        )
        self.trouble.content = told(trouble_of(observer, now), bad=True)
        self.key.content = self.drawing.shown.key
        self.members.content = members_table(observer, now)
        self.faults.content, self.notes.content = faults_of(observer), notes_of(observer)
        if self.chosen is None:
            self.about.content = note("click a drone, or press S")
        else:
            self.about.content = about(observer, card.members[self.chosen], now)

    def _measure(self, now: float) -> None:
        """Add the present moment to the charts, once somebody was heard."""
        observer, flying = self.observer, self.observer.flying(now)
        if not observer.accepted:
            return
        places = np.array([observer.place(member, now) for member in flying], float).reshape(-1, 3)
        motion = np.array([peer.state[3:] for m in flying if (peer := observer.peers[m]).state]).reshape(-1, 3)
        speed = np.linalg.norm(motion, axis=1) if len(motion) else np.full(1, np.nan)
        gap = Pairs(places).nearest() if len(places) > 1 else np.nan
        self._counted.append((now, observer.accepted))
        since, before = self._counted[0]
        rate = (observer.accepted - before) / len(observer.card.members) / (now - since) if now > since else np.nan
        self._course.append((now - observer.begun, speed.mean(), speed.min(), speed.max(), gap, rate))
        columns = np.array(self._course).T
        time_, mean, slowest, fastest, nearest, rates = (np.ascontiguousarray(column) for column in columns)
        self.speeds.data = time_, mean, slowest, fastest
        self.nearest.data = time_, nearest
        self.arrivals.data = time_, rates
