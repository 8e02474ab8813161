"""The flight: N pilots, as a drone carries one, with a world, bodies and an ether around them in lists and floats.

What decides is `core.pilot.Pilot`, given what it measures and what it hears. Here stands what is outside: true states,
errors of measurement, the air between agents, wind, bodies, edges, faults. All rules run on the random numbers of a
driver, in its order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.check.models import flock_solver
from airflock.core import radio, random
from airflock.core.body import first_command
from airflock.core.contract import State, call_rule
from airflock.core.maths import norm
from airflock.core.metric import Metric
from airflock.core.parameters import choices
from airflock.core.pilot import PacketPolicy, Pilot
from airflock.parts.bodies import dryden, wind
from airflock.scenarios.cost import step_counts
from airflock.scenarios.flight_world import FlightWorld, GoalCourse, wall_range
from airflock.scenarios.scenario import Scenario
from inside import Flown
from reference.begin import ZERO, Vector, begin, given, normals
from reference.individuals import Suffering, ahead, begins, groups_of, law_of, misled, own_parameters, radio_of
from reference.scores import Scores

MOVING = ("vx", "vy", "vz", "cx", "cy", "cz")
LIMIT = 1e8  # m; no radio reaches farther


@dataclass
class Link:
    """What the radio of one agent keeps of another: its Packet, and what is under way: when it is due, what it says."""

    packet: Any = None
    way: tuple[float, State, float] | None = None


@dataclass
class Agent:
    """One agent in the air.

    state      : true position (m) and velocity (m/s)
    pilot      : what decides; b, s: the numbers of its body and sensor; remembered, sensed: what these remember
    command    : its pilot's last command, if no fault has overruled it
    waiting, followed : commands that wait for the body's dead time, with the step when each is due; the one it flies by
    own, sent  : errors of its own and of its sent measurements: position error q (m), velocity error u (m/s)
    rays       : how many it cast at its last decision
    links      : by the number of another agent, what the radio keeps of what that one sends
    faults     : by kind, all that have hit it; kept : of each kind what it may repeat
    present    : whether it is there
    """

    state: State
    pilot: Pilot
    b: Any = None
    s: Any = None
    remembered: Any = None
    sensed: Any = None
    command: Vector = ZERO
    waiting: list[tuple[int, Vector]] = field(default_factory=list)
    followed: Vector = ZERO
    own: State = State(*ZERO, *ZERO)
    sent: State = State(*ZERO, *ZERO)
    rays: float = 0.0
    links: dict[int, Link] = field(default_factory=dict)
    faults: dict[str, list[Suffering]] = field(default_factory=dict)
    kept: dict[tuple[str, str], State] = field(default_factory=dict)
    present: bool = True

    def fault(self, kind: str, time: float) -> Suffering | None:
        """The fault of a kind that had begun last at a time (s): of each kind a later one replaces an earlier one."""
        begun = [suffering for suffering in self.faults.get(kind, ()) if suffering.begun(time)]
        return begun[-1] if begun else None

    def suffers(self, time: float) -> list[Suffering]:
        """The last fault of each kind at a time, s."""
        return [found for kind in self.faults if (found := self.fault(kind, time)) is not None]


def fly_plainly(  # noqa: C901 - one loop that a reader can follow
    scenario: Scenario,
    seed: int = 0,
    start: NDArray[Any] | None = None,
    metrics: tuple[Metric, ...] | None = None,
) -> Flown:
    """Fly one world and keep every sample.

    start : positions (m) and velocities (m/s) to start from, (component, agent), instead of random ones

    Returns what a compiled driver returns: order parameters over time, frames (time, component, agent), the state at
    the end, and minus the number of the agent that found no room to start in.
    """
    scenario = scenario.with_drawn_scene(seed)
    place, times = FlightWorld(scenario), step_counts(scenario)
    dims, dt, delay, every = scenario.dimensions, scenario.flight.dt, times["delay"], times["decide_every"]
    begun = begin(scenario, seed, place) if start is None else given(start, dims)
    flock = [boarded(scenario, seed, place, i, state) for i, state in enumerate(begun)]
    due, here = begins(scenario, seed), 0
    may_leave = scenario.can_land or any(
        entry.fault.leaves for entry in scenario.faults if entry.fault in scenario.fault_kinds
    )
    count = times["steps"] // times["sample_every"] + 1
    frames = np.zeros((count, 3 * dims, scenario.agents))
    chosen = scenario.order_parameters if metrics is None else metrics
    scores, course = Scores(chosen, scenario.resolved_metrics(), place, dims, scenario.wing), GoalCourse(scenario)
    solve = flock_solver(scenario)
    if len(flock) < scenario.agents:
        return Flown(scores.totals(), frames, np.zeros((2 * dims, scenario.agents)), -(len(flock) + 1))
    at_start, gust = states(flock), ZERO
    past: dict[int, list[State]] = {}  # by the number of the decision that hears them
    for step in range(times["steps"] + 1):
        if befall(scenario, step, flock, due):
            solve = flock_solver(scenario)
        there = [i for i, agent in enumerate(flock) if agent.present]
        here += len(there)
        if not there:
            if step % times["sample_every"] == 0:
                frames[step // times["sample_every"]] = components(flock, dims)
            continue
        count = len(there) >= min(2, len(flock))
        course.advance(step * dt, dt, states(flock, None if scenario.goals.kind == "own" else there))
        place.update_appearing(step * dt, states(flock, there))
        if (step + delay) % every == 0:
            past[(step + delay) // every] = told_of(scenario, flock)
        if step % every == 0 and scenario.flight.update == "synchronous":
            number = step // every
            shared = dict(zip(there, solve(states(flock, there)), strict=True)) if solve else None
            past_now = past.pop(number, at_start)
            decisions(scenario, seed, (place, course), flock, number, past_now, step * dt, shared=shared)
        if step % times["collide_every"] == 0:
            seen = scores.look("collision", states(flock, there), step * dt, who=there, count=count)
            if seen.get("n_coll", 0.0) > 0.5 and scenario.metrics.stop == "collision":
                frames = frames[: -(-step // times["sample_every"])]
                break
        if step % times["sample_every"] == 0:
            rays = [flock[i].rays for i in there]
            scores.look("sample", states(flock, there), step * dt, rays, who=there, count=count)
            frames[step // times["sample_every"]] = components(flock, dims)
        if step < times["steps"]:
            gust = blow(scenario, seed, step, gust)
            for i in there:
                agent = flock[i]
                if scenario.flight.update == "sequential":
                    decisions(scenario, seed, (place, course), flock, step, states(flock), step * dt, [i])
                if step % every == 0:
                    agent.waiting.append((step + times["lag"], agent.command))
                if agent.waiting and agent.waiting[0][0] <= step:
                    agent.followed = agent.waiting.pop(0)[1]
                advance(scenario, seed, step, i, agent, gust, place)
    told = {"present": here / ((step + 1) * len(flock))} if may_leave else {}
    return Flown(scores.totals() | course.values() | told, frames, components(flock, dims)[: 2 * dims], 0)


def boarded(scenario: Scenario, seed: int, place: FlightWorld, i: int, state: State) -> Agent:
    """Agent i with its pilot, which carries the map, its own numbers, and its seed."""
    law = law_of(scenario, i)
    p = own_parameters(scenario, "model", law[1], i, seed)
    b = own_parameters(scenario, "body", scenario.body.numbers, i, seed)
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    pilot = Pilot(
        law[0], p, place.seen(wall_range(law[0], p)), index=i, period=period, groups=groups_of(scenario),
        hearing=PacketPolicy.simulated(scenario.radio.rule, scenario.radio.numbers),
        silence=scenario.resolved_silence(), body=scenario.body.rule, b=b,
        flat=scenario.dimensions == 2, seed=seed, wing=scenario.wing, aero=scenario.aero,
        steer=scenario.resolved_steer(),
        gets_flock_solution=scenario.model.flock is not None,
        topology=scenario.topology.rule, t=scenario.topology.numbers,
    )  # fmt: skip
    kept, sensed = (each() if each else None for each in (scenario.body.rule.Memory, scenario.sensors.rule.Memory))
    s = own_parameters(scenario, "sensors", scenario.sensors.numbers, i, seed)
    before = first_command(scenario.model.command, state[3:])
    return Agent(state, pilot, b, s, kept, sensed, followed=before)


def befall(scenario: Scenario, step: int, flock: list[Agent], due: dict[int, Any]) -> bool:
    """Let begin what is due, and drop out who has landed with an empty battery; whether somebody dropped out."""
    left = False
    for number, entry, lasts, leaves in due.get(step, ()):
        agent = flock[number]
        if not agent.present:
            continue
        if leaves:
            agent.present, left = False, True
            for other in flock:
                other.pilot.forget(number)
            continue
        known = {f"at_{name}": value for name, value in agent.state._asdict().items()}
        known |= dict(zip(("at_cx", "at_cy", "at_cz"), agent.command, strict=True))
        dt = scenario.flight.dt
        suffering = Suffering(entry.fault, entry.numbers, step * dt, lasts, known, 0.5 * dt)
        agent.faults.setdefault(entry.fault.name, []).append(suffering)
        order = [kind.name for kind in scenario.fault_kinds]  # a later kind disturbs what an earlier one has left
        agent.faults = dict(sorted(agent.faults.items(), key=lambda item: order.index(item[0])))
    for number, agent in enumerate(flock if scenario.can_land else ()):
        low = agent.present and agent.state.z <= scenario.ground
        if low and scenario.body.rule.lasts(memory=agent.remembered, b=agent.b, wing=scenario.wing) <= 0.0:
            agent.present, left = False, True
            for other in flock:
                other.pilot.forget(number)
    return left


def states(flock: Sequence[Agent], who: Sequence[int] | None = None) -> list[State]:
    """True states of all agents, or of some."""
    return [agent.state for agent in flock] if who is None else [flock[i].state for i in who]


def told_of(scenario: Scenario, flock: Sequence[Agent]) -> list[State]:
    """What others come to know: the true state, or that with the errors of the last measurement; seen it is true."""
    plain = scenario.sensors.rule.measure is None or scenario.radio.rule.see is not None
    return states(flock) if plain else [plus(agent.state, agent.own) for agent in flock]


def components(flock: Sequence[Agent], dims: int) -> NDArray[np.float64]:
    """Position, velocity and command, (component, agent), only the axes that are flown."""
    rows = [
        (*a.state[:dims], *a.state[3 : 3 + dims], *a.command[:dims]) if a.present else (np.nan,) * (3 * dims)
        for a in flock
    ]
    return np.array(rows).T


def plus(state: State, error: State) -> State:
    """A state with an error."""
    return State(*(a + b for a, b in zip(state, error, strict=True)))


# ------------------------------------------------------------------------------------------------------- decision


def decisions(
    scenario: Scenario,
    seed: int,
    world: tuple[FlightWorld, GoalCourse],
    flock: list[Agent],
    number: int,
    past: list[State],
    time: float,
    turn: Sequence[int] | None = None,
    shared: Sequence[Any] | None = None,
) -> None:
    """Decision `number` of all agents, or of those in turn, from true states now and the `past` ones heard now."""
    if scenario.has_sensor_error:
        for i, agent in enumerate(flock):
            drift(scenario, seed, number, i, agent, time)
    times, dt, (place, course) = step_counts(scenario), scenario.flight.dt, world
    sent = (number * times["decide_every"] - times["delay"]) * dt
    kinds, dims, of_sent = scenario.fault_kinds, scenario.dimensions, (("sense", "sent"), ("tell", "told"))
    said = [
        state
        if scenario.radio.rule.see is not None
        else misled(agent, kinds, of_sent, sent, plus(state, agent.sent), dims)
        for state, agent in zip(past, flock, strict=True)
    ]
    for i in [k for k, agent in enumerate(flock) if agent.present] if turn is None else turn:
        agent, pilot = flock[i], flock[i].pilot
        own = misled(agent, kinds, (("sense", "believed"),), time, plus(agent.state, agent.own), dims)
        near = hear(scenario, seed, number, i, flock, said, time, place, own)
        made = pilot.decide(
            own, time + ahead(agent, time), goal=course.of(i), time=time, visible=near,
            shared=shared[i] if shared else None, fades=fading(scenario, seed, number, i, len(flock)),
        )  # fmt: skip
        agent.rays = float(pilot.senses.rays)
        x, y, z = made.command
        for suffering in agent.suffers(time):
            stuck = suffering.asked("overrule", time, cx=x, cy=y, cz=z)
            x, y, z = (x, y, z) if stuck is None else stuck
        agent.command = (x, y, z if scenario.dimensions == 3 else 0.0)


def fading(scenario: Scenario, seed: int, number: int, i: int, n: int) -> dict[int, float]:
    """Normal numbers of the signals between agent i and each other one, the same both ways."""
    if scenario.topology.rule is None or not scenario.topology.rule.asks_for("fade"):
        return {}
    pairs = {j: min(i, j) * n + max(i, j) for j in range(n) if j != i}
    words = {j: random.random_words(seed, random.FADE, 0, number, pair) for j, pair in pairs.items()}
    return {j: random.normal_pair(*found[:2])[0] for j, found in words.items()}


def drift(scenario: Scenario, seed: int, number: int, i: int, agent: Agent, time: float) -> None:
    """Advance both errors of one agent by one sensor period, or have it measure."""
    if scenario.sensors.rule.measure is not None:
        agent.own, agent.sensed = sensed(scenario, seed, number, i, agent, time)
        return
    s, period = agent.s, step_counts(scenario)["decide_every"] * scenario.flight.dt
    own_x, own_y, sent_x, sent_y = normals(seed, random.SENSOR, number, i)
    own_z, sent_z = normals(seed, random.SENSOR, number, i, draw=1)[:2] if scenario.dimensions == 3 else (0.0, 0.0)
    rule = scenario.sensors.rule.error
    agent.own = swing(rule, agent.own, (own_x, own_y, own_z), period, s)
    agent.sent = swing(rule, agent.sent, (sent_x, sent_y, sent_z), period, s)


def sensed(scenario: Scenario, seed: int, number: int, i: int, agent: Agent, time: float) -> tuple[State, Any]:
    """How far what an agent measures is off, and what its sensor remembers."""
    sensor, period = scenario.sensors.rule, step_counts(scenario)["decide_every"] * scenario.flight.dt
    drawn = [g for block in (8, 9, 10) for g in normals(seed, random.SENSOR, number, i, draw=block)]
    chances = [random.uniform(word) for word in random.random_words(seed, random.SENSOR, 0, number, i, draw=11)]
    given = agent.state._asdict() | {f"g{c}": g for c, g in enumerate(drawn)}
    given |= {f"u{c}": u for c, u in enumerate(chances)}
    given |= {"memory": agent.sensed, "time": time, "period": period, "s": agent.s}
    found = call_rule(sensor.measure, "measure", given, sensor.name)
    off = [a - b for a, b in zip(found[:6], agent.state, strict=True)]
    if scenario.dimensions == 2:
        off[2] = off[5] = 0.0
    return State(*off), found[6] if sensor.Memory else None


def swing(rule: Any, error: State, g: Vector, period: float, s: Any) -> State:
    """One step of an error on all axes."""
    steps = [
        call_rule(rule, "error", {"dx": error[c], "dv": error[3 + c], "g": g[c], "period": period, "s": s})
        for c in range(3)
    ]
    return State(*(dx for dx, _ in steps), *(dv for _, dv in steps))


def hear(
    scenario: Scenario, seed: int, number: int, i: int, flock: list[Agent], said: list[State], time: float,
    place: FlightWorld, own_believed: State,
) -> set[int]:  # fmt: skip
    """Hand the pilot of agent i the packets that arrive at decision `number`; returns who is in range, truly."""
    k, late, found = scenario.radio.numbers, step_counts(scenario)["delay"] * scenario.flight.dt, set()
    for j, other in enumerate(flock):
        if j == i or not other.present:
            continue
        own, true = flock[i].state, place.beside(flock[i].state, other.state)
        distance = norm(true.x - own.x, true.y - own.y, true.z - own.z)
        in_range = distance <= norm(min(k.range, LIMIT), 0.0, 0.0)  # at exactly the range it is heard
        reach = min(k.range, LIMIT)
        into, out = radio_of(flock[i], time, reach)[1], radio_of(other, time, reach)[0]
        far = into if scenario.radio.rule.see is not None else min(into, out)  # who is seen need not send
        carries = distance <= norm(far, 0.0, 0.0) and far >= 0.0
        mine, theirs = ahead(flock[i], time), ahead(other, time - late)
        if in_range:
            found.add(j)
        link = flock[i].links.setdefault(j, Link())
        if in_range and carries and arrives(scenario, seed, number, place, i, j, flock, link, time + mine):
            wait = lateness(scenario, seed, number, place, i, j, flock)
            if scenario.radio.rule.see is not None:
                then = time - late + ahead(flock[i], time - late)
                seen = glimpsed(scenario, seed, number, place, i, j, flock, said, own_believed, then)
                link.way = time, seen, then
            if link.way is None:  # one packet at a time is under way
                link.way = time + wait, said[j], time - late + theirs
        if link.way is not None and link.way[0] <= time + 0.5 * scenario.flight.dt:
            flock[i].pilot.receive(j, link.way[1], link.way[2], time + mine)
            link.way = None
    return found


def glimpsed(
    scenario: Scenario,
    seed: int,
    number: int,
    place: FlightWorld,
    i: int,
    j: int,
    flock: list[Agent],
    said: list[State],
    own: State,
    taken: float,
) -> State:
    """Where agent i believes agent j by a picture that was taken so long after the start by its clock, s."""
    state, kind, pair = flock[i].state, scenario.radio.rule, i * len(flock) + j
    here = place.image_offset(*(a - b for a, b in zip(state[:3], said[i][:3], strict=True)))
    base = [a - b for a, b in zip(own[:3], here, strict=True)]
    off = place.image_offset(*(a - b for a, b in zip(said[j][:3], said[i][:3], strict=True)))
    known = flock[i].pilot.packets.get(j)
    before, since = (known.state, taken - known.sent_at) if known else (State(*ZERO, *ZERO), taken + 1e9)
    expected = place.image_offset(*(x + v * since - b for x, v, b in zip(before[:3], before[3:], base, strict=True)))
    chances = [random.uniform(word) for word in random.random_words(seed, random.AIR, 0, number, pair)]
    given = dict(zip(("dx", "dy", "dz", "ex", "ey", "ez"), (*off, *expected), strict=True))
    given |= dict(zip(("evx", "evy", "evz", "vx", "vy", "vz"), (*before[3:], *own[3:]), strict=True))
    given |= {f"u{c}": u for c, u in enumerate(chances)}
    given |= {f"g{c}": g for c, g in enumerate(normals(seed, random.AIR, number, pair, draw=1))}
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    found = call_rule(
        kind.see, "see", given | {"since": since, "period": period, "k": scenario.radio.numbers}, kind.name
    )
    flat = {} if scenario.dimensions == 3 else {"z": 0.0, "vz": 0.0}
    return State(*(a + b for a, b in zip(base, found[:3], strict=True)), *found[3:])._replace(**flat)


def asked_of_radio(
    scenario: Scenario, seed: int, number: int, place: FlightWorld, i: int, j: int, flock: list[Agent]
) -> dict[str, Any]:
    """What rules of the radio may ask for of what agent j sends agent i."""
    own, n, period = flock[i].state, len(flock), step_counts(scenario)["decide_every"] * scenario.flight.dt
    there = [k for k, agent in enumerate(flock) if agent.present]
    seen = {k: place.beside(own, flock[k].state) for k in there}
    apart = {k: norm(s.x - own.x, s.y - own.y, s.z - own.z) for k, s in seen.items()}
    reach, true = norm(min(scenario.radio.range, LIMIT), 0.0, 0.0), seen[j]
    pair = i * n + j
    chances = [random.uniform(word) for word in random.random_words(seed, random.AIR, 0, number, pair)]
    sent = {
        link: radio.packets(float(number), getattr(scenario.radio.numbers, rate), period)
        for link, rate in zip(("fast", "slow"), scenario.radio.rule.rates, strict=False)
    }
    return sent | {
        "distance": apart[j], "vx": own.vx, "vy": own.vy, "vz": own.vz,
        "dx": true.x - own.x, "dy": true.y - own.y, "dz": true.z - own.z,
        "talkers": float(sum(apart[k] <= reach for k in there if k != i)),
        "clear": 0.0 if place.is_blocked(*own[:3], *true[:3]) else 1.0, "step": float(number), "period": period,
        **{f"u{c}": u for c, u in enumerate(chances)},
        **{f"g{c}": g for c, g in enumerate(normals(seed, random.AIR, number, pair, draw=1))},
        "k": scenario.radio.numbers,
    }  # fmt: skip


def arrives(
    scenario: Scenario,
    seed: int,
    number: int,
    place: FlightWorld,
    i: int,
    j: int,
    flock: list[Agent],
    link: Link,
    now: float,
) -> bool:
    """Whether anything of what agent j sends agent i in a decision arrives; `now` by the clock of agent i."""
    kind, k = scenario.radio.rule, scenario.radio.numbers
    asked = asked_of_radio(scenario, seed, number, place, i, j, flock)
    if kind.receive is not None:
        newest = flock[i].pilot.packets.get(j)
        asked |= {"age": now - newest.sent_at if newest else now + 1e9}
        asked["packet"] = link.packet or (kind.Packet() if kind.Packet else None)
        found = call_rule(kind.receive, "receive", asked, kind.name)
        hit, link.packet = found if kind.Packet else (found, None)
        if hit <= 0.5:
            return False
    missed = call_rule(kind.missed, "missed", asked, kind.name) if kind.missed is not None else 0.0
    u = random.pair_uniform(seed, random.PACKET, 0, number, i, j, len(flock))
    return u >= missed + (1.0 - missed) * radio.lost(asked["distance"], k)


def lateness(
    scenario: Scenario, seed: int, number: int, place: FlightWorld, i: int, j: int, flock: list[Agent]
) -> float:
    """How late what agent j sends agent i in a decision comes, s; 0.0 over a radio that brings all in time."""
    kind = scenario.radio.rule
    if kind.late is None:
        return 0.0
    return max(0.0, call_rule(kind.late, "late", asked_of_radio(scenario, seed, number, place, i, j, flock), kind.name))


# --------------------------------------------------------------------------------------------------------- motion


def blow(scenario: Scenario, seed: int, step: int, gust: Vector) -> Vector:
    """Gust after one motion step, m/s."""
    a, dt = scenario.wind, scenario.flight.dt
    if a.kind == "dryden":
        return turbulence(scenario, seed, step, gust)
    if a.gust == 0.0:
        return ZERO
    x, y, z = (wind.gusting(w, g, dt, a) for w, g in zip(gust, normals(seed, random.GUST, step, 0), strict=False))
    return x, y, z


def turbulence(scenario: Scenario, seed: int, step: int, gust: Any) -> Any:
    """Gust of the Dryden spectrum after one motion step, m/s; it carries its five states along."""
    air, dt = dryden.numbers_of(scenario.wind), scenario.flight.dt
    u, p, q, r, s = gust.states if isinstance(gust, Turbulent) else (0.0,) * 5
    ga, gb, gc, gd = normals(seed, random.GUST, step, 0)
    ge = normals(seed, random.GUST, step, 0, draw=1)[0]
    u = dryden.along(u, ga, dt, air.length, air.sigma, air.airspeed)
    p, q = dryden.across(p, q, gb, gc, dt, air.length, air.airspeed)
    r, s = dryden.across(r, s, gd, ge, dt, air.length_up, air.airspeed)
    side, up = dryden.gust_of(p, q, air.sigma), dryden.gust_of(r, s, air.sigma_up)
    made = Turbulent((air.east * u - air.north * side, air.north * u + air.east * side, up))
    made.states = (u, p, q, r, s)
    return made


class Turbulent(tuple):
    """A gust, m/s, with the states of its three axes."""

    states: tuple[float, ...]


def advance(scenario: Scenario, seed: int, step: int, i: int, agent: Agent, gust: Vector, place: FlightWorld) -> None:
    """One motion step: position by the old or the new velocity, velocity by the body; then the edges of the arena."""
    s, dt, three, body = agent.state, scenario.flight.dt, scenario.dimensions == 3, scenario.body.rule
    if three:
        g: Vector = normals(seed, random.OUTER, step, i)[:3]
    else:  # one draw serves two steps: four numbers are two steps of two axes
        four = normals(seed, random.OUTER, step // 2, i)
        g = (*(four[:2] if step % 2 == 0 else four[2:]), 0.0)
    a = scenario.wind
    w = (a.east + gust[0], a.north + gust[1], a.up + gust[2] if three else 0.0)
    known = {"v": s[3:], "m": plus(s, agent.own)[3:], "c": agent.followed, "g": g, "w": w}
    given = {letter + axis: vector[c] for letter, vector in known.items() for c, axis in enumerate("xyz")}
    moved = call_rule(
        body.move,
        "move",
        given | {"dt": dt, "b": agent.b, "memory": agent.remembered, "wing": scenario.wing},
        body.name,
    )
    velocity, agent.remembered = (*moved[:2], moved[2] if three else 0.0), moved[3] if body.Memory else None
    for suffering in agent.suffers(step * dt):
        told = {f"n{axis}": velocity[c] for c, axis in enumerate("xyz")} | {"dt": dt}
        velocity = suffering.asked("motion", step * dt, **{k: given[k] for k in MOVING}, **told) or velocity
    integration = choices(scenario.body.numbers).get("integration", body.integration)
    vx, vy, vz = s[3:] if integration == "old" else velocity
    agent.state = place.settled(State(s.x + vx * dt, s.y + vy * dt, s.z + vz * dt, *velocity))
