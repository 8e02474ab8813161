"""What befalls single agents, in plain loops: numbers of their own, faults with when they begin and end, absence."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from airflock.core import random
from airflock.core.contract import State, call_rule
from airflock.core.parameters import Quantity, declarations
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.schema import RelativeSpread


@dataclass
class Suffering:
    """A fault of one agent: its kind and numbers, when it began and for how long it lasts, s, and what was so then."""

    kind: Any
    numbers: Any
    begin: float
    lasts: float
    known: dict[str, float]
    near: float  # s; half a step: times are whole steps, and a fault lasts for whole steps

    def begun(self, time: float) -> bool:
        """Whether it has begun by a time, s."""
        return self.begin - self.near < time

    def asked(self, rule: str, time: float, **given: Any) -> Any:
        """What a rule of it answers, or None where it has none or does not last at that time (s)."""
        now = self.begun(time) and time < self.begin + self.lasts - self.near
        found = getattr(self.kind, rule)
        if found is None or not now:
            return None
        known = {**self.known, "since": max(time - self.begin, 0.0), "f": self.numbers, **given}
        return call_rule(found, rule, known, self.kind.name)


def begins(scenario: Scenario, seed: int) -> dict[int, list[tuple[int, Any, float, bool]]]:
    """By step: agents that are hit, by which entry, for how long (s), and whether they leave by then."""
    duration, dt = scenario.flight.duration, scenario.flight.dt
    found: list[Hit] = []
    for number, entry in enumerate(scenario.faults):
        for occurrence, at in enumerate(times(entry, number, seed, duration)):
            ends = min(entry.lasts, entry.until - at)
            lasts = dt * round(ends / dt) if ends < 1e9 else 1e9
            if lasts <= 0.0:
                continue
            step = round(at / dt)
            for agent in hit(entry, number, occurrence, seed):
                found.append(Hit(step, number, occurrence, agent, False, entry, lasts, step))
                if entry.fault.leaves is not None:
                    gone = call_rule(entry.fault.leaves, "leaves", {"f": entry.numbers}, entry.fault.name)
                    if gone < lasts:
                        found.append(Hit(step + round(gone / dt), number, occurrence, agent, True, entry, lasts, step))
    by_step: dict[int, list[tuple[int, Any, float, bool]]] = {}
    for hit_ in sorted(found, key=lambda one: one[:5]):
        if not (hit_.leaves and any(replaces(other, hit_) for other in found)):
            by_step.setdefault(hit_.step, []).append((hit_.agent, hit_.entry, hit_.lasts, hit_.leaves))
    return by_step


class Hit(NamedTuple):
    """An agent that is hit, or leaves, at a step: by which entry and occurrence, for how long (s), begun when."""

    step: int
    number: int
    occurrence: int
    agent: int
    leaves: bool
    entry: Any
    lasts: float
    begin: int


def replaces(other: Hit, leaving: Hit) -> bool:
    """Whether a fault has replaced one of its kind, before the agent left by it."""
    same = other.agent == leaving.agent and other.entry.fault.name == leaving.entry.fault.name
    later = (other.begin, other.number) > (leaving.begin, leaving.number) and other.begin < leaving.step
    return same and later and not other.leaves


def times(entry: Any, number: int, seed: int, duration: float) -> Iterator[float]:
    """When it begins, s."""
    if entry.at is not None:
        if entry.at < duration:
            yield entry.at
        return
    time = 0.0
    for occurrence in range(10_000):
        u = random.uniform(random.random_words(seed, random.FAULT, 0, occurrence, number)[0])
        time += 3600.0 / entry.per_hour * -math.log(u)
        if time >= min(duration, entry.until):
            return
        yield time


def hit(entry: Any, number: int, occurrence: int, seed: int) -> list[int]:
    """Whom it hits: those with the least random words."""
    if entry.number is None:
        return list(entry.agents)
    lots = [(random.random_words(seed, random.FAULT, 0, occurrence, a, 1 + number)[0], a) for a in entry.agents]
    return sorted(agent for _, agent in sorted(lots)[: entry.number])


def groups_of(scenario: Scenario) -> list[int]:
    """Of each agent which group it is in; -1 for none."""
    return [next((k for k, g in enumerate(scenario.groups) if i in g.agents), -1) for i in range(scenario.agents)]


def law_of(scenario: Scenario, agent: int) -> tuple[Any, Any]:
    """Model of an agent and its parameters without numbers of its group."""
    group = next((group for group in scenario.groups if agent in group.agents), None)
    return group.law if group and group.law else (scenario.model, scenario.parameters)


def own_parameters(scenario: Scenario, section: str, record: Any, agent: int, seed: int) -> Any:
    """Numbers of model or body of one agent: its group's, off them by its tolerance."""
    letter, changed = {"model": "p", "body": "b", "sensors": "s"}[section], {}
    own = [each for each in declarations(record) if (section, each[0]) != ("body", "delay")]  # one for all agents
    for place, (name, declared, _) in enumerate(own):
        for group in scenario.groups:
            if agent in group.agents and isinstance(declared, Quantity):
                value = group.numbers.get((letter, name), getattr(record, name))
                spread = group.spread.get((letter, name), 0.0)
                spread *= abs(value) if isinstance(spread, RelativeSpread) else 1.0
                if spread > 0.0:
                    words = random.random_words(seed, random.SPREAD, 0, place, agent, "pbs".index(letter))
                    value += spread * random.normal_pair(*words[:2])[0]
                if value is not None:
                    changed[name] = min(max(value, declared.low), declared.high)
    return replace(record, **changed)


def misled(
    agent: Any, kinds: Sequence[Any], rules: Sequence[tuple[str, str]], time: float, state: State, dims: int
) -> State:
    """A state as the faults of an agent leave it; what each may repeat is the one that it was last given before.

    rules : each with the name under which the agent keeps that state
    """
    flat = {} if dims == 3 else {"z": 0.0, "vz": 0.0}
    for rule, name in rules:
        for kind in kinds:
            suffering, key = agent.fault(kind.name, time), (kind.name, name)
            given = {f"at_{each}": value for each, value in agent.kept.get(key, state)._asdict().items()}
            found = None if suffering is None else suffering.asked(rule, time, **state._asdict(), **given)
            agent.kept[key] = agent.kept.get(key, state) if found is not None else state
            state = state if found is None else State(*found)._replace(**flat)
    return state


def radio_of(agent: Any, time: float, reach: float) -> tuple[float, float]:
    """How far an agent is heard and hears, m; negative where not at all."""
    out = into = reach
    for suffering in agent.suffers(time):
        found = suffering.asked("radio", time, reach=reach)
        if found is not None:
            out, into = min(out, found[0]), min(into, found[1])
    return out, into


def ahead(agent: Any, time: float) -> float:
    """How far its clock is ahead, s."""
    return sum(suffering.asked("clock", time) or 0.0 for suffering in agent.suffers(time))
