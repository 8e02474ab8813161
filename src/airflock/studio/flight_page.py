"""Flight page: the player's flights on a view, frame by frame. Its panels hold the controls and the measures."""

import html
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.studio.browser_view import BrowserView, LivePage
from airflock.studio.page_panels import (
    ActionPanel,
    ComparisonPanel,
    MeasurementPanel,
    OpeningPanel,
    PagePanel,
    PlaybackPanel,
    SelectionPanel,
    TuningPanel,
    status_html,
)
from airflock.studio.page_scene import PageScene
from airflock.studio.player import Player


class FlightPage(LivePage):
    """Page that flies the flights of a player."""

    def __init__(self, player: Player, view: BrowserView):
        super().__init__(view, player.tick, player.run_actions_within)
        self.player = player
        self.scene = PageScene(player, view)
        panel = view.panel
        self.title, self.warning_text = panel.text(), panel.text()
        self.rescue_button = panel.add_button("Go back one moment", lambda: player.ask(self._rescued))
        self.rescue_button.visible = False
        play, tune, measure, compare = panel.add_tabs("Play", "Tune", "Measure", "Compare")
        with play:
            self.playback, self.selection, self.actions = PlaybackPanel(self), SelectionPanel(self), ActionPanel(self)
            self.open_panel = OpeningPanel(self)
        with tune:
            self.tuning = TuningPanel(self, tune)
        self.measurement = MeasurementPanel(self, measure)
        with compare:
            self.comparison = ComparisonPanel(self, compare)
        self.panels: list[PagePanel] = [
            self.playback, self.selection, self.actions, self.open_panel, self.tuning, self.measurement,
            self.comparison,
        ]  # fmt: skip
        for room in self.panels:
            room.rebuild()
        self.frame(True)
        view.on_click(lambda origin, way: player.ask(lambda: self._clicked(origin, way)))

    def rebuild(self) -> None:
        """Draw and list everything again, for other flights than before."""
        self.scene.rebuild()
        for room in self.panels:
            room.rebuild()
        self.frame(True)

    def on_time_changed(self) -> None:
        """Forget trails, charts, and collisions that lie ahead: the flights are at another time."""
        self.scene.forget()
        # Going back before a fork closes a pane.
        if len(self.player.sides) != len(self.scene.flocks):
            self.rebuild()
        self.measurement.clear()
        self.tuning.show_values()

    def frame(self, refresh: bool) -> None:
        """Draw the present moment, with charts, tables and words if `refresh`."""
        chosen = self.selection.chosen
        with self.view.atomic():
            if refresh:
                self.scene.rebuild_if_changed()
            self.scene.frame(chosen)
            if refresh:
                for room in self.panels:
                    room.refresh()
                self._show_status()

    def _clicked(self, origin: NDArray[Any], direction: NDArray[Any]) -> None:
        if self.actions.is_aiming:
            self.actions.at(np.asarray(origin), np.asarray(direction))
        else:
            self.selection.at(np.asarray(origin), np.asarray(direction))

    def _rescued(self) -> None:
        """Go back to the last snapshot before the flight failed."""
        self.playback.go_back(self.player.time)

    def _show_status(self) -> None:
        """Show where the flight is, any error, and the last event."""
        player = self.player
        state = "paused" if player.is_paused else "stopped" if player.failure_message or player.over else "flying"
        counts = [side.flight.agents for side in player.sides]
        agents = f"{' and '.join(map(str, counts))} agent{'s' * (counts != [1])}"
        done = " and ".join(str(len(side.flight.events)) for side in player.sides)
        self.title.content = (
            f"<div style='padding:0 0.75em;font-variant-numeric:tabular-nums'><b>{html.escape(player.where)}</b><br>"
            f"<small>t = {player.time:.1f} s · {agents} · seed {player.seed} · {state} · events: {done}</small></div>"
        )
        self.rescue_button.visible = bool(player.failure_message)
        self.warning_text.content = status_html(player.status, is_error=bool(player.failure_message))
