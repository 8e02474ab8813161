"""The pilot of one agent, in plain Python: it hears its neighbours, decides, and says at which velocity to fly.

A pilot checks its law once, when it is built: a law that requests what a drone lacks is refused
then, not in flight.
"""

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from airflock.core.agent import (
    BoundPercept,
    Decision,
    HeardNeighbour,
    Vector,
    WorldMap,
    decide,
    initial_memory,
    met_neighbours,
)
from airflock.core.body import Body
from airflock.core.contract import State, argument_names, call_rule
from airflock.core.maths import FAR, norm
from airflock.core.model import Model
from airflock.core.radio import Radio
from airflock.core.silence import (
    SilenceParameters,
    back,
    could_be_near,
    counts,
    for_standing_neighbour,
    stands_until,
    with_defaults,
)
from airflock.core.topology import Topology
from airflock.core.vocabulary import Percept
from airflock.support import RuleError

EARLY = 0.05  # s; how far in the future a neighbour's data may seem to be, by two clocks that differ


@dataclass(frozen=True)
class PacketPolicy:
    """Policy for the data of neighbours: how long they count, and how they are carried forward.

    extrapolate : carry them forward with their own velocity to the moment of the decision
    forget      : age (s) beyond which they say nothing; by the rule of silence they count up to its
                  patience
    once        : they say something at the one decision after they came, as over a radio of one
                  constant delay
    early       : how far (s) in the future they may seem to be, by two clocks that differ
    in_order    : believe stamps: what is older than what is known says nothing
    radio, k    : kind of radio whose rule carries them forward instead, and its numbers
    """

    extrapolate: bool = True
    forget: float = 5.0
    once: bool = False
    early: float = EARLY
    drop_reordered: bool = True
    radio: Radio | None = None
    k: Any = None

    # A simulated agent differs from a drone by settings only: packets of a constant delay count
    # once, and stamps of wrong clocks are believed.
    @classmethod
    def simulated(cls, radio: Radio, k: Any) -> "PacketPolicy":
        """As a simulated agent hears: packets of a plain radio count once, of one that keeps them until the next."""
        return cls(False, forget=FAR, once=not radio.keeps_packets, early=FAR, drop_reordered=False, radio=radio, k=k)


class ReceivedPacket:
    """The newest state of one neighbour, when it held (s), and how many decisions there were before it came.

    stands : its sender said that it holds or returns
    """

    __slots__ = ("arrived_at", "sent_at", "stands", "state")

    def __init__(self, state: State, sent_at: float, came: int, stands: bool = False):
        self.state, self.sent_at, self.arrived_at, self.stands = state, sent_at, came, stands

    def extrapolated(self, now: float) -> State:
        """The state carried forward with its own velocity."""
        age = now - self.sent_at
        x, y, z, vx, vy, vz = self.state
        return State(x + vx * age, y + vy * age, z + vz * age, vx, vy, vz)


def extrapolated_state(radio: Radio, k: Any, state: State, age: float) -> State:
    """State of the newest packet, of this age (s), as a radio's rule carries it on to now."""
    if radio.carry is None:
        return state
    x, y, z = call_rule(radio.carry, "carry", {**state._asdict(), "age": age, "k": k}, radio.name)
    return state._replace(x=x, y=y, z=z)


def packet_counts(radio: Radio, k: Any, age: float) -> bool:
    """Return True if the newest packet, of this age (s), counts by the rule of a radio."""
    return radio.lasts is None or bool(call_rule(radio.lasts, "lasts", {"age": age, "k": k}, radio.name) > 0.5)


def flattened(state: State) -> State:
    """A state in the plane."""
    x, y, _, vx, vy, _ = state
    return State(x, y, 0.0, vx, vy, 0.0)


