"""A fleet in lock-step: nodes, vehicles and radio channel on one virtual clock in one process. Equal seeds, equal bits.

At each motion step telemetry and packets that are due arrive, the nodes whose tick it is decide,
and vehicles move.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import SensorState, State, number_names, random
from airflock.drones import (
    FLYING_PHASES,
    FlightCard,
    MissionPhase,
    Node,
    OperatorOrder,
    OrderKind,
    PacketSigner,
    orders,
    read_key,
    write_card,
    write_key,
)
from airflock.fleets.card_document import agent_records, agent_sensors
from airflock.fleets.drone_faults import DroneFaults, InjectedFault, whole_flight_amount
from airflock.fleets.radio_channel import SOFTWARE_KEY, FaultyNode, RadioChannel
from airflock.fleets.vehicle import GUIDED, MESSAGE_RATES, SoftwareVehicle
from airflock.scenarios import Scenario
from airflock.support import CardError, Geodetic

STEPS_PER_BLOCK = 256  # motion steps that are drawn together
MEASUREMENTS_PER_BLOCK = 16  # measurements that are drawn together
NormalTriple = tuple[float, float, float]


class MotionNoise:
    """Normal random numbers of every drone at every motion step, to be drawn in the order of time.

    seed        : of the flight
    count       : of drones
    in_space    : a draw serves one step; in a plane it serves two
    first_drone : index of the first of these drones
    """

    def __init__(self, seed: int, count: int, in_space: bool, first_drone: int = 0):
        self._seed, self._count, self._in_space, self._drone = seed, count, in_space, first_drone
        self._first_step = -STEPS_PER_BLOCK
        self._numbers: tuple[list[float], list[float]] = ([], [])  # first and second half of each draw, flat

    def __call__(self, step: int, drone: int) -> NormalTriple:
        """Return three numbers N(0, 1) of a drone at a step; in a plane the third is zero."""
        if not self._first_step <= step < self._first_step + STEPS_PER_BLOCK:
            self._first_step = step - step % STEPS_PER_BLOCK
            self._numbers = self._drawn(self._first_step)
        place, column, (one, two) = step - self._first_step, drone - self._drone, self._numbers
        if self._in_space:
            at = 2 * (place * self._count + column)
            return one[at], one[at + 1], two[at]
        at = 2 * ((place >> 1) * self._count + column)
        numbers = two if place & 1 else one
        return numbers[at], numbers[at + 1], 0.0

    def _drawn(self, first: int) -> tuple[list[float], list[float]]:
        """Draw the numbers of STEPS_PER_BLOCK steps: words as arrays, normal numbers by the scalar function."""
        # Words come as arrays, 256 steps at once; the normal numbers are made by the scalar
        # function of the simulator, because NumPy's functions may round differently.
        steps = np.arange(first, first + STEPS_PER_BLOCK, 1 if self._in_space else 2, dtype=np.uint64)
        if not self._in_space:
            steps //= np.uint64(2)
        drones = np.arange(self._drone, self._drone + self._count, dtype=np.uint64)
        drawn = random.random_words(self._seed, random.OUTER, 0, steps[:, None], drones[None, :])
        a, b, c, d = (np.broadcast_to(words, (len(steps), self._count)).ravel().tolist() for words in drawn)
        one = [number for pair in map(random.normal_pair, a, b) for number in pair]
        two = [number for pair in map(random.normal_pair, c, d) for number in pair]
        return one, two


class SensorWords:
    """Random words for the errors of every drone's navigation, to be drawn in the order of time.

    seed  : of the flight
    count : of drones
    """

    def __init__(self, seed: int, count: int):
        self._seed, self._count = seed, count
        self._first_measurement, self._tables = -MEASUREMENTS_PER_BLOCK, {}  # type: ignore[var-annotated]

    def __call__(self, measurement: int, draw: int, drone: int) -> tuple[int, int, int, int]:
        """Return four words of a measurement, a draw and a drone."""
        if not self._first_measurement <= measurement < self._first_measurement + MEASUREMENTS_PER_BLOCK:
            self._first_measurement, self._tables = measurement - measurement % MEASUREMENTS_PER_BLOCK, {}
        if draw not in self._tables:
            first = self._first_measurement
            numbers = np.arange(first, first + MEASUREMENTS_PER_BLOCK, dtype=np.uint64)[:, None]
            drones = np.arange(self._count, dtype=np.uint64)[None, :]
            drawn = random.random_words(self._seed, random.SENSOR, 0, numbers, drones, draw)
            self._tables[draw] = np.stack(drawn, axis=-1).tolist()
        a, b, c, d = self._tables[draw][measurement - self._first_measurement][drone]
        return a, b, c, d


# Time for satellites, parameters and clocks to be reported before anybody may start.
SECONDS_BEFORE_START = 12.0  # s on the ground before a start is ordered
# 4 m apart, drones that climbed past each other came as near as 0.3 m: each keeps its place by a position
# that is off by a metre, and drifts. Of 12 fleets of ten the nearest pass was 1.2 m, of 8 at 8 m it was 4.2 m.
GROUND_STEP = 8.0  # m
DROPS_OUT_NOTE = "drops out by a fault: node and motors are off"
# Μs; packets sent so long before a node began are accepted, for its clock may be wrong.
ACCEPTED_BEFORE_START = 60_000_000


def make_vehicle(
    scenario: Scenario, card: FlightCard, index: int, body: Any, noise: MotionNoise, started: int,
    faults: Sequence[InjectedFault],
) -> SoftwareVehicle:  # fmt: skip
    """Make a vehicle on the ground; the places form a square grid GROUND_STEP apart.

    index   : among the members
    body    : numbers of its own body
    started : Unix time of its time 0, µs
    """
    side = max(1, round(len(card.members) ** 0.5))
    at = (*(GROUND_STEP * (k - 0.5 * (side - 1)) for k in (index % side, index // side)), 0.0)
    noisy = "noise" in number_names(body) and body.noise > 0.0
    draw = partial(noise, drone=index) if noisy else lambda step: (0.0, 0.0, 0.0)
    vehicle = SoftwareVehicle(
        card.autopilot.name, card.members[index], card.site, at, scenario.body.rule, body, draw, started, faults
    )
    vehicle.place = index
    return vehicle


def write_card_and_key(path: Path, card: FlightCard) -> None:
    """Write the card of a fleet in software, and its key beside it, for `airflock watch`.

    Files of an earlier fleet in software are replaced; raises CardError where those of a real
    mission would be lost.
    """
    key = path.with_suffix(".key")
    if key.exists() and read_key(key) != SOFTWARE_KEY:
        raise CardError([f"{key}: exists and is of a real mission; give another name with --card"])
    if path.exists() and not key.exists():
        raise CardError([f"{path}: exists without a key of a fleet in software; give another name with --card"])
    write_card(path, card.document)
    if not key.exists():
        write_key(key, SOFTWARE_KEY)


def law_zero_height(card: FlightCard) -> float:
    """Return the height (m) above the site of the law's zero."""
    return -card.law_state(State(*(0.0,) * 6)).z


