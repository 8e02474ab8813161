"""Seeds and events: the inputs of a flight besides its scenario. The three together give the same bits again.

A seed is the key of the random numbers, two words of 32 bits. An event is a change from outside
before one step.
"""

import math
import operator
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from airflock.support import FlightError, ParameterError


@dataclass(frozen=True)
class Event:
    """A change to a flight before it flew `step`.

    kind : change (keys of the scenario), command (of agents, instead of their law's), push (of
           agents, m/s), place (of agents, m), fault (of some agents), remove (an agent drops out),
           add (one that was absent joins), or branch (another world's random numbers)
    data : plain values, as the method of `Flight` of the same name takes them
    """

    step: int
    kind: str
    data: Mapping[str, Any] = field(default_factory=dict)

    def plain(self) -> dict[str, Any]:
        """Return the event as a dict of plain values, for JSON."""
        return {"step": self.step, "kind": self.kind, "data": dict(self.data)}


KINDS = ("change", "command", "push", "place", "fault", "remove", "add", "branch")


def to_events(items: Sequence[Event | Mapping[str, Any]]) -> list[Event]:
    """Make events from events or plain dicts, in the order of their steps. Raises FlightError."""
    if not isinstance(items, Iterable):
        raise FlightError(f"events = {items!r}: give a list of events, such as those of a flight")
    events = []
    for number, entry in enumerate(items):
        try:
            event = entry if isinstance(entry, Event) else Event(int(entry["step"]), str(entry["kind"]), entry["data"])
        except (KeyError, TypeError, ValueError) as error:
            raise FlightError(f"events[{number}]: needs step, kind and data") from error
        if event.kind not in KINDS or event.step < 0 or not isinstance(event.data, Mapping):
            raise FlightError(
                f"events[{number}]: kind = {event.kind!r} at step {event.step}; known kinds: {', '.join(KINDS)}"
            )
        events.append(event)
    # sorted() is stable: events of one step keep their order, which changes the result.
    return sorted(events, key=lambda event: event.step)


def to_vectors(name: str, value: Any, count: int, dimensions: int, unit: str) -> list[Any]:
    """Check one finite vector for all of `count` agents, or one for each. Raises FlightError."""
    rows = value.tolist() if hasattr(value, "tolist") else value
    each = isinstance(rows, (list, tuple)) and any(hasattr(row, "__len__") for row in rows)
    if not each:
        return to_vector(name, rows, dimensions, unit)
    if len(rows) != count:
        raise FlightError(f"{name}: {len(rows)} rows for {count} agents; give one for all, or (agent, axis)")
    return [to_vector(f"{name}[{number}]", row, dimensions, unit) for number, row in enumerate(rows)]


def to_vector(name: str, value: Any, dimensions: int, unit: str) -> list[float]:
    """Check a finite vector; return plain floats. Raises FlightError in one line."""
    try:
        vector = [float(c) for c in value]
    except (TypeError, ValueError):
        vector = []
    if len(vector) != dimensions or not all(math.isfinite(c) for c in vector):
        axes = ("east", "north", "up")[:dimensions]
        raise FlightError(f"{name} = {value!r} is not [{', '.join(axes)}] in {unit or '1'}, each finite")
    return vector


def check_agent(agent: Any, agents: int) -> int:
    """Return the number of an agent of the flock. Raises FlightError in one line."""
    try:  # not int(): 1.5 or "3" would pass as another agent
        number = -1 if isinstance(agent, bool) else operator.index(agent)
    except TypeError:
        number = -1
    if not 0 <= number < agents:
        raise FlightError(f"agent = {agent!r}: this flight has the agents 0 to {agents - 1}")
    return number


def are_several(agents: Any) -> bool:
    """Return True if agents are a list, an array or a range, and not one by itself."""
    return (
        isinstance(agents, Iterable)
        and not isinstance(agents, (str, bytes, Mapping))
        and getattr(agents, "ndim", 1) > 0
    )


def check_agents(number_or_list: Any, agents: int) -> list[int]:
    """Return the numbers of one agent or of several different ones. Raises FlightError."""
    numbers = [
        check_agent(number, agents) for number in (number_or_list if are_several(number_or_list) else [number_or_list])
    ]
    if not numbers:
        raise FlightError(f"agent = {number_or_list!r}: names no agent")
    if len(set(numbers)) < len(numbers):
        twice = next(number for place, number in enumerate(numbers) if number in numbers[:place])
        raise FlightError(f"agent = {number_or_list!r}: {twice} is named twice")
    return numbers


LARGEST_SEED = 2**64 - 1
MAX_FLIGHTS = 10_000_000  # flights at a time


def check_seed(seed: Any) -> int:
    """Return a seed as a plain integer. Raises ParameterError, as any other number would fly like another seed."""
    try:
        number = operator.index(seed)
    except TypeError:
        raise ParameterError(f"seed = {seed!r} is not a whole number in [0, 2^64 - 1]") from None
    if not 0 <= number <= LARGEST_SEED:
        raise ParameterError(f"seed = {number} lies outside [0, 2^64 - 1]")
    return number


def check_seeds(seeds: int | Iterable[int]) -> list[int]:
    """Return the seeds of several flights: 0, 1, ... up to a count, or those of a list."""
    if isinstance(seeds, Iterable):
        checked = [check_seed(seed) for seed in islice(seeds, MAX_FLIGHTS + 1)]
        if len(checked) > MAX_FLIGHTS:
            raise ParameterError(f"seeds: more than {MAX_FLIGHTS} flights at a time")
    else:
        try:
            count = operator.index(seeds)
            if count > MAX_FLIGHTS:
                raise ParameterError(f"seeds = {count}: more than {MAX_FLIGHTS} flights at a time")
            checked = list(range(count))
        except TypeError:
            raise ParameterError(f"seeds = {seeds!r} is neither a whole number nor a list of seeds") from None
    if not checked:
        raise ParameterError(f"seeds = {seeds!r}: no flight would be flown; give at least 1")
    return checked
