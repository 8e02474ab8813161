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

from airflock.core import SensorState, State
from airflock.drones import FlightCard, MissionPhase, Node, TaskRest, TickCounts, UdpAddresses, UdpPort, tick_task
from airflock.fleets.ailing import FaultyNode
from airflock.fleets.befalling import DroneFaults
from airflock.fleets.dice import MotionNoise
from airflock.fleets.ether import RadioChannel
from airflock.fleets.faults import InjectedFault, initial_clock_offset
from airflock.fleets.individuals import agent_records
from airflock.fleets.starting import (
    ACCEPTED_BEFORE_START,
    DROPS_OUT_NOTE,
    SOFTWARE_KEY,
    is_clear_between,
    make_vehicle,
    put_in_air,
)
from airflock.fleets.telemetry import MESSAGE_MAKERS
from airflock.fleets.teller import TelemetryBroadcast
from airflock.scenarios import Scenario

LOCAL_HOST = "127.0.0.1"
HOVER_SECONDS = 1.0  # s beyond the radio's delay for which all hover before the flight begins
MIN_LOOK_PERIOD = 0.02  # s; least time between two looks of a vehicle at its ports
CHANNEL_PERIOD = 0.01  # s between two looks of the ether
CLIENT_CALL_PERIOD = 0.5  # s between two calls of a vehicle at a port where nobody has answered yet
NEVER_HEARD = -1e9
ABSENT_ROW = (math.nan,) * 6  # a row of a vehicle that has dropped out


class FleetPorts(NamedTuple):
    """Sockets of a fleet: of each node to its autopilot and of its radio, of each vehicle to its node and to clients,
    of the ether, and of who gives orders.
    """

    nodes: list[UdpPort]
    radios: list[UdpPort]
    vehicles: list[UdpPort]
    clients: list[UdpPort]
    channel: UdpPort
    station: UdpPort

    @classmethod
    def open(cls, count: int, first_client: tuple[str, int]) -> "FleetPorts":
        """Ports for so many drones; vehicle i calls clients at the port `join` + i."""
        nodes, radios, vehicles, clients = ([_port() for _ in range(count)] for _ in range(4))
        found = cls(nodes, radios, vehicles, clients, _port(), _port())
        for i in range(count):
            nodes[i].aim(vehicles[i].here)
            vehicles[i].aim(nodes[i].here)
            radios[i].aim(found.channel.here)
            clients[i].aim((first_client[0], first_client[1] + i))
        return found

    def close(self) -> None:
        """Close all."""
        for port in (*self.nodes, *self.radios, *self.vehicles, *self.clients, self.channel, self.station):
            port.close()


def _port() -> UdpPort:
    return UdpPort(UdpAddresses((LOCAL_HOST, 0), None))


@dataclass(frozen=True)
class RealtimePlan:
    """What all lives of a fleet know.

    start : states of drones that begin in the air; None: on the ground
    clock : time.monotonic of the flight's time 0, and of its end, s; then for each node 1 once it has heard its
            vehicle; shared by all
    seen  : of each vehicle its position (m) and whether it is armed, four numbers; shared by all
    epoch : Unix time at which time.monotonic was 0, µs
    watcher : address at which somebody hears all packets, and what the ether tells; None: nobody does
    """

    scenario: Scenario
    card: FlightCard
    seed: int
    start: Sequence[State] | None
    faults: tuple[InjectedFault, ...]
    ports: FleetPorts
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


class TaskResult(NamedTuple):
    """What is left of one node or vehicle when it ends.

    rows   : one per period: true state of a vehicle; command, own state and times of peers' states of a node
    notes  : time.monotonic (s), member and text; ticks: of a node, of a vehicle its looks; processor: s
    """

    rows: list[Any]
    notes: list[tuple[float, int, str]]
    ticks: TickCounts
    phase: MissionPhase
    processor: float


