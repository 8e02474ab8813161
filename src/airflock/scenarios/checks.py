"""Checks of a scenario that take more than one key: the body's kind, the order of updates, the metrics."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airflock.body.registry import BODIES, body_for
from airflock.core.contract import Body, Metric, MetricSet, Model, body
from airflock.core.radio import Packets, Radio, radio
from airflock.core.sensor import Sensor, sensor
from airflock.core.topology import Topology, topology
from airflock.core.vocabulary import CLOCKS, asks
from airflock.errors import AirflockError
from airflock.metrics.registry import SETS, USUAL, metric_set
from airflock.radios.registry import RADIOS
from airflock.radios.registry import USUAL as USUAL_RADIO
from airflock.scenarios.geometry import largest_extension
from airflock.scenarios.own_code import own_code
from airflock.sensors.registry import SENSORS
from airflock.sensors.registry import USUAL as USUAL_SENSOR
from airflock.spelling import meant


def body_of(
    table: Any, found: Model | None, folder: Path | None = None, *, trust: bool = False
) -> tuple[Body, list[str]]:
    """Body of the section body, by its key kind or else by what the model commands; and what is wrong with it."""
    usual = body_for(found.command if found else "velocity")
    kind = table.get("kind", usual) if isinstance(table, Mapping) else usual
    if isinstance(kind, str) and kind.endswith(".py"):
        try:
            carried = body(own_code("body.kind", kind, folder, trust=trust), Path(kind).stem)
        except AirflockError as fault:
            return BODIES[usual], str(fault).splitlines()
    elif isinstance(kind, str) and kind in BODIES:
        carried = BODIES[kind]
    else:
        hint = meant(kind, BODIES, f"known: {', '.join(BODIES)}, or a file that ends in .py", cutoff=0.4)
        return BODIES[usual], [f"body.kind = {kind!r}: unknown body; {hint}"]
    faults = carries(carried, found, kind)
    return BODIES[usual] if faults else carried, faults


def carries(carried: Body, found: Model | None, kind: str) -> list[str]:
    """Why a body cannot fly what a model commands, one line."""
    if found is None or carried.accepts == found.command:
        return []
    return [
        f"body.kind = {kind!r} takes a {carried.accepts}, but model {found.name} commands {found.command}; "
        f"body.kind = {body_for(found.command)!r} takes it"
    ]


def body_faults(carried: Body, parts: Mapping[str, Any], found: Model | None) -> list[str]:
    """What of a scenario its body cannot fly: too long a step, too slow a law."""
    b, p, flight = parts["body"], parts.get("parameters"), parts["flight"]
    if b is None or flight is None or found is None or p is None:
        return []
    speed = float(found.preferred_speed(p)) if found.preferred_speed is not None else 0.0
    begin, wing = parts["start"], parts["wing"]
    if begin is None or wing is None:
        return []
    return carried.lacks(b=b, dt=flight.dt, speed=speed, start=begin.speed, wing=wing)


def sensor_of(table: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[Sensor, list[str]]:
    """Sensor of the section sensors, by its key kind; and what is wrong with it."""
    usual = SENSORS[USUAL_SENSOR]
    kind = table.get("kind", usual.name) if isinstance(table, Mapping) else usual.name
    kind = kind["value"] if isinstance(kind, Mapping) and "value" in kind else kind
    if isinstance(kind, str) and kind in SENSORS:
        return SENSORS[kind], []
    if isinstance(kind, str) and kind.endswith(".py"):
        try:
            return sensor(own_code("sensors.kind", kind, folder, trust=trust), Path(kind).stem), []
        except AirflockError as fault:
            return usual, str(fault).splitlines()
    hint = meant(kind, SENSORS, f"known: {', '.join(SENSORS)}, or a file that ends in .py", cutoff=0.4)
    return usual, [f"sensors.kind = {kind!r}: unknown sensor; {hint}"]


def sensor_faults(found: Sensor, parts: Mapping[str, Any]) -> list[str]:
    """What of a scenario its sensor cannot measure."""
    s, flight = parts["sensors"], parts["flight"]
    if s is None or flight is None:
        return []
    period = max(1, round(s.period / flight.dt)) * flight.dt
    return found.lacks(s=s, period=period, dt=flight.dt)


def radio_of(table: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[Radio, list[str]]:
    """Radio of the section radio, by its key kind; and what is wrong with it."""
    usual = RADIOS[USUAL_RADIO]
    kind = table.get("kind", usual.name) if isinstance(table, Mapping) else usual.name
    kind = kind["value"] if isinstance(kind, Mapping) and "value" in kind else kind
    if isinstance(kind, str) and kind in RADIOS:
        return RADIOS[kind], []
    if isinstance(kind, str) and kind.endswith(".py"):
        try:
            return radio(own_code("radio.kind", kind, folder, trust=trust), Path(kind).stem), []
        except AirflockError as fault:
            return _stand_in(kind), str(fault).splitlines()
    hint = meant(kind, RADIOS, f"known: {', '.join(RADIOS)}, or a file that ends in .py", cutoff=0.4)
    return _stand_in(kind), [f"radio.kind = {kind!r}: unknown radio; {hint}"]


def _stand_in(kind: Any) -> Radio:
    """A radio in place of one that cannot be had, by whose common numbers the rest is judged."""
    return Radio(str(kind), Packets)


def metrics_set(table: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[MetricSet, list[str]]:
    """Metric set of the section metrics, by its key kind; and what is wrong with it."""
    kind = table.get("kind", USUAL) if isinstance(table, Mapping) else USUAL
    kind = kind["value"] if isinstance(kind, Mapping) and "value" in kind else kind
    if isinstance(kind, str) and kind in SETS:
        return SETS[kind], []
    if isinstance(kind, str) and kind.endswith(".py"):
        try:
            return metric_set(own_code("metrics.kind", kind, folder, trust=trust), Path(kind).stem), []
        except AirflockError as fault:
            return SETS[USUAL], str(fault).splitlines()
    hint = meant(kind, SETS, lead="; ", cutoff=0.6)
    return SETS[USUAL], [f"metrics.kind = {kind!r} is none of {', '.join(SETS)}, or a file that ends in .py{hint}"]


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


def topology_of(table: Any, folder: Path | None = None, *, trust: bool = False) -> tuple[Topology | None, list[str]]:
    """Topology of a user's own that the section topology names by its key kind, if it does; and what is wrong with it.

    Raises nothing: a kind that is none of ours and no file is told by the section's own check.
    """
    kind = table.get("kind") if isinstance(table, Mapping) else None
    kind = kind["value"] if isinstance(kind, Mapping) and "value" in kind else kind
    if not isinstance(kind, str) or not kind.endswith(".py"):
        return None, []
    try:
        return topology(own_code("topology.kind", kind, folder, trust=trust), Path(kind).stem), []
    except AirflockError as fault:
        return None, str(fault).splitlines()


def topology_faults(kind: Topology | None, world: Any, found: Model | None) -> list[str]:
    """Why agents of a law in a world cannot meet each other by a topology."""
    faults = []
    if kind is not None and kind.flat and world is not None and world.dimensions == "3":
        faults.append(f"topology.kind = {kind.name!r}: cells are found in a plane; world.dimensions = '2' is one")
    if kind is not None and found is not None and found.neighbour is None:
        faults.append(f"topology.kind = {kind.name!r}: law {found.name} has no rule for single neighbours")
    return faults


def metric_faults(measures: MetricSet, q: Any, world: Any) -> list[str]:
    """What a metric set says is wrong with its parameters beyond single ranges."""
    if q is None or world is None or measures.faults is None:
        return []
    given = {"q": q, "largest": largest_extension(world), "edges": world.edges}
    return measures.faults(**{name: given[name] for name in asks(measures.faults, "faults", measures.name)})


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
    seconds = 0.4e-9 * flight.agents**2  # one core, measured in benchmarks/RESULTS-boids.md
    return [
        f"metrics.kind = {q.kind!r} looks at all pairs of {flight.agents:g} agents ({', '.join(paired)}), about "
        f"{seconds:.2g} s for each sample; metrics.kind = 'order' does not, a longer metrics.period looks less often"
    ]
