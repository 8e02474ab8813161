"""Fleets on the real clock: as tasks of one process, or as processes that fork from a warm parent.

Processes wait at a barrier: each reports that it is ready, and the clock starts when all have.
There is no time-out: a process that ends early is named in one line, and ends the fleet.
"""

import asyncio
import math
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Coroutine, Generator, MutableSequence, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import wait
from typing import Any, NamedTuple

from airflock.core import SensorState, State
from airflock.drones import (
    FlightCard,
    MissionPhase,
    Node,
    OrderKind,
    TaskRest,
    TickCounts,
    UdpAddresses,
    UdpPort,
    common_dialect,
    hand_on_data,
    run_alone,
    tick_task,
)
from airflock.fleets.card_document import agent_records
from airflock.fleets.drone_faults import DroneFaults, InjectedFault, whole_flight_amount
from airflock.fleets.fleet_observer import TelemetryBroadcast
from airflock.fleets.lockstep import (
    ABSENT_ROW,
    ACCEPTED_BEFORE_START,
    DROPS_OUT_NOTE,
    SECONDS_BEFORE_START,
    FlownFleet,
    MotionNoise,
    OperatorStation,
    is_clear_between,
    make_vehicle,
    put_in_air,
)
from airflock.fleets.radio_channel import SOFTWARE_KEY, FaultyNode, RadioChannel
from airflock.fleets.vehicle import MESSAGE_MAKERS, MESSAGE_RATES
from airflock.scenarios import Scenario
from airflock.support import LinkError, ScenarioError

LOCAL_HOST = "127.0.0.1"
HOVER_SECONDS = 1.0  # s beyond the radio's delay for which all hover before the flight begins
MIN_LOOK_PERIOD = 0.02  # s; least time between two looks of a vehicle at its ports
CHANNEL_PERIOD = 0.01  # s between two looks of the radio channel
CLIENT_CALL_PERIOD = 0.5  # s between two calls of a vehicle at a port where nobody has answered yet
NEVER_HEARD = -1e9
ABSENT_VEHICLE_ROW = (math.nan,) * 6  # a row of a vehicle that has dropped out


class FleetPorts(NamedTuple):
    """Sockets of nodes (to the autopilot, radios), vehicles (to the node, clients), channel and operator."""

    nodes: list[UdpPort]
    radios: list[UdpPort]
    vehicles: list[UdpPort]
    clients: list[UdpPort]
    channel: UdpPort
    station: UdpPort

    @classmethod
    def open(cls, count: int, first_client: tuple[str, int]) -> "FleetPorts":
        """Open ports for this many drones; vehicle i calls clients at the port `join` + i."""
        nodes, radios, vehicles, clients = ([_port() for _ in range(count)] for _ in range(4))
        found = cls(nodes, radios, vehicles, clients, _port(), _port())
        for i in range(count):
            nodes[i].aim(vehicles[i].here)
            vehicles[i].aim(nodes[i].here)
            radios[i].aim(found.channel.here)
            clients[i].aim((first_client[0], first_client[1] + i))
        return found

    def close(self) -> None:
        """Close all ports."""
        for port in (*self.nodes, *self.radios, *self.vehicles, *self.clients, self.channel, self.station):
            port.close()


def _port() -> UdpPort:
    return UdpPort(UdpAddresses((LOCAL_HOST, 0), None))


