"""Records: what stages hand on together. No driver has them: while it is made, a record stands for its parts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from airflock.core import Model
from airflock.engine.plan import Plan

if TYPE_CHECKING:
    from airflock.engine.stages.state import FlockRows


@dataclass(frozen=True)
class WorldArrays:
    """The world as arrays: ends of all walls, the span of them that each obstacle has, and the scene."""

    edges: Any
    spans: Any
    scene: Any


@dataclass(frozen=True)
class FlightView:
    """A flight as its stages see it.

    plan, model    : what is known while a driver is made; the law of these stages
    flock          : rows of all agents
    numbers, whole : records of numbers by letter, and integers, by name
    around         : the world as arrays
    """

    plan: Plan
    model: Model
    flock: "FlockRows"
    numbers: Any
    whole: Any
    around: WorldArrays


@dataclass(frozen=True)
class Decision:
    """One decision of a flock.

    step, agents : its number, and how many decide
    time, late   : now, and how old what is heard is on arrival, s
    fast, slow   : packets that either link of a radio sends in it
    drawn        : draws the random word of what agent j sends agent i, where each pair draws for
                   itself
    """

    step: int
    agents: int
    time: Any
    late: Any
    fast: Any
    slow: Any
    drawn: Callable[[int, int], Any] | None


@dataclass(frozen=True)
class CandidateRows:
    """Rows of the agents that a pair loop visits: all of a flock, or the candidates around a line of cells.

    number, group : of each, and what it is heard to do
    square, away  : what the agent makes of each, from here on by its place among the others
                    (`stages.state.Flock`)
    """

    number: Any
    group: Any
    heard_position: Any
    heard_velocity: Any
    square: Any
    away: Any
    hidden: Any
    fade: Any
    met: Any
    heap: Any
    weak: Any


@dataclass(frozen=True)
class SquaredRanges:
    """Squared ranges of an agent: of its radio and of its law, m².

    radio, radio_ : square of the radio's range, and as squares that carry the guard TINY are
                    compared with it
    law           : square of the law's reach
    """

    radio: Any
    radio_: Any
    law: Any


@dataclass(frozen=True)
class PairLoopAgent:
    """An agent that goes through the others.

    i           : its place in the rows
    ii, number  : its place among the others, and its number, as wide as real numbers
    end         : how many the others are, where more are gone through, to fill vectors
    own, v, h   : where it believes that it is (m), how it moves (m/s) and heads
    true        : where it is, m
    p           : its numbers of the law
    talkers     : how many others talk within the range of its radio
    words       : random words of what it is sent, by sender
    others      : rows of those that it goes through
    reach, at   : its ranges, and the decision
    """

    i: int
    ii: Any
    number: Any
    end: Any
    own: Any
    v: Any
    h: Any
    true: Any
    p: Any
    talkers: Any
    words: Any
    others: CandidateRows
    reach: SquaredRanges
    at: Decision


@dataclass(frozen=True)
class NeighbourEstimate:
    """An estimate of another agent: offset (m) and relative velocity (m/s) with their lengths, heading, age (s).

    r2 : square of the offset's length, m²
    """

    d: Any
    dv: Any
    h: Any
    r: Any
    r2: Any
    speed: Any
    age: Any


@dataclass(frozen=True)
class SortedCells:
    """A flock sorted by cells.

    starts       : first place of each cell
    whose        : who is at each place
    packed, flat : their states, by place and component, and by component and place
    count        : of cells along each axis
    """

    starts: Any
    whose: Any
    packed: Any
    flat: Any
    count: Any


@dataclass(frozen=True)
class HomeCell:
    """The cell of an agent: where it is along each axis, and how many cells there are below and above it."""

    at: Any
    low: Any
    high: Any


@dataclass(frozen=True)
class GrowingClusters:
    """Clusters that grow, one after another.

    left, places  : how many of a cell are in none yet, and at which places
    reached, cell : places of all who are, cluster by cluster, and their cells
    """

    left: Any
    places: Any
    reached: Any
    cell: Any


@dataclass(frozen=True)
class CellLine:
    """All who lie in and around a line of cells.

    others : their rows, side by side
    slab   : where those of each cell and of the cells beside it across the line begin
    middle : where in a slab those of the line's own cell begin
    """

    others: CandidateRows
    slab: Any
    middle: Any
