"""Look: what one agent perceives, and the parts of its command, by the law's own rules in plain Python."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from airflock.core import (
    AgentView,
    HeardNeighbour,
    Model,
    State as Motion,
    agent as one,
    call_rule,
    extrapolated_state,
    met_neighbours,
    norm,
    packet_counts,
    radio,
    random,
    silence,
)
from airflock.engine.driver_state import DriverState
from airflock.engine.plan import NO_PACKET_TIME
from airflock.scenarios import FlightWorld, Scenario, step_counts
from airflock.world import edges


def agent_view(scenario: Scenario, state: DriverState, agent: int, step: int, seed: int, world: int) -> AgentView:
    """Return the percept of `agent` at the last decision up to `step`; exact if the driver has just decided there."""
    plan, model = state.plan, scenario.law_of(agent).model
    every = state.whole("decide_every")
    number = step // every
    measured, said = [agent_states(state, prefix) for prefix in ("m", "h")]
    truth = agent_states(state, "")
    own = measured[agent]
    heard = tuple(_heard(scenario, state, agent, number, truth, said, seed, world))
    p = _parameters(scenario, state, agent)
    met = _met(scenario, state, own, heard)
    near = call_rule(model.reach, "reach", {"p": p}, model.name) if model.reach else math.inf
    terms, alike = [], []
    for other, meets in zip(heard, met, strict=True):
        if model.neighbour is None:
            break
        beside = other._replace(state=_beside(scenario, own, other.state))
        given = one.pair_arguments(own, beside, agent, scenario.group_indices[agent])
        far = not meets or given["r"] > near
        # The same neighbour at the same velocity: a page draws that answer as repulsion, the rest as
        # alignment.
        same = given | {"dvx": 0.0, "dvy": 0.0, "dvz": 0.0, "dv": norm(0.0, 0.0, 0.0)}
        same |= {f"n{name}": given[name] for name in ("hx", "hy", "hz")}
        found = [call_rule(model.neighbour, "neighbour", case | {"p": p}, model.name) for case in (given, same)]
        none = type(found[0])(*(0.0 for _ in found[0]))
        terms.append(none if far else found[0])
        alike.append(none if far else found[1])
    memory = _memory(state, model, agent)
    command = tuple(float(state.rows([f"c{axis}"])[0, agent]) for axis in plan.axes)
    return AgentView(
        agent, number * every * scenario.flight.dt, truth[agent], own, heard, met, tuple(terms), tuple(alike),
        _record(state, model.Sums, "sum", agent), _record(state, model.Walls, "wall", agent), memory, command,
        _record(state, plan.body.Memory, "body", agent),
    )  # fmt: skip


def _memory(state: DriverState, model: Model, agent: int) -> Any:
    """Return the memory of an agent's law."""
    if model.Memory is None:
        return None
    fields = len(model.Memory._fields)
    return model.Memory(*(float(x) for x in state.arrays["mem"][:fields, _slot(state, agent)]))


def _met(scenario: Scenario, state: DriverState, own: Motion, heard: tuple[HeardNeighbour, ...]) -> tuple[bool, ...]:
    """Of each that is heard whether the agent meets it."""
    if state.plan.topology is None:
        return (True,) * len(heard)
    place = FlightWorld(scenario)
    if len(state.arrays["later"]):
        place.shapes[:] = state.arrays["shapes"].astype(float).tolist()
    beside = [other._replace(state=_beside(scenario, own, other.state)) for other in heard]
    found = {other.who for other in met_neighbours(state.plan.topology, scenario.topology.numbers, own, beside, place)}
    return tuple(other.who in found for other in heard)


def _parameters(scenario: Scenario, state: DriverState, agent: int) -> Any:
    """Numbers of the law, with the agent's own where they differ among agents."""
    law, own = scenario.law_of(agent), zip(state.plan.columns, state.tables.own[:, agent].tolist(), strict=True)
    numbers = {name: value for (letter, name), value in own if letter == "p" and (letter, name) in law.varied}
    return replace(law.parameters, **numbers)


def agent_states(state: DriverState, prefix: str) -> list[Motion]:
    """States of all agents from the rows with a prefix, or the true ones where the plan keeps no such rows."""
    axes, had = state.plan.axes, state.driver.ROWS
    names = [f"{prefix}{name}" for name in state.plan.motion]
    rows = state.rows([name if name in had else name[len(prefix) :] for name in names]).astype(float)
    flat = [0.0] * (3 - len(axes))
    half = len(axes)
    return [Motion(*row[:half], *flat, *row[half:], *flat) for row in rows.T.tolist()]


