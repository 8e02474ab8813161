"""State: the rows of a flock by what they hold, its numbers and its integers, as stages name them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.records import CandidateRows
from airflock.engine.stages.words import *

Row = Any  # one number per agent: row[i]
FAULT_PREFIX = "fault_"  # what names of rows with numbers of a fault begin with
NUMBER_PREFIX = "number_"  # those of rows with a number that differs among agents
# The scene is one tuple of arrays: shapes, nodes and links (`world.bvh`); near, numbers of gathered
# shapes; counts (rays cast at this decision, whether positions before are known); goals, aim (where
# the goal is, its number) and reached (time of each, s; -1 before); later (bounds, time and number
# of each shape that is yet to appear; time -1 once it has). A shape that is not there yet has its
# bounds far away, so that nothing meets it.
SCENE_ARRAYS = ("shapes", "nodes", "links", "near", "counts", "goals", "aim", "reached", "later")


@dataclass(frozen=True)
class Axes:
    """Rows of a vector, one per axis that is flown: rows[X][i]; zero along any other."""

    prefix: str
    take: Callable[[str], Row]
    dimensions: int

    def __getitem__(self, axis: int) -> Row:
        return self.take(self.prefix + "xyz"[axis]) if axis < self.dimensions else ZERO_ROW


@dataclass(frozen=True)
class Columns:
    """Rows of a record, one per field: rows[c][i]."""

    prefix: str
    take: Callable[[str], Row]

    def __getitem__(self, column: int) -> Row:
        return self.take(f"{self.prefix}{column}")


def axes_attribute(prefix: str) -> Any:
    """Rows of a vector as an attribute of a flock."""
    return cached_property(lambda flock: Axes(prefix, flock.take, flock.dimensions))


def columns_attribute(prefix: str) -> Any:
    """Rows of a record as an attribute of a flock."""
    return cached_property(lambda flock: Columns(prefix, flock.take))


def row_attribute(name: str) -> Any:
    """One row as an attribute of a flock."""
    return cached_property(lambda flock: flock.take(name))


class FlockRows:
    """Rows of one flock, each with one number per agent: position[X][i], sums[c][i], speed[i].

    take       : the row of a name in the driver
    dimensions : 2 or 3
    number     : of agent i, by which random numbers and others know it
    then       : of faults those numbers that held when what is heard now was sent
    """

    position: Axes = axes_attribute("")  # true state, m
    velocity: Axes = axes_attribute("v")  # m/s
    command: Axes = axes_attribute("c")  # command as decided
    obeyed: Axes = axes_attribute("obeyed_")  # that which the body follows, where commands wait
    measured_position: Axes = axes_attribute("m")  # own state as the agent believes it, m
    measured_velocity: Axes = axes_attribute("mv")  # m/s
    heard_position: Axes = axes_attribute("h")  # its state as others hear it, m
    heard_velocity: Axes = axes_attribute("hv")  # m/s
    packet: Columns = columns_attribute(
        "packet"
    )  # [c][i, j]: number c (`Plan.of_pair`) of what agent i has kept of agent j
    own_error: Axes = axes_attribute("own_q")  # of the own measured position, m
    own_drift: Axes = axes_attribute("own_u")  # of the own measured velocity, m/s
    sent_error: Axes = axes_attribute("sent_q")  # the same of what is sent to others
    sent_drift: Axes = axes_attribute("sent_u")
    reach_out: Row = row_attribute("reach_out")  # square of how far it is heard, m²; negative: not at all
    reach_in: Row = row_attribute("reach_in")  # square of how far it hears
    clock: Row = row_attribute("clock")  # how far its clock is ahead, s
    sent_clock: Row = row_attribute("sent_clock")  # the same when it sent what is heard now
    stopped: Row = row_attribute("stopped")  # whether it stopped for a lost neighbour, 1 or 0
    stop_position: Axes = axes_attribute("stop_")  # where, m
    stands_until: Row = row_attribute("stands_until")  # s
    away: Columns = columns_attribute("away")  # offsets of the others from one agent, m
    square: Row = row_attribute("square")  # squares of their distances, m²; FAR for agents not heard
    closing: Columns = columns_attribute("closing")  # their velocities relative to its own, m/s
    heard_age: Row = row_attribute("heard_age")  # how old what it has heard of each is, s
    seen: Columns = columns_attribute("seen")  # what it observes (`Plan.observed`)
    hidden: Row = row_attribute("hidden")  # whether something that stands in the world hides each of them, 1 or 0
    clear: Row = row_attribute("clear")  # whether nothing stands in the way of packets from each of them, 1 or 0
    fade: Row = row_attribute("fade")  # normal number of the signal of each of them
    met: Row = row_attribute("met")  # whether that agent meets each of them, 1 or 0
    heap: Row = row_attribute("heap")  # scratch for ranking agents
    weak: Row = row_attribute("weak")  # scratch for ranking signals
    sums: Columns = columns_attribute("sum")  # what the rule for neighbours adds up to, by field
    walls: Columns = columns_attribute("wall")  # what the rule for surfaces adds up to
    body: Columns = columns_attribute("body")  # what the body remembers, by field of its Memory
    sense: Columns = columns_attribute("sense")  # what the sensor remembers
    goal: Axes = axes_attribute("goal_")  # where its own goal is, m
    departed: Axes = axes_attribute("from_")  # where it started, m
    speed: Row = row_attribute("speed")  # of the true state, m/s
    heading: Axes = axes_attribute("head_")  # unit vector
    excursion: Row = row_attribute("excursion_")  # how far it is outside the arena or inside of what stands in it, m
    before: Axes = axes_attribute("before_")  # where it was when it was last looked at, m
    before_step: Axes = axes_attribute(
        "unhindered_v"
    )  # velocity before a motion step, where a fault of motion may act, m/s
    touches: Row = row_attribute("touches_")  # whether it touched the scene since then, 1 or 0
    rays: Row = row_attribute("rays_")  # rays that it cast at its last decision
    errors: Columns = columns_attribute("e")  # normal numbers of the sensors
    chances: Columns = columns_attribute("chance")  # uniform numbers of the sensors
    outer: Columns = columns_attribute("g")  # normal numbers of the outer noise
    words: Columns = columns_attribute("u")  # random words

    def __init__(self, take: Callable[[str], Row], dimensions: int, number: Row, then: bool = False):
        self.take, self.dimensions, self.number, self.then = take, dimensions, number, then

    @cached_property
    def as_sent(self) -> "FlockRows":
        """The flock with the faults of the moment when the data heard now were sent."""
        return FlockRows(self.take, self.dimensions, self.number, then=True)

    def fault(self, kind: str, column: str) -> Row:
        """Of a kind of fault: its "onset" (s) and how long it "lasts" (s; 0 where there is none), or one number."""
        return self.take(fault_row(kind, f"sent_{column}" if self.then else column))

    def kept(self, kind: str, state: str, component: str) -> Row:
        """Of a kind of fault: a component of the state that a rule disturbs, as it was last before the fault began."""
        return self.take(fault_memory_row(kind, state, component))

    def shared(self, owner: str, name: str) -> Row:
        """A column of Shared, that a rule of the whole flock fills: of the "model" or of a metric, by its name."""
        return self.take(f"shared_{owner}_{name}")

    def pair(self, metric: str, name: str) -> Row:
        """Row of one field that the pair rule of a metric has filled."""
        return self.take(f"{metric}_{name}")

    def own(self, letter: str, name: str) -> Row:
        """A number that differs among agents."""
        return self.take(own_row(letter, name))


def followed_command(flock: FlockRows, *, plan: Plan) -> Axes:
    """Return the command that bodies follow now: the one decided last, or where commands wait the one that is due."""
    return flock.obeyed if plan.lags else flock.command


def scene_tree(scene: Any) -> tuple[Any, Any, Any]:
    """Shapes of a scene and the tree over them, as `world.bvh` takes them."""
    return scene.shapes, scene.nodes, scene.links


def fault_row(kind: str, column: str) -> str:
    """Name of the row with one number of a kind of fault."""
    return f"{FAULT_PREFIX}{kind}_{column}"


def fault_memory_row(kind: str, state: str, component: str) -> str:
    """Name of the row with the last undisturbed value for a kind of fault; state as in `core.DISTURBED_STATES`."""
    return fault_row(kind, f"{state}_{component}")


def own_row(letter: str, name: str) -> str:
    """Name of the row with a number that differs among agents; without a letter it is of no record."""
    return f"{NUMBER_PREFIX}{letter}_{name}" if letter else name


def record_from_rows(i: int, record: Any, rows: Columns) -> Any:
    """A record of what rows hold of agent i, by field; None where there is no such record."""
    return record(*[rows[c][i] for c in field_indices(record)]) if record else None


def record_from_table(i: int, record: Any, table: Any, first: int) -> Any:
    """A record of what a table holds of agent i, from row `first` on."""
    return record(*[table[first + c, i] for c in field_indices(record)])


def agent_numbers(i: int, letter: str, flock: FlockRows, numbers: Any, *, plan: Plan) -> Any:
    """Record of numbers of agent i: that of the flock, with its own where they differ among agents."""
    return (
        numbers.own[letter](
            *[
                flock.own(letter, name)[i] if (letter, name) in plan.varied else getattr(getattr(numbers, letter), name)
                for name in plan.fields(letter)
            ]
        )
        if plan.varies(letter)
        else getattr(numbers, letter)
    )


def all_agents(flock: FlockRows) -> CandidateRows:
    """All of a flock, as each agent goes through them."""
    return CandidateRows(
        IdentityRow(), flock.own("", "group"), flock.heard_position, flock.heard_velocity, flock.square, flock.away,
        flock.hidden, flock.fade, flock.met, flock.heap, flock.weak,
    )  # fmt: skip
