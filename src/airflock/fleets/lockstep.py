"""A fleet in lock-step: nodes, vehicles and ether on one virtual clock in one process. The same seed, the same bits.

At each motion step: telemetry and packets that are due arrive, nodes whose tick it is decide, vehicles move.
"""

import hashlib
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import SensorState, State
from airflock.drones import FLYING_PHASES, FlightCard, MissionPhase, Node, OrderKind
from airflock.fleets.ailing import FaultyNode
from airflock.fleets.befalling import DroneFaults
from airflock.fleets.dice import MotionNoise, SensorWords
from airflock.fleets.ether import RadioChannel
from airflock.fleets.faults import InjectedFault, initial_clock_offset
from airflock.fleets.individuals import agent_records, agent_sensors
from airflock.fleets.starting import (
    ACCEPTED_BEFORE_START,
    DROPS_OUT_NOTE,
    SOFTWARE_KEY,
    OperatorStation,
    is_clear_between,
    law_zero_height,
    make_vehicle,
    put_in_air,
)
from airflock.fleets.vehicle import VEHICLE_FAULTS
from airflock.scenarios import Scenario
from airflock.support import Geodetic

START_TIME = 1_800_000_000_000_000  # virtual Unix time of 0 s, µs
UNREAD_MESSAGES = ("attitude", "home", "battery")  # messages that no node reads; in lock-step nobody else is there
ABSENT_ROW = (math.nan,) * 15  # a row of a drone that has dropped out
NEVER_HEARD = -1e8  # s; a peer whose last state held before this has not been heard