def node_task(plan: RealtimePlan, i: int) -> Generator[TaskRest, None, TaskResult]:
    """Life of a node, from now until the end of the flight or its own."""
    card, began = plan.card, time.process_time()
    member = card.members[i]
    dies = min([fault.begin for fault in plan.faults if fault.kind == "node" and fault.affects(member)], default=1e9)
    now = time.monotonic()
    utc = plan.utc(now) + initial_clock_offset(plan.faults, member)
    node = Node(card, member, SOFTWARE_KEY, now=now, utc=utc, since=utc - ACCEPTED_BEFORE_START)
    befalls = DroneFaults(plan.scenario, plan.seed, only=i)
    ailing = FaultyNode(lambda: node, befalls, i, card.site, lambda own: own - plan.clock[0])
    rows: list[Any] = []
    notes: list[tuple[float, int, str]] = []
    waits = plan.start is not None

    def until() -> bool:
        nonlocal waits
        wire, now = node.autopilot_link, plan.now
        befalls.until(now)
        if wire.state is not None and wire.armed is not None:
            plan.clock[2 + i] = 1.0
        if waits and wire.state is not None and wire.mode == card.autopilot.ours and wire.armed:
            waits, node.phase, node.home = False, MissionPhase.FLOCK, (wire.state.x, wire.state.y, card.layer(member))
        while now >= len(rows) * card.period:
            ages = [node.peers.all[m].at - plan.clock[0] if m != member else NEVER_HEARD for m in card.members]
            rows.append(((*node.command, *(wire.state or (0.0,) * 6)), ages))
        return plan.over or now >= dies or i in befalls.dropped_out

    def tell(note: str) -> None:
        notes.append((time.monotonic(), member, note))

    ticks = yield from tick_task(ailing, [plan.ports.nodes[i], plan.ports.radios[i]], card.safety.tick, tell, until)
    return TaskResult(rows, notes, ticks, node.phase, time.process_time() - began)


class RealtimeVehicle:
    """A vehicle with its ports, on the real clock."""

    def __init__(self, plan: RealtimePlan, i: int):
        scenario, card = plan.scenario, plan.card
        self.plan, self.place, self.rows, self.steps = plan, i, [], 0  # type: ignore[var-annotated]
        body = agent_records(scenario, len(card.members), plan.seed)[i][1]
        noise = MotionNoise(plan.seed, 1, not card.flat, first_drone=i)
        self.vehicle = made = make_vehicle(scenario, card, i, body, noise, plan.utc(time.monotonic()))
        self._faults = DroneFaults(scenario, plan.seed, only=i)
        made.faults = self._faults or None
        self.notes: list[tuple[float, int, str]] = []
        self._booted = time.monotonic() - HOVER_SECONDS
        self._sensor_state = SensorState(scenario.sensor, scenario.sensors, plan.seed, i, flat=card.flat)
        self._steps_per_period = max(1, round(card.period / scenario.flight.dt))
        self._node_port, self._client_port = plan.ports.vehicles[i], plan.ports.clients[i]
        self._client_address: tuple[str, int] | None = None
        self._called_at = NEVER_HEARD
        made.due = dict.fromkeys(made.due, NEVER_HEARD)
        if plan.start is not None:
            put_in_air(made, card, plan.start[i])
            made.state = State(*made.state[:3], 0.0, 0.0, 0.0)  # it hovers until the flight begins
        self._node_port.write(made.origin_frame())
        self._publish_position()

    @property
    def period(self) -> float:
        """Time between two looks, s: as often as it tells what it tells most often."""
        return max(MIN_LOOK_PERIOD, 1.0 / max(self.vehicle.rates.values()))

    def look(self) -> None:
        """Read what came, move up to now, and tell."""
        vehicle, plan, zero = self.vehicle, self.plan, self.plan.clock[0]  # once: the clock may be set meanwhile
        now = time.monotonic() - zero
        vehicle.start_time, vehicle.booted_at = plan.utc(zero), self._booted - zero
        for data in self._node_port.read():
            self._send(vehicle.receive(data, now))
        for data, sender in self._client_port.read_from():
            self._client_address = sender
            self._send(vehicle.receive(data, now), sender)
        self._move(now)
        told = vehicle.due_telemetry(now)
        self._send(told)
        if self._client_address is not None:
            self._send(told, self._client_address)
        elif now - self._called_at >= CLIENT_CALL_PERIOD:
            self._called_at = now
            self._client_port.write(vehicle.frame(MESSAGE_MAKERS["heartbeat"](vehicle)))
        self._publish_position()

    def _send(self, data: bytes, client: tuple[str, int] | None = None) -> None:
        """Tell the node or a client, if there is anything to tell: an empty datagram would wake them as well."""
        if data and client is not None:
            self._client_port.send(data, client)
        elif data:
            self._node_port.write(data)

    def _publish_position(self) -> None:
        """Write down where it is, for the ether and for who watches."""
        at = 4 * self.place
        self.plan.seen[at : at + 4] = (*self.vehicle.state[:3], float(self.vehicle.armed))

    def _move(self, now: float) -> None:
        vehicle, plan, dt = self.vehicle, self.plan, self.plan.scenario.flight.dt
        while now >= self.steps * dt:
            at = self.steps * dt
            self._faults.begin_due(self.steps, lambda _: (vehicle.state, vehicle.last_command))
            if self._faults.dropped_out and not vehicle.off:
                vehicle.off = True
                self.notes.append((time.monotonic(), vehicle.system, DROPS_OUT_NOTE))
            if self.steps == 0 and plan.start is not None:
                vehicle.state = State(*vehicle.state[:3], *plan.start[self.place][3:])
            if self.steps % self._steps_per_period == 0:
                if plan.scenario.has_sensor_error:
                    vehicle.error = self._sensor_state.measure(
                        self.steps // self._steps_per_period, vehicle.state, plan.card.period
                    )
                self.rows.append(ABSENT_ROW if vehicle.off else tuple(vehicle.state))
            vehicle.apply_faults(plan.faults, at, dt)
            vehicle.step(at, dt)
            self.steps += 1


