"""Onsets: when faults begin and whom they hit, drawn beforehand; and the columns that are written when they do."""

import math
from collections.abc import Collection, Iterator, Sequence
from typing import Any, NamedTuple

from airflock.core import random
from airflock.scenarios.faulty import FaultEntry
from airflock.scenarios.scenario import Scenario

ENDLESS = 1e9  # s; how long a fault lasts that does not end
HOUR = 3600.0  # s


class FaultOnset(NamedTuple):
    """A fault of one agent that begins, or an agent that drops out.

    step  : before which it begins
    kind  : of the fault; agent : whom it hits
    lasts : s; ENDLESS without an end
    numbers : of the kind, by name
    leaves  : the agent is absent from now on, by a fault that has begun earlier
    entry   : number of the entry of [[faults]] that says so; begin : step before which that fault begins
    """

    step: int
    kind: str
    agent: int
    lasts: float
    numbers: tuple[float, ...]
    leaves: bool = False
    entry: int = 0
    begin: int = 0


def draw_onsets(scenario: Scenario, seed: int, world: int = 0) -> tuple[FaultOnset, ...]:
    """All faults of a flight in the order of their steps."""
    found: list[FaultOnset] = []
    for number, entry in enumerate(scenario.faults):
        found += _of_entry(scenario, entry, number, seed, world)
    return _in_order(found)


def merge_onsets(
    before: Sequence[FaultOnset], after: Sequence[FaultOnset], now: int, lasting: Collection[int]
) -> tuple[FaultOnset, ...]:  # fmt: skip
    """Faults of a flight for which others come into force before step `now`, in the order of their steps.

    What has begun goes on where its fault is named by these as well, with their numbers, or by an entry that stays;
    what would have begun earlier by these does not begin.

    lasting : numbers of the entries before that stay as they are
    """
    named = {_which(onset): onset for onset in after}
    begun = [named.get(_which(o), o) for o in before if o.begin < now and (_which(o) in named or o.entry in lasting)]
    kept = {_which(onset)[:3] for onset in begun}
    gone = [o for o in after if o.begin < now <= o.step and _which(o)[:3] in kept and o not in begun]
    return _in_order([*begun, *gone, *(o for o in after if o.begin >= now)])


def _in_order(found: Sequence[FaultOnset]) -> tuple[FaultOnset, ...]:
    """These in the order of their steps. Nobody leaves by a fault that another of its kind has replaced before."""
    kept: list[FaultOnset] = []
    last: dict[tuple[str, int], FaultOnset] = {}
    for onset in sorted(found, key=lambda onset: onset.step):
        other = last.get((onset.kind, onset.agent), onset)
        if not onset.leaves:
            last[onset.kind, onset.agent] = onset
        elif other.step < onset.step and (other.step, other.entry) > (onset.begin, onset.entry):
            continue
        kept.append(onset)
    return tuple(kept)


def _which(onset: FaultOnset) -> tuple[str, int, int, bool]:
    """What makes a fault of an agent this one, whatever its numbers: when it began, of whom, and whether one leaves."""
    return onset.kind, onset.agent, onset.begin, onset.leaves


def _of_entry(scenario: Scenario, entry: FaultEntry, number: int, seed: int, world: int) -> Iterator[FaultOnset]:
    dt, kind = scenario.flight.dt, entry.fault
    numbers = tuple(float(getattr(entry.numbers, name)) for name in kind.fields)
    for occurrence, at in enumerate(_times(scenario, entry, number, seed, world)):
        ends = min(entry.lasts, entry.until - at, ENDLESS)
        lasts = ends if ends >= ENDLESS else round(ends / dt) * dt
        if lasts <= 0.0:
            continue
        step = round(at / dt)
        gone = kind.time_to_absence(entry.numbers)
        for agent in _hit(entry, number, occurrence, seed, world):
            yield FaultOnset(step, kind.name, agent, lasts, numbers, entry=number, begin=step)
            if gone < lasts:
                yield FaultOnset(step + round(gone / dt), kind.name, agent, lasts, numbers, True, number, step)


def _times(scenario: Scenario, entry: FaultEntry, number: int, seed: int, world: int) -> Iterator[float]:
    """When a fault begins, s: once, or with exponential waiting times."""
    if entry.at is not None:
        if entry.at < scenario.flight.duration:
            yield entry.at
        return
    time, occurrence = 0.0, 0
    while entry.per_hour > 0.0:
        word = random.random_words(seed, random.FAULT, world, occurrence, number)[0]
        time -= HOUR / entry.per_hour * math.log(random.uniform(word))
        occurrence += 1
        if time >= min(scenario.flight.duration, entry.until):
            return
        yield time


def _hit(entry: FaultEntry, number: int, occurrence: int, seed: int, world: int) -> list[int]:
    """Whom an occurrence hits: all who may be, or so many of them, drawn without going back."""
    may = entry.agents
    if entry.number is None or entry.number >= len(may):
        return list(may)
    draw = {agent: random.random_words(seed, random.FAULT, world, occurrence, agent, 1 + number)[0] for agent in may}
    return sorted(sorted(may, key=lambda agent: (draw[agent], agent))[: entry.number])


def begun_faults(due: tuple[FaultOnset, ...], step: int, dt: float) -> list[dict[str, Any]]:
    """Faults that have begun before a step, as plain values: kind, agent, when they begin and end (s; None: never)."""
    return [
        {
            "kind": onset.kind,
            "agent": onset.agent,
            "begin": onset.step * dt,
            "end": None if onset.lasts >= ENDLESS else onset.step * dt + onset.lasts,
        }
        for onset in due
        if onset.step < step and not onset.leaves
    ]
