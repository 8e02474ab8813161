"""A fleet on the real clock: nodes, vehicles and ether that speak over UDP on this computer, each a life of its own.

A node lives by the code that flies on board (`onboard.run.live`). A vehicle talks to its node, and to whoever joins:
like PX4's simulator it calls at a port of its own, and a client that answers there gets everything. The ether hears
every packet and where each vehicle is. The flight begins when every node has heard its vehicle, and all have hovered
and heard each other for a while.
"""

import asyncio
import struct
import time
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from airflock.core.agent import State
from airflock.core.sensing import Sensing
from airflock.fleet.dice import OuterNoise
from airflock.fleet.ether import Ether
from airflock.fleet.faults import Fault
from airflock.fleet.individuals import records_of
from airflock.fleet.starting import KEY, in_the_air, vehicle_of
from airflock.fleet.telemetry import MESSAGES
from airflock.fleet.teller import Teller
from airflock.onboard.card import Card
from airflock.onboard.mission import Phase
from airflock.onboard.node import Node
from airflock.onboard.ports import Place, Udp
from airflock.onboard.run import Ticks, live
from airflock.scenarios.scenario import Scenario

HOST = "127.0.0.1"
WARM = 1.0  # s beyond the radio's delay for which all hover before the flight begins
LOOK = 0.02  # s between two looks of a vehicle at its ports
HOP = 0.005  # s between two looks of the ether
BEAT = 0.5  # s between two calls of a vehicle at a port where nobody has answered yet
SINCE = 60_000_000  # µs; packets sent so long before a node began are accepted, for its clock may be wrong
WHERE = struct.Struct("<Hddd?")  # place among the members, position (m), whether it is armed
NEVER = -1e9


class Ports(NamedTuple):
    """Sockets of a fleet: of each node to its autopilot and of its radio, of each vehicle to its node and to clients,
    of the ether for packets and for places, and of whoever watches.
    """

    nodes: list[Udp]
    radios: list[Udp]
    vehicles: list[Udp]
    clients: list[Udp]
    ether: Udp
    places: Udp
    watch: Udp

    @classmethod
    def opened(cls, count: int, join: tuple[str, int]) -> "Ports":
        """Ports for so many drones; vehicle i calls clients at the port `join` + i."""
        nodes, radios, vehicles, clients = ([_port() for _ in range(count)] for _ in range(4))
        found = cls(nodes, radios, vehicles, clients, _port(), _port(), _port())
        for i in range(count):
            nodes[i].aim(vehicles[i].here)
            vehicles[i].aim(nodes[i].here)
            radios[i].aim(found.ether.here)
            clients[i].aim((join[0], join[1] + i))
        return found

    def close(self) -> None:
        """Close all."""
        for port in (*self.nodes, *self.radios, *self.vehicles, *self.clients, self.ether, self.places, self.watch):
            port.close()


def _port() -> Udp:
    return Udp(Place((HOST, 0), None))


@dataclass(frozen=True)
class Plan:
    """What all lives of a fleet know.

    start : states of drones that begin in the air; None: on the ground
    clock : time.monotonic of the flight's time 0, and of its end, s; then for each node 1 once it has heard its
            vehicle; shared by all
    epoch : Unix time at which time.monotonic was 0, µs
    watcher : address at which somebody hears all packets, and what the ether tells; None: nobody does
    """

    scenario: Scenario
    card: Card
    seed: int
    start: Sequence[State] | None
    faults: tuple[Fault, ...]
    ports: Ports
    clock: MutableSequence[float]
    epoch: int
    watcher: tuple[str, int] | None = None

    @property
    def now(self) -> float:
        """Time of the flight, s; negative while all hover."""
        return time.monotonic() - self.clock[0]

    @property
    def ready(self) -> bool:
        """Whether every node has heard its vehicle."""
        return all(self.clock[2 + i] > 0.5 for i in range(len(self.card.members)))

    @property
    def over(self) -> bool:
        """Whether the flight has ended."""
        return time.monotonic() >= self.clock[1]

    def utc(self, now: float) -> int:
        """Unix time (µs) at a time of `time.monotonic`, s."""
        return self.epoch + round(now * 1e6)


