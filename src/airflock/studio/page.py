"""Page: the player's flight on a view, frame by frame, and the controls that play, tune and measure it."""

import html
import math
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.errors import AirflockError
from airflock.metrics.registry import numbers_of
from airflock.stage import colours
from airflock.stage.scene import stage_of, turned
from airflock.studio import measures
from airflock.studio.controls import Control, controls_of
from airflock.studio.player import Player, value_of
from airflock.studio.view import View

OPEN = 8.0  # s; half of what is seen of an open world is at least the way flown in this time
PIECE = 6  # frames of one piece of a trail
FRAMES = 30  # per second of real time
CHARTS = 5  # per second
SOON = 10  # s; how far one press goes back
SPEEDS = {"0.1 ×": 0.1, "0.5 ×": 0.5, "1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0, "20 ×": 20.0, "as fast as it goes": 1e9}
MARGIN = 20.0  # a dart of a flock of a hundred is so many times smaller than half the picture


class Page:
    """One page: call `run` to fly until `stop` or Ctrl-C."""

    def __init__(self, player: Player, view: View):
        self.player, self.view = player, view
        self.measures = measures.Measures()
        self.chosen: int | None = None
        self.collisions: deque[tuple[float, int, int]] = deque(maxlen=12)
        self._touching: set[tuple[int, int]] = set()
        self._handles: dict[str, tuple[Any, Control]] = {}
        self._before: NDArray[Any] | None = None
        self._pieces = 0
        self._running = True
        self._shown: Any = None
        self.stage = stage_of(player.scenario, player.motion[0])
        self._build()
        self._stand()
        view.on_click(lambda origin, way: player.ask(lambda: self._choose(origin, way)))

    def stop(self) -> None:
        """End `run` after the frame at hand; from any thread."""
        self._running = False

    def run(self) -> None:
        """Fly and draw in real time until the page is stopped."""
        now = drawn = charted = time.perf_counter()
        while self._running:
            last, now = now, time.perf_counter()
            moved = self.player.tick(now - last)
            chart = now - charted >= 1.0 / CHARTS
            if moved or chart:
                self._frame(chart)
            charted = now if chart else charted
            drawn = max(drawn + 1.0 / FRAMES, now)
            time.sleep(max(drawn - time.perf_counter(), 0.001))

    # ----------------------------------------------------------------------------------------------- what stands

    def _stand(self) -> None:
        """Draw the world of the present flight, and its agents at their start."""
        position, velocity = self.player.motion
        scenario, view = self.player.scenario, self.view
        self.stage = stage_of(scenario, position)
        self._period = measures.period_of(scenario)
        measured = scenario.measured_by()
        counts = {"n_coll", "phi_coll", "collisions"} & set(numbers_of(scenario.measures, measured))
        self._near = float(measured.r_coll) if counts else 0.0  # fish have no collisions
        speed = float(np.sqrt((velocity**2).sum(1)).max())
        self.top = max(1.5 * float(measured.v_flock or 0.0), 1.1 * speed, 1e-3)
        if scenario.world.arena == "none" and not self.stage.solids:
            self.stage = self.stage._replace(span=max(self.stage.span, OPEN * self.top / 1.5))
        flat = scenario.dimensions == 2
        with view.atomic():
            view.clear()
            view.ground(self.stage.span, self.stage.height[0], self.stage.centre)
            for solid in self.stage.solids:
                view.solid(solid)
            for lines in self.stage.lines:
                view.lines(lines)
            crowd = min(1.0, (100.0 / len(position)) ** 0.25)
            self.size = self.stage.span * crowd / MARGIN
            view.agents(len(position), self.size)
        beside = np.array([0.3 * self.stage.span if flat else 0.0, 0.0, 0.0])  # of the panel
        view.look_at(self.stage.centre + beside, self.stage.span, flat)
        self.chosen, self._before, self._pieces = None, None, 0
        self._touching.clear()
        self.measures.clear()
        self._shown = self.player.preset
        self._frame(True)

    # ------------------------------------------------------------------------------------------------- controls

    def _build(self) -> None:
        view, player = self.view, self.player
        ask = self._asking
        self.title = view.text()
        self.trouble = view.text()
        play, tune, measure = view.tabs("Play", "Tune", "Measure")
        with play:
            self.pause = view.button("Pause", ask(player.toggle), "or the key P", "PLAYER_PAUSE")
            view.row(
                {
                    "Step": ask(player.step),
                    f"Back {SOON} s": ask(lambda: self._back(player.flight.time - SOON)),
                    "Reset": ask(self._reset),
                }
            )
            view.menu("speed", tuple(SPEEDS), "1 ×", lambda chosen: self._speed(SPEEDS[chosen]))
            view.number("seed", player.seed, 0, 2**31, lambda seed: player.ask(lambda: self._reset(seed)))
            most = max(1000, player.flight.agents)
            view.number(
                "agents", player.flight.agents, 1, most, lambda n: player.ask(lambda: self._reset(agents=n)),
                "another number begins another flight",
            )  # fmt: skip
            self.way = view.menu("colour by", colours.WAYS, "speed", lambda _: None)
            self.key = view.text()
            self.trails = view.checkbox("trails", True)
            self.links = view.checkbox("nearest neighbours", False, "lines from each agent to its three nearest")
            self.follow = view.checkbox(
                "follow the flock", player.scenario.world.arena == "none" and not self.stage.solids
            )
            with view.folder("Selected agent"):
                self.about = view.text(_note("click an agent"))
                view.row(
                    {
                        "Previous": ask(lambda: self._select(-1)),
                        "Next": ask(lambda: self._select(1)),
                        "Push": ask(self._push),
                        "None": ask(self._unselect),
                    }
                )
            self.listed = view.text()
        with tune:
            view.row(
                {
                    "Undo": ask(lambda: self._put(player.undo())),
                    "Back to preset": ask(lambda: self._put(player.to_preset())),
                }
            )
            view.row(
                {
                    "Save scenario (.toml)": ask(self._save_toml),
                    "Save flight (.nc)": ask(self._save_recording),
                    "Save replay (.html)": ask(self._save_replay),
                }
            )
            self.command = view.text()
            for section, controls in controls_of(player.preset).items():
                with view.folder(section, section == "model"):
                    for control in controls:
                        self._handles[control.key] = view.control(control, self._change), control
        with measure:
            names = [name for name, value in player.flight.scores().items() if isinstance(value, (int, float))]
            published = player.scenario.published
            self.measures.name = measures.chosen_score(dict.fromkeys(names), published)
            view.menu("order parameter", names, self.measures.name, lambda name: player.ask(lambda: self._name(name)))
            self.course = view.chart("since the last change", ("value", "paper +", "paper −"), band=True)
            self.speeds = view.chart("speed (m/s)", ("mean", "slowest", "fastest"))
            self.nearest = view.chart("smallest distance (m)", ("nearest pair",))
            self.table = view.text()
        for key, label, action in (
            ("P", "Pause or fly", player.toggle), ("N", "Step", player.step), ("R", "Reset", self._reset),
            ("B", "Back", lambda: self._back(player.flight.time - SOON)), ("S", "Next agent", lambda: self._select(1)),
        ):  # fmt: skip
            view.command(label, key, ask(action))

    def _asking(self, action: Callable[[], Any]) -> Callable[[], None]:
        return lambda: self.player.ask(lambda: (action(), None)[1])

    def _speed(self, speed: float) -> None:
        self.player.pace.speed = speed

    def _change(self, key: str, value: Any) -> None:
        self.player.ask(lambda: self._changed(key, value))

    def _changed(self, key: str, value: Any) -> None:
        try:
            self.player.change(key, value)
        except AirflockError:
            self._put({key: value_of(self.player.scenario, key)})
            raise
        self.measures.course.clear()

    def _put(self, values: dict[str, Any]) -> None:
        """Show values on their controls."""
        for key, value in values.items():
            if key in self._handles:
                self._handles[key][0].value = value
        self.measures.course.clear()

    def _name(self, name: str) -> None:
        self.measures.name = name
        self.measures.course.clear()

    def _back(self, moment: float) -> None:
        self.player.back(moment)
        self.view.no_trails()
        self._before = None
        self.measures.clear()
        values = {key: value_of(self.player.scenario, key) for key in self._handles}
        self._put({key: v for key, v in values.items() if v != self._handles[key][0].value})

    def _reset(self, seed: int | None = None, agents: int | None = None) -> None:
        self.player.reset(seed, {} if agents is None else {"agents": agents})
        self.collisions.clear()
        self._stand()
        self._put({key: value_of(self.player.scenario, key) for key in self._handles})

    def _push(self) -> None:
        if self.chosen is not None:
            self.player.push(self.chosen, 2.0 * self.top / 1.5)

    def _save_toml(self) -> None:
        path = self.player.save_toml(_free(Path(f"{_stem(self.player)}_tuned.toml")))
        self._saved(path)

    def _save_recording(self) -> None:
        path = self.player.save_recording(_free(Path(f"{_stem(self.player)}_seed{self.player.seed}.nc")))
        self._saved(path)

    def _save_replay(self) -> None:
        self._saved(self.player.save_replay(_free(Path(f"{_stem(self.player)}_seed{self.player.seed}.html"))))

    def _saved(self, path: Path) -> None:
        self.player.note = f"saved {path.absolute()}"
        self.player.fault(self.player.note)
        self.view.say("Saved", str(path.absolute()))

    # ------------------------------------------------------------------------------------------------ selecting

    def _choose(self, origin: NDArray[Any], way: NDArray[Any]) -> None:
        """Select the agent nearest to a ray, if it is near."""
        position, _ = self.player.motion
        away = position - origin
        along = np.maximum(away @ way, 0.0)
        off = np.linalg.norm(away - along[:, None] * way, axis=1)
        best = int(off.argmin())
        self.chosen = best if off[best] < 2.0 * self.size else None
        self._frame(True)

    def _select(self, by: int) -> None:
        self.chosen = ((-1 if self.chosen is None else self.chosen) + by) % self.player.flight.agents
        self._frame(True)

    def _unselect(self) -> None:
        self.chosen = None
        self._frame(True)

    def _look(self) -> None:
        """Show what the selected agent perceives and commands."""
        flat: NDArray[Any] = np.zeros((0, 2, 3))
        heard, ghosts, terms, command = flat, flat, flat, flat
        if self.chosen is None:
            self.about.content = _note("click an agent")
        else:
            seen = self.player.flight.look(self.chosen)
            own = np.array(seen.true[:3])
            at = np.array([other.state[:3] for other in seen.heard]).reshape(-1, 3)
            heard = np.stack([np.broadcast_to(own, at.shape), at], 1)
            cross = self.size * 0.5 * np.array([[[-1, -1, 0], [1, 1, 0]], [[-1, 1, 0], [1, -1, 0]]], float)
            ghosts = (at[:, None, None] + cross).reshape(-1, 2, 3)
            length = 5.0 * self.size / max(self.top, 1e-9)
            wish = np.zeros(3)
            wish[: len(seen.command)] = seen.command
            command = np.array([[own, own + wish * length]])
            if seen.sums is not None and {"x", "y"} <= set(seen.sums._fields):
                pull = np.array([seen.sums.x, seen.sums.y, getattr(seen.sums, "z", 0.0)])
                terms = np.array([[own, own + pull * length]])
            self.about.content = _about(seen)
        for name, points in (("heard", heard), ("ghosts", ghosts), ("terms", terms), ("command", command)):
            self.view.extra(name, points)

    # -------------------------------------------------------------------------------------------------- frames

    def _frame(self, chart: bool) -> None:
        if self.player.preset is not self._shown:
            return
        position, velocity = self.player.motion
        if not np.isfinite(position).all():
            self._told()
            return
        tone = colours.colours(self.way.value, position, velocity, self.top, self.stage.height)
        pairs, anew = measures.Pairs(position, self._period), False
        tone = self._flash(tone, pairs)
        trail = tone.copy()
        if self.chosen is not None:
            tone[self.chosen] = colours.CHOSEN
        with self.view.atomic():
            self.view.move(position, turned(velocity), tone)
            if self._before is not None and self.trails.value:
                self._pieces += 1
                anew = self._pieces % PIECE == 0
                self.view.trail(self._from(position), position, trail, anew)
            if self.follow.value:
                self.view.follow(position.mean(axis=0).astype(float))
            self.view.extra("links", pairs.neighbours() if self.links.value else np.zeros((0, 2, 3)))
            if chart:
                self._chart(velocity, pairs)
                self._look()
        if self._before is None or anew:
            self._before = position

    def _from(self, position: NDArray[Any]) -> NDArray[Any]:
        """Where a piece of trail begins: where the agent was, or here if it went through a periodic face."""
        assert self._before is not None
        if self._period is None:
            return self._before
        far = (np.abs(position - self._before) > 0.5 * np.array([s or np.inf for s in self._period])).any(axis=1)
        return np.where(far[:, None], position, self._before)

    def _flash(self, tone: NDArray[np.uint8], pairs: measures.Pairs) -> NDArray[np.uint8]:
        """Colour who collides, and list new collisions."""
        touching = pairs.within(self._near)
        tone[touching.ravel()] = colours.ALERT
        now = {(int(i), int(j)) for i, j in touching}
        for i, j in sorted(now - self._touching):
            self.collisions.appendleft((self.player.flight.time, i, j))
        self._touching = now
        return tone

    def _chart(self, velocity: NDArray[Any], pairs: measures.Pairs) -> None:
        flight = self.player.flight
        scores = self.measures.note(flight, velocity, pairs)
        instants = np.array(self.measures.instants)
        self.speeds.data = tuple(np.ascontiguousarray(instants[:, c]) for c in (0, 1, 2, 3))
        self.nearest.data = tuple(np.ascontiguousarray(instants[:, c]) for c in (0, 4))
        if self.measures.course:
            course = np.array(self.measures.course)
            mean, spread = flight.scenario.published.get(self.measures.name, (math.nan, None))
            edge = np.full(len(course), mean)
            half = spread or 0.0
            self.course.data = (course[:, 0].copy(), course[:, 1].copy(), edge + half, edge - half)
        self.table.content = measures.score_table(flight, scores)
        self.key.content = colours.key(self.way.value, self.top, self.stage.height)
        self._told()

    def _told(self) -> None:
        """Say where the flight is, what is wrong, and what has happened."""
        player, flight = self.player, self.player.flight
        state = "paused" if player.paused else "stopped" if player.failure else "flying"
        self.title.content = (
            f"<div style='padding:0 0.75em'><b>{html.escape(player.where)}</b><br><small>t = {flight.time:.1f} s · "
            f"{flight.agents} agents · seed {player.seed} · {state} · {len(flight.events)} events</small></div>"
        )
        said = player.status
        if player.failure:
            said += " — press “Back” for the moment before"
        tone = "#b00020" if player.failure else "#555"
        self.trouble.content = f"<div style='padding:0 0.75em;color:{tone}'>{html.escape(said)}</div>" if said else ""
        label = "Fly" if player.paused else "Pause"
        if self.pause.label != label:
            self.pause.label = label
        self.command.content = _note(f"<code>{html.escape(player.command)}</code>")
        lines = [f"t = {when:.1f} s: {i} and {j}" for when, i, j in self.collisions]
        self.listed.content = _note("<b>Nearer than a collision</b><br>" + "<br>".join(lines)) if lines else ""


def _note(text: str) -> str:
    return f"<div style='padding:0 0.75em;font-size:0.85em'>{text}</div>"


def _about(seen: Any) -> str:
    """What is said of a selected agent."""
    speed = math.hypot(*seen.true[3:])
    oldest = max((other.age for other in seen.heard), default=0.0)
    wish = ", ".join(f"{part:.2f}" for part in seen.command)
    return _note(
        f"<b>agent {seen.agent}</b>, {speed:.2f} m/s<br>hears {len(seen.heard)} others, at most {oldest:.2g} s old"
        f"<br>command ({wish})<br><span style='color:#E69F00'>━</span> heard "
        f"<span style='color:#CC79A7'>✕</span> where they were heard<br><span style='color:#009E73'>━</span> "
        f"neighbours' terms <span style='color:#D55E00'>━</span> command"
    )


def _stem(player: Player) -> str:
    return Path(player.where).with_suffix("").name


def _free(path: Path) -> Path:
    """A name that is not taken: flight.nc, flight-2.nc, ..."""
    found, number = path, 2
    while found.exists():
        found, number = path.with_name(f"{path.stem}-{number}{path.suffix}"), number + 1
    return found