def is_clear_between(card: FlightCard, here: tuple[float, float, float], there: tuple[float, float, float]) -> bool:
    """Return True if no obstacle stands between two positions of vehicles, m."""
    a, b = (card.law_state(State(*place, 0.0, 0.0, 0.0)) for place in (here, there))
    return not card.place.is_blocked(*a[:3], *b[:3])


def put_in_air(vehicle: SoftwareVehicle, card: FlightCard, start: State) -> None:
    """Put a vehicle in the air, where it obeys its node as if it had done so for long."""
    vehicle.state = start._replace(z=start.z + (card.height if card.flat else law_zero_height(card)))
    vehicle.armed, vehicle.mode, vehicle.setpoint_at, vehicle.stream_since = True, GUIDED, 0.0, -9.0
    # The node has requested them long ago.
    vehicle.rates |= MESSAGE_RATES | {"heartbeat": vehicle.rates["heartbeat"]}


class OperatorStation:
    """The operator of a fleet in software, who signs orders.

    card    : of the fleet
    private : key of the operator
    """

    def __init__(self, card: FlightCard, private: bytes):
        self._card, self._private, self._sign, self._last_order_time = (
            card,
            private,
            PacketSigner(SOFTWARE_KEY, orders.OPERATOR_SYSTEM),
            0,
        )

    def order(self, do: OrderKind, utc: int, *, target: int = 0, at: int = 0, point: Geodetic | None = None) -> bytes:
        """Return the datagram of an order given at utc for a time `at`, µs of Unix time; no two share a time."""
        self._last_order_time = max(utc, self._last_order_time + 1)
        p = point or Geodetic(0.0, 0.0, 0.0)
        place = (round(p.latitude * 1e7), round(p.longitude * 1e7), round(p.altitude * 1e3))
        given = OperatorOrder(do, target, self._card.mission, self._last_order_time, at, place)
        return self._sign(orders.order_message(given, self._private), self._last_order_time)


