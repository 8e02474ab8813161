"""State: the rows of a flock by what they hold, its numbers and its integers, as stages name them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.words import NOTHING

Row = Any  # one number per agent: row[i]
# The scene is one tuple of arrays: shapes, nodes and links (`world.bvh`); near, numbers of gathered shapes; counts
# (rays cast at this decision, whether positions before are known); goals, aim (where the goal is, its number) and
# reached (time of each, s; -1 before); later (bounds, time and number of each shape that is yet to appear; time -1 once
# it has). A shape that is not there yet has its bounds far away, so that nothing meets it.
SCENE = ("shapes", "nodes", "links", "near", "counts", "goals", "aim", "reached", "later")


@dataclass(frozen=True)
class Axes:
    """Rows of a vector, one per axis that is flown: rows[X][i]; zero along any other."""

    prefix: str
    take: Callable[[str], Row]
    dimensions: int

    def __getitem__(self, axis: int) -> Row:
        return self.take(self.prefix + "xyz"[axis]) if axis < self.dimensions else NOTHING


@dataclass(frozen=True)
class Columns:
    """Rows of a record, one per field: rows[c][i]."""

    prefix: str
    take: Callable[[str], Row]

    def __getitem__(self, column: int) -> Row:
        return self.take(f"{self.prefix}{column}")


class Flock:
    """Rows of one flock, each with one number per agent.

    number                               : of agent i, by which random numbers and others know it
    position, velocity, command          : true state (m, m/s), and what was asked of the body
    measured_position, measured_velocity : own state as the agent believes it
    heard_position, heard_velocity       : its state as others hear it
    packet                               : where packets are kept, those of each pair: packet[c][i, j] is number c
                                           (`Plan.of_pair`) of what agent i has of agent j
    own_error, own_drift                 : error of the own measured position (m) and velocity (m/s)
    sent_error, sent_drift               : the same of what is sent to others
    reach_out, reach_in                  : squares of how far it is heard and hears, m²; negative: not at all
    clock                                : how far its clock is ahead, s
    stopped, stop_position, stands_until : whether it stopped for somebody whom it has lost (1 or 0), where, and until
                                           when it stands, s
    away, square                         : offsets of the others from one agent (m), and their squares (m²), FAR of
                                           whom it does not hear
    hidden, fade                         : whether something hides each of them (1 or 0), normal numbers of signals
    clear                                : whether nothing stands in the way of packets from each of them (1 or 0)
    met, heap, weak                      : whether that agent meets each of them (1 or 0), and scratch to find out
    sums, walls                          : what the rules for neighbours and for surfaces add up to, by field
    body, sense                          : what the body and the sensor remember, by field of their Memory
    goal, departed                       : where its own goal is, and where it started, m
    speed, heading                       : m/s, and unit vector, of the true state
    excursion                            : how far it is outside the arena or inside of what stands in it, m
    before, touches                      : where it was when it was last looked at (m), and whether it touched (1 or 0)
    rays                                 : rays that it cast at its last decision
    errors, chances                      : normal and uniform numbers of the sensors
    outer, words                         : normal numbers of the outer noise, and random words

    take       : the row of a name in the driver
    dimensions : 2 or 3
    number     : row of the numbers of agents
    """

    def __init__(self, take: Callable[[str], Row], dimensions: int, number: Row):
        def axes(prefix: str) -> Axes:
            return Axes(prefix, take, dimensions)

        self.number = number
        self.position, self.velocity, self.command = axes(""), axes("v"), axes("c")
        self.measured_position, self.measured_velocity = axes("m"), axes("mv")
        self.heard_position, self.heard_velocity = axes("h"), axes("hv")
        self.own_error, self.own_drift = axes("own_q"), axes("own_u")
        self.sent_error, self.sent_drift = axes("sent_q"), axes("sent_u")
        self.stop_position = axes("stop_")
        self.sums, self.walls, self.body = Columns("sum", take), Columns("wall", take), Columns("body", take)
        self.away = Columns("away", take)
        self.errors, self.outer, self.words = Columns("e", take), Columns("g", take), Columns("u", take)
        self.sense, self.chances = Columns("sense", take), Columns("chance", take)
        self.packet = Columns("packet", take)
        self.goal, self.departed, self.before = axes("goal_"), axes("from_"), axes("before_")
        self.heading = axes("head_")
        self._take = take

    @property
    def speed(self) -> Row:
        """Speed of each agent, m/s."""
        return self._take("speed")

    @property
    def excursion(self) -> Row:
        """How far each agent is outside, m."""
        return self._take("excursion_")

    @property
    def touches(self) -> Row:
        """Whether each agent touched the scene since it was last looked at, 1 or 0."""
        return self._take("touches_")

    @property
    def rays(self) -> Row:
        """How many rays each agent cast at its last decision."""
        return self._take("rays_")

    @property
    def square(self) -> Row:
        """Squared distance of each other agent, m²; FAR of whom one agent does not hear."""
        return self._take("square")

    @property
    def hidden(self) -> Row:
        """Whether something that stands in the world hides each other agent, 1 or 0."""
        return self._take("hidden")

    @property
    def clear(self) -> Row:
        """Whether nothing stands between one agent and each other one, 1 or 0."""
        return self._take("clear")

    @property
    def fade(self) -> Row:
        """Normal number of the signal of each other agent."""
        return self._take("fade")

    @property
    def met(self) -> Row:
        """Whether one agent meets each other one, 1 or 0."""
        return self._take("met")

    @property
    def heap(self) -> Row:
        """Scratch of whoever ranks agents."""
        return self._take("heap")

    @property
    def weak(self) -> Row:
        """Scratch of whoever ranks signals."""
        return self._take("weak")

    @property
    def reach_out(self) -> Row:
        """Square of how far the packets of each agent carry, m²; negative where nobody hears it."""
        return self._take("reach_out")

    @property
    def reach_in(self) -> Row:
        """Square of how far each agent hears, m²; negative where it hears nobody."""
        return self._take("reach_in")

    @property
    def clock(self) -> Row:
        """How far the clock of each agent is ahead, s."""
        return self._take("clock")

    @property
    def stopped(self) -> Row:
        """Whether each agent stopped for somebody whom it has lost, 1 or 0."""
        return self._take("stopped")

    @property
    def stands_until(self) -> Row:
        """Time until which each agent that stopped stands, s."""
        return self._take("stands_until")

    def fault(self, kind: str, what: str) -> Row:
        """Of a kind of fault: its "onset" (s) and how long it "lasts" (s; 0 where there is none), or one number."""
        return self._take(fault_row(kind, what))

    def shared(self, owner: str, name: str) -> Row:
        """A column of Shared, that a rule of the whole flock fills: of the "model" or of a metric, by its name."""
        return self._take(f"shared_{owner}_{name}")

    def pair(self, metric: str, name: str) -> Row:
        """What the pair rule of a metric found, one field of it."""
        return self._take(f"{metric}_{name}")

    def own(self, letter: str, name: str) -> Row:
        """A number that differs among agents."""
        return self._take(own_row(letter, name))


def tree(scene: Any) -> tuple[Any, Any, Any]:
    """Shapes of a scene and the tree over them, as `world.bvh` takes them."""
    return scene.shapes, scene.nodes, scene.links


def fault_row(kind: str, what: str) -> str:
    """Name of the row with one number of a kind of fault."""
    return f"fault_{kind}_{what}"


def own_row(letter: str, name: str) -> str:
    """Name of the row with a number that differs among agents; without a letter it is of no record."""
    return f"number_{letter}_{name}" if letter else name


def numbers_of(i: int, letter: str, flock: Flock, numbers: Any, *, plan: Plan) -> Any:
    """Record of numbers of agent i: that of the flock, with its own where they differ among agents."""
    return (
        numbers.own[letter](
            *[
                flock.own(letter, name)[i] if (letter, name) in plan.varied else getattr(getattr(numbers, letter), name)
                for name in plan.records[letter]
            ]
        )
        if plan.varies(letter)
        else getattr(numbers, letter)
    )
