"""Page: the player's flights on a view, frame by frame. Its rooms hold the controls and say what is seen."""

import html
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.studio.acting import Acting
from airflock.studio.comparing import Comparing
from airflock.studio.drawing import Drawing
from airflock.studio.measuring import Measuring
from airflock.studio.opening import Opening
from airflock.studio.player import Player
from airflock.studio.playing import Playing
from airflock.studio.room import Room, told
from airflock.studio.selecting import Selecting
from airflock.studio.tuning import Tuning
from airflock.studio.view import View

FRAMES = 30  # per second of real time
CHARTS = 5  # per second


class Page:
    """One page: call `run` to fly until `stop` or Ctrl-C."""

    def __init__(self, player: Player, view: View):
        self.player, self.view = player, view
        self._running = True
        self.drawing = Drawing(player, view)
        panel = view.panel
        self.title, self.trouble = panel.text(), panel.text()
        self.rescue = panel.button("Go back one moment", lambda: player.ask(self._rescued))
        self.rescue.visible = False
        play, tune, measure, compare = panel.tabs("Play", "Tune", "Measure", "Compare")
        with play:
            self.playing, self.selecting, self.acting = Playing(self), Selecting(self), Acting(self)
            self.opening = Opening(self)
        with tune:
            self.tuning = Tuning(self, tune)
        self.measuring = Measuring(self, measure)
        with compare:
            self.comparing = Comparing(self, compare)
        self.rooms: list[Room] = [
            self.playing, self.selecting, self.acting, self.opening, self.tuning, self.measuring, self.comparing,
        ]  # fmt: skip
        for room in self.rooms:
            room.rebuild()
        self.frame(True)
        view.on_click(lambda origin, way: player.ask(lambda: self._clicked(origin, way)))

    def stop(self) -> None:
        """End `run` after the frame at hand; from any thread."""
        self._running = False

    def run(self) -> None:
        """Fly and draw in real time until the page is stopped."""
        now = drawn = refreshed = time.perf_counter()
        acted = False
        while self._running:
            last, now = now, time.perf_counter()
            moved = self.player.tick(now - last)
            refresh = now - refreshed >= 1.0 / CHARTS
            if moved or acted or refresh:
                self.frame(refresh)
            refreshed = now if refresh else refreshed
            drawn = max(drawn + 1.0 / FRAMES, now)
            acted = self._answer_until(drawn)

    def _answer_until(self, end: float) -> bool:
        """Do at once what a hand asks for, until the next frame is due. Whether anything was done."""
        acted = self.player.wait(0.001)  # the threads of the page's server come first
        while self._running and (left := end - time.perf_counter()) > 0.0:
            acted = self.player.wait(left) or acted
        return acted

    def rebuild(self) -> None:
        """Draw and list everything again, for other flights than before."""
        self.drawing.rebuild()
        for room in self.rooms:
            room.rebuild()
        self.frame(True)

    def show_other_time(self) -> None:
        """Forget trails, charts, and collisions that lie ahead: the flights are at another time."""
        self.drawing.forget()
        if len(self.player.sides) != len(self.drawing.flocks):
            self.rebuild()
        self.measuring.clear()
        self.tuning.show_values()

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        chosen = self.selecting.chosen
        with self.view.atomic():
            if refresh:
                self.drawing.rebuild_if_changed()
            self.drawing.frame(chosen)
            if refresh:
                for room in self.rooms:
                    room.refresh()
                self._show_status()

    def _clicked(self, origin: NDArray[Any], way: NDArray[Any]) -> None:
        if self.acting.aiming:
            self.acting.at(np.asarray(origin), np.asarray(way))
        else:
            self.selecting.at(np.asarray(origin), np.asarray(way))

    def _rescued(self) -> None:
        """Go back to the last moment that was kept before the flight failed."""
        self.playing.back(self.player.time)

    def _show_status(self) -> None:
        """Say where the flight is, what is wrong, and what has happened."""
        player = self.player
        state = "paused" if player.paused else "stopped" if player.failure or player.over else "flying"
        counts = [side.flight.agents for side in player.sides]
        agents = f"{' and '.join(map(str, counts))} agent{'s' * (counts != [1])}"
        done = " and ".join(str(len(side.flight.events)) for side in player.sides)
        self.title.content = (
            f"<div style='padding:0 0.75em;font-variant-numeric:tabular-nums'><b>{html.escape(player.where)}</b><br>"
            f"<small>t = {player.time:.1f} s · {agents} · seed {player.seed} · {state} · events: {done}</small></div>"
        )
        self.rescue.visible = bool(player.failure)
        self.trouble.content = told(player.status, bad=bool(player.failure))
