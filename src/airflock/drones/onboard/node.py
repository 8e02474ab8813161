"""The node: what a drone runs beside its autopilot. Bytes in, bytes out, the clock passed in; no sockets, no files.

autopilot(bytes, now) and radio(datagram, now) take what arrives; tick(now) gives what is to be sent. The same inputs
give the same outputs to the bit, so that a log can be flown again.
"""

from typing import NamedTuple

from airflock.drones.mavlink import orders, status
from airflock.drones.mavlink.autopilots import TAKE_OFF, Speaker
from airflock.drones.mavlink.orders import Do
from airflock.drones.mavlink.signing import Receiver, Signer
from airflock.drones.onboard import saying
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.limiter import STILL, Velocity
from airflock.drones.onboard.mission import FLY, STANDING, Facts, Phase, look
from airflock.drones.onboard.operator import Operator
from airflock.drones.onboard.peers import Peers
from airflock.drones.onboard.situation import Tick, Timers, facts
from airflock.drones.onboard.steering import EPSILON, Moment, Steering
from airflock.drones.onboard.wire import Wire

RETRY = 1.0  # s between two tries of a command
KILLING = 3.0  # s at least for which a kill is repeated to an autopilot that is armed
TELL = frozenset({Phase.BOOT, Phase.READY, Phase.CLEARED})


class Memory(NamedTuple):
    """What outlives a restart: own last stamp, last stamp of each member, when the last order was given (µs)."""

    sent: int = 0
    heard: dict[int, int] = {}  # never changed in place
    order: int = 0


class Out(NamedTuple):
    """What one tick gives: bytes for the autopilot, datagrams for each radio, lines for a person to read."""

    autopilot: list[bytes]
    radios: tuple[list[bytes], ...]
    notes: list[str]