@dataclass(frozen=True)
class RealtimePlan:
    """Data that all tasks of a fleet share.

    start   : states of drones that begin in the air; None: on the ground
    clock   : time.monotonic of the flight's time 0, and of its end, s; then for each node 1 once it
              has heard its vehicle; shared memory
    seen    : position (m) of each vehicle and whether it is armed, four numbers; shared memory
    epoch   : Unix time at which time.monotonic was 0, µs
    watcher : address that gets all packets and the reports of the channel; None: no such address
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
        """Return the time of the flight, s; negative while all hover."""
        return time.monotonic() - self.clock[0]

    @property
    def ready(self) -> bool:
        """Return True if every node has heard its vehicle."""
        return all(self.clock[2 + i] > 0.5 for i in range(len(self.card.members)))

    @property
    def places(self) -> list[tuple[float, float, float]]:
        """Return the positions of the vehicles, m."""
        return list(zip(self.seen[0::4], self.seen[1::4], self.seen[2::4], strict=True))

    @property
    def armed(self) -> list[bool]:
        """Return which vehicles are armed."""
        return [armed > 0.5 for armed in self.seen[3::4]]

    @property
    def over(self) -> bool:
        """Return True if the flight has ended."""
        return time.monotonic() >= self.clock[1]

    def utc(self, now: float) -> int:
        """Return the Unix time (µs) at a time of `time.monotonic`, s."""
        return self.epoch + round(now * 1e6)


class TaskResult(NamedTuple):
    """Result of one node or vehicle.

    rows      : one per period: true state of a vehicle; command, own state and times of peers'
                states of a node
    notes     : time.monotonic (s), member and text
    ticks     : ticks of a node, looks of a vehicle
    processor : processor time, s
    """

    rows: list[Any]
    notes: list[tuple[float, int, str]]
    ticks: TickCounts
    phase: MissionPhase
    processor: float


def node_task(plan: RealtimePlan, i: int) -> Generator[TaskRest, None, TaskResult]:
    """Run a node until the end of the flight or its own."""
    card, began = plan.card, time.process_time()
    member = card.members[i]
    dies = min([fault.begin for fault in plan.faults if fault.kind == "node" and fault.affects(member)], default=1e9)
    now = time.monotonic()
    utc = plan.utc(now) + round(1e6 * whole_flight_amount(plan.faults, "clock", member))
    node = Node(card, member, SOFTWARE_KEY, now=now, utc=utc, since=utc - ACCEPTED_BEFORE_START)
    drone_faults = DroneFaults(plan.scenario, plan.seed, only=i)
    faulty_node = FaultyNode(lambda: node, drone_faults, i, card.site, lambda own: own - plan.clock[0])
    rows: list[Any] = []
    notes: list[tuple[float, int, str]] = []
    waits = plan.start is not None

    def until() -> bool:
        nonlocal waits
        wire, now = node.autopilot_link, plan.now
        drone_faults.until(now)
        if wire.state is not None and wire.armed is not None:
            plan.clock[2 + i] = 1.0
        if waits and wire.state is not None and wire.mode == card.autopilot.ours and wire.armed:
            waits, node.phase, node.home = False, MissionPhase.FLOCK, (wire.state.x, wire.state.y, card.layer(member))
        # A late node fills the rows that it missed with its present state, so that all have as
        # many.
        while now >= len(rows) * card.period:
            ages = [node.peers.all[m].at - plan.clock[0] if m != member else NEVER_HEARD for m in card.members]
            rows.append(((*node.command, *(wire.state or (0.0,) * 6)), ages))
        return plan.over or now >= dies or i in drone_faults.dropped_out

    def keep_note(note: str) -> None:
        notes.append((time.monotonic(), member, note))

    ticks = yield from tick_task(
        faulty_node, [plan.ports.nodes[i], plan.ports.radios[i]], card.safety.tick, keep_note, until
    )
    return TaskResult(rows, notes, ticks, node.phase, time.process_time() - began)


class RealtimeVehicle:
    """A vehicle with its ports, on the real clock."""

    def __init__(self, plan: RealtimePlan, i: int):
        scenario, card = plan.scenario, plan.card
        self.plan, self.place, self.rows, self.steps = plan, i, [], 0  # type: ignore[var-annotated]
        body = agent_records(scenario, len(card.members), plan.seed)[i][1]
        noise = MotionNoise(plan.seed, 1, not card.flat, first_drone=i)
        self.vehicle = made = make_vehicle(scenario, card, i, body, noise, plan.utc(time.monotonic()), plan.faults)
        self._faults = DroneFaults(scenario, plan.seed, only=i)
        made.faults = self._faults or None
        self.notes: list[tuple[float, int, str]] = []
        self._booted, self._zero = time.monotonic() - HOVER_SECONDS, 0.0
        self._sensor_state = SensorState(scenario.sensors.rule, scenario.sensors.numbers, plan.seed, i, flat=card.flat)
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
        """Return the time between two looks, s: the period of its most frequent message."""
        # Also with no stream but a heartbeat it must hear what its node sends, and move.
        return max(MIN_LOOK_PERIOD, 1.0 / max(MESSAGE_RATES["local"], *self.vehicle.rates.values()))

    def look(self) -> None:
        """Read what came, move up to now, and send what is due."""
        vehicle, plan, zero = self.vehicle, self.plan, self.plan.clock[0]  # once: the clock may be set meanwhile
        now = time.monotonic() - zero
        if zero != self._zero:  # not at each look: a reboot in flight has a time of its own
            self._zero, vehicle.start_time, vehicle.booted_at = zero, plan.utc(zero), self._booted - zero
        for data in self._node_port.read():
            self._send(vehicle.receive(data, now))
        for data, sender in self._client_port.read_from():
            self._client_address = sender
            self._send(vehicle.receive(data, now), sender)
        self._move(now)
        telemetry = vehicle.due_telemetry(now)
        self._send(telemetry)
        if self._client_address is not None:
            self._send(telemetry, self._client_address)
        # A simulator of PX4 calls its ground station, not the other way round.
        elif now - self._called_at >= CLIENT_CALL_PERIOD:
            self._called_at = now
            self._client_port.write(vehicle.frame(MESSAGE_MAKERS["heartbeat"](vehicle)))
        self._publish_position()

    def _send(self, data: bytes, client: tuple[str, int] | None = None) -> None:
        """Send bytes to the node or a client; no empty datagram, which would wake them as well."""
        if data and client is not None:
            self._client_port.send(data, client)
        elif data:
            self._node_port.write(data)

    def _publish_position(self) -> None:
        """Publish its position, for the channel and for observers."""
        at = 4 * self.place
        self.plan.seen[at : at + 4] = (*self.vehicle.state[:3], float(self.vehicle.armed))

    def _move(self, now: float) -> None:
        vehicle, plan, dt = self.vehicle, self.plan, self.plan.scenario.flight.dt
        # The vehicle catches up in whole steps: its motion does not depend on when it is scheduled.
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
                self.rows.append(ABSENT_VEHICLE_ROW if vehicle.off else tuple(vehicle.state))
            vehicle.apply_faults(at, dt)
            vehicle.step(at, dt)
            self.steps += 1


def vehicle_task(plan: RealtimePlan, i: int) -> Generator[TaskRest, None, TaskResult]:
    """Run a vehicle until the end of the flight."""
    began, vehicle = time.process_time(), RealtimeVehicle(plan, i)
    count, late, worst, due = 0, 0, 0.0, time.monotonic()
    while not plan.over:
        behind, period = time.monotonic() - due, vehicle.period
        count, late, worst = count + 1, late + (behind > 0.5 * period), max(worst, behind)
        vehicle.look()
        # After a long delay it skips looks instead of running them all at once.
        due = max(due + period, time.monotonic() - period)
        yield TaskRest(due)
    return TaskResult(
        vehicle.rows, vehicle.notes, TickCounts(count, late, worst), MissionPhase.DONE, time.process_time() - began
    )


def channel_task(plan: RealtimePlan) -> Generator[TaskRest, None, TaskResult]:
    """Run the radio channel: packets reach the nodes that the radio allows, orders reach all at once."""
    began, card, ports = time.process_time(), plan.card, plan.ports
    flown, period = plan.scenario, card.safety.status_period
    drone_faults = DroneFaults(flown, plan.seed)
    reach = drone_faults.reach if drone_faults else None
    channel = RadioChannel(
        flown.radio.rule,
        flown.radio.numbers,
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
    broadcast = TelemetryBroadcast(card.members, plan.faults) if plan.watcher else None

    def watched(data: bytes) -> None:
        if plan.watcher is not None:
            ports.channel.send(data, plan.watcher)

    while not plan.over:
        now, at = plan.now, plan.places
        drone_faults.until(now)
        for data, sender in ports.channel.read_from():
            if sender in who:
                channel.send(now, who[sender], data, at)
                watched(data)
            elif sender == station:
                for radio in radios:
                    ports.channel.send(data, radio)
                watched(data)
        for to, data in channel.deliver(now, at):
            ports.channel.send(data, radios[to])
            if broadcast is not None:
                broadcast.note_arrival(to, data, now)
        for data in (
            ()
            if broadcast is None
            else broadcast.report(now, plan.utc(time.monotonic()), drone_faults.active_kinds(now))
        ):
            watched(data)
        yield TaskRest(time.monotonic() + CHANNEL_PERIOD)
    return TaskResult([], [], TickCounts(0, 0, 0.0), MissionPhase.DONE, time.process_time() - began)


class ComputerLoad(NamedTuple):
    """Cost and lateness of a fleet on the real clock.

    cores             : processor time of all per second
    nodes, vehicles   : of these (with the channel), where they are processes
    ticks, late, worst: of all nodes: total, late by more than half a period, largest delay (s)
    others            : load of this computer (processes that want a processor, one minute) at the
                        end of the flight
    """

    cores: float
    nodes: float | None
    vehicles: float | None
    ticks: int
    late: int
    worst: float
    others: float


class RealtimeFleet(FlownFleet):
    """A fleet that has flown on the real clock; recorded like one in lock-step."""

    def __init__(self, plan: RealtimePlan, results: Sequence[TaskResult], load: ComputerLoad):
        super().__init__(plan.scenario, plan.card, plan.seed, plan.faults)
        self.load = load
        count = len(plan.card.members)
        self._nodes, vehicles = results[1 : 1 + count], results[1 + count :]
        self.log = sorted((t - plan.clock[0], who, note) for result in results[1:] for t, who, note in result.notes)
        unheard = (0.0,) * 9, [NEVER_HEARD] * count
        for k in range(min(len(vehicle.rows) for vehicle in vehicles)):
            # After its end a node counts with its last row.
            rows = [node.rows[min(k, len(node.rows) - 1)] if node.rows else unheard for node in self._nodes]
            gone = [math.isnan(vehicle.rows[k][0]) for vehicle in vehicles]
            self.frames.append(
                [
                    ABSENT_ROW if out else (*vehicle.rows[k], *own)
                    for vehicle, (own, _), out in zip(vehicles, rows, gone, strict=True)
                ]
            )
            self.state_times.append([unheard[1] if out else ages for (_, ages), out in zip(rows, gone, strict=True)])

    def phases(self) -> list[MissionPhase]:
        """Return the last phase of every node."""
        return [result.phase for result in self._nodes]


FLEET_MODES = ("lockstep", "tasks", "processes")
DEFAULT_CLIENT = ("127.0.0.1", 14540)  # where PX4's simulator calls its first client
START_ORDER_PERIOD = 2.0  # s between two orders to start
MAX_ARM_SECONDS = 60.0  # s in which all must have armed
MAX_RETURN_SECONDS = 600.0  # s in which all must have landed
FAR_FUTURE = 1e6  # s; longer than anybody waits
WATCH_PERIOD = 0.1  # s between two looks at how the fleet is doing
ENDED_MESSAGE = "a process of the fleet ended with status {}"
Task = Generator[TaskRest, None, TaskResult]
Supervisor = Callable[[Callable[[], None]], Coroutine[Any, Any, None]]
CHANNEL_TASK = 0  # index of the radio channel among the tasks


def lockstep_only_errors(faults: Sequence[InjectedFault]) -> list[str]:
    """Return one line for each fault that only a fleet in lock-step can fly."""
    gone = [f for f in faults if f.kind == "node" and f.end < 1e9]
    return ["fault node: on the real clock a node that died stays dead; leave out end"] * bool(gone)


def fly_in_realtime(
    scenario: Scenario, card: FlightCard, seed: int, mode: str, *, start: Sequence[State] | None,
    faults: Sequence[InjectedFault] = (), operator: bytes = b"", first_client: tuple[str, int] = DEFAULT_CLIENT,
    on_done: Callable[[], None] | None = None, watcher: tuple[str, int] | None = None,
) -> RealtimeFleet:  # fmt: skip
    """Fly one fleet for the scenario's duration on the real clock, in the mode "tasks" or "processes".

    start        : states in the air; None: from the ground by orders of the operator, and back
    first_client : address at which vehicle 1 calls a client; vehicle 2 calls at the next port
    on_done      : called once for each second flown
    watcher      : address that gets every packet and the reports of the channel
                   (`TelemetryBroadcast`)

    Raises ScenarioError for faults that need lock-step, LinkError where a process ends before its
    time.
    """
    errors = lockstep_only_errors(faults)
    if errors:
        raise ScenarioError(errors)
    ports = FleetPorts.open(len(card.members), first_client)
    try:
        now = time.monotonic()
        first = [
            now + FAR_FUTURE,
            now + 2.0 * FAR_FUTURE,
            *(0.0,) * len(card.members),
        ]  # the watch sets the clock when all are there
        # Shared memory without a lock: each number has one writer, and a double is written at once.
        kept: Callable[[list[float]], Any] = list if mode == "tasks" else partial(multiprocessing.RawArray, "d")
        clock, seen = kept(first), kept([0.0] * (4 * len(card.members)))
        epoch = time.time_ns() // 1000 - round(now * 1e6)
        plan = RealtimePlan(scenario, card, seed, start, tuple(faults), ports, clock, seen, epoch, watcher)
        factories: list[Callable[[], Task]] = [partial(channel_task, plan)]
        factories += [partial(node_task, plan, i) for i in range(len(card.members))]
        factories += [partial(vehicle_task, plan, i) for i in range(len(card.members))]
        watching = partial(_watch, plan, operator, on_done)
        began = time.monotonic()
        ended, all_ = asyncio.run(_tasks(factories, watching)) if mode == "tasks" else _forked(factories, watching)
        return RealtimeFleet(
            plan, ended, _computer_load(ended, len(card.members), time.monotonic() - began, all_, mode == "tasks")
        )
    finally:
        ports.close()


async def _tasks(factories: Sequence[Callable[[], Task]], watching: Supervisor) -> tuple[list[TaskResult], float]:
    """Run all tasks in one event loop; return their results and the processor time of all, s."""
    began = time.process_time()
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(run_in_event_loop(make_task())) for make_task in factories]
        await watching(lambda: None)
    return [task.result() for task in tasks], time.process_time() - began


async def run_in_event_loop(task: Task) -> TaskResult:
    """Run a task among others in one event loop, as `run_alone` does in a process of its own."""
    loop, hears = asyncio.get_running_loop(), TaskRest(0.0).handlers
    try:
        while True:
            try:
                rest = next(task)
            except StopIteration as end:
                result: TaskResult = end.value
                return result
            if rest.handlers is not hears:
                hears = rest.handlers
                for port, hand in hears:
                    loop.add_reader(port.fileno(), hand_on_data, port, hand)
            await asyncio.sleep(max(0.0, rest.until - time.monotonic()))
    finally:
        for port, _ in hears:
            loop.remove_reader(port.fileno())


# Processes fork from a warm parent: sixty cold interpreters came up later than the flight ended.
def _forked(factories: Sequence[Callable[[], Task]], watching: Supervisor) -> tuple[list[TaskResult], float]:
    """Run each task in a process of its own; return their results and the processor time of all, s."""
    if not hasattr(os, "fork"):
        raise LinkError("mode = 'processes' forks, which this system does not do; give mode = 'tasks'")
    context, began = multiprocessing.get_context("fork"), time.process_time()
    common_dialect()  # once here, so that no process imports it for itself
    pipes = [context.Pipe() for _ in factories]
    processes = [
        context.Process(target=_process_main, args=(factory, pipe[1]), daemon=True)
        for factory, pipe in zip(factories, pipes, strict=True)
    ]
    try:
        for process, (_, theirs) in zip(processes, pipes, strict=True):
            process.start()
            theirs.close()
        ours = [pipe[0] for pipe in pipes]
        # Nobody may tick before all are there, or the first drones would fly among neighbours that
        # do not exist yet.
        _all(ours, processes)  # the barrier
        for pipe in ours:
            pipe.send("go")
        asyncio.run(watching(partial(_alive, processes)))
        results: list[TaskResult] = _all(ours, processes)
        for process in processes:
            process.join()
        return results, time.process_time() - began + sum(result.processor for result in results)
    finally:
        for process in processes:
            if process.is_alive():
                process.terminate()


def _all(pipes: Sequence[Any], processes: Sequence[Any]) -> list[Any]:
    """Return one message of each process; raise LinkError if one ends without it."""
    received: dict[int, Any] = {}
    while len(received) < len(pipes):
        waiting = {pipe: i for i, pipe in enumerate(pipes) if i not in received}
        for pipe in wait(list(waiting)):
            i = waiting[pipe]  # type: ignore[index]
            try:
                received[i] = pipes[i].recv()
            except EOFError as error:
                processes[i].join()
                raise LinkError(ENDED_MESSAGE.format(processes[i].exitcode)) from error
    return [received[i] for i in range(len(pipes))]


def _alive(processes: Sequence[Any]) -> None:
    """Raise LinkError if a process has failed."""
    for process in processes:
        if process.exitcode:
            raise LinkError(ENDED_MESSAGE.format(process.exitcode))


def _process_main(factory: Callable[[], Task], pipe: Any) -> None:
    """Report that the process is ready, wait for all others, run the task, and send its result."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends the fleet, and says why
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    pipe.send("ready")
    pipe.recv()
    pipe.send(run_alone(factory()))