def vehicle_task(plan: RealtimePlan, i: int) -> Generator[TaskRest, None, TaskResult]:
    """Life of a vehicle until the end of the flight."""
    began, craft = time.process_time(), RealtimeVehicle(plan, i)
    count, late, worst, due = 0, 0, 0.0, time.monotonic()
    while not plan.over:
        behind, period = time.monotonic() - due, craft.period
        count, late, worst = count + 1, late + (behind > 0.5 * period), max(worst, behind)
        craft.look()
        due = max(due + period, time.monotonic() - period)
        yield TaskRest(due)
    return TaskResult(
        craft.rows, craft.notes, TickCounts(count, late, worst), MissionPhase.DONE, time.process_time() - began
    )


def channel_task(plan: RealtimePlan) -> Generator[TaskRest, None, TaskResult]:
    """Life of the ether: packets of nodes reach those whom the radio lets them reach, orders reach all at once."""
    began, card, ports = time.process_time(), plan.card, plan.ports
    flown, period = plan.scenario, card.safety.status_period
    befalls = DroneFaults(flown, plan.seed)
    reach = befalls.reach if befalls else None
    ether = RadioChannel(
        flown.transceiver,
        flown.radio,
        card.members,
        plan.seed,
        period,
        plan.faults,
        reach,
        partial(is_clear_between, card),
        card.site,
    )
    station = ports.station.here
    radios = [port.here for port in ports.radios]
    who = {here: i for i, here in enumerate(radios)}
    teller = TelemetryBroadcast(card.members, plan.faults) if plan.watcher else None

    def watched(data: bytes) -> None:
        if plan.watcher is not None:
            ports.channel.send(data, plan.watcher)

    while not plan.over:
        now, at = plan.now, plan.places
        befalls.until(now)
        for data, sender in ports.channel.read_from():
            if sender in who:
                ether.send(now, who[sender], data, at)
                watched(data)
            elif sender == station:
                for radio in radios:
                    ports.channel.send(data, radio)
                watched(data)
        for to, data in ether.deliver(now, at):
            ports.channel.send(data, radios[to])
            if teller is not None:
                teller.note_arrival(to, data, now)
        for data in () if teller is None else teller.report(now, plan.utc(time.monotonic()), befalls.active_kinds(now)):
            watched(data)
        yield TaskRest(time.monotonic() + CHANNEL_PERIOD)
    return TaskResult([], [], TickCounts(0, 0, 0.0), MissionPhase.DONE, time.process_time() - began)
