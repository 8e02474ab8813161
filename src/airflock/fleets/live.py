"""A fleet on the real clock: nodes, vehicles and ether that speak over UDP on this computer, each a life of its own.

A node lives by the code that flies on board (`drones.onboard.run.live`). A vehicle talks to its node and to clients
that join: like PX4's simulator it calls at a port of its own, and a client that answers there gets everything. The
ether hears every packet; where each vehicle is stands in memory that all share. The flight begins when every node has
heard its vehicle, and all have hovered and heard each other for a while.
"""

import math
import time
from collections.abc import Generator, MutableSequence, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

from airflock.core.agent import State
from airflock.core.sensing import Sensing
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import Phase
from airflock.drones.onboard.node import Node
from airflock.drones.onboard.ports import Place, Udp
from airflock.drones.onboard.resting import Rest
from airflock.drones.onboard.run import Ticks, live
from airflock.fleets.ailing import Ailing
from airflock.fleets.befalling import Faults
from airflock.fleets.dice import OuterNoise
from airflock.fleets.ether import Ether
from airflock.fleets.faults import Fault, clock_error
from airflock.fleets.individuals import records_of
from airflock.fleets.starting import DROPS_OUT, KEY, SINCE, clear, in_the_air, vehicle_of
from airflock.fleets.telemetry import MESSAGES
from airflock.fleets.teller import Teller
from airflock.scenarios.scenario import Scenario

HOST = "127.0.0.1"
WARM = 1.0  # s beyond the radio's delay for which all hover before the flight begins
LOOK = 0.02  # s; least time between two looks of a vehicle at its ports
HOP = 0.01  # s between two looks of the ether
BEAT = 0.5  # s between two calls of a vehicle at a port where nobody has answered yet
NEVER = -1e9
ABSENT = (math.nan,) * 6  # a row of a vehicle that has dropped out


class Ports(NamedTuple):
    """Sockets of a fleet: of each node to its autopilot and of its radio, of each vehicle to its node and to clients,
    of the ether, and of who gives orders.
    """

    nodes: list[Udp]
    radios: list[Udp]
    vehicles: list[Udp]
    clients: list[Udp]
    ether: Udp
    station: Udp

    @classmethod
    def opened(cls, count: int, join: tuple[str, int]) -> "Ports":
        """Ports for so many drones; vehicle i calls clients at the port `join` + i."""
        nodes, radios, vehicles, clients = ([_port() for _ in range(count)] for _ in range(4))
        found = cls(nodes, radios, vehicles, clients, _port(), _port())
        for i in range(count):
            nodes[i].aim(vehicles[i].here)
            vehicles[i].aim(nodes[i].here)
            radios[i].aim(found.ether.here)
            clients[i].aim((join[0], join[1] + i))
        return found

    def close(self) -> None:
        """Close all."""
        for port in (*self.nodes, *self.radios, *self.vehicles, *self.clients, self.ether, self.station):
            port.close()


def _port() -> Udp:
    return Udp(Place((HOST, 0), None))


