"""Playing: pause, step, back, speed, seed and agents; how the flock is shown; collisions, with a way to their time."""

import math
from typing import TYPE_CHECKING

from airflock.studio.collisions import BOTH_PANES, Collision
from airflock.studio.drawing import FOLLOW_CHOICES, LINK_CHOICES, PANE_NAMES
from airflock.studio.room import PagePanel, small_print_html
from airflock.studio.shading import available_colourings
from airflock.support import AirflockError, StudioError

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage

BACK_SECONDS = 10  # s; how far one press goes back
SECONDS_BEFORE_COLLISION = 1.0  # s; a jump to a collision ends so long before it
SPEED_CHOICES = {
    "0.1 ×": 0.1,
    "0.5 ×": 0.5,
    "1 ×": 1.0,
    "2 ×": 2.0,
    "5 ×": 5.0,
    "20 ×": 20.0,
    "as fast as possible": 1e9,
}
NO_JUMP_TEXT = "jump to …"


class PlaybackPanel(PagePanel):
    """Controls of time and of what is drawn."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        panel, player, drawing = self.widgets, self.player, self.scene
        self.pause = panel.add_button("Pause", self.ask(player.toggle_pause), "or the key P")
        panel.row(
            {
                "Step": self.ask(player.step),
                f"Back {BACK_SECONDS} s": self.ask(self.go_back),
                "Reset": self.ask(self.reset),
            }
        )
        self.moment_field = panel.field("moment (s)", "any time already flown; everything after it is discarded")
        panel.row({"Go to this moment": self.ask(self._go)})
        panel.add_menu("speed", tuple(SPEED_CHOICES), "1 ×", lambda chosen: self._speed(SPEED_CHOICES[chosen]))
        self.seed = panel.number("seed", player.seed, 0, 2**31, lambda seed: player.ask(lambda: self.reset(seed)))
        most = max(1000, player.flight.agents)
        self.agents = panel.number(
            "agents", player.flight.agents, 1, most, lambda n: player.ask(lambda: self.reset(agents=n)),
            "another number starts another flight",
        )  # fmt: skip
        self.colouring_menu = panel.add_menu(
            "colour by",
            available_colourings(drawing.flocks),
            drawing.colouring.name,
            lambda way: setattr(drawing.colouring, "name", way),
        )
        self.key = panel.text()
        panel.add_checkbox("trails", True, action=lambda on: player.ask(lambda: drawing.trails.show(on)))
        panel.add_menu(
            "links", LINK_CHOICES, drawing.links, lambda kind: setattr(drawing, "links", kind),
            "to the three nearest, or to all in radio range; paler where packets are lost",
        )  # fmt: skip
        self.follow_menu = panel.add_menu("follow", FOLLOW_CHOICES, FOLLOW_CHOICES[0], self._follow)
        self.collision_menu = panel.add_menu(
            "collisions", (NO_JUMP_TEXT,), NO_JUMP_TEXT, self._jump, "goes back to one second before it"
        )
        self.listed = panel.text()
        self._listed_collisions: list[Collision] = []
        self._camera_scenario = ""  # which scenario the camera is set for
        for key, label, action in (
            ("P", "Pause or fly", player.toggle_pause), ("N", "Step", player.step), ("R", "Reset", self.reset),
            ("B", "Back", self.go_back),
        ):  # fmt: skip
            panel.command(label, key, self.ask(action))

    def rebuild(self) -> None:
        """What may colour the agents of these flights; whom the camera follows in a scenario that is new here."""
        player = self.player
        self._show_seed_and_agents()
        if self._camera_scenario != player.side.origin.where:
            self._camera_scenario = player.side.origin.where
            free = player.scenario.world.arena == "none" and not self.scene.stages[0].solids
            self.follow_menu.value = self.scene.follow_choice = FOLLOW_CHOICES[1 if free else 0]
        known = available_colourings(self.scene.flocks)
        if tuple(self.colouring_menu.options) != known:
            self.colouring_menu.options = known
            self.scene.colouring.name = self.scene.colouring.name if self.scene.colouring.name in known else known[0]
            self.colouring_menu.value = self.scene.colouring.name

    def _show_seed_and_agents(self) -> None:
        """Show seed and number of agents of what flies."""
        self.seed.value, self.agents.value = self.player.seed, self.player.flight.agents

    def _follow(self, choice: str) -> None:
        self.scene.follow_choice = choice

    def _go(self) -> None:
        """Go to the moment that was typed."""
        try:
            time = float(self.moment_field.value)
        except ValueError:
            time = math.nan
        if not 0.0 <= time <= self.player.time:
            raise StudioError(
                f"moment = {self.moment_field.value or 'nothing'}: give a time from 0 to {self.player.time:g} s"
            )
        self.go_back(time)

    def _speed(self, speed: float) -> None:
        self.player.clock.speed = speed

    def go_back(self, time: float | None = None) -> None:
        """Go back to a time, s, or by ten seconds."""
        self.player.go_back(self.player.time - BACK_SECONDS if time is None else time)
        self.page.on_time_changed()

    def reset(self, seed: int | None = None, agents: int | None = None) -> None:
        """Begin another flight; where that is refused, the fields show what flies."""
        try:
            self.player.reset(seed, {} if agents is None else {"agents": agents})
        except AirflockError:
            self._show_seed_and_agents()
            raise
        self.scene.collisions.clear()
        self.page.rebuild()

    def _jump(self, choice: str) -> None:
        when = next((c.time for c in self._listed_collisions if self._collision_text(c) == choice), None)
        if when is not None:
            self.player.ask(lambda: self.go_back(max(when - SECONDS_BEFORE_COLLISION, 0.0)))

    def _collision_text(self, c: Collision) -> str:
        side = f", {PANE_NAMES[c.side]}" if len(self.player.sides) > 1 and c.side != BOTH_PANES else ""
        return f"t = {c.time:.1f} s: {c.first} and {c.second}{side}"

    def refresh(self) -> None:
        """The button's words, the key to the colours, and the list of collisions."""
        label = "Fly" if self.player.is_paused else "Pause"
        if self.pause.label != label:
            self.pause.label = label
        drawing = self.scene
        self.key.content = drawing.colouring.shown.key
        if self.colouring_menu.value != drawing.colouring.name:
            self.colouring_menu.value = drawing.colouring.name
        collisions = drawing.collisions.listed
        if collisions != self._listed_collisions:
            self._listed_collisions = collisions
            self.collision_menu.options = (NO_JUMP_TEXT, *dict.fromkeys(map(self._collision_text, collisions)))
            self.collision_menu.value = NO_JUMP_TEXT
            few = "<br>".join(self._collision_text(c) for c in collisions[:8])
            self.listed.content = small_print_html(f"<b>Pairs that collided</b><br>{few}") if collisions else ""