class Node:
    """One member of a flock.

    card, member, key : flight card, own system id, secret of the mission
    now, utc : the own clock (s) and Unix time (µs) at the start; both run alike from then on
    memory   : what outlived a restart
    radios   : periods (s) at which each radio sends the same packet
    since    : µs of Unix time; nothing that was sent before is accepted. By default the start, so that no replay is
    """

    def __init__(
        self, card: Card, member: int, key: bytes, *, now: float, utc: int, memory: Memory | None = None,
        radios: tuple[float, ...] | None = None, since: int | None = None,
    ):  # fmt: skip
        kept = memory or Memory()
        self.card, self.member, self.phase = card, member, Phase.BOOT
        self._zero, self.since = utc - round(now * 1e6), utc if since is None else since
        self._radios = radios or (card.safety.status_period,)
        self._say = Speaker(card.autopilot, member)
        self._sign = Signer(key, member, last=kept.sent)
        others = [who for who in card.members if who != member]
        self._receive = Receiver(
            key, member, {status.MESSAGE: others, orders.MESSAGE: (orders.OPERATOR,)}, 
            started=self.since, heard=kept.heard,
            spread=card.safety.clock_spread + card.delay,
        )  # fmt: skip
        self.wire = Wire(card.autopilot, member, card.site)
        self.peers = Peers(card, member)
        self.operator = Operator(card, member, max(kept.order, utc))
        self.pilot = card.pilot(member)
        self._timers, self._since, self._before = Timers(), now, Phase.FLOCK
        self.home: tuple[float, float, float] | None = None
        self._twin = False  # somebody else signs as this member
        self.command: Velocity = STILL
        self._last_tick, self._next_status = now, [now] * len(self._radios)
        self._flew_at: float | None = None
        self._stream_since: float | None = None
        self._tried_at, self._beat_at, self._asked_at = -1e9, -1e9, -1e9
        self._overloads = 0
        self._stay: Velocity | None = None  # what keeps it where it stopped for somebody who is not heard
        self._told: tuple[str, ...] = ()
        self._notes: list[str] = []
        self._steering = Steering(card, self.pilot, now, self._notes)

    # ------------------------------------------------------------------------------------------------------ in

    def utc(self, now: float) -> int:
        """Unix time (µs) at a time of the own clock (s)."""
        return self._zero + round(now * 1e6)

    def set_clock(self, ahead: int) -> None:
        """Set the own clock forward by so much, µs: it stamps packets by it, and tells how old those of others are."""
        self._zero += ahead
        self.peers.set_clock(1e-6 * ahead)
        self.pilot.set_clock(1e-6 * ahead)

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self.wire(data, now, self.utc(now), self.card.safety.jump)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by any radio; one that came by two counts once."""
        utc = self.utc(now)
        got = self._receive(datagram, utc)
        if got is None:
            stamp = self._receive.own_heard
            if stamp is not None and stamp not in self._sign.recent and not self._twin:
                self._twin = True
                self._notes.append(f"another sender signs as member {self.member}")
            return
        if got.message == orders.MESSAGE:
            self.operator.take(got.values, now, utc)
            return
        told = status.status_in(got.payload, self.card.site)
        if told is None:
            return
        at = (told.time - self._zero) * 1e-6
        if self.peers.take(got.system, told, at, now):
            index, peer = self.card.members.index(got.system), self.peers.all[got.system]
            if peer.flies:
                assert peer.state is not None, "it was taken"
                self.pilot.hear(index, self.card.law_state(peer.state), at, now, stands=peer.phase in STANDING)
            else:
                self.pilot.forget(index)

    @property
    def memory(self) -> Memory:
        """What must outlive a restart."""
        return Memory(self._sign.last, dict(self._receive.heard), self.operator.given)

    @property
    def stands(self) -> bool:
        """Whether it stands because somebody whom it has lost could be near."""
        return self._stay is not None

    @property
    def refused(self) -> dict[str, int]:
        """Datagrams and orders that were refused, by reason."""
        return self._receive.refused | self.peers.refused | {f"order: {k}": n for k, n in self.operator.refused.items()}

    # ----------------------------------------------------------------------------------------------------- out

    def tick(self, now: float) -> Out:
        """Look at the mission and say what is to be sent; to be called every `safety.tick` seconds."""
        late = now - self._last_tick > self.card.safety.late
        self._last_tick = now
        out = Out([], tuple([] for _ in self._radios), [])
        known = self._facts(now, overload=late or self._steering.failed)
        self._overloads += known.overload
        self._steering.failed = False
        step = look(self.phase, known, self.card.safety)
        if step.row is not None:
            self._enter(step.to, step.row.event, now, out)
            if known.order in orders.CALL_OFF and step.row.number != "23" and self.phase in FLY:
                self.operator.again(known.order)  # something else came first at this tick
        if known.killed and self.phase != Phase.DONE:
            self.operator.killed = False  # it must not wait for the moment at which the pilot gives the drone back
            self._notes.append(f"not killed: in {self.phase.name} this node does not fly the drone")
        self.peers.joined = False
        self._tell(known)
        self._steer(now, known, out)
        self._speak(now, out)
        out.notes.extend(self._notes)
        self._notes.clear()
        return out

    def _facts(self, now: float, overload: bool) -> Facts:
        s, own = self.card.safety, self.wire.state
        if own is not None:
            self._stay = self.pilot.stay(self.card.law_state(own), now)
        order = self.operator.next()
        if self.phase in TELL and self.operator.missed(self.utc(now), self.card.turn(self.member)):
            self._notes.append("not started: something was missing when its turn came; order the start once more")
        if order == Do.GOTO and self._goal_outside():
            order = None
            self._notes.append("the point that was ordered lies outside the fence; not followed")
        elif order == Do.GOTO:
            self._steering.goal, self.operator.held = self.operator.goal, False
        if order == Do.RESUME and self.phase != Phase.MANUAL:
            self.operator.resume = False
        tick = Tick(
            now=now, utc=self.utc(now), phase=self.phase, before=self._before, home=self.home, twin=self._twin,
            order=order, overload=overload, overloads=self._overloads, lost_near=self.stands,
            near_fence=self._steering.fenced,
            streamed_for=0.0 if self._stream_since is None else now - self._stream_since, phase_for=now - self._since,
            time_over=self._flew_at is not None and now - self._flew_at > s.mission_time,
        )  # fmt: skip
        return facts(self.card, self.member, self.wire, self.peers, self.operator, self._timers, tick)

    def _goal_outside(self) -> bool:
        goal = self.operator.goal
        return goal is None or self.card.outside(*goal) > 0.0 or goal[2] < self.card.low

    def _enter(self, to: Phase, event: str, now: float, out: Out) -> None:
        """Change the phase, and do what belongs to it once."""
        was = self.phase
        self._notes.append(f"{was.name} → {to.name}: {event}")
        if to == Phase.HOLD and was in FLY:
            self._before = Phase.GATHER if was == Phase.TAKEOFF else was
        elif to == Phase.HOLD:
            self._before, self.operator.held, self.operator.resume = Phase.FLOCK, True, False
        if to == Phase.ARMING:
            assert self.wire.state is not None
            self.operator.held = self.operator.resume = False
            self.home = (self.wire.state.x, self.wire.state.y, self.card.layer(self.member))
        if was == Phase.ARMING and to == Phase.READY:
            self.operator.start_at = None
            out.autopilot.append(self._say.arm(False))
        if was == Phase.ARMING and to == Phase.TAKEOFF:
            self._flew_at, self._overloads = now, 0
        if to in (Phase.FLOCK, Phase.GOTO) and was not in (Phase.FLOCK, Phase.GOTO):
            self._steering.begin(now)
        if to == Phase.RETURN and self.home is None and self.wire.state is not None:
            self.home = (self.wire.state.x, self.wire.state.y, self.card.layer(self.member))
        self.phase, self._since, self._tried_at = to, now, -1e9

    def _tell(self, known: Facts) -> None:
        """Tell a person what is missing, when it changes."""
        told = (known.fault,) if self.phase == Phase.FAULT else known.misses if self.phase in TELL else ()
        if told != self._told:
            self._notes += [f"missing: {line}" for line in told if line not in self._told]
            self._told = told

    # ------------------------------------------------------------------------------------------------- steering

    def _steer(self, now: float, known: Facts, out: Out) -> None:
        """Say to the autopilot what the phase asks for: a setpoint, a mode, or nothing."""
        phase, say = self.phase, self._say
        if phase == Phase.DONE and self.operator.killed:
            if (known.armed or now == self._since) and self._try(now):
                out.autopilot.append(say.arm(False, force=True))
            elif not known.armed and now - self._since > KILLING:
                self.operator.killed = False  # whoever arms it from now on has another flight in mind
        if phase == Phase.LAND and not known.mode_land and self._try(now):
            out.autopilot.append(say.set_mode(self.card.autopilot.land))
        streams = phase in FLY or phase == Phase.ARMING or (phase == Phase.MANUAL and known.resume)
        streams = streams or (phase == Phase.LAND and known.mode_ours)  # until the autopilot lands by itself
        if not streams:
            self._stream_since, self.command = None, STILL
            return
        if phase == Phase.ARMING and known.streamed_for >= self.card.safety.stream and self._try(now):
            out.autopilot.append(say.arm(True) if known.mode_ours else say.set_mode(self.card.autopilot.ours))
        if phase == Phase.TAKEOFF and not self.card.autopilot.climbs:
            if self._try(now):  # setpoints would end the climb that the autopilot flies by itself
                out.autopilot.append(say.command(TAKE_OFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self._climb()))
            return
        self._stream_since = now if self._stream_since is None else self._stream_since
        own = self.wire.state
        flying = self.peers.flying() if phase == Phase.RETURN else {}
        near = [peer.state for peer in flying.values() if peer.state is not None]
        at = Moment(now, phase, self.home, self._stay, near, known.navigates)
        self.command = STILL if own is None else self._steering.velocity(own, at)
        out.autopilot.append(say.velocity(self.command, round(now * 1e3)))

    def _climb(self) -> float:
        """How far above the ground the own layer lies, m."""
        ground = 0.0 if self.wire.state is None else min(self.wire.state.z, self.card.safety.base)
        return self.card.layer(self.member) - (ground if self.wire.landed else 0.0)

    def _try(self, now: float) -> bool:
        if now - self._tried_at < RETRY - EPSILON:
            return False
        self._tried_at = now
        return True

    # ------------------------------------------------------------------------------------------------- speaking

    def _speak(self, now: float, out: Out) -> None:
        """Heartbeat, questions to the autopilot, and the own status on every radio that is due."""
        if now - self._beat_at >= RETRY - EPSILON:
            self._beat_at = now
            out.autopilot.append(self._say.heartbeat())
        if now - self._asked_at >= RETRY - EPSILON and self.phase in TELL:
            self._asked_at = now
            out.autopilot.extend(saying.questions(self._say, self.card.autopilot, self.wire))
        due = [k for k, at in enumerate(self._next_status) if now >= at - EPSILON]
        if not due:
            return
        for datagram in self.say_status(now):
            for k in due:
                self._next_status[k] = max(self._next_status[k] + self._radios[k], now)
                out.radios[k].append(datagram)

    def say_status(self, now: float) -> list[bytes]:
        """The own status as a signed datagram; nothing while no own position is known."""
        own = self.wire.state
        if own is None:
            return []
        told = saying.own_status(
            self.card, self.wire, own, self.utc(self.wire.state_at), self.phase, peers=self.peers.heard(now)
        )
        return [self._sign(status.message(told, self.card.site), self.utc(now))]
