"""Playing: pause, step, back, speed, seed and agents; how the flock is shown; collisions, with a way to their time."""

import math
from typing import TYPE_CHECKING

from airflock.studio.collisions import BOTH, Collision
from airflock.studio.drawing import FOLLOWED, LINKS, NAMES
from airflock.studio.room import Room, note
from airflock.studio.shading import ways
from airflock.support.errors import AirflockError, StudioError

if TYPE_CHECKING:
    from airflock.studio.page import Page

SOON = 10  # s; how far one press goes back
BEFORE = 1.0  # s; a jump to a collision ends so long before it
SPEEDS = {"0.1 ×": 0.1, "0.5 ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0, "20 ×": 20.0, "as fast as possible": 1e9}
JUMP = "jump to …"


class Playing(Room):
    """Controls of time and of what is drawn."""

    def __init__(self, page: "Page"):
        super().__init__(page)
        panel, player, drawing = self.panel, self.player, self.drawing
        self.pause = panel.button("Pause", self.ask(player.toggle), "or the key P")
        panel.row({"Step": self.ask(player.step), f"Back {SOON} s": self.ask(self.back), "Reset": self.ask(self.reset)})
        self.moment = panel.field("moment (s)", "any time already flown; everything after it is discarded")
        panel.row({"Go to this moment": self.ask(self._go)})
        panel.menu("speed", tuple(SPEEDS), "1 ×", lambda chosen: self._speed(SPEEDS[chosen]))
        self.seed = panel.number("seed", player.seed, 0, 2**31, lambda seed: player.ask(lambda: self.reset(seed)))
        most = max(1000, player.flight.agents)
        self.agents = panel.number(
            "agents", player.flight.agents, 1, most, lambda n: player.ask(lambda: self.reset(agents=n)),
            "another number starts another flight",
        )  # fmt: skip
        self.way = panel.menu(
            "colour by", ways(drawing.flocks), drawing.shading.way, lambda way: setattr(drawing.shading, "way", way)
        )
        self.key = panel.text()
        panel.checkbox("trails", True, action=lambda on: player.ask(lambda: drawing.trails.show(on)))
        panel.menu(
            "links", LINKS, drawing.links, lambda kind: setattr(drawing, "links", kind),
            "to the three nearest, or to all in radio range; paler where packets are lost",
        )  # fmt: skip
        self.follow = panel.menu("follow", FOLLOWED, FOLLOWED[0], self._follow)
        self.jump = panel.menu("collisions", (JUMP,), JUMP, self._jump, "goes back to one second before it")
        self.listed = panel.text()
        self._in_menu: list[Collision] = []
        self._camera_of = ""  # which scenario the camera is set for
        for key, label, action in (
            ("P", "Pause or fly", player.toggle), ("N", "Step", player.step), ("R", "Reset", self.reset),
            ("B", "Back", self.back),
        ):  # fmt: skip
            panel.command(label, key, self.ask(action))

    def rebuild(self) -> None:
        """What may colour the agents of these flights; whom the camera follows in a scenario that is new here."""
        player = self.player
        self._show_seed_and_agents()
        if self._camera_of != player.side.origin.where:
            self._camera_of = player.side.origin.where
            free = player.scenario.world.arena == "none" and not self.drawing.stages[0].solids
            self.follow.value = self.drawing.follow = FOLLOWED[1 if free else 0]
        known = ways(self.drawing.flocks)
        if tuple(self.way.options) != known:
            self.way.options = known
            self.drawing.shading.way = self.drawing.shading.way if self.drawing.shading.way in known else known[0]
            self.way.value = self.drawing.shading.way

    def _show_seed_and_agents(self) -> None:
        """Show seed and number of agents of what flies."""
        self.seed.value, self.agents.value = self.player.seed, self.player.flight.agents

    def _follow(self, whom: str) -> None:
        self.drawing.follow = whom

    def _go(self) -> None:
        """Go to the moment that was typed."""
        try:
            time = float(self.moment.value)
        except ValueError:
            time = math.nan
        if not 0.0 <= time <= self.player.time:
            raise StudioError(
                f"moment = {self.moment.value or 'nothing'}: give a time from 0 to {self.player.time:g} s"
            )
        self.back(time)

    def _speed(self, speed: float) -> None:
        self.player.pace.speed = speed

    def back(self, time: float | None = None) -> None:
        """Go back to a time, s, or by ten seconds."""
        self.player.back(self.player.time - SOON if time is None else time)
        self.page.show_other_time()

    def reset(self, seed: int | None = None, agents: int | None = None) -> None:
        """Begin another flight; where that is refused, the fields show what flies."""
        try:
            self.player.reset(seed, {} if agents is None else {"agents": agents})
        except AirflockError:
            self._show_seed_and_agents()
            raise
        self.drawing.collisions.clear()
        self.page.rebuild()

    def _jump(self, chosen: str) -> None:
        when = next((c.time for c in self._in_menu if self._name(c) == chosen), None)
        if when is not None:
            self.player.ask(lambda: self.back(max(when - BEFORE, 0.0)))

    def _name(self, c: Collision) -> str:
        side = f", {NAMES[c.side]}" if len(self.player.sides) > 1 and c.side != BOTH else ""
        return f"t = {c.time:.1f} s: {c.first} and {c.second}{side}"

    def refresh(self) -> None:
        """The button's words, the key to the colours, and the list of collisions."""
        label = "Fly" if self.player.paused else "Pause"
        if self.pause.label != label:
            self.pause.label = label
        drawing = self.drawing
        self.key.content = drawing.shading.shown.key
        if self.way.value != drawing.shading.way:
            self.way.value = drawing.shading.way
        collisions = drawing.collisions.listed
        if collisions != self._in_menu:
            self._in_menu = collisions
            self.jump.options = (JUMP, *dict.fromkeys(map(self._name, collisions)))
            self.jump.value = JUMP
            few = "<br>".join(self._name(c) for c in collisions[:8])
            self.listed.content = note(f"<b>Pairs that collided</b><br>{few}") if collisions else ""