# This class flies on board and is the reference of the tests: what the tests trust is what flies.
class Pilot:
    """One agent's law, with the packets that it has heard and the memory of its model.

    model, p : flocking law and its parameters
    place    : the world, queried for surfaces, rays and casts
    index    : own index in the flock; period : between two decisions, s
    hearing  : what is done with neighbours' data
    body, b  : of a law that commands an acceleration or a heading: what turns it into a velocity
    silence  : the rule for neighbours that are lost; None, or one that flies on: they are forgotten
    flat     : fly in a plane: every z is zero
    seed     : of the random numbers that a law may ask for
    wing, aero, steer : numbers of the wing, of drag descent and of [steer], for laws that ask for
                        them
    gets_flock_solution : the law decides for the whole flock; the caller passes its solution to
                          `decide`
    topology, t : kind of topology, which selects among the heard, and its parameters; None: all
    groups   : of each agent the number of its group, -1 in none; empty where nobody is in one

    Raises RuleError where the law asks for what a drone does not have, or gives what is no
    velocity.
    """

    def __init__(
        self,
        model: Model,
        p: Any,
        place: WorldMap,
        *,
        index: int,
        period: float,
        hearing: PacketPolicy | None = None,
        body: Body | None = None,
        b: Any = None,
        silence: SilenceParameters | None = None,
        flat: bool = False,
        seed: int = 0,
        wing: Any = None,
        aero: Any = None,
        steer: Any = None,
        gets_flock_solution: bool = False,
        topology: Topology | None = None,
        t: Any = None,
        groups: Sequence[int] = (),
    ):
        self.model, self.p, self.place, self.index, self.period = model, p, place, index, period
        self.hearing, self.flat, self.seed = hearing or PacketPolicy(), flat, seed
        self.silence = (
            with_defaults(silence, model.speed(p)) if silence is not None and silence.rule == "stop" else None
        )
        self._of_standing = for_standing_neighbour(self.silence) if self.silence is not None else None
        self.body, self.b, self.wing, self.aero, self.gets_flock_solution = body, b, wing, aero, gets_flock_solution
        self.steering = steer
        self.topology, self.t, self.groups = topology, t, groups
        self.memory = initial_memory(model)
        self.stopped: Vector | None = None
        self.stands_until = 0.0
        self.packets: dict[int, ReceivedPacket] = {}
        self.decisions = 0
        self.senses: Percept | None = None
        self._check()

    def _check(self) -> None:
        """Refuse the law now rather than in flight: one decision with a neighbour and a wall, which must be finite."""
        names = [name for rule in self.model.decide_rules for name in argument_names(rule, "decide", self.model.name)]
        if not self.gets_flock_solution and (self.model.flock is not None or "shared" in names):
            raise RuleError(f"{self.model.name} decides for the whole flock at once; no single drone can fly it")
        if self.model.command != "velocity" and (self.body is None or self.body.accepts != self.model.command):
            raise RuleError(
                f"{self.model.name} commands {self.model.command}; give a body that turns it into a velocity"
            )
        if not self.period > 0.0:
            raise RuleError(f"period = {self.period:g} s between two decisions is not positive")
        own, other = State(0.0, 0.0, 0.0, 1.0, 0.5, 0.0), State(7.0, -3.0, 0.0, -0.5, 1.0, 0.0)
        walls = [(5.0, 1.0, 0.0, 0.0), *self.place.surfaces(0.0, 0.0, 0.0)]
        record: Any = self.model.Shared
        shared = None if record is None else record(*(0.0 for _ in record._fields))
        for near in ([], [HeardNeighbour(self.index + 1, other, 0.0)]):
            made = self._decided(own, near, walls, 0.0, BoundPercept.of(self.place, own, 0.0), shared)
            setpoint = self.setpoint(own, made.command)
            if not all(map(isfinite, setpoint)):
                raise RuleError(f"{self.model.name} commands {setpoint}, which is not a velocity")

    def receive(self, sender: int, state: State, sent_at: float, now: float, *, is_standing: bool = False) -> bool:
        """Take note of a neighbour's state that held at sent_at (s); False if it is old, of the future or nan.

        stands : it says that it holds or returns, so that less is to be feared of it once it is
                 lost
        """
        known = self.packets.get(sender)
        if sender == self.index or not all(map(isfinite, state)) or not sent_at <= now + self.hearing.early:
            return False
        if known is not None and self.hearing.drop_reordered and sent_at <= known.sent_at:
            return False
        self.packets[sender] = ReceivedPacket(state, sent_at, self.decisions, is_standing)
        return True

    def group_of(self, agent: int) -> float:
        """Number of an agent's group; -1 where it is in none."""
        return float(self.groups[agent]) if 0 <= agent < len(self.groups) else -1.0

    def shift_clock(self, ahead: float) -> None:
        """The own clock has been set forward by so much, s: by it, all that was heard is older."""
        self.stands_until -= ahead
        for packet in self.packets.values():
            packet.sent_at -= ahead

    def forget(self, neighbour: int) -> None:
        """Drop the data of a neighbour that has announced to be on the ground, or has left the flock."""
        self.packets.pop(neighbour, None)

    def heard(self, now: float) -> list[HeardNeighbour]:
        """All neighbours whose data are fresh enough, by their number."""
        found, rule = [], self.hearing
        for who, packet in sorted(self.packets.items()):
            age = now - packet.sent_at
            over = rule.once and (
                self.silence is not None or packet.arrived_at < self.decisions
            )  # by silence: `counts`
            fresh = age <= rule.forget and not over
            if rule.radio is not None and not packet_counts(rule.radio, rule.k, age):
                continue
            if fresh or (self.silence is not None and counts(age, self.silence) > 0.5):
                state = packet.extrapolated(now) if rule.extrapolate else packet.state
                state = state if rule.radio is None else extrapolated_state(rule.radio, rule.k, state, age)
                found.append(
                    HeardNeighbour(who, flattened(state) if self.flat else state, age, group=self.group_of(who))
                )
        return found

    def lost_near(self, own: State, now: float) -> bool:
        """Return True if a neighbour that is not heard any more could be near by now."""
        if self.silence is None:
            return False
        for packet in self.packets.values():
            age = now - packet.sent_at
            if counts(age, self.silence) > 0.5:
                continue  # it is not lost
            at, rule = self.place.beside(own, packet.state), self._of_standing if packet.stands else self.silence
            distance = norm(at.x - own.x, at.y - own.y, 0.0 if self.flat else at.z - own.z)
            if could_be_near(distance, age, rule) > 0.5:
                return True
        return False

    def stay(self, own: State, now: float) -> Vector | None:
        """Velocity (m/s) that keeps it where it stopped for a neighbour that it has lost; None while it may fly."""
        if self.silence is None:
            return None
        near = 1.0 if self.lost_near(own, now) else 0.0
        self.stands_until = stands_until(near, now, self.stands_until, self.silence)
        if not now < self.stands_until:
            self.stopped = None
            return None
        x, y, z = self.stopped = self.stopped or own[:3]
        vx, vy, vz = back(x - own.x, y - own.y, z - own.z, self.silence)
        return vx, vy, vz

    def decide(
        self, own: State, now: float, percept: Percept | None = None, goal: Vector | None = None, *,
        time: float | None = None, visible: Container[int] | None = None, shared: Any = None,
        fades: Mapping[int, float] | None = None,
    ) -> Decision:  # fmt: skip
        """The law's command from the own state as measured, and its new memory; or what keeps it where it stopped.

        now     : by the own clock, s
        percept : of a real range finder; without it the map answers
        goal    : where the law is to go, m; without one its offset is zero
        time    : of the flight (s), if that is not the own clock's
        only    : neighbours that count, by their number, where somebody knows who is in sight;
                  None: all that are heard
        shared  : what a law for the whole flock found for this agent
        fades   : normal numbers by which signals are weaker, by who sends them, where somebody
                  draws them
        """
        if self.flat:
            own, goal = flattened(own), None if goal is None else (*goal[:2], 0.0)
        time = now if time is None else time
        self.senses = percept or BoundPercept.of(self.place, own, time, goal, (self.seed, self.decisions, self.index))
        near = [self._beside(own, heard, fades) for heard in self.heard(now) if visible is None or heard.who in visible]
        near = met_neighbours(self.topology, self.t, own, near, self.place)
        made = self._decided(own, near, self.place.surfaces(own.x, own.y, own.z), time, self.senses, shared)
        self.decisions += 1
        self.memory = made.memory
        stays = self.stay(own, now) if self.model.command == "velocity" else None
        x, y, z = made.command if stays is None else stays
        return Decision((x, y, 0.0) if self.flat else (x, y, z), made.memory)

    def _beside(self, own: State, heard: HeardNeighbour, fades: Mapping[int, float] | None) -> HeardNeighbour:
        """A neighbour at its image nearest to own, with what weakens its signal."""
        state, fade = self.place.beside(own, heard.state), fades.get(heard.who, 0.0) if fades else 0.0
        if state is heard.state and fade == heard.fade:
            return heard
        return HeardNeighbour(heard.who, state, heard.age, fade, heard.group)

    def _decided(
        self, own: State, near: list[HeardNeighbour], walls: Iterable[tuple[float, float, float, float]], time: float,
        percept: Percept, shared: Any,
    ) -> Decision:  # fmt: skip
        return decide(
            self.model, self.p, own, near, walls, self.memory, time=time, period=self.period, index=self.index,
            group=self.group_of(self.index), percept=percept, shared=shared, wing=self.wing, aero=self.aero,
            steer=self.steering,
        )  # fmt: skip

    def steer(self, own: State, now: float, goal: Vector | None = None) -> Vector:
        """Velocity (m/s) to ask an autopilot for: what the law decides now, through its body."""
        made = self.decide(own, now, goal=goal)
        if self.model.command == "velocity":
            return made.command
        if self.flat:
            own = flattened(own)
        stays = self.stay(own, now)
        x, y, z = self.setpoint(own, made.command) if stays is None else stays
        return (x, y, 0.0) if self.flat else (x, y, z)

    def setpoint(self, own: State, command: Vector) -> Vector:
        """A law's command as a velocity, m/s: itself, or where its body would be at the next decision, in still air."""
        if self.model.command == "velocity":
            return command
        assert self.body is not None
        still = {"g": (0.0, 0.0, 0.0), "w": (0.0, 0.0, 0.0), "v": own[3:], "m": own[3:], "c": command}
        given: dict[str, Any] = {a + axis: v[c] for a, v in still.items() for c, axis in enumerate("xyz")}
        rule: Callable[..., Any] = self.body.move
        x, y, z = call_rule(rule, "move", given | {"dt": self.period, "b": self.b}, self.body.name)[:3]
        return x, y, z
