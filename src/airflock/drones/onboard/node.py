"""The node: what a drone runs beside its autopilot. Bytes in, bytes out, the clock passed in; no sockets, no files.

autopilot(bytes, now) and radio(datagram, now) take what arrives; tick(now) returns what is to be
sent. The same inputs give the same outputs to the bit, so that a log can be flown again.
"""

import re
from collections import deque
from typing import NamedTuple

from airflock.core import State
from airflock.drones.mavlink import orders
from airflock.drones.mavlink.autopilots import TAKE_OFF_COMMAND, AutopilotCommands
from airflock.drones.mavlink.messages import (
    STATUS_MESSAGE,
    DroneStatus,
    parse_status_payload,
    status_message,
    text_messages,
)
from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.mavlink.signing import PacketReceiver, PacketSigner
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import (
    FLYING_PHASES,
    NOT_FLOCKING_PHASES,
    PREFLIGHT_PHASES,
    STANDING_PHASES,
    MissionFacts,
    MissionPhase,
    next_step,
)
from airflock.drones.onboard.peers import ORDER_REFUSALS, AutopilotLink, OperatorOrders, Peers
from airflock.drones.onboard.situation import ConditionTimers, explain_clock_offset, mission_facts
from airflock.drones.onboard.steering import NO_VELOCITY, TIME_TOLERANCE, PhaseVelocity, SteeringInput, Velocity

ORIGIN_MESSAGE = 49
POSITION_MESSAGES = (32, 33)
UNKNOWN_CLOCK_ERROR = 2.5  # s; error of a clock that nobody has compared yet, the largest value of a packet


def own_status(
    card: FlightCard, link: AutopilotLink, own: State, time: int, phase: MissionPhase, *, peers: int
) -> DroneStatus:
    """Return the own status at a time (µs of Unix time), with the number of peers that are heard."""
    offset = link.unexplained_offset
    # A report of the ground may be false or missing: whom the others take to stand, they fly into.
    is_airborne = link.is_landed is False or (bool(link.armed) and own.z > card.low)
    return DroneStatus(
        time=time,
        position=own[:3],
        velocity=own[3:],
        accuracy=min(link.horizontal_accuracy, 65.0),
        phase=int(phase),
        is_airborne=is_airborne,
        mission=card.mission,
        card=bytes.fromhex(card.hash)[:4],
        battery=round(link.battery or 0.0),
        clock_error=UNKNOWN_CLOCK_ERROR if offset is None else abs(offset),
        peers=peers,
    )


QUANTITY = re.compile(r"[-+]?\d+(\.\d+)? (?=Hz|m|km|s|V|%)")
RETRY_PERIOD = 1.0  # s between two tries of a command
STOP_SECONDS = 3.0  # s for which the motors must be reported off: a heartbeat may be a second old
MAX_UNSENT_LINES = 64  # lines for a person that wait for the radio


class NodeMemory(NamedTuple):
    """State that survives a restart: own last stamp, last stamp of each member, time of the last order (µs)."""

    sent: int = 0
    heard: dict[int, int] = {}  # never changed in place
    order: int = 0


class NodeOutput(NamedTuple):
    """Output of one tick: bytes for the autopilot, datagrams for each radio, lines for a person to read.

    texts : datagrams for the first radio that bring the lines to whoever watches; drones ignore
            them
    """

    autopilot: list[bytes]
    radios: tuple[list[bytes], ...]
    notes: list[str]
    texts: list[bytes]


