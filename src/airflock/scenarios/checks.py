"""Checks of a scenario that take more than one key: the body's kind, the order of updates, the metrics."""

import math
from collections.abc import Mapping
from typing import Any

from airflock.core import CLOCKS, Body, Metric, MetricSet, Model, Radio, Sensor, Topology, call_rule
from airflock.scenarios.geometry import largest_extension


def body_errors(body: Body, parts: Mapping[str, Any], model: Model | None, started: bool = False) -> list[str]:
    """What of a scenario its body cannot fly: too long a step, too slow a law or (unless it has started) a start."""
    b, p, flight = parts["body"], parts.get("parameters"), parts["flight"]
    if b is None or flight is None or model is None or p is None:
        return []
    begin, wing = parts["start"], parts["wing"]
    if begin is None or wing is None:
        return []
    start = math.inf if started else begin.speed
    return body.limit_errors(b=b, dt=flight.dt, speed=model.speed(p), start=start, wing=wing)


def sensor_errors(sensor: Sensor, parts: Mapping[str, Any]) -> list[str]:
    """What of a scenario its sensor cannot measure."""
    s, flight = parts["sensors"], parts["flight"]
    if s is None or flight is None:
        return []
    period = max(1, round(s.period / flight.dt)) * flight.dt
    return sensor.bound_errors(s=s, period=period, dt=flight.dt)


IDEAL = {"radio.kind": "'constant'", "sensors.kind": "'perfect'"}  # what is not ideal at 0


def update_order_errors(flight: Any, sensor: Sensor, sensors: Any, radio: Radio, k: Any) -> list[str]:
    """Sequential update is for agents that see each other as they are, at every step."""
    if flight.update == "synchronous" or sensors is None or k is None:
        return []
    late = sensors.period if round(sensors.period / flight.dt) > 1 else 0.0
    ideal = {
        "sensors.kind": 0.0 if sensor.is_exact(sensors) else sensor.name,
        "sensors.period": late,
        "radio.delay": k.delay,
        "radio.loss": k.loss,
        "radio.kind": radio.name if radio.keeps_packets else 0.0,
    }
    return [
        f"{key} = {value}: update = 'sequential' needs ideal perception at every step; set {key} = "
        + IDEAL.get(key, "0")
        for key, value in ideal.items()
        if value != 0.0
    ]


def topology_errors(kind: Topology | None, world: Any, model: Model | None) -> list[str]:
    """Why agents of a law in a world cannot meet each other by a topology."""
    faults = []
    if kind is not None and kind.flat and world is not None and world.dimensions == "3":
        faults.append(f"topology.kind = {kind.name!r}: works in a plane only; set world.dimensions = '2'")
    if kind is not None and model is not None and model.neighbour is None:
        faults.append(f"topology.kind = {kind.name!r}: law {model.name} has no rule for single neighbours")
    return faults


def metric_errors(measures: MetricSet, q: Any, world: Any) -> list[str]:
    """What a metric set says is wrong with its parameters beyond single ranges."""
    if q is None or world is None or measures.faults is None:
        return []
    given = {"q": q, "largest": largest_extension(world), "edges": world.edges}
    return list(call_rule(measures.faults, "faults", given, measures.name))


def silence_errors(rule: str, flight: Any, model: Model | None) -> list[str]:
    """Who stops for a neighbour that it has lost must hear of neighbours, and be able to stop."""
    if rule == "fly_on" or model is None:
        return []
    faults = []
    if model.command != "velocity":
        faults.append(
            f"commands {'an' if model.command[0] in 'aeiou' else 'a'} {model.command}, and none of it stops an agent"
        )
    if model.neighbour is None or model.flock is not None:
        faults.append("has no rule for the neighbours that an agent hears")
    if flight.update == "sequential":
        faults.append("sees all others as they are with update = 'sequential'")
    return [f"silence.rule = {rule!r}: model {model.name} {fault}; set silence.rule = 'fly_on'" for fault in faults]


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
