"""Reach: how far margins reach with a set of numbers, found by flying what is ever worse; and which is shortest."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from airflock.evolve.held import Broken
from airflock.evolve.margins import Margin
from airflock.scenarios.scenario import Scenario

FARTHEST = 8.0  # factor up to which a number is made worse
FINE = 1.1  # ratio of the first value at which something breaks and the last one at which all holds

Test = Callable[[Sequence[Scenario]], Broken | None]  # flies scenarios that are worse; what no longer holds in them


@dataclass(frozen=True)
class Reach:
    """How far a margin reaches for one set of numbers.

    holds  : largest factor that was flown at which all holds; 1: as the scenario is
    breaks : smallest that was flown at which something does not; inf: none up to FARTHEST or to the end of its range
    broken : what breaks there
    """

    margin: Margin
    holds: float = 1.0
    breaks: float = math.inf
    broken: Broken | None = None

    @property
    def ends(self) -> bool:
        """Whether something breaks at all."""
        return math.isfinite(self.breaks)

    @property
    def at_walls(self) -> bool:
        """Whether it ends with contacts with walls and obstacles."""
        return self.broken is not None and self.broken.at_walls

    @property
    def value(self) -> float:
        """Value of the number up to which all holds."""
        return self.margin.value(self.holds)

    @property
    def far(self) -> str:
        """How far it reaches, in words."""
        least = "" if self.ends else " at least"
        return f"{'up' if self.margin.first.way > 0 else 'down'} to {self.margin.told(self.holds)}{least}"

    @property
    def told(self) -> str:
        """How far it reaches and what ends it, in words."""
        end = f", not at {self.margin.told(self.breaks)}: {self.broken.why}" if self.broken else ""
        return f"{self.margin.name}: what held holds {self.far}{end}"


def reach(margin: Margin, test: Test, near: Reach | None = None) -> Reach:
    """How far a margin reaches: doubled until something breaks, then halved.

    near : how far it reached for another set, where flights begin; what lies between its two factors is not told apart
    """
    found = Reach(margin)
    if near is not None and near.ends:
        found = _tried(found, near.breaks, test)
        if found.ends and near.holds > 1.0:
            found = _tried(found, near.holds, test)
    while not found.ends and found.holds < FARTHEST:
        factor = min(2.0 * found.holds, FARTHEST)
        if margin.value(factor) == margin.value(found.holds):  # the end of its range
            return found
        found = _tried(found, factor, test)
    return found if near is not None and found.holds == near.holds else _halved(found, test)


def shortest(margins: Sequence[Margin], test: Test) -> list[Reach]:
    """How far each margin reaches, the shortest first; of the others only that they reach farther."""
    found: list[Reach] = []
    for margin in margins:
        if not found or not found[0].ends:
            own = reach(margin, test)
        else:
            own = _tried(Reach(margin), found[0].breaks, test)
            own = _halved(own, test) if own.ends else own
        shorter = not found or own.breaks < found[0].breaks
        found = [own, *found] if shorter else [*found, own]
    return found


def _halved(found: Reach, test: Test) -> Reach:
    """A reach between whose two factors lies little, or no other value of the number."""
    while found.ends and found.breaks > FINE * found.holds:
        middle = math.sqrt(found.holds * found.breaks)
        if found.margin.value(middle) in (found.margin.value(found.holds), found.margin.value(found.breaks)):
            break
        found = _tried(found, middle, test)
    return found


def _tried(found: Reach, factor: float, test: Test) -> Reach:
    broken = test(found.margin.worse(factor))
    return replace(found, breaks=factor, broken=broken) if broken else replace(found, holds=factor)
