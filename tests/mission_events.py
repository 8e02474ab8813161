"""A node, an autopilot of few lines, and random events: what must hold whatever happens, and in whatever order.

The autopilot follows ArduPilot or PX4 where they differ in what lifts a drone. It and the node exchange values, no
bytes, so that 10^5 sequences take less than an hour.
"""

from airflock.core.contract import State
from airflock.drones.mavlink.autopilots import STREAM_RATES
from airflock.drones.mavlink.orders import CALL_OFF_ORDERS, OperatorOrder, OrderKind
from airflock.drones.onboard.mission import AIRBORNE_PHASES, FLYING_PHASES, MissionPhase
from airflock.drones.onboard.node import Node
from airflock.fleets.lockstep import START_TIME
from airflock.fleets.radio_channel import SOFTWARE_KEY
from fleets import card, scenario

P = MissionPhase
DT = 0.2  # s; one tick of these cards
SCENARIO = scenario(2)
CARDS = {
    kind: card(SCENARIO, autopilot=kind, safety={"start_step": 0.0, "mission_time": 60.0})
    for kind in ("px4", "ardupilot")
}
ORDERS = tuple(kind for kind in OrderKind if kind != OrderKind.PING)
# what a sequence may hold beside orders: name → what it changes
SWITCHES = {
    "pilot takes over": {"pilot": True}, "pilot selects our mode": {"pilot": False, "land": False},
    "pilot lets it land": {"land": True}, "pilot climbs": {"lift": 3.0}, "pilot sinks": {"lift": -3.0},
    "pilot hovers": {"lift": 0.0}, "sinks by itself": {"weak": True}, "flies well": {"weak": False},
    "no position": {"position": False}, "position": {"position": True}, "bad navigation": {"fix": 1},
    "good navigation": {"fix": 3}, "no status": {"silent": True}, "status": {"silent": False},
    "ground state unknown": {"blind": True}, "ground state known": {"blind": False},
    "bad clock": {"clock": 9.0}, "good clock": {"clock": 0.0}, "battery low": {"battery": 20.0},
    "battery critical": {"battery": 5.0}, "battery full": {"battery": 90.0},
    "neighbour is lost": {"heard": False}, "neighbour is heard": {"heard": True},
    "neighbour flies near": {"near": True}, "neighbour is far": {"near": False},
    "lands by a failsafe": {"land": True, "failsafe": True}, "failsafe is over": {"failsafe": False},
    "commands are lost": {"deaf": True}, "commands arrive": {"deaf": False},
    "landing is reported falsely": {"lying": True}, "landing is reported truly": {"lying": False},
}  # fmt: skip
ACTIONS = (
    "pilot arms",
    "pilot disarms",
    "pilot and operator resume",
    "reboots",
    "late tick",
    "jumps aside",
    "jumps out",
    "jumps home",
)
EVENTS = (*ORDERS, *SWITCHES, *ACTIONS)


class Recorder:
    """Commands of a node as values: a name and its arguments."""

    def __getattr__(self, name):
        return lambda *values, **more: (name, *values, *more.values())

    def request_streams(self, numbers):
        """Return one request."""
        return [("streams", *numbers)] if numbers else []