class Life(NamedTuple):
    """What is left of one node or vehicle when it ends.

    rows   : one per period: true state of a vehicle; command, own state and times of peers' states of a node
    notes  : time.monotonic (s), member and text; ticks: of a node, of a vehicle its looks; processor: s
    """

    rows: list[Any]
    notes: list[tuple[float, int, str]]
    ticks: Ticks
    phase: Phase
    processor: float


async def node_life(plan: Plan, i: int) -> Life:
    """Life of a node, from now until the end of the flight or its own."""
    card, began = plan.card, time.process_time()
    member = card.members[i]
    ahead = sum(round(f.amount * 1e6) for f in plan.faults if f.kind == "clock" and f.holds(member, f.begin))
    dies = min([f.begin for f in plan.faults if f.kind == "node" and f.holds(member, f.begin)], default=1e9)
    now = time.monotonic()
    utc = plan.utc(now) + ahead
    node = Node(card, member, KEY, now=now, utc=utc, since=utc - SINCE)
    rows: list[Any] = []
    notes: list[tuple[float, int, str]] = []
    waits = plan.start is not None

    def until() -> bool:
        nonlocal waits
        wire, now = node.wire, plan.now
        if wire.state is not None and wire.armed is not None:
            plan.clock[2 + i] = 1.0
        if waits and wire.state is not None and wire.mode == card.autopilot.ours and wire.armed:
            waits, node.phase, node.home = False, Phase.FLOCK, (wire.state.x, wire.state.y, card.layer(member))
        while now >= len(rows) * card.period:
            ages = [node.peers.all[m].at - plan.clock[0] if m != member else NEVER for m in card.members]
            rows.append(((*node.command, *(wire.state or (0.0,) * 6)), ages))
        return plan.over or now >= dies

    def tell(note: str) -> None:
        notes.append((time.monotonic(), member, note))

    ticks = await live(node, [plan.ports.nodes[i], plan.ports.radios[i]], card.safety.tick, tell, until)
    return Life(rows, notes, ticks, node.phase, time.process_time() - began)


