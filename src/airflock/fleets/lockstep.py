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

from airflock.core.agent import State
from airflock.core.sensing import Sensing
from airflock.drones.mavlink.orders import Do
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import FLY, Phase
from airflock.drones.onboard.node import Node
from airflock.fleets.ailing import Ailing
from airflock.fleets.befalling import Faults
from airflock.fleets.dice import OuterNoise, SensorDice
from airflock.fleets.ether import Ether
from airflock.fleets.faults import Fault, clock_error
from airflock.fleets.individuals import records_of, sensors_of
from airflock.fleets.starting import DROPS_OUT, KEY, SINCE, Station, clear, in_the_air, lift_of, vehicle_of
from airflock.fleets.vehicle import SUFFERED
from airflock.scenarios.scenario import Scenario
from airflock.support.coordinates import Geodetic

STARTED = 1_800_000_000_000_000  # virtual Unix time of 0 s, µs
UNREAD = ("attitude", "home", "battery")  # messages that no node reads; in lock-step nobody else is there
ABSENT = (math.nan,) * 15  # a row of a drone that has dropped out
NEVER = -1e8  # s; a peer whose last state held before this has not been heard


class Fleet:
    """N nodes with their vehicles.

    scenario : body, sensors, radio and motion step of the simulated world; card: what the nodes carry
    start    : state of each drone in the air, from which all flock at once; None: from the ground, by orders
    operator : private key of the operator, to order from the ground
    """

    def __init__(
        self, scenario: Scenario, card: Card, seed: int = 0, *, start: Sequence[State] | None = None,
        faults: Sequence[Fault] = (), operator: bytes = b"",
    ):  # fmt: skip
        self.scenario, self.card, self.seed, self.faults = scenario, card, seed, tuple(faults)
        self._dt = scenario.flight.dt
        self._every = max(1, round(card.period / self._dt))
        self._tick = max(1, round(min(card.safety.tick, card.period) / self._dt))
        self.steps, self.frames, self.stamps, self.log = 0, [], [], []  # type: ignore[var-annotated]
        self.standing: list[list[bool]] = []  # (time, agent): who stands because it has lost somebody
        self._befalls = befalls = Faults(scenario, seed)
        self._bodies = [b for _, b in records_of(scenario, len(card.members), seed)]
        self._errs = scenario.errs
        self._noise = OuterNoise(seed, len(card.members), not card.flat)
        self.vehicles = [vehicle_of(scenario, card, i, b, self._noise, STARTED) for i, b in enumerate(self._bodies)]
        for vehicle in self.vehicles:
            vehicle.faults = befalls or None
            vehicle.rates |= dict.fromkeys(("local", "global"), 1.0 / (self._tick * self._dt))
            vehicle.rates |= dict.fromkeys(UNREAD, 0.0)
        self.nodes = [
            Node(card, who, KEY, now=0.0, utc=STARTED + clock_error(self.faults, who), since=STARTED - SINCE)
            for who in card.members
        ]  # fmt: skip
        self._ailing = [
            Ailing(partial(self.nodes.__getitem__, i), befalls, i, card.site) for i in range(len(self.nodes))
        ]
        self._suffering = [
            (vehicle, own)
            for vehicle in self.vehicles
            if (own := [fault for fault in self.faults if fault.kind in SUFFERED and fault.befalls(vehicle.system)])
        ]
        reach = befalls.reach if befalls else None
        radio, period = (scenario.transceiver, scenario.radio), card.safety.status_period
        self.ether = Ether(*radio, card.members, seed, period, faults, reach, partial(clear, card), card.site)
        words = SensorDice(seed, len(card.members))
        self._sensing = [
            Sensing(scenario.sensor, own, seed, i, flat=card.flat, words=partial(words, drone=i))
            for i, own in enumerate(sensors_of(scenario, len(card.members), seed))
        ]
        self._station = Station(card, operator)
        if start is not None:
            self._begin(start)

    def _begin(self, start: Sequence[State]) -> None:
        """Put all in the air, flocking, and let everybody have heard the start states as the simulator does."""
        for vehicle, node, s in zip(self.vehicles, self.nodes, start, strict=True):
            in_the_air(vehicle, self.card, s)
            node.phase, node.home = Phase.FLOCK, (*vehicle.home[:2], self.card.layer(node.member))
            node.autopilot(vehicle.frame_origin(), 0.0)
            node.autopilot(vehicle.telemetry(0.0), 0.0)
        delay, period = self.scenario.radio.delay, self.card.safety.status_period
        for who, (node, vehicle) in enumerate(zip(self.nodes, self.vehicles, strict=True)):
            early = Node(self.card, node.member, KEY, now=-delay, utc=STARTED - round(1e6 * delay))
            early.phase = Phase.FLOCK
            early.autopilot(vehicle.frame_origin(), -delay)
            for k in range(round(delay / period), 0, -1):
                early.autopilot(vehicle.pack_state(), -k * period)
                for datagram in early.say_status(-k * period):
                    self.ether.send(-k * period, who, self._ailing[who].told(datagram, -k * period))

    # ------------------------------------------------------------------------------------------------------ flight

    @property
    def now(self) -> float:
        """Virtual time, s."""
        return self.steps * self._dt

    @property
    def lift(self) -> float:
        """Height (m) above the site at which the law counts zero."""
        return lift_of(self.card)

    def order(self, do: Do, target: int = 0, at: float = 0.0, point: Geodetic | None = None) -> None:
        """Give an order as the operator's station would; it reaches every drone at once."""
        utc, due = (STARTED + round(t * 1e6) for t in (self.now, at))
        datagram = self._station.order(do, utc, target=target, at=due, point=point)
        for node in self.nodes:
            node.radio(datagram, self.now)

    def advance(self, seconds: float, done: Callable[[], None] | None = None) -> None:
        """Fly on."""
        for _ in range(round(seconds / self._dt)):
            self._step()
            if done is not None and self.steps % 100 == 0:
                done()

    def _step(self) -> None:
        now = self.now
        if self._befalls:
            self._befalls.strike(self.steps, lambda i: (self.vehicles[i].state, self.vehicles[i].followed))
            self._drop_out(now)
        if self.steps % self._tick == 0:
            self._exchange(now)
        if self.steps % self._every == 0:
            self._keep()
        for vehicle, faults in self._suffering:
            vehicle.suffer(faults, now, self._dt)
        for vehicle in self.vehicles:
            vehicle.step(now, self._dt)
        self.steps += 1

    def _exchange(self, now: float) -> None:
        """Telemetry, packets and decisions of one tick."""
        if self.steps % self._every == 0:
            self._measure(self.steps // self._every)
        dead = [i in self.gone or self._is_dead(node.member, now) for i, node in enumerate(self.nodes)]
        for node, vehicle, gone in zip(self.nodes, self.vehicles, dead, strict=True):
            told = vehicle.telemetry(now)
            if not gone:
                node.autopilot(told, now)
        at = [vehicle.state[:3] for vehicle in self.vehicles]
        for to, datagram in self.ether.deliver(now, at):
            if not dead[to]:
                self.nodes[to].radio(datagram, now)
        for i, (node, vehicle) in enumerate(zip(self.nodes, self.vehicles, strict=True)):
            if dead[i]:
                continue
            out = self._ailing[i].tick(now)
            self.log += [(now, node.member, note) for note in out.notes]
            for data in out.autopilot:
                node.autopilot(vehicle.receive(data, now), now)
            for datagram in out.radios[0]:
                self.ether.send(now, i, datagram, at)

    def _drop_out(self, now: float) -> None:
        """Let the drones come down that faults have just taken out of the flight."""
        for i in sorted(self._befalls.gone):
            if not self.vehicles[i].off:
                self.vehicles[i].off = True
                self.log.append((now, self.nodes[i].member, DROPS_OUT))

    @property
    def gone(self) -> set[int]:
        """Places of the drones that have dropped out by a fault of the scenario."""
        return self._befalls.gone

    def _is_dead(self, who: int, now: float) -> bool:
        """Whether a fault keeps a node from hearing and saying anything."""
        return any(fault.kind == "node" and fault.holds(who, now) for fault in self.faults)

    def _measure(self, number: int) -> None:
        """Advance the error of each drone's navigation by one period, with the simulator's numbers."""
        if not self._errs:
            return
        for sensing, vehicle in zip(self._sensing, self.vehicles, strict=True):
            vehicle.error = sensing.measure(number, State(*vehicle.state), self.card.period)

    # --------------------------------------------------------------------------------------------------- recording

    def _keep(self) -> None:
        both = enumerate(zip(self.vehicles, self.nodes, strict=True))
        rows = [
            (*v.state, *n.command, *(n.wire.state or v.state)) if i not in self.gone else ABSENT for i, (v, n) in both
        ]
        self.frames.append(rows)
        self.stamps.append(
            [
                [n.peers.all[m].at if m != n.member and i not in self.gone else -1e9 for m in self.card.members]
                for i, n in enumerate(self.nodes)
            ]
        )
        self.standing.append([n.stands for n in self.nodes])

    def array(self) -> NDArray[np.float64]:
        """(time, agent, 15): true position and velocity, setpoint, own position and velocity as the node knows them.

        Of drones that have dropped out nan, as in the recording of a simulation.
        """
        return np.array(self.frames)

    def ages(self) -> NDArray[np.float64]:
        """(time, receiver, sender): s since the state that a node has of another one held; nan: it has none."""
        times = self._every * self._dt * np.arange(len(self.stamps))
        stamps = np.array(self.stamps)
        return np.where(stamps > NEVER, times[:, None, None] - stamps, np.nan)

    def digest(self) -> str:
        """SHA-256 of all that was flown."""
        return hashlib.sha256(self.array().tobytes()).hexdigest()

    def phases(self) -> list[Phase]:
        """Phase of every node."""
        return [node.phase for node in self.nodes]

    @property
    def airborne(self) -> bool:
        """Whether any drone still flies by its node."""
        return any(phase in FLY for i, phase in enumerate(self.phases()) if i not in self.gone)


def start_states(frames: Any, dims: int) -> list[State]:
    """States from positions and velocities (component, agent)."""
    pad = (0.0,) * (3 - dims)
    return [State(*map(float, c[:dims]), *pad, *map(float, c[dims : 2 * dims]), *pad) for c in np.asarray(frames).T]