class Flight:
    """One node and its autopilot; `step` lets both live for a tick, and checks all invariants."""

    def __init__(self, kind):
        self.kind, self.card = kind, CARDS[kind]
        self.node = Node(self.card, 1, SOFTWARE_KEY, now=0.0, utc=START_TIME)
        self.node._speaker = Recorder()
        self.now, self.x, self.z, self.armed, self.climb, self.velocity_up = 0.0, 0.0, 0.0, False, None, 0.0
        self.setpoint_at, self.stood_at, self.start_at = -9.0, 0.0, None
        self.resumed = False  # by an order since it stood last
        self.ground_ticks = 0  # in a phase that flies
        self.pilot, self.land, self.lift, self.weak, self.position, self.fix = True, False, 0.0, False, True, 3
        self.silent = self.blind = self.near = self.failsafe = self.deaf = self.lying = False
        self.is_armed_by_pilot, self.spinning_ticks = False, 0  # on the ground, where it should stand
        self.jumped = False  # in flight, and nobody has released it since
        self.called_home = False  # by an order in flight, and nobody has released it since
        self.clock, self.battery, self.heard, self.log = 0.0, 90.0, True, []
        link = self.node.autopilot_link
        link.origin, link.kind = (0.0, 0.0, 0.0), self.card.autopilot.number

    @property
    def mode(self):
        """Return the number of the mode."""
        autopilot = self.card.autopilot
        return autopilot.land if self.land else autopilot.hold if self.pilot else autopilot.ours

    def apply(self, event):
        """Let an event happen."""
        self.log.append((round(self.now, 1), getattr(event, "name", event)))
        node = self.node
        if isinstance(event, OrderKind):
            now = node.utc(self.now)
            goal = self.card.site.to_geodetic(10.0, 0.0, 20.0)
            point = (round(goal.latitude * 1e7), round(goal.longitude * 1e7), round(goal.altitude * 1e3))
            node.operator._obey(OperatorOrder(event, 0, self.card.mission, now, now, point), now)
            self.resumed |= event == OrderKind.RESUME
            self.jumped &= event != OrderKind.RESUME
            self.called_home |= event == OrderKind.RETURN and node.phase in FLYING_PHASES
            self.called_home &= event not in (OrderKind.RESUME, OrderKind.GOTO)
            if event == OrderKind.START:
                self.start_at = self.now
            elif event in CALL_OFF_ORDERS and node.phase in (P.BOOT, P.READY, P.CLEARED, P.ARMING):
                self.start_at = None
        elif event in SWITCHES:
            vars(self).update(SWITCHES[event])
        elif event == "pilot and operator resume":
            self.pilot = self.land = False
            self.apply(OrderKind.RESUME)
        elif event == "pilot arms":
            self.is_armed_by_pilot |= self.z == 0.0
            self.armed = self.armed or self.z == 0.0
        elif event == "pilot disarms":
            self.armed = self.armed and self.z > 0.0
        elif event == "reboots" and self.z == 0.0:
            self.armed, self.pilot, self.land, self.climb = False, True, False, None
            node.autopilot_link._forget(0)
            node.autopilot_link.origin = None
        elif event == "late tick":
            self.now += 1.4
        elif event.startswith("jumps"):
            x = {"jumps out": 500.0, "jumps aside": 20.0}.get(event, 0.0)
            self.jumped |= x != self.x and self.position and node.phase in FLYING_PHASES
            self.x = x

    def step(self):
        """Let both live for a tick."""
        self.now += DT
        self._move()
        self._report()
        was, stood, lands = self.node.phase, self.z == 0.0, self.land and self.armed
        out = self.node.tick(self.now)
        if was in FLYING_PHASES and lands:  # before anything that the node commands: the pilot's or the autopilot's
            assert self.node.phase == (P.LAND if self.failsafe else P.MANUAL), (self.node.phase, self.log)
        self.log += [(round(self.now, 1), note) for note in out.notes if "→" in note]
        for name, *values in out.autopilot:
            self._check_command(name, values)
            if not self.deaf:
                self._obey(name, values)
        self._check(was, stood)

    def _move(self):
        """Fly for a tick."""
        z = self.z
        self.climb = self.climb if self.armed and not self.pilot and not self.land else None
        if not self.armed:
            up = -3.0
        elif self.land:
            up = -1.0
        elif self.pilot:
            up = self.lift
        elif self.climb is not None:
            up = 3.0 if z < self.climb else 0.0
        else:
            fresh = self.now - self.setpoint_at < 1.5
            up = self.velocity_up if fresh and (z > 0.0 or self.kind == "px4") else 0.0
        up = -4.0 if self.weak else up
        self.z, self.speed_up = max(0.0, z + DT * up), up if z > 0.0 or up > 0.0 else 0.0
        if self.z == 0.0:
            self.armed, self.stood_at = self.armed and not (self.land and up < 0.0), self.now
        if z == 0.0 < self.z and not self.pilot and not self.land:
            assert self.node.phase == P.TAKEOFF, ("lifted by a node in", self.node.phase, self.log)

    def _report(self):
        """Tell the node what its autopilot would."""
        link, now = self.node.autopilot_link, self.now
        link.heartbeat_at, link.armed, link.mode = now, self.armed, self.mode
        silent = {24} if self.silent else set()
        silent |= ({245} if self.blind else set()) | (set() if self.position else {32, 33})
        link.arrivals |= {number: now for number in STREAM_RATES if number not in silent}
        link.is_landed = link.is_landed if self.blind else self.lying or self.z == 0.0
        link.fix_type, link.horizontal_accuracy, link.battery = self.fix, 1.0, self.battery
        link.clock_offsets, link.in_failsafe = [self.clock], self.failsafe
        if self.position:
            link.global_state, link.global_at = State(self.x, 0.0, self.z, 0.0, 0.0, self.speed_up), now
            link._moved(link.global_state, now)
        peer = self.node.peers.all[2]
        if self.heard:
            peer.heard_at = peer.at = now
        flies = self.near or self.node.phase in FLYING_PHASES
        peer.phase, peer.is_flying = (P.FLOCK if flies else P.READY), flies
        peer.state = State(self.x + (1.0 if self.near else 20.0), 0.0, self.z, 0.0, 0.0, 0.0)

    def _obey(self, name, values):
        """Follow a command as the autopilot would."""
        link = self.node.autopilot_link
        if name == "request_parameter":
            checks = {check.name: check.range(1)[1] for check in self.card.autopilot.parameter_checks}
            link.parameters[values[0]] = 3.0 if values[0] == "GF_ACTION" else checks.get(values[0], 0.0)
        elif name == "request_message":
            link.origin = (0.0, 0.0, 0.0)
        elif name == "arm":
            self.armed = values[0] and (self.armed or self.z == 0.0) if len(values) == 1 else False
            self.armed = self.armed or (not values[0] and len(values) == 1 and self.z > 0.0)
        elif name == "set_mode":
            self.pilot, self.land = values[0] == self.card.autopilot.hold, values[0] == self.card.autopilot.land
            self.climb = None
        elif name == "command" and self.armed and self.z == 0.0 and not self.pilot and not self.land:
            self.climb = values[-1]
        elif name == "velocity":
            self.velocity_up, self.setpoint_at, self.climb = values[0][2], self.now, None

    def _check_command(self, name, values):
        """Check one command of the node."""
        phase = self.node.phase
        if name == "arm" and values[0]:
            ordered = self.start_at is not None and self.now - self.start_at <= 10.0 + self.card.safety.arm_time + 2.0
            assert phase == P.ARMING and ordered, ("armed without an order", self.log)
        if name == "command":
            assert phase == P.TAKEOFF, ("take-off commanded in", phase, self.log)
        if name == "velocity" and (phase == P.MANUAL or (self.z == 0.0 and not self.blind)):
            assert phase == P.TAKEOFF or values[0][2] <= 0.0, ("climbs in", phase, self.log)

    def _check(self, was, stood):
        """Check the phase after a tick."""
        phase, low = self.node.phase, self.card.low
        seen = not self.blind and (not self.lying or self.z > low)
        self.is_armed_by_pilot &= self.armed
        stands = phase in (P.READY, P.CLEARED, P.DONE) and self.z == 0.0 and self.mode != self.card.autopilot.hold
        spins = stands and self.armed and not self.is_armed_by_pilot and not self.deaf
        self.spinning_ticks = self.spinning_ticks + 1 if spins else 0
        assert self.spinning_ticks < 9, ("turns its motors in", phase, self.log)
        if phase == P.READY and was in (P.ARMING, P.LAND, P.MANUAL):
            self.start_at = None
        if phase in (P.GATHER, P.FLOCK, P.GOTO) and phase != was and seen:
            assert not stood, (phase, "begun on the ground", self.log)
        if phase not in FLYING_PHASES - {P.TAKEOFF} or self.z > 0.0 or self.blind:
            self.ground_ticks = 0
        self.ground_ticks += 1
        assert self.ground_ticks < 9, (phase, "on the ground", self.log)
        assert phase != P.HOLD or was != P.MANUAL or self.resumed, ("resumed by an order of before", self.log)
        self.resumed &= self.z > 0.0
        if was == P.HOLD and self.jumped:
            assert phase not in (P.GATHER, P.FLOCK, P.GOTO, P.TAKEOFF), (phase, "after a jump", self.log)
        if was == P.HOLD and self.called_home:
            assert phase not in (P.GATHER, P.FLOCK, P.GOTO, P.TAKEOFF), (phase, "though called home", self.log)
        self.jumped &= phase in FLYING_PHASES
        self.called_home &= phase in FLYING_PHASES
        if phase in FLYING_PHASES:
            assert self.node.autopilot_link.mode == self.card.autopilot.ours, (phase, "of a pilot", self.log)
        if self.now - self.stood_at > 1.0 and self.armed and seen and phase != P.FAULT:
            assert phase in AIRBORNE_PHASES or self.node.operator.kill_confirmed, ("flies unseen in", phase, self.log)


def fly(kind, events):
    """Fly a sequence of (event, ticks until the next); raise AssertionError with the whole story."""
    flight = Flight(kind)
    for event, ticks in events:
        flight.apply(event)
        for _ in range(ticks):
            flight.step()
    return flight