START_TIME = 1_800_000_000_000_000  # virtual Unix time of 0 s, µs
UNREAD_MESSAGES = ("attitude", "home", "battery")  # messages that no node reads; in lock-step nobody else is there
ABSENT_ROW = (math.nan,) * 15  # a row of a drone that has dropped out
# A peer that was never heard has the time -1e9 (its default), far below this bound whatever the
# clock offsets add.
HEARD_SINCE = -1e8  # s; a peer whose last state held before this has not been heard


class FlownFleet:
    """A fleet that has flown, with what was recorded of it once a period.

    frames      : (time, agent, 15): true position and velocity, setpoint, own position and velocity
                  of the node; nan once a drone has dropped out, as in the recording of a simulation
    state_times : (time, receiver, sender): time of the last state that a node has of another one, s
    log         : time (s), member and text of each note
    """

    def __init__(self, scenario: Scenario, card: FlightCard, seed: int, faults: Sequence[InjectedFault]):
        self.scenario, self.card, self.seed, self.faults = scenario, card, seed, tuple(faults)
        self.frames: list[Sequence[Sequence[float]]] = []
        self.state_times: list[list[list[float]]] = []
        self.log: list[tuple[float, int, str]] = []

    @property
    def law_zero_height(self) -> float:
        """Return the height (m) above the site of the law's zero."""
        return law_zero_height(self.card)

    def array(self) -> NDArray[np.float64]:
        """Return the frames (time, agent, 15)."""
        return np.array(self.frames, float)

    def packet_ages(self) -> NDArray[np.float64]:
        """Return (time, receiver, sender): age (s) of the state that a node has of another one; nan: none."""
        stamps = np.array(self.state_times)
        times = self.card.period * np.arange(len(stamps))
        return np.where(stamps > HEARD_SINCE, times[:, None, None] - stamps, np.nan)

    def digest(self) -> str:
        """Return the SHA-256 of the flight."""
        return hashlib.sha256(self.array().tobytes()).hexdigest()