# Bytes and a clock in, bytes out: lock-step fleets, fuzzing and replay of a log run the code that
# flies.
class Node:
    """One member of a flock.

    card, member, key : flight card, own system id, secret of the mission
    now, utc : own clock (s) and Unix time (µs) at the start; both advance together
    memory   : state from before a restart
    radios   : periods (s) at which each radio sends the same packet
    since    : µs of Unix time; older packets are refused. The default is the start, so that no
               replay is accepted
    """

    def __init__(
        self, card: FlightCard, member: int, key: bytes, *, now: float, utc: int, memory: NodeMemory | None = None,
        radios: tuple[float, ...] | None = None, since: int | None = None,
    ):  # fmt: skip
        kept = memory or NodeMemory()
        self.card, self.member, self.phase = card, member, MissionPhase.BOOT
        self._clock_zero, self.accepted_since = utc - round(now * 1e6), utc if since is None else since
        self._radio_periods = radios or (card.safety.status_period,)
        self._speaker = AutopilotCommands(card.autopilot, member)
        self._signer = PacketSigner(key, member, last=kept.sent)
        others = [who for who in card.members if who != member]
        self._receiver = PacketReceiver(
            key, member, {STATUS_MESSAGE: others, orders.TUNNEL_MESSAGE: (orders.OPERATOR_SYSTEM,)}, 
            started=self.accepted_since, last_stamps=kept.heard,
            max_clock_difference=card.safety.clock_spread + card.delay,
        )  # fmt: skip
        self.autopilot_link = AutopilotLink(card.autopilot, member, card.site)
        self.peers = Peers(card, member)
        self.operator = OperatorOrders(card, member, max(kept.order, utc))
        self.pilot = card.pilot(member)
        self._timers, self._phase_since, self._phase_before_hold = ConditionTimers(), now, MissionPhase.FLOCK
        self.home: tuple[float, float, float] | None = None
        self._has_twin = False  # somebody else signs as this member
        self.command: Velocity = NO_VELOCITY
        self._last_tick, self._next_status = now, [now] * len(self._radio_periods)
        self._takeoff_at: float | None = None
        self._stream_since: float | None = None
        self._stop_since: float | None = None  # time at which the motors were ordered off, s
        self._command_at, self._heartbeat_at, self._request_at = -1e9, -1e9, -1e9
        self._restarts, self._has_flown = 0, False
        self._overdue: list[int] = []  # streams of the autopilot that are not heard
        self._overload_count = 0
        self._standing_velocity: Velocity | None = None  # what keeps it where it stopped for somebody who is not heard
        self._reported_missing: tuple[str, ...] = ()
        self._reported_refusals: set[int | str] = set()  # system ids of wrong clocks, reasons of orders
        self._notes: list[str] = []
        self._unsent_lines: deque[tuple[int, str]] = deque(maxlen=MAX_UNSENT_LINES)
        self._line_number = 0
        self._phase_velocity = PhaseVelocity(card, self.pilot, now, self._notes)

    def utc(self, now: float) -> int:
        """Return the Unix time (µs) at a time of the own clock (s)."""
        return self._clock_zero + round(now * 1e6)

    def shift_clock(self, ahead: int) -> None:
        """Set the own clock forward (µs): it stamps own packets and gives the age of others."""
        self._clock_zero += ahead
        self.peers.shift_clock(1e-6 * ahead)
        self.pilot.shift_clock(1e-6 * ahead)

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self.autopilot_link(data, now, self.utc(now), self.card.safety.jump)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by any radio; one that came by two counts once."""
        utc = self.utc(now)
        got = self._receiver(datagram, utc)
        if got is None:
            stamp = self._receiver.own_id_stamp
            # A radio may repeat our own frames to us. Only a stamp that we never sent proves a
            # second sender.
            if stamp is not None and stamp not in self._signer.recent_stamps and not self._has_twin:
                self._has_twin = True
                self._notes.append(f"another sender signs as member {self.member}")
            self._report_wrong_clocks()
            return
        if got.message == orders.TUNNEL_MESSAGE:
            reason = "" if self.operator.take(got.values, now, utc) else self.operator.last_refusal
            if reason and ORDER_REFUSALS[reason] and reason not in self._reported_refusals:
                self._reported_refusals.add(reason)
                self._notes.append(f"an order is refused: {ORDER_REFUSALS[reason]}")
            return
        status = parse_status_payload(got.payload, self.card.site)
        if status is None:
            return
        at = (status.time - self._clock_zero) * 1e-6
        if self.peers.take(got.system, status, at, now):
            index, peer = self.card.members.index(got.system), self.peers.all[got.system]
            # A drone on the ground is no neighbour: the law would flee from it or follow it down.
            if peer.is_flying:
                assert peer.state is not None, "it was taken"
                self.pilot.receive(
                    index, self.card.law_state(peer.state), at, now, is_standing=peer.phase in NOT_FLOCKING_PHASES
                )
            else:
                self.pilot.forget(index)

    def _report_wrong_clocks(self) -> None:
        """Note once whose packets are all refused for their time: such an order has no effect."""
        for system, seconds in self._receiver.clock_differences.items():
            if system not in self._reported_refusals and system != self.member:
                self._reported_refusals.add(system)
                who = "the operator" if system == orders.OPERATOR_SYSTEM else f"drone {system}"
                self._notes.append(
                    f"packets of {who} are refused: they are from {abs(seconds):.1f} s in the "
                    f"{'future' if seconds > 0.0 else 'past'} by this computer's clock; one of the two clocks is wrong"
                )

    @property
    def memory(self) -> NodeMemory:
        """Return the state that must survive a restart."""
        return NodeMemory(self._signer.last, dict(self._receiver.heard), self.operator.last_order_time)

    @property
    def stands(self) -> bool:
        """Return True if it stands because a lost neighbour could be near."""
        return self._standing_velocity is not None

    @property
    def refused(self) -> dict[str, int]:
        """Return the counts of refused datagrams and orders, by reason."""
        return (
            self._receiver.refused | self.peers.refused | {f"order: {k}": n for k, n in self.operator.refused.items()}
        )

    def tick(self, now: float) -> NodeOutput:
        """Decide by the mission table, and return what is to be sent; call it every `safety.tick` seconds."""
        # A computer that is overloaded ticks late; the mission counts that like a law that fails.
        late = now - self._last_tick > self.card.safety.late
        self._last_tick = now
        self._overdue = self.autopilot_link.overdue_streams(now)
        if self.autopilot_link.restarts != self._restarts:
            self._restarts, self._request_at = self.autopilot_link.restarts, -1e9
            self._notes.append("the autopilot has rebooted, or its streams ended: all is requested once more")
        self._has_flown |= self.phase in FLYING_PHASES and self.autopilot_link.is_landed is False
        out = NodeOutput([], tuple([] for _ in self._radio_periods), [], [])
        self._notes += self.autopilot_link.lines
        self.autopilot_link.lines.clear()
        known = self._mission_facts(now, overload=late or self._phase_velocity.failed)
        self._overload_count += known.is_overloaded
        self._phase_velocity.failed = False
        step = next_step(self.phase, known, self.card.safety)
        if step.row is not None:
            reasons = f": {', '.join(known.reasons_to_hold)}" if step.row.number == "19d" else ""
            self._enter(step.next_phase, step.row.event + reasons, now, out)
            # The row that fired has changed the phase, and the order would be lost with this tick:
            # give it to the next one.
            if known.order in orders.CALL_OFF_ORDERS and step.row.number != "23" and self.phase in FLYING_PHASES:
                self.operator.put_back(known.order)  # something else came first at this tick
        # RETURN has ended `held`: without this the drone would flock on once it knows its place again.
        elif known.order == OrderKind.RETURN and self.phase == MissionPhase.HOLD:
            self.operator.held = True
            self._notes.append("not returned: it does not know its position; it holds until the operator orders more")
        if known.order == OrderKind.GOTO and self.phase != MissionPhase.GOTO:
            why = ": its position jumped; look where it is, then resume" if self.operator.needs_resume else ""
            self._notes.append(f"the point that was ordered is not followed in {self.phase.name}{why}")
        if known.order == OrderKind.RESUME and self.phase == MissionPhase.HOLD and known.reasons_to_hold:
            self._notes.append(f"holds on: {', '.join(known.reasons_to_hold)}")
        # A resume must not be followed minutes later, once the pilot has taken off.
        if known.resume_ordered and self.phase == MissionPhase.MANUAL and (known.is_landed or not known.is_high):
            self.operator.resume_ordered = False
            self._notes.append("not resumed: the drone stands, or is below the fence; it takes off by a start only")
        # Neither must a kill that could not be done now, when the pilot has given the
        # drone back.
        if known.kill_confirmed and self.phase != MissionPhase.DONE:
            self.operator.kill_confirmed = False
            self._notes.append(f"not killed: in {self.phase.name} this node does not fly the drone")
        self.peers.member_joined = False
        self._report_missing(known)
        self._steer(now, known, out)
        self._speak(now, known, out)
        out.notes.extend(self._notes)
        for note in self._notes:
            self._line_number = self._line_number % 0xFFFF + 1
            # The phase is in each status; the line adds why. It is sent twice: a radio loses packets.
            why = note.partition(": ")[2] if " → " in note else note
            self._unsent_lines.extend(2 * [(self._line_number, why)])
        self._notes.clear()
        return out

    def _mission_facts(self, now: float, overload: bool) -> MissionFacts:
        s, own = self.card.safety, self.autopilot_link.state
        if own is not None:
            self._standing_velocity = self.pilot.stay(self.card.law_state(own), now)
        # After a step of the estimate both positions of the autopilot agree again, at a place that may
        # be the wrong one (measured: 22 m off, 5 s after a disturbed GNSS): only a person can see it.
        if self.phase in FLYING_PHASES and not self.operator.held and self.autopilot_link.is_position_doubtful(now):
            self.operator.held = self.operator.needs_resume = True
            self._notes.append("the position jumped: holds until the operator resumes; compare its place with the map")
        order = self.operator.next_order()
        if self.phase in PREFLIGHT_PHASES and self.operator.missed(self.utc(now), self.card.turn(self.member)):
            self._notes.append("not started: something was missing when its turn came; order the start once more")
        # The limiter would stop at the fence anyway; refusing the order gives the operator a
        # reason.
        if order == OrderKind.GOTO and self._is_goal_outside():
            order = None
            self._notes.append("the point that was ordered lies outside the fence; not followed")
        elif order == OrderKind.GOTO:
            self._phase_velocity.goal = self.operator.goal
        if order == OrderKind.RESUME and self.phase != MissionPhase.MANUAL:
            self.operator.resume_ordered = False
        known = MissionFacts(
            phase_before_hold=self._phase_before_hold,
            has_flown=self._has_flown,
            order=order,
            is_overloaded=overload,
            overload_count=self._overload_count,
            lost_near=self.stands,
            is_at_fence=self._phase_velocity.is_fenced,
            setpoints_for=0.0 if self._stream_since is None else now - self._stream_since,
            phase_for=now - self._phase_since,
            time_over=self._takeoff_at is not None and now - self._takeoff_at > s.mission_time,
        )
        explain_clock_offset(self.card, self.autopilot_link, self.peers, now)
        return mission_facts(
            self.card, self.member, self.autopilot_link, self.peers, self.operator, self._timers, known, now=now,
            utc=self.utc(now), phase=self.phase, home=self.home, has_twin=self._has_twin,
        )  # fmt: skip

    def _is_goal_outside(self) -> bool:
        goal = self.operator.goal
        return goal is None or self.card.outside(*goal) > 0.0 or goal[2] < self.card.low

    def _enter(self, to: MissionPhase, event: str, now: float, out: NodeOutput) -> None:
        """Change the phase, and do once what belongs to it."""
        was = self.phase
        self._notes.append(f"{was.name} → {to.name}: {event}")
        if to == MissionPhase.HOLD and was in FLYING_PHASES:
            self._phase_before_hold = was
        elif was == MissionPhase.HOLD:
            self._phase_before_hold = MissionPhase.FLOCK
        elif to == MissionPhase.HOLD:
            self._phase_before_hold, self.operator.held, self.operator.resume_ordered = MissionPhase.FLOCK, True, False
        if to == MissionPhase.ARMING:
            assert self.autopilot_link.state is not None
            self.operator.held = self.operator.resume_ordered = self.operator.needs_resume = False
            self.home = (self.autopilot_link.state.x, self.autopilot_link.state.y, self.card.layer(self.member))
        if was not in PREFLIGHT_PHASES and to == MissionPhase.READY:
            self.operator.start_at = None
        # It may be armed already, or still spin after its landing: it is switched off as it was on.
        if (was, to) == (MissionPhase.ARMING, MissionPhase.READY) or (
            to == MissionPhase.DONE and was != MissionPhase.MANUAL and self.autopilot_link.armed
        ):
            self._stop_since = now
        if was == MissionPhase.ARMING and to == MissionPhase.TAKEOFF:
            self._takeoff_at, self._overload_count = now, 0
            self.autopilot_link.accepted.discard(TAKE_OFF_COMMAND)
        # A refusal to land is news, though one of the same mode was reported before the flight.
        if to not in PREFLIGHT_PHASES:
            self.autopilot_link.reported_lines.clear()
        self.operator.held &= to != MissionPhase.GOTO
        if to in (MissionPhase.FLOCK, MissionPhase.GOTO) and was not in (MissionPhase.FLOCK, MissionPhase.GOTO):
            self._phase_velocity.begin(now)
        # A node that was restarted in flight does not know its home: the place where it begins to
        # return has to do.
        if to == MissionPhase.RETURN and self.home is None and self.autopilot_link.state is not None:
            self.home = (self.autopilot_link.state.x, self.autopilot_link.state.y, self.card.layer(self.member))
        self.phase, self._phase_since, self._command_at = to, now, -1e9

    def _report_missing(self, mission_facts: MissionFacts) -> None:
        """Note for a person what is missing, whenever it changes."""
        missing = (
            (mission_facts.fault,)
            if self.phase == MissionPhase.FAULT
            else mission_facts.missing
            if self.phase in PREFLIGHT_PHASES
            else mission_facts.bad_streams
        )
        if missing != self._reported_missing:
            # A line whose quantity alone has changed is no news: some change at each tick.
            reported = {QUANTITY.sub("", line) for line in self._reported_missing}
            self._notes += [f"missing: {line}" for line in missing if QUANTITY.sub("", line) not in reported]
            self._reported_missing = missing

    def _steer(self, now: float, mission_facts: MissionFacts, out: NodeOutput) -> None:
        """Send the autopilot the setpoint or the mode of the phase, or nothing."""
        phase, say = self.phase, self._speaker
        self._stop_motors(now, mission_facts, out)
        if phase == MissionPhase.LAND and not mission_facts.in_land_mode and self._may_retry(now):
            out.autopilot.append(say.set_mode(self.card.autopilot.land))
        # PX4 leaves its mode when setpoints end, so they go on in every phase in which we fly, and
        # before we arm.
        streams = (
            phase in FLYING_PHASES
            or phase == MissionPhase.ARMING
            or (phase == MissionPhase.MANUAL and mission_facts.resume_ordered)
        )
        streams = streams or (
            phase == MissionPhase.LAND and mission_facts.in_guided_mode
        )  # until the autopilot lands by itself
        if not streams:
            self._stream_since, self.command = None, NO_VELOCITY
            return
        if (
            phase == MissionPhase.ARMING
            and mission_facts.setpoints_for >= self.card.safety.stream
            and self._may_retry(now)
        ):
            out.autopilot.append(
                say.arm(True) if mission_facts.in_guided_mode else say.set_mode(self.card.autopilot.ours)
            )
        # Setpoints would end the climb that ArduPilot flies by itself; after a HOLD they lift it.
        first_climb = self._phase_since == self._takeoff_at
        if phase == MissionPhase.TAKEOFF and first_climb and not self.card.autopilot.takes_off_by_setpoints:
            # Once it spools up ArduPilot refuses another one: each ordinary take-off would report a refusal.
            if TAKE_OFF_COMMAND not in self.autopilot_link.accepted and self._may_retry(now):
                out.autopilot.append(say.command(TAKE_OFF_COMMAND, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, self._climb_height()))
            return
        self._stream_since = now if self._stream_since is None else self._stream_since
        own = self.autopilot_link.state
        flying = self.peers.flying() if phase == MissionPhase.RETURN else {}
        near = [peer.state for peer in flying.values() if peer.state is not None]
        at = SteeringInput(now, phase, self.home, self._standing_velocity, near, mission_facts.has_navigation)
        # Only a take-off may lift a drone that stands: PX4 climbs by any setpoint.
        stands = mission_facts.is_landed and phase != MissionPhase.TAKEOFF
        self.command = NO_VELOCITY if own is None or stands else self._phase_velocity.velocity(own, at)
        out.autopilot.append(say.velocity(self.command, round(now * 1e3)))

    def _stop_motors(self, now: float, mission_facts: MissionFacts, out: NodeOutput) -> None:
        """Order the motors off, once at least and until they are off; not those of a pilot, unless it is a kill."""
        kills = self.phase == MissionPhase.DONE and self.operator.kill_confirmed
        if kills and self._stop_since is None:
            self._stop_since = now
        if self._stop_since is None:
            return
        is_ours = self.phase in STANDING_PHASES - {MissionPhase.ARMING} and (
            mission_facts.in_guided_mode or mission_facts.in_land_mode
        )
        is_over = not mission_facts.armed and now - self._stop_since > STOP_SECONDS
        if is_over or not (kills or is_ours):
            self._stop_since, self.operator.kill_confirmed = None, False  # armed later, it starts another flight
        elif (mission_facts.armed or now == self._stop_since) and self._may_retry(now):
            out.autopilot.append(self._speaker.arm(False, force=kills))

    def _climb_height(self) -> float:
        """Return the height of the own layer above the ground, m."""
        ground = 0.0 if self.autopilot_link.state is None else min(self.autopilot_link.state.z, self.card.safety.base)
        return self.card.layer(self.member) - (ground if self.autopilot_link.is_landed else 0.0)

    def _may_retry(self, now: float) -> bool:
        if now - self._command_at < RETRY_PERIOD - TIME_TOLERANCE:
            return False
        self._command_at = now
        return True

    def _speak(self, now: float, mission_facts: MissionFacts, out: NodeOutput) -> None:
        """Send heartbeat, requests to the autopilot, and the own status on every radio that is due."""
        if now - self._heartbeat_at >= RETRY_PERIOD - TIME_TOLERANCE:
            self._heartbeat_at = now
            out.autopilot.append(self._speaker.heartbeat())
        # In flight, too: there a stream that ends, or that somebody slows down, is needed most.
        if now - self._request_at >= RETRY_PERIOD - TIME_TOLERANCE and self.phase != MissionPhase.FAULT:
            streams = dict.fromkeys((*self._overdue, *(POSITION_MESSAGES if mission_facts.bad_streams else ())))
            parameters = self.autopilot_link.unknown_parameters() if self.phase in PREFLIGHT_PHASES else []
            messages = [self._speaker.request_parameter(name) for name in parameters]
            if self.autopilot_link.origin is None:
                messages.append(self._speaker.request_message(ORIGIN_MESSAGE))
            messages += self._speaker.request_streams(streams)
            self._request_at = now if messages else self._request_at
            out.autopilot.extend(messages)
        due = [k for k, at in enumerate(self._next_status) if now >= at - TIME_TOLERANCE]
        if not due:
            return
        for datagram in self.status_datagrams(now):
            for k in due:
                self._next_status[k] = max(self._next_status[k] + self._radio_periods[k], now)
                out.radios[k].append(datagram)
        if 0 in due and self._unsent_lines:
            number, line = self._unsent_lines.popleft()
            out.texts.extend(self._signer(piece, self.utc(now)) for piece in text_messages(line, number))

    def status_datagrams(self, now: float) -> list[bytes]:
        """Return the own status as a signed datagram; nothing while the own position is unknown."""
        own = self.autopilot_link.state
        if own is None:
            return []
        status = own_status(
            self.card,
            self.autopilot_link,
            own,
            self.utc(self.autopilot_link.state_at),
            self.phase,
            peers=self.peers.heard(now),
        )
        return [self._signer(status_message(status, self.card.site), self.utc(now))]
