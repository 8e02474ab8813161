"""Environment: numbers of a scenario that are no choice of its flock's, and which way each is worse.

Delay, errors, lag, wind, the number of agents, and how often faults strike. A number that is zero has no factor to be
moved by: it is moved up from a first value.
"""

import re
from dataclasses import replace

from airflock.core import Quantity, declarations
from airflock.engine import driver_text
from airflock.runs import declared_numbers, with_parameters
from airflock.scenarios import FaultTiming, Scenario
from airflock.support import ScenarioError, suggest

# number of the environment → which way is worse
WORSE = {
    "radio.delay": 1, "radio.range": -1, "radio.far": -1, "radio.received_far": -1, "radio.loss": 1,
    "sensors.noise": 1, "sensors.sd": 1, "sensors.jump_rate": 1, "sensors.outage_rate": 1, "sensors.lag": 1,
    "sensors.period": 1, "body.noise": 1, "body.tau": 1, "body.a_max": -1, "wind.gust": 1, "wind.at_6m": 1,
    "agents": 1,
}  # fmt: skip
# number that may be zero → first value above zero that is tried
FIRST_VALUE = {
    "radio.loss": 0.1,
    "wind.gust": 1.0,
    "sensors.jump_rate": 1.0 / 600.0,
    "sensors.outage_rate": 1.0 / 600.0,
}
READ_AS = {"sensors": "s", "radio": "k", "wind": "a"}  # section → what a driver calls its numbers

EnvironmentNumbers = dict[str, tuple[Quantity, float]]


def environment_numbers(scenario: Scenario) -> EnvironmentNumbers:
    """Key → declaration and value of all numbers of the environment that a scenario has, those of faults included."""
    known = declared_numbers(scenario)
    dryden = scenario.wind.kind == "dryden"
    left_out = {"wind.gust" if dryden else "wind.at_6m"}
    found = {key: (known[key][0], float(known[key][1] or 0.0)) for key in WORSE if key in known and key not in left_out}
    return found | _of_faults(scenario)


def used_and_unused_keys(scenario: Scenario) -> tuple[str, ...]:
    """Numbers of the environment that a scenario uses, and those that it leaves at zero and would read above it.

    The latter come last: another driver has to be compiled for some of them.
    """
    links = scenario.transceiver.keeps_packets
    unused = {"radio.range"} if links else {"radio.far", "radio.received_far"}
    known = environment_numbers(scenario)
    used = [key for key, (_, value) in known.items() if value and key not in unused]
    zero = [key for key, (_, value) in known.items() if not value and key in FIRST_VALUE and _read(scenario, key)]
    return (*used, *zero)


def check_environment_keys(scenario: Scenario, keys: list[str]) -> tuple[str, ...]:
    """The keys that are named; ScenarioError for one that cannot be varied."""
    known, faults = environment_numbers(scenario), []
    for key in keys:
        if key not in known:
            hint = f"known: {', '.join(known)}"
            hint = hint if key in WORSE else suggest(key, list(known), hint)
            of = "a number of this scenario" if key in WORSE else "a number of the environment"
            faults.append(f"tolerance: {key} is not {of}; {hint}")
        elif not known[key][1] and key not in FIRST_VALUE:
            faults.append(f"tolerance: {key} = 0 in {scenario.name}; give it a value that a factor can change")
        elif not known[key][1] and not _read(scenario, key):
            faults.append(f"tolerance: {key}: nothing reads it in {scenario.name}")
    if faults:
        raise ScenarioError(faults)
    return tuple(dict.fromkeys(keys))


def worse_direction(key: str) -> int:
    """1 where a larger value is worse, -1 where a smaller one is."""
    return WORSE.get(key, 1)


def _of_faults(scenario: Scenario) -> EnvironmentNumbers:
    """How often each fault strikes at random, or how many agents it hits at its time."""
    known = {name: how for name, how, _ in declarations(FaultTiming()) if isinstance(how, Quantity)}
    found: EnvironmentNumbers = {}
    for i, entry in enumerate(scenario.faults):
        if entry.at is None and entry.per_hour > 0.0:
            found[f"faults[{i}].per_hour"] = (known["per_hour"], entry.per_hour)
        elif entry.at is not None and entry.number is not None and entry.number < len(entry.agents):
            most = known["number"]._replace(high=float(len(entry.agents)), whole=True)
            found[f"faults[{i}].number"] = (most, float(entry.number))
    return found


def _read(scenario: Scenario, key: str) -> bool:
    """Whether flights read a number once it is above zero."""
    section, _, name = key.partition(".")
    if section == "wind" and scenario.wind.kind == "dryden":
        return False
    above = with_parameters(replace(scenario, groups=()) if scenario.groups else scenario, {key: FIRST_VALUE[key]})
    return bool(re.search(rf"\b{READ_AS[section]}\.{name}\b", driver_text(above)))