class Craft:
    """A vehicle with its ports, on the real clock."""

    def __init__(self, plan: Plan, i: int):
        scenario, card = plan.scenario, plan.card
        self.plan, self.place, self.rows, self.steps = plan, i, [], 0  # type: ignore[var-annotated]
        body = records_of(scenario, len(card.members), plan.seed)[i][1]
        noise = OuterNoise(plan.seed, 1, not card.flat, first=i)
        self.vehicle = made = vehicle_of(scenario, card, i, body, noise, plan.utc(time.monotonic()))
        self._booted = time.monotonic() - WARM
        self._sensing = Sensing(scenario.sensor, scenario.sensors, plan.seed, i, flat=card.flat)
        self._every = max(1, round(card.period / scenario.flight.dt))
        self._node, self._clients = plan.ports.vehicles[i], plan.ports.clients[i]
        self._client: tuple[str, int] | None = None
        self._beat_at = NEVER
        made.due = dict.fromkeys(made.due, NEVER)
        if plan.start is not None:
            in_the_air(made, card, plan.start[i])
            made.state = State(*made.state[:3], 0.0, 0.0, 0.0)  # it hovers until the flight begins
        self._node.write(made.frame_origin())

    def look(self) -> None:
        """Read what came, move up to now, and tell."""
        vehicle, plan, zero = self.vehicle, self.plan, self.plan.clock[0]  # once: the clock may be set meanwhile
        now = time.monotonic() - zero
        vehicle.started, vehicle.booted = plan.utc(zero), self._booted - zero
        for data in self._node.read():
            self._node.write(vehicle.receive(data, now))
        for data, sender in self._clients.read_from():
            self._client = sender
            self._clients.send(vehicle.receive(data, now), sender)
        self._move(now)
        told = vehicle.telemetry(now)
        self._node.write(told)
        if self._client is not None:
            self._clients.send(told, self._client)
        elif now - self._beat_at >= BEAT:
            self._beat_at = now
            self._clients.write(vehicle.frame(MESSAGES["heartbeat"](vehicle)))
        at = WHERE.pack(self.place, *vehicle.state[:3], vehicle.armed)
        for port in (plan.ports.places, plan.ports.watch):
            self._node.send(at, port.here)

    def _move(self, now: float) -> None:
        vehicle, plan, dt = self.vehicle, self.plan, self.plan.scenario.flight.dt
        while now >= self.steps * dt:
            at = self.steps * dt
            if self.steps == 0 and plan.start is not None:
                vehicle.state = State(*vehicle.state[:3], *plan.start[self.place][3:])
            if self.steps % self._every == 0:
                if plan.scenario.errs:
                    vehicle.error = self._sensing.measure(self.steps // self._every, vehicle.state, plan.card.period)
                self.rows.append(tuple(vehicle.state))
            vehicle.suffer(plan.faults, at, dt)
            vehicle.step(at, dt)
            self.steps += 1


async def craft_life(plan: Plan, i: int) -> Life:
    """Life of a vehicle until the end of the flight."""
    began, craft = time.process_time(), Craft(plan, i)
    count, late, worst, due = 0, 0, 0.0, time.monotonic()
    while not plan.over:
        behind = time.monotonic() - due
        count, late, worst = count + 1, late + (behind > 0.5 * LOOK), max(worst, behind)
        craft.look()
        due = max(due + LOOK, time.monotonic() - LOOK)
        await asyncio.sleep(max(0.0, due - time.monotonic()))
    return Life(craft.rows, [], Ticks(count, late, worst), Phase.DONE, time.process_time() - began)


async def ether_life(plan: Plan) -> Life:
    """Life of the ether: packets of nodes reach those whom the radio lets them reach, orders reach all at once."""
    began, card, ports = time.process_time(), plan.card, plan.ports
    flown, period = plan.scenario, card.safety.status_period
    ether = Ether(flown.transceiver, flown.radio, card.members, plan.seed, period, plan.faults, site=card.site)
    at: list[tuple[float, float, float]] = [(0.0, 0.0, 0.0)] * len(card.members)
    radios = [port.here for port in ports.radios]
    who = {here: i for i, here in enumerate(radios)}
    teller = Teller(card.members, plan.faults) if plan.watcher else None

    def watched(data: bytes) -> None:
        if plan.watcher is not None:
            ports.ether.send(data, plan.watcher)

    while not plan.over:
        for data in ports.places.read():
            i, x, y, z, _ = WHERE.unpack(data)
            at[i] = (x, y, z)
        now = plan.now
        for data, sender in ports.ether.read_from():
            if sender in who:
                ether.send(now, who[sender], data, at)
                watched(data)
            elif sender == ports.watch.here:
                for radio in radios:
                    ports.ether.send(data, radio)
                watched(data)
        for to, data in ether.deliver(now, at):
            ports.ether.send(data, radios[to])
            if teller is not None:
                teller.arrived(to, data, now)
        for data in () if teller is None else teller.report(now, plan.utc(time.monotonic())):
            watched(data)
        await asyncio.sleep(HOP)
    return Life([], [], Ticks(0, 0, 0.0), Phase.DONE, time.process_time() - began)


class Watched:
    """What whoever watches knows: where each vehicle is, and whether it is armed."""

    def __init__(self, plan: Plan):
        self._port, count = plan.ports.watch, len(plan.card.members)
        self.armed = [plan.start is not None] * count

    def look(self) -> None:
        """Read what came."""
        for data in self._port.read():
            i, _, _, _, armed = WHERE.unpack(data)
            self.armed[i] = armed
