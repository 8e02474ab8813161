"""Checks of a scenario that take more than one key: the body's kind, the order of updates, the metrics."""

import math
from collections.abc import Mapping
from typing import Any

from airflock.core.contract import Body, Metric, MetricSet, Model
from airflock.core.contract.declared import CLOCKS
from airflock.core.radio import Radio
from airflock.core.sensor import Sensor
from airflock.core.topology import Topology
from airflock.core.vocabulary import answer
from airflock.scenarios.geometry import largest_extension


def body_faults(carried: Body, parts: Mapping[str, Any], found: Model | None, started: bool = False) -> list[str]:
    """What of a scenario its body cannot fly: too long a step, too slow a law or (unless it has started) a start."""
    b, p, flight = parts["body"], parts.get("parameters"), parts["flight"]
    if b is None or flight is None or found is None or p is None:
        return []
    begin, wing = parts["start"], parts["wing"]
    if begin is None or wing is None:
        return []
    start = math.inf if started else begin.speed
    return carried.lacks(b=b, dt=flight.dt, speed=found.speed(p), start=start, wing=wing)


def sensor_faults(found: Sensor, parts: Mapping[str, Any]) -> list[str]:
    """What of a scenario its sensor cannot measure."""
    s, flight = parts["sensors"], parts["flight"]
    if s is None or flight is None:
        return []
    period = max(1, round(s.period / flight.dt)) * flight.dt
    return found.lacks(s=s, period=period, dt=flight.dt)


IDEAL = {"radio.kind": "'constant'", "sensors.kind": "'perfect'"}  # what is not ideal at 0


def order_faults(flight: Any, found: Sensor, sensors: Any, link: Radio, k: Any) -> list[str]:
    """Sequential update is for agents that see each other as they are, at every step."""
    if flight.update == "synchronous" or sensors is None or k is None:
        return []
    late = sensors.period if round(sensors.period / flight.dt) > 1 else 0.0
    ideal = {
        "sensors.kind": 0.0 if found.is_exact(sensors) else found.name,
        "sensors.period": late,
        "radio.delay": k.delay,
        "radio.loss": k.loss,
        "radio.kind": link.name if link.keeps else 0.0,
    }
    return [
        f"{key} = {value}: update = 'sequential' needs ideal perception at every step; set {key} = "
        + IDEAL.get(key, "0")
        for key, value in ideal.items()
        if value != 0.0
    ]


def topology_faults(kind: Topology | None, world: Any, found: Model | None) -> list[str]:
    """Why agents of a law in a world cannot meet each other by a topology."""
    faults = []
    if kind is not None and kind.flat and world is not None and world.dimensions == "3":
        faults.append(f"topology.kind = {kind.name!r}: works in a plane only; set world.dimensions = '2'")
    if kind is not None and found is not None and found.neighbour is None:
        faults.append(f"topology.kind = {kind.name!r}: law {found.name} has no rule for single neighbours")
    return faults


def metric_faults(measures: MetricSet, q: Any, world: Any) -> list[str]:
    """What a metric set says is wrong with its parameters beyond single ranges."""
    if q is None or world is None or measures.faults is None:
        return []
    given = {"q": q, "largest": largest_extension(world), "edges": world.edges}
    return list(answer(measures.faults, "faults", given, measures.name))


def silence_faults(rule: str, flight: Any, found: Model | None) -> list[str]:
    """Who stops for a neighbour that it has lost must hear of neighbours, and be able to stop."""
    if rule == "fly_on" or found is None:
        return []
    faults = []
    if found.command != "velocity":
        faults.append(
            f"commands {'an' if found.command[0] in 'aeiou' else 'a'} {found.command}, and none of it stops an agent"
        )
    if found.neighbour is None or found.flock is not None:
        faults.append("has no rule for the neighbours that an agent hears")
    if flight.update == "sequential":
        faults.append("sees all others as they are with update = 'sequential'")
    return [f"silence.rule = {rule!r}: model {found.name} {fault}; set silence.rule = 'fly_on'" for fault in faults]


MANY = 5000  # agents; below, a look at all pairs costs less than 10 ms


def pair_notes(flight: Any, q: Any, metrics: tuple[Metric, ...], cells: bool) -> list[str]:
    """What order parameters over all pairs cost in a large flock.

    cells : order parameters look at pairs by cells if all of a clock say when they are `settled`, at links if they say
            how far they reach
    """
    near = {
        clock: cells and all(item.settled for item in metrics if item.pair and item.clock == clock) for clock in CLOCKS
    }
    paired = [
        item.name
        for item in metrics
        if (item.pair and not near[item.clock]) or (item.cluster and not (cells and item.linked_within)) or item.survey
    ]
    if flight.agents < MANY or not paired:
        return []
    seconds = 0.4e-9 * flight.agents**2  # measured: 0.4 ns a pair, one core, in vectors
    return [
        f"metrics.kind = {q.kind!r} looks at all pairs of {flight.agents:g} agents ({', '.join(paired)}), about "
        f"{seconds:.2g} s for each sample; metrics.kind = 'order' does not, a longer metrics.period looks less often"
    ]
