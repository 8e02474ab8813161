"""Checks of a scenario that take more than one key: the body's kind, the order of updates, the metrics."""

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from airflock.body.registry import BODIES, body_for
from airflock.core.contract import Model
from airflock.metrics.registry import metrics_of
from airflock.scenarios.geometry import largest_extension


def body_record(table: Any, found: Model | None) -> tuple[type, list[str]]:
    """Record behind the section body, by its key kind or else by what the model commands; and what is wrong with it."""
    usual = body_for(found.command if found else "velocity")
    kind = table.get("kind", usual) if isinstance(table, Mapping) else usual
    if not isinstance(kind, str) or kind not in BODIES:
        near = get_close_matches(str(kind), BODIES, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(BODIES)}"
        return BODIES[usual].Parameters, [f"body.kind = {kind!r} is no body; {hint}"]
    if found and BODIES[kind].accepts != found.command:
        return BODIES[usual].Parameters, [
            f"body.kind = {kind!r} takes a {BODIES[kind].accepts}, but model {found.name} commands {found.command}; "
            f"body.kind = {usual!r} takes it"
        ]
    return BODIES[kind].Parameters, []


def order_faults(flight: Any, sensors: Any, radio: Any) -> list[str]:
    """Sequential update is for agents that see each other as they are, at every step."""
    if flight.update == "synchronous" or sensors is None or radio is None:
        return []
    late = sensors.period if round(sensors.period / flight.dt) > 1 else 0.0
    ideal = {
        "sensors.noise": sensors.noise,
        "sensors.period": late,
        "radio.delay": radio.delay,
        "radio.loss": radio.loss,
        "radio.kind": 0.0 if radio.kind == "constant" else radio.kind,
    }
    return [
        f"{key} = {value}: update = 'sequential' needs ideal perception at every step; set {key} = "
        + ("'constant'" if key == "radio.kind" else "0")
        for key, value in ideal.items()
        if value != 0.0
    ]


def metric_faults(q: Any, world: Any) -> list[str]:
    """What is wrong with the metrics of Zapotecatl et al. 2016 beyond single ranges."""
    if q is None or world is None or q.kind not in ("zapotecatl", "groups"):
        return []
    most = q.max_e if q.max_e is not None else largest_extension(world)
    if not most:
        return ["metrics.max_e is missing: without an arena the largest extension is unknown; give metrics.max_e in m"]
    faults = []
    if q.count == "program" and world.edges == "periodic":
        faults.append("metrics.count = 'program': the program knows no periodic box (world.edges); count each")
    if q.k is not None and q.k > most * (1.0 + 1e-9):
        faults.append(f"metrics.k = {q.k:g} m lies outside [0, {most:g}] m, the largest extension metrics.max_e")
    if abs(q.sigma + q.gamma - 1.0) > 1e-9:
        faults.append(f"metrics.sigma + metrics.gamma = {q.sigma + q.gamma:g} is not 1")
    return faults


MANY = 5000  # agents; below, a look at all pairs costs less than 10 ms


def pair_notes(flight: Any, q: Any) -> list[str]:
    """What order parameters over all pairs cost in a large flock: neighbours may be found by cells, these are not."""
    paired = [item.name for item in metrics_of(q) if item.pair or item.cluster or item.survey]
    if flight.agents < MANY or not paired:
        return []
    seconds = 0.4e-9 * flight.agents**2  # one core, measured in benchmarks/RESULTS-boids.md
    return [
        f"metrics.kind = {q.kind!r} looks at all pairs of {flight.agents:g} agents ({', '.join(paired)}), about "
        f"{seconds:.2g} s for each sample; metrics.kind = 'order' does not, a longer metrics.period looks less often"
    ]
