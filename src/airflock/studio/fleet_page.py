"""Page of a running fleet: drones where they are, their phases, links and faults, and what happened. It only looks."""

import html
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.fleets import FleetObserver
from airflock.studio.fleet_drawing import FLEET_COLOURINGS, FLEET_FOLLOW_CHOICES, FLEET_LINK_CHOICES, FleetScene
from airflock.studio.fleet_tables import drone_html, faults_html, fleet_warning, members_html, notes_html
from airflock.studio.measures import MAX_CHART_POINTS, AgentPairs
from airflock.studio.requests import ActionQueue
from airflock.studio.room import small_print_html, status_html
from airflock.studio.view import BrowserView

FRAMES_PER_SECOND = 30  # per second
CHARTS_PER_SECOND = 5  # per second


class FleetPage:
    """One page: call `run` to listen and draw until `stop` or Ctrl-C.

    observer : of the fleet; listen : gives the datagrams that have arrived; clock : the own clock of both, s
    """

    def __init__(
        self, observer: FleetObserver, view: BrowserView, read_datagrams: Callable[[], Iterable[bytes]],
        clock: Callable[[], float] = time.monotonic,
    ):  # fmt: skip
        self.observer, self.view, self._read_datagrams, self._clock = observer, view, read_datagrams, clock
        self._is_running, self._asked = True, ActionQueue()
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
                lambda whom: setattr(drawing, "follow_choice", whom),
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
        """Do something before the next frame; from any thread."""
        self._asked.put(action)

    def stop(self) -> None:
        """End `run` after the frame at hand; from any thread."""
        self._is_running = False

    def run(self) -> None:
        """Listen and draw in real time until the page is stopped."""
        drawn = refreshed = self._clock()
        while self._is_running:
            now = self._clock()
            for datagram in self._read_datagrams():
                self.observer.take(datagram, now)
            refresh = now - refreshed >= 1.0 / CHARTS_PER_SECOND
            refreshed = now if refresh else refreshed
            self.frame(refresh)
            drawn = max(drawn + 1.0 / FRAMES_PER_SECOND, now)
            self._asked.wait(max(drawn - self._clock(), 0.001))
            self._asked.answer(lambda action: action())

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        now = self._clock()
        with self.view.atomic():
            self.scene.frame(now, self.chosen)
            if refresh:
                self.observer.look(now)
                self._show_status(now)
                self._measure(now)

    # -------------------------------------------------------------------------------------------------- selecting

    def select(self, number: int | None) -> None:
        """Select a drone by its place among the members, or none."""
        self.chosen = number

    def select_next(self, count: int) -> None:
        """Select a drone some places on."""
        now = -1 if self.chosen is None and count > 0 else self.chosen or 0
        self.select((now + count) % len(self.observer.card.members))

    def _clicked(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        """Select the drone nearest to a ray, if it is near."""
        away = self.scene.positions(self._clock()) - origin
        off = np.linalg.norm(away - np.maximum(away @ direction, 0.0)[:, None] * direction, axis=1)
        best = int(off.argmin())
        self.select(best if off[best] < 2.0 * self.scene.size else None)

    # ---------------------------------------------------------------------------------------------------- telling

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
        """Add the present moment to the charts, once somebody was heard."""
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