class LockstepFleet:
    """N nodes with their vehicles.

    scenario : body, sensors, radio and motion step of the simulated world; card: what the nodes carry
    start    : state of each drone in the air, from which all flock at once; None: from the ground, by orders
    operator : private key of the operator, to order from the ground
    """

    def __init__(
        self, scenario: Scenario, card: FlightCard, seed: int = 0, *, start: Sequence[State] | None = None,
        faults: Sequence[InjectedFault] = (), operator: bytes = b"",
    ):  # fmt: skip
        self.scenario, self.card, self.seed, self.faults = scenario, card, seed, tuple(faults)
        self._dt = scenario.flight.dt
        self._steps_per_period = max(1, round(card.period / self._dt))
        self._steps_per_tick = max(1, round(min(card.safety.tick, card.period) / self._dt))
        self.steps, self.frames, self.state_times, self.log = 0, [], [], []  # type: ignore[var-annotated]
        self.standing: list[list[bool]] = []  # (time, agent): who stands because it has lost somebody
        self._faults = befalls = DroneFaults(scenario, seed)
        self._bodies = [b for _, b in agent_records(scenario, len(card.members), seed)]
        self._has_sensor_error = scenario.has_sensor_error
        self._noise = MotionNoise(seed, len(card.members), not card.flat)
        self.vehicles = [
            make_vehicle(scenario, card, i, b, self._noise, START_TIME) for i, b in enumerate(self._bodies)
        ]
        for vehicle in self.vehicles:
            vehicle.faults = befalls or None
            vehicle.rates |= dict.fromkeys(("local", "global"), 1.0 / (self._steps_per_tick * self._dt))
            vehicle.rates |= dict.fromkeys(UNREAD_MESSAGES, 0.0)
        self.nodes = [
            Node(
                card,
                who,
                SOFTWARE_KEY,
                now=0.0,
                utc=START_TIME + initial_clock_offset(self.faults, who),
                since=START_TIME - ACCEPTED_BEFORE_START,
            )
            for who in card.members
        ]
        self._faulty_nodes = [
            FaultyNode(partial(self.nodes.__getitem__, i), befalls, i, card.site) for i in range(len(self.nodes))
        ]
        self._faulty_vehicles = [
            (vehicle, own)
            for vehicle in self.vehicles
            if (
                own := [
                    fault for fault in self.faults if fault.kind in VEHICLE_FAULTS and fault.affects(vehicle.system)
                ]
            )
        ]
        reach = befalls.reach if befalls else None
        radio, period = (scenario.transceiver, scenario.radio), card.safety.status_period
        self.channel = RadioChannel(
            *radio, card.members, seed, period, faults, reach, partial(is_clear_between, card), card.site
        )
        words = SensorWords(seed, len(card.members))
        self._sensor_states = [
            SensorState(scenario.sensor, own, seed, i, flat=card.flat, words=partial(words, drone=i))
            for i, own in enumerate(agent_sensors(scenario, len(card.members), seed))
        ]
        self._station = OperatorStation(card, operator)
        if start is not None:
            self._begin(start)

    def _begin(self, start: Sequence[State]) -> None:
        """Put all in the air, flocking, and let everybody have heard the start states as the simulator does."""
        for vehicle, node, s in zip(self.vehicles, self.nodes, start, strict=True):
            put_in_air(vehicle, self.card, s)
            node.phase, node.home = MissionPhase.FLOCK, (*vehicle.home[:2], self.card.layer(node.member))
            node.autopilot(vehicle.origin_frame(), 0.0)
            node.autopilot(vehicle.due_telemetry(0.0), 0.0)
        delay, period = self.scenario.radio.delay, self.card.safety.status_period
        for who, (node, vehicle) in enumerate(zip(self.nodes, self.vehicles, strict=True)):
            early = Node(self.card, node.member, SOFTWARE_KEY, now=-delay, utc=START_TIME - round(1e6 * delay))
            early.phase = MissionPhase.FLOCK
            early.autopilot(vehicle.origin_frame(), -delay)
            for k in range(round(delay / period), 0, -1):
                early.autopilot(vehicle.state_frames(), -k * period)
                for datagram in early.status_datagrams(-k * period):
                    self.channel.send(-k * period, who, self._faulty_nodes[who].told(datagram, -k * period))

    # ------------------------------------------------------------------------------------------------------ flight

    @property
    def now(self) -> float:
        """Virtual time, s."""
        return self.steps * self._dt

    @property
    def law_zero_height(self) -> float:
        """Height (m) above the site at which the law counts zero."""
        return law_zero_height(self.card)

    def order(self, do: OrderKind, target: int = 0, at: float = 0.0, point: Geodetic | None = None) -> None:
        """Give an order as the operator's station would; it reaches every drone at once."""
        utc, due = (START_TIME + round(t * 1e6) for t in (self.now, at))
        datagram = self._station.order(do, utc, target=target, at=due, point=point)
        for node in self.nodes:
            node.radio(datagram, self.now)

    def advance(self, seconds: float, on_done: Callable[[], None] | None = None) -> None:
        """Fly on."""
        for _ in range(round(seconds / self._dt)):
            self._step()
            if on_done is not None and self.steps % 100 == 0:
                on_done()

    def _step(self) -> None:
        now = self.now
        if self._faults:
            self._faults.begin_due(self.steps, lambda i: (self.vehicles[i].state, self.vehicles[i].last_command))
            self._drop_out(now)
        if self.steps % self._steps_per_tick == 0:
            self._exchange(now)
        if self.steps % self._steps_per_period == 0:
            self._keep()
        for vehicle, faults in self._faulty_vehicles:
            vehicle.apply_faults(faults, now, self._dt)
        for vehicle in self.vehicles:
            vehicle.step(now, self._dt)
        self.steps += 1

    def _exchange(self, now: float) -> None:
        """Telemetry, packets and decisions of one tick."""
        if self.steps % self._steps_per_period == 0:
            self._measure(self.steps // self._steps_per_period)
        dead = [i in self.dropped_out or self._is_dead(node.member, now) for i, node in enumerate(self.nodes)]
        for node, vehicle, gone in zip(self.nodes, self.vehicles, dead, strict=True):
            told = vehicle.due_telemetry(now)
            if not gone:
                node.autopilot(told, now)
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
        """Places of the drones that have dropped out by a fault of the scenario."""
        return self._faults.dropped_out

    def _is_dead(self, member: int, now: float) -> bool:
        """Whether a fault keeps a node from hearing and saying anything."""
        return any(fault.kind == "node" and fault.holds(member, now) for fault in self.faults)

    def _measure(self, number: int) -> None:
        """Advance the error of each drone's navigation by one period, with the simulator's numbers."""
        if not self._has_sensor_error:
            return
        for sensing, vehicle in zip(self._sensor_states, self.vehicles, strict=True):
            vehicle.error = sensing.measure(number, State(*vehicle.state), self.card.period)

    # --------------------------------------------------------------------------------------------------- recording

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

    def array(self) -> NDArray[np.float64]:
        """(time, agent, 15): true position and velocity, setpoint, own position and velocity as the node knows them.

        Of drones that have dropped out nan, as in the recording of a simulation.
        """
        return np.array(self.frames)

    def packet_ages(self) -> NDArray[np.float64]:
        """(time, receiver, sender): s since the state that a node has of another one held; nan: it has none."""
        times = self._steps_per_period * self._dt * np.arange(len(self.state_times))
        stamps = np.array(self.state_times)
        return np.where(stamps > NEVER_HEARD, times[:, None, None] - stamps, np.nan)

    def digest(self) -> str:
        """SHA-256 of all that was flown."""
        return hashlib.sha256(self.array().tobytes()).hexdigest()

    def phases(self) -> list[MissionPhase]:
        """Phase of every node."""
        return [node.phase for node in self.nodes]

    @property
    def is_airborne(self) -> bool:
        """Whether any drone still flies by its node."""
        return any(phase in FLYING_PHASES for i, phase in enumerate(self.phases()) if i not in self.dropped_out)


def states_from_arrays(frames: Any, dims: int) -> list[State]:
    """States from positions and velocities (component, agent)."""
    pad = (0.0,) * (3 - dims)
    return [State(*map(float, c[:dims]), *pad, *map(float, c[dims : 2 * dims]), *pad) for c in np.asarray(frames).T]
