"""Margins: how much worse a number of the environment may get until what held of an optimum no longer holds.

A delay that is half as long again, an error that is twice as large, faults that strike four times as often: each is a
factor by which one number gets worse, so that margins can be compared and the shortest one is found. A number that is
zero is moved up from a first value: that value counts as the factor 2, twice that value as 3. Faults that a scenario
does not have may strike, too: each kind as `vasarhelyi_2018/faulty` has it, from once an hour on.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from airflock.core.parameters import Quantity, with_unit
from airflock.errors import ScenarioError
from airflock.evolve.environment import FROM_ZERO, environment, sound_keys, worse
from airflock.evolve.space import with_parameters
from airflock.scenarios.change import named, remade
from airflock.scenarios.files import load
from airflock.scenarios.scenario import Scenario

FAULTS = "faults"  # stands for all kinds of fault
USUAL = "vasarhelyi_2018/faulty"  # how long faults last that a scenario does not have
HOURLY = 1.0  # faults of one kind in an hour of the flock: the first rate of those that a scenario does not have
NEVER = 1e-9  # rate, 1/h, of faults that a driver has and no flight sees
UNITS = {"per_hour": "an hour", "number": "agents"}  # of numbers of faults


@dataclass(frozen=True)
class Number:
    """A number that gets worse.

    way   : 1 where larger is worse, -1 where smaller is
    first : value above zero that stands for the factor 2, if `now` is zero
    """

    key: str
    how: Quantity
    now: float
    way: int = 1
    first: float = 0.0

    def at(self, factor: float) -> float:
        """Its value where it is so many times worse, within its range."""
        value = self.now * factor**self.way if self.now else self.first * (factor - 1.0)
        value = min(max(value, self.how.low), self.how.high)
        return float(round(value)) if self.how.whole else value


@dataclass(frozen=True)
class Margin:
    """Numbers that get worse together: one of the environment, or how often a kind of fault strikes.

    name    : key of the number, or kind of the fault
    numbers : of each scenario; none where it has no such number, so that it stays as it is
    """

    name: str
    scenarios: tuple[Scenario, ...]
    numbers: tuple[tuple[Number, ...], ...]

    def worse(self, factor: float) -> list[Scenario]:
        """The scenarios with their numbers so many times worse."""
        pairs = zip(self.scenarios, self.numbers, strict=True)
        return [with_parameters(s, {each.key: each.at(factor) for each in own}) if own else s for s, own in pairs]

    @property
    def first(self) -> Number:
        """The number that is told: that of the first scenario that has one."""
        return next(own[0] for own in self.numbers if own)

    def value(self, factor: float) -> float:
        """That number, so many times worse."""
        return self.first.at(factor)

    def told(self, factor: float) -> str:
        """That value with its unit."""
        unit = UNITS.get(self.first.key.rpartition(".")[2], "") if self.first.key.startswith("faults[") else ""
        return with_unit(f"{self.value(factor):.3g}", unit or self.first.how.unit)


def read_margins(names: str | Sequence[str], scenarios: Sequence[Scenario]) -> tuple[list[Margin], list[str]]:
    """Margins by the keys of their numbers, or `faults` for all kinds of fault; and what is wrong with the names."""
    asked = [names] if isinstance(names, str) else list(names)
    found: list[Margin] = []
    faults: list[str] = []
    for name in dict.fromkeys(asked):
        if name == FAULTS:
            found += _of_faults(scenarios)
            continue
        try:
            sound_keys(scenarios[0], [name], "margin", [FAULTS])
        except ScenarioError as fault:
            faults += fault.faults
            continue
        known = [environment(scenario).get(name) for scenario in scenarios]
        numbers = (
            (Number(name, each[0], each[1], worse(name), FROM_ZERO.get(name, 0.0)),)
            if each is not None and (each[1] or name in FROM_ZERO)
            else ()
            for each in known
        )
        found.append(Margin(name, tuple(scenarios), tuple(numbers)))
    return found, faults


def _of_faults(scenarios: Sequence[Scenario]) -> Iterator[Margin]:
    """One margin for each kind of fault that the scenarios have; where they have none, for each of the usual ones."""
    known = [environment(scenario) for scenario in scenarios]
    numbers = [
        {
            kind: tuple(Number(key, *own[key]) for key in own if _kind(scenario, key) == kind)
            for kind in dict.fromkeys(entry.fault.name for entry in scenario.faults)
        }
        for scenario, own in zip(scenarios, known, strict=True)
    ]
    kinds = dict.fromkeys(kind for own in numbers for kind, moved in own.items() if moved)
    for kind in kinds:
        yield Margin(kind, tuple(scenarios), tuple(own.get(kind, ()) for own in numbers))
    if kinds:
        return
    usual = [entry for entry in load(USUAL).document["faults"] if all(_stands(s, entry) for s in scenarios)]
    made = [remade(s, {"faults": [*named(s), *({**entry, "per_hour": NEVER} for entry in usual)]}) for s in scenarios]
    # all in one driver, which is compiled once
    hit = tuple(replace(s, faults=each.faults) for s, each in zip(scenarios, made, strict=True))
    for place, entry in enumerate(usual):
        keys = [f"faults[{len(s.faults) - len(usual) + place}].per_hour" for s in hit]
        rates = (Number(key, environment(s)[key][0], 0.0, 1, HOURLY) for key, s in zip(keys, hit, strict=True))
        yield Margin(str(entry["kind"]), hit, tuple((rate,) for rate in rates))


def _stands(scenario: Scenario, entry: Mapping[str, Any]) -> bool:
    """Whether a scenario may have a fault: agents that see each other as they are have none of what they hear."""
    try:
        remade(scenario, {"faults": [*named(scenario), entry]})
    except ScenarioError:
        return False
    return True


def _kind(scenario: Scenario, key: str) -> str:
    """The kind of fault that a key belongs to; none for other keys."""
    place = key.removeprefix("faults[").partition("]")[0]
    return scenario.faults[int(place)].fault.name if key.startswith("faults[") and place.isdecimal() else ""