@dataclass(frozen=True)
class Plan:
    """What all lives of a fleet know.

    start : states of drones that begin in the air; None: on the ground
    clock : time.monotonic of the flight's time 0, and of its end, s; then for each node 1 once it has heard its
            vehicle; shared by all
    seen  : of each vehicle its position (m) and whether it is armed, four numbers; shared by all
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
    seen: MutableSequence[float]
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
    def places(self) -> list[tuple[float, float, float]]:
        """Where the vehicles are, m."""
        return list(zip(self.seen[0::4], self.seen[1::4], self.seen[2::4], strict=True))

    @property
    def armed(self) -> list[bool]:
        """Which vehicles are armed."""
        return [armed > 0.5 for armed in self.seen[3::4]]

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


def node_life(plan: Plan, i: int) -> Generator[Rest, None, Life]:
    """Life of a node, from now until the end of the flight or its own."""
    card, began = plan.card, time.process_time()
    member = card.members[i]
    dies = min([fault.begin for fault in plan.faults if fault.kind == "node" and fault.befalls(member)], default=1e9)
    now = time.monotonic()
    utc = plan.utc(now) + clock_error(plan.faults, member)
    node = Node(card, member, KEY, now=now, utc=utc, since=utc - SINCE)
    befalls = Faults(plan.scenario, plan.seed, only=i)
    ailing = Ailing(lambda: node, befalls, i, card.site, lambda own: own - plan.clock[0])
    rows: list[Any] = []
    notes: list[tuple[float, int, str]] = []
    waits = plan.start is not None

    def until() -> bool:
        nonlocal waits
        wire, now = node.wire, plan.now
        befalls.until(now)
        if wire.state is not None and wire.armed is not None:
            plan.clock[2 + i] = 1.0
        if waits and wire.state is not None and wire.mode == card.autopilot.ours and wire.armed:
            waits, node.phase, node.home = False, Phase.FLOCK, (wire.state.x, wire.state.y, card.layer(member))
        while now >= len(rows) * card.period:
            ages = [node.peers.all[m].at - plan.clock[0] if m != member else NEVER for m in card.members]
            rows.append(((*node.command, *(wire.state or (0.0,) * 6)), ages))
        return plan.over or now >= dies or i in befalls.gone

    def tell(note: str) -> None:
        notes.append((time.monotonic(), member, note))

    ticks = yield from live(ailing, [plan.ports.nodes[i], plan.ports.radios[i]], card.safety.tick, tell, until)
    return Life(rows, notes, ticks, node.phase, time.process_time() - began)


class Craft:
    """A vehicle with its ports, on the real clock."""

    def __init__(self, plan: Plan, i: int):
        scenario, card = plan.scenario, plan.card
        self.plan, self.place, self.rows, self.steps = plan, i, [], 0  # type: ignore[var-annotated]
        body = records_of(scenario, len(card.members), plan.seed)[i][1]
        noise = OuterNoise(plan.seed, 1, not card.flat, first=i)
        self.vehicle = made = vehicle_of(scenario, card, i, body, noise, plan.utc(time.monotonic()))
        self._befalls = Faults(scenario, plan.seed, only=i)
        made.faults = self._befalls or None
        self.notes: list[tuple[float, int, str]] = []
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
        self._show()

    @property
    def period(self) -> float:
        """Time between two looks, s: as often as it tells what it tells most often."""
        return max(LOOK, 1.0 / max(self.vehicle.rates.values()))

    def look(self) -> None:
        """Read what came, move up to now, and tell."""
        vehicle, plan, zero = self.vehicle, self.plan, self.plan.clock[0]  # once: the clock may be set meanwhile
        now = time.monotonic() - zero
        vehicle.started, vehicle.booted = plan.utc(zero), self._booted - zero
        for data in self._node.read():
            self._tell(vehicle.receive(data, now))
        for data, sender in self._clients.read_from():
            self._client = sender
            self._tell(vehicle.receive(data, now), sender)
        self._move(now)
        told = vehicle.telemetry(now)
        self._tell(told)
        if self._client is not None:
            self._tell(told, self._client)
        elif now - self._beat_at >= BEAT:
            self._beat_at = now
            self._clients.write(vehicle.frame(MESSAGES["heartbeat"](vehicle)))
        self._show()

    def _tell(self, data: bytes, client: tuple[str, int] | None = None) -> None:
        """Tell the node or a client, if there is anything to tell: an empty datagram would wake them as well."""
        if data and client is not None:
            self._clients.send(data, client)
        elif data:
            self._node.write(data)

    def _show(self) -> None:
        """Write down where it is, for the ether and for who watches."""
        at = 4 * self.place
        self.plan.seen[at : at + 4] = (*self.vehicle.state[:3], float(self.vehicle.armed))

    def _move(self, now: float) -> None:
        vehicle, plan, dt = self.vehicle, self.plan, self.plan.scenario.flight.dt
        while now >= self.steps * dt:
            at = self.steps * dt
            self._befalls.strike(self.steps, lambda _: (vehicle.state, vehicle.followed))
            if self._befalls.gone and not vehicle.off:
                vehicle.off = True
                self.notes.append((time.monotonic(), vehicle.system, DROPS_OUT))
            if self.steps == 0 and plan.start is not None:
                vehicle.state = State(*vehicle.state[:3], *plan.start[self.place][3:])
            if self.steps % self._every == 0:
                if plan.scenario.errs:
                    vehicle.error = self._sensing.measure(self.steps // self._every, vehicle.state, plan.card.period)
                self.rows.append(ABSENT if vehicle.off else tuple(vehicle.state))
            vehicle.suffer(plan.faults, at, dt)
            vehicle.step(at, dt)
            self.steps += 1


def craft_life(plan: Plan, i: int) -> Generator[Rest, None, Life]:
    """Life of a vehicle until the end of the flight."""
    began, craft = time.process_time(), Craft(plan, i)
    count, late, worst, due = 0, 0, 0.0, time.monotonic()
    while not plan.over:
        behind, period = time.monotonic() - due, craft.period
        count, late, worst = count + 1, late + (behind > 0.5 * period), max(worst, behind)
        craft.look()
        due = max(due + period, time.monotonic() - period)
        yield Rest(due)
    return Life(craft.rows, craft.notes, Ticks(count, late, worst), Phase.DONE, time.process_time() - began)


def ether_life(plan: Plan) -> Generator[Rest, None, Life]:
    """Life of the ether: packets of nodes reach those whom the radio lets them reach, orders reach all at once."""
    began, card, ports = time.process_time(), plan.card, plan.ports
    flown, period = plan.scenario, card.safety.status_period
    befalls = Faults(flown, plan.seed)
    reach = befalls.reach if befalls else None
    ether = Ether(
        flown.transceiver, flown.radio, card.members, plan.seed, period, plan.faults, reach, partial(clear, card),
        card.site,
    )  # fmt: skip
    station = ports.station.here
    radios = [port.here for port in ports.radios]
    who = {here: i for i, here in enumerate(radios)}
    teller = Teller(card.members, plan.faults) if plan.watcher else None

    def watched(data: bytes) -> None:
        if plan.watcher is not None:
            ports.ether.send(data, plan.watcher)

    while not plan.over:
        now, at = plan.now, plan.places
        befalls.until(now)
        for data, sender in ports.ether.read_from():
            if sender in who:
                ether.send(now, who[sender], data, at)
                watched(data)
            elif sender == station:
                for radio in radios:
                    ports.ether.send(data, radio)
                watched(data)
        for to, data in ether.deliver(now, at):
            ports.ether.send(data, radios[to])
            if teller is not None:
                teller.arrived(to, data, now)
        for data in () if teller is None else teller.report(now, plan.utc(time.monotonic()), befalls.holding(now)):
            watched(data)
        yield Rest(time.monotonic() + HOP)
    return Life([], [], Ticks(0, 0, 0.0), Phase.DONE, time.process_time() - began)
