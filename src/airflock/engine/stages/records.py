"""Records: what stages hand on together. No driver has them: while it is made, a record stands for its parts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Surroundings:
    """What stands in the world: ends of all walls, which of them are of each obstacle, and the scene."""

    edges: Any
    spans: Any
    scene: Any


@dataclass(frozen=True)
class Decision:
    """One decision of a flock.

    step, agents : its number, and how many decide
    time, late   : now, and how old what is heard is on arrival, s
    fast, slow   : packets that either link of a radio sends in it
    drawn        : draws the random word of what agent j sends agent i, where each pair draws for itself
    """

    step: int
    agents: int
    time: Any
    late: Any
    fast: Any
    slow: Any
    drawn: Callable[[int, int], Any] | None


@dataclass(frozen=True)
class Hearer:
    """An agent that goes through the others.

    i, ii       : its place in the rows, and the same as wide as real numbers
    own, v, h   : where it believes that it is (m), how it moves (m/s) and heads
    true        : where it is, m
    p           : its numbers of the law
    talkers     : how many others talk within the range of its radio
    words       : random words of what it is sent, by sender
    """

    i: int
    ii: Any
    own: Any
    v: Any
    h: Any
    true: Any
    p: Any
    talkers: Any
    words: Any


@dataclass(frozen=True)
class Reach:
    """How far an agent hears and heeds others, m².

    radio, radio_ : square of the radio's range, and as squares that carry the guard TINY are compared with it
    law           : square of the law's reach
    """

    radio: Any
    radio_: Any
    law: Any


@dataclass(frozen=True)
class Other:
    """What an agent makes of another one: offset (m) and relative velocity (m/s) with their lengths, heading, age (s).

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
class Cells:
    """A flock sorted by cells.

    starts      : first place of each cell
    whose, flat : who is at each place, and their states, by component and place
    count       : of cells along each axis
    """

    starts: Any
    whose: Any
    flat: Any
    count: Any


@dataclass(frozen=True)
class Home:
    """The cell of an agent: where it is along each axis, and how many cells there are below and above it."""

    at: Any
    low: Any
    high: Any


@dataclass(frozen=True)
class Growing:
    """Clusters that grow, one after another.

    left, places  : how many of a cell are in none yet, and at which places
    reached, cell : places of all who are, cluster by cluster, and their cells
    """

    left: Any
    places: Any
    reached: Any
    cell: Any