async def _watch(
    plan: RealtimePlan, operator: bytes, on_done: Callable[[], None] | None, check: Callable[[], None]
) -> None:
    """Give the orders of a flight from the ground, end the flight, and report progress; check raises failures."""
    seconds = plan.scenario.flight.duration
    reported = 0

    async def until(holds: Callable[[], bool]) -> None:
        nonlocal reported
        while not holds():
            await asyncio.sleep(WATCH_PERIOD)
            check()
            while on_done is not None and reported < min(plan.now, seconds + SECONDS_BEFORE_START):
                reported += 1
                on_done()

    await until(lambda: plan.ready)
    # The flight begins when the packets of the start states have arrived everywhere.
    plan.clock[0] = time.monotonic() + plan.scenario.radio.delay + HOVER_SECONDS
    if plan.start is not None:
        await until(lambda: plan.now > seconds + plan.card.period)
    else:
        await _from_the_ground(plan, OperatorStation(plan.card, operator), until)
    plan.clock[1] = time.monotonic()


async def _from_the_ground(plan: RealtimePlan, station: OperatorStation, until: Callable[..., Any]) -> None:
    """Order a start, a return when the time is over, and wait until all have landed."""

    def order(do: OrderKind) -> None:
        utc = plan.utc(time.monotonic())
        plan.ports.station.send(station.order(do, utc, at=utc), plan.ports.channel.here)

    await until(lambda: plan.now > SECONDS_BEFORE_START)
    begun = plan.now
    # Repeated, because the radio may lose an order.
    while not all(plan.armed) and plan.now < begun + MAX_ARM_SECONDS:
        order(OrderKind.START)
        next_ = plan.now + START_ORDER_PERIOD
        await until(lambda: plan.now > next_ or all(plan.armed))  # noqa: B023
    begun = plan.now
    await until(lambda: plan.now > begun + plan.scenario.flight.duration)
    order(OrderKind.RETURN)
    begun = plan.now
    await until(lambda: plan.now > begun + MAX_RETURN_SECONDS or not any(plan.armed))


def _computer_load(
    results: Sequence[TaskResult], count: int, seconds: float, all_: float, together: bool
) -> ComputerLoad:
    nodes, others = results[1 : 1 + count], [results[CHANNEL_TASK], *results[1 + count :]]
    by = [None if together else sum(result.processor for result in part) / seconds for part in (nodes, others)]
    ticks = [result.ticks for result in nodes]
    total, late = sum(t.total for t in ticks), sum(t.late for t in ticks)
    others_ = os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan  # Windows counts none
    return ComputerLoad(all_ / seconds, by[0], by[1], total, late, max(t.worst for t in ticks), others_)