class LockstepFleet(FlownFleet):
    """Nodes with their vehicles on one virtual clock.

    scenario : body, sensors, radio and motion step of the simulated world
    card     : card of all nodes
    start    : state of each drone in the air, from which all flock at once; None: from the ground,
               by orders
    operator : private key of the operator, for orders from the ground
    """

    def __init__(
        self, scenario: Scenario, card: FlightCard, seed: int = 0, *, start: Sequence[State] | None = None,
        faults: Sequence[InjectedFault] = (), operator: bytes = b"",
    ):  # fmt: skip
        super().__init__(scenario, card, seed, faults)
        self._dt = scenario.flight.dt
        self._steps_per_period = max(1, round(card.period / self._dt))
        self._steps_per_tick = max(1, round(min(card.safety.tick, card.period) / self._dt))
        self.steps = 0
        self.standing: list[list[bool]] = []  # (time, agent): who stands because it has lost somebody
        self._faults = drone_faults = DroneFaults(scenario, seed)
        self._bodies = [b for _, b in agent_records(scenario, len(card.members), seed)]
        self._has_sensor_error = scenario.has_sensor_error
        self._noise = MotionNoise(seed, len(card.members), not card.flat)
        self.vehicles = [
            make_vehicle(scenario, card, i, b, self._noise, START_TIME, faults) for i, b in enumerate(self._bodies)
        ]
        for vehicle, s in zip(self.vehicles, start or (), strict=False):
            put_in_air(vehicle, card, s)
        for vehicle in self.vehicles:
            vehicle.faults = drone_faults or None
            if vehicle.rates["local"]:
                vehicle.rates |= dict.fromkeys(("local", "global"), 1.0 / (self._steps_per_tick * self._dt))
            vehicle.rates |= dict.fromkeys(UNREAD_MESSAGES, 0.0)
        self.nodes = [
            Node(
                card,
                who,
                SOFTWARE_KEY,
                now=0.0,
                utc=START_TIME + round(1e6 * whole_flight_amount(self.faults, "clock", who)),
                since=START_TIME - ACCEPTED_BEFORE_START,
            )
            for who in card.members
        ]
        self._faulty_nodes = [
            FaultyNode(partial(self.nodes.__getitem__, i), drone_faults, i, card.site) for i in range(len(self.nodes))
        ]
        reach = drone_faults.reach if drone_faults else None
        radio, period = (scenario.radio.rule, scenario.radio.numbers), card.safety.status_period
        self.channel = RadioChannel(
            *radio, card.members, seed, period, faults, reach, partial(is_clear_between, card), card.site
        )
        words = SensorWords(seed, len(card.members))
        self._sensor_states = [
            SensorState(scenario.sensors.rule, own, seed, i, flat=card.flat, words=partial(words, drone=i))
            for i, own in enumerate(agent_sensors(scenario, len(card.members), seed))
        ]
        self._station = OperatorStation(card, operator)
        if start is not None:
            self._begin()

    def _begin(self) -> None:
        """Let all flock, and hear the start states as in the simulator."""
        for vehicle, node in zip(self.vehicles, self.nodes, strict=True):
            node.phase, node.home = MissionPhase.FLOCK, (*vehicle.home[:2], self.card.layer(node.member))
            node.autopilot(vehicle.origin_frame(), 0.0)
            node.autopilot(vehicle.due_telemetry(0.0), 0.0)
        delay, period = self.scenario.radio.delay, self.card.safety.status_period
        for who, (node, vehicle) in enumerate(zip(self.nodes, self.vehicles, strict=True)):
            # At time 0 a simulated agent has already heard packets that were sent one delay ago: a
            # node of its own sends them.
            early = Node(self.card, node.member, SOFTWARE_KEY, now=-delay, utc=START_TIME - round(1e6 * delay))
            early.phase = MissionPhase.FLOCK
            early.autopilot(vehicle.origin_frame(), -delay)
            for k in range(round(delay / period), 0, -1):
                early.autopilot(vehicle.state_frames(), -k * period)
                for datagram in early.status_datagrams(-k * period):
                    self.channel.send(-k * period, who, self._faulty_nodes[who].falsified(datagram, -k * period))

    @property
    def now(self) -> float:
        """Return the virtual time, s."""
        return self.steps * self._dt

    def order(self, do: OrderKind, target: int = 0, at: float = 0.0, point: Geodetic | None = None) -> None:
        """Give an order as the operator's station would; it reaches every drone at once."""
        utc, due = (START_TIME + round(t * 1e6) for t in (self.now, at))
        datagram = self._station.order(do, utc, target=target, at=due, point=point)
        for node in self.nodes:
            node.radio(datagram, self.now)

    def advance(self, seconds: float, on_done: Callable[[], None] | None = None) -> None:
        """Fly on for some seconds."""
        for _ in range(round(seconds / self._dt)):
            self._step()
            if on_done is not None and self.steps % 100 == 0:
                on_done()

    # One loop on a virtual clock: sixty processes on two cores start late, tick late and give other
    # bits each time.
    def _step(self) -> None:
        now = self.now
        if self._faults:
            self._faults.begin_due(self.steps, lambda i: (self.vehicles[i].state, self.vehicles[i].last_command))
            self._drop_out(now)
        if self.steps % self._steps_per_tick == 0:
            self._exchange(now)
        if self.steps % self._steps_per_period == 0:
            self._keep()
        for vehicle in self.vehicles:
            vehicle.apply_faults(now, self._dt)
            vehicle.step(now, self._dt)
        self.steps += 1

    def _exchange(self, now: float) -> None:
        """Deliver telemetry and packets, and let the nodes decide, for one tick."""
        if self.steps % self._steps_per_period == 0:
            self._measure(self.steps // self._steps_per_period)
        dead = [i in self.dropped_out or self._is_dead(node.member, now) for i, node in enumerate(self.nodes)]
        # The order of the simulator: measure, receive, decide, move. A packet of this tick arrives
        # at the next one at best.
        for node, vehicle, gone in zip(self.nodes, self.vehicles, dead, strict=True):
            telemetry = vehicle.due_telemetry(now)
            if not gone:
                node.autopilot(telemetry, now)
        at = [vehicle.state[:3] for vehicle in self.vehicles]
        for to, datagram in self.channel.deliver(now, at):
            if not dead[to]:
                self.nodes[to].radio(datagram, now)
        for i, (node, vehicle) in enumerate(zip(self.nodes, self.vehicles, strict=True)):
            if dead[i]:
                continue
            out = self._faulty_nodes[i].tick(now)
            self.log += [(now, node.member, note) for note in out.notes]
            for data in out.autopilot:
                node.autopilot(vehicle.receive(data, now), now)
            for datagram in out.radios[0]:
                self.channel.send(now, i, datagram, at)

    def _drop_out(self, now: float) -> None:
        """Let the drones come down that faults have just taken out of the flight."""
        for i in sorted(self._faults.dropped_out):
            if not self.vehicles[i].off:
                self.vehicles[i].off = True
                self.log.append((now, self.nodes[i].member, DROPS_OUT_NOTE))

    @property
    def dropped_out(self) -> set[int]:
        """Return the indices of the drones that have dropped out by a fault of the scenario."""
        return self._faults.dropped_out

    def _is_dead(self, member: int, now: float) -> bool:
        """Return True if a fault keeps a node from receiving and sending."""
        return any(fault.kind == "node" and fault.holds(member, now) for fault in self.faults)

    def _measure(self, number: int) -> None:
        """Advance the error of each drone's navigation by one period, with the simulator's numbers."""
        if not self._has_sensor_error:
            return
        for sensing, vehicle in zip(self._sensor_states, self.vehicles, strict=True):
            vehicle.error = sensing.measure(number, State(*vehicle.state), self.card.period)

    def _keep(self) -> None:
        both = enumerate(zip(self.vehicles, self.nodes, strict=True))
        rows = [
            (*v.state, *n.command, *(n.autopilot_link.state or v.state)) if i not in self.dropped_out else ABSENT_ROW
            for i, (v, n) in both
        ]
        self.frames.append(rows)
        self.state_times.append(
            [
                [n.peers.all[m].at if m != n.member and i not in self.dropped_out else -1e9 for m in self.card.members]
                for i, n in enumerate(self.nodes)
            ]
        )
        self.standing.append([n.stands for n in self.nodes])

    def phases(self) -> list[MissionPhase]:
        """Return the phase of every node."""
        return [node.phase for node in self.nodes]

    @property
    def is_airborne(self) -> bool:
        """Return True if any drone still flies by its node."""
        return any(phase in FLYING_PHASES for i, phase in enumerate(self.phases()) if i not in self.dropped_out)


def states_from_arrays(frames: Any, dims: int) -> list[State]:
    """Return states from positions and velocities (component, agent)."""
    pad = (0.0,) * (3 - dims)
    return [State(*map(float, c[:dims]), *pad, *map(float, c[dims : 2 * dims]), *pad) for c in np.asarray(frames).T]