def _heard(
    scenario: Scenario,
    state: DriverState,
    i: int,
    number: int,
    truth: list[Motion],
    said: list[Motion],
    seed: int,
    world: int,
) -> Iterator[HeardNeighbour]:
    """Everybody in range whose packet agent i has and still believes: as the driver drew it, from the same counters."""
    k, plan, n = scenario.radio.numbers, state.plan, state.agents
    fades = plan.topology is not None and plan.topology.asks_for("fade")
    clocks, sent_clocks = _clocks(state, "clock"), _clocks(state, "sent_clock" if plan.late else "clock")
    reach, groups = _reach(state, i), scenario.group_indices
    late = step_counts(scenario)["delay"] * scenario.flight.dt
    now = number * state.whole("decide_every") * scenario.flight.dt
    for j in range(n):
        if not state.present[j]:
            continue
        true = _beside(scenario, truth[i], truth[j])
        distance = math.dist(true[:3], truth[i][:3])
        if j == i or distance > min(k.range, 1e8):
            continue
        # As in the driver: the lower number first, since a signal fades equally in both directions.
        pair = min(i, j) * n + max(i, j)
        fade = random.normal_pair(*random.random_words(seed, random.FADE, world, number, pair)[:2])[0] if fades else 0.0
        if plan.packets:
            packet = state.arrays["store"][:, _slot(state, i), _slot(state, j)].tolist()
            axes, stamp = len(plan.axes), packet[2 * len(plan.axes)]
            age, flat = now + clocks[i] - stamp, [0.0] * (3 - axes)
            counts = (
                packet_counts(plan.radio, k, age)
                if plan.radio.keeps_packets
                else silence.counts(age, scenario.resolved_silence())
            )
            if stamp <= NO_PACKET_TIME / 10.0 or not counts:
                continue
            sent = Motion(*packet[:axes], *flat, *packet[axes : 2 * axes], *flat)
            yield HeardNeighbour(j, extrapolated_state(plan.radio, k, sent, age), age, fade, groups[j])
        elif distance * distance > reach[j]:
            continue
        elif not plan.lossy or random.pair_uniform(seed, random.PACKET, world, number, i, j, n) >= radio.lost(
            distance, k
        ):
            yield HeardNeighbour(j, said[j], late + clocks[i] - sent_clocks[j], fade, groups[j])


def _reach(state: DriverState, i: int) -> list[float]:
    """Square of how far agent i hears each other one, m², where faults leave less than the radio's range."""
    if not state.plan.suffers("radio"):
        return [math.inf] * state.agents
    out, into = state.rows(["reach_out", "reach_in"]).astype(float)
    return [min(found, float(into[i])) for found in out.tolist()]


def _clocks(state: DriverState, row: str) -> list[float]:
    """How far the clock of each agent is ahead, or was when it sent what is heard now, s."""
    return [float(ahead) for ahead in state.rows([row])[0]] if state.plan.suffers("clock") else [0.0] * state.agents


def _beside(scenario: Scenario, own: Motion, other: Motion) -> Motion:
    """A state at its image nearest to another one, where the world is periodic."""
    if scenario.world.edges != "periodic":
        return other
    halves = (0.5 * scenario.world.side, 0.5 * scenario.world.side, 0.5 * scenario.world.height)
    x, y, z = (
        a + edges.nearest_image(b - a, half) if half > 0.0 else b
        for a, b, half in zip(own[:3], other[:3], halves, strict=True)
    )
    return other._replace(x=x, y=y, z=z)


def _record(state: DriverState, record: Any, prefix: str, agent: int) -> Any:
    """Sums or Walls of one agent as the law was given them; a field that nobody reads is 0. None without such."""
    if record is None:
        return None
    had = state.driver.ROWS
    names = [f"{prefix}{c}" for c in range(len(record._fields))]
    values = [float(state.rows([name])[0, agent]) if name in had else 0.0 for name in names]
    return record(*values)


def _slot(state: DriverState, agent: int) -> int:
    return agent if state.slots is None else int(state.slots[agent])
