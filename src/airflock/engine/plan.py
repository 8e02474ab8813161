"""Plan: what of a scenario is fixed when its driver is generated. Everything else is a number at run time."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

from airflock.body.registry import BODIES
from airflock.core.contract import Body, Metric, Model
from airflock.core.fault import Fault
from airflock.core.radio import Radio, forward
from airflock.core.sensor import Sensor
from airflock.core.topology import Topology
from airflock.core.vectors import vectors_of
from airflock.radios.registry import RADIOS
from airflock.radios.registry import USUAL as USUAL_RADIO
from airflock.sensors.registry import SENSORS, USUAL
from airflock.world import arena, edges, rays

WHOLE = (
    "agents", "steps", "decide_every", "sample_every", "collide_every", "delay", "ring", "world", "seed_low",
    "seed_high", "corners", "obstacles", "faces_0", "faces_1", "born",
)  # fmt: skip

NEVER = -1e9  # s; time stamp of a packet that has not come
GONE = -1.0  # s; when what is not under way is due


class OwnLaw(NamedTuple):
    """A law that groups of a flock fly by, beside that of the others.

    choices : its compile-time constants, by name
    varied  : its numbers that differ among those who fly by it, as (letter, name)
    """

    model: Model
    choices: tuple[tuple[str, str | float], ...]
    varied: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Build:
    """How a driver is built, whatever the scenario says.

    bits        : 32 or 64 per number
    record      : keep every sample (position, velocity, command) besides the running sums
    given_start : the flight starts from positions and velocities that are handed over
    grid        : neighbours by cells, all cores for one flock; else all pairs, one core
    absence     : agents may be absent: they lie behind those who are there (`engine.presence`)
    """

    bits: int = 32
    record: bool = False
    given_start: bool = False
    grid: bool = False
    absence: bool = False


@dataclass(frozen=True)
class Plan:
    """Compile-time side of a flight: what the scenario says, and how it is built.

    It is made by `engine.plan_of` alone; whoever needs the same flight built otherwise asks for `built`.

    build     : how it is built; bits, record, given_start and grid read it
    numbers   : letter of each record of numbers and its fields: the columns of a driver's row, in order
    surfaces  : surface function of each family of walls, in the order of the faces table
    dryden    : gusts are those of the Dryden spectrum
    polygon   : the arena is a polygon, whose edges are walls; raised: the middle of its heights is not 0
    obstacle  : surface function of an obstacle
    excursion : how far outside a position is
    ray       : free distance along a direction
    body      : what turns commands into motion; body_choices its compile-time constants
    sensor    : what agents measure of themselves by; sensor_choices its compile-time constants
    noisy     : it errs
    edge      : what happens to a coordinate beyond the arena's faces, if anything
    start     : region in which agents start
    scene     : something stands in the world that agents see with rays, feel, or must not touch
    goals     : the flock has goals; herd: the goal is a shepherd
    own       : each agent has a goal of its own
    stop      : the flight ends at its first collision
    wing_choices : compile-time constants of the wing, where a rule solves for the whole flock
    aero_choices : those of drag descent, where it is added to the model
    radio     : which packets arrive; radio_choices its compile-time constants. lossy: some are lost by radio.loss
    few       : each of its rates sends at most `core.radio.FEW` packets in a decision
    silent    : an agent stops while a neighbour that it has lost could be near
    sequential: one agent after another perceives, decides and moves
    faults    : kinds of fault that may occur
    varied    : numbers that differ among agents, as (letter, name); each is a row
    topology  : which of those whom an agent hears it meets; None: all. fading: signals differ by chance
    laws      : laws of groups, beside `model`; the numbers of the first have the letter p1, and so on
    law       : which of all laws the stages are made for that ask one: 0 is `model`; None where there is no other
    grouped   : a rule asks for the groups of agents
    """

    model: Model
    model_choices: tuple[tuple[str, str | float], ...]
    numbers: tuple[tuple[str, tuple[str, ...]], ...]
    metrics: tuple[Metric, ...]
    surfaces: tuple[Callable[..., Any], ...]
    excursion: Callable[..., float]
    ray: Callable[..., float] = rays.to_nothing
    body: Body = BODIES["multirotor"]
    body_choices: tuple[tuple[str, str], ...] = ()
    sensor: Sensor = SENSORS[USUAL]
    sensor_choices: tuple[tuple[str, str], ...] = ()
    edge: Callable[..., Any] | None = None
    start: str = "arena"
    scene: bool = False
    meshed: bool = False
    goals: bool = False
    stop: bool = False
    wing_choices: tuple[tuple[str, str], ...] = ()
    aero_choices: tuple[tuple[str, str], ...] = ()
    herd: bool = False
    own: bool = False
    sequential: bool = False
    dimensions: int = 2
    noisy: bool = True
    delayed: bool = True
    lossy: bool = False
    radio: Radio = RADIOS[USUAL_RADIO]
    radio_choices: tuple[tuple[str, str], ...] = ()
    few: bool = True
    silent: bool = False
    windy: bool = False
    dryden: bool = False
    obstacles: bool = False
    obstacle: Callable[..., Any] = arena.convex_obstacle
    polygon: bool = False
    raised: bool = False
    faults: tuple[Fault, ...] = ()
    varied: tuple[tuple[str, str], ...] = ()
    topology: Topology | None = None
    fading: bool = False
    laws: tuple[OwnLaw, ...] = ()
    law: int | None = None
    grouped: bool = False
    build: Build = Build()

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Taken once: what a plan leads to is looked up several times in each flight."""
        return hash(tuple(getattr(self, each.name) for each in fields(self)))

    def built(self, **changes: Any) -> "Plan":
        """The same flight built otherwise: fields of `Build`."""
        return replace(self, build=replace(self.build, **changes))

    @property
    def bits(self) -> int:
        """Bits of a number."""
        return self.build.bits

    @property
    def record(self) -> bool:
        """Whether every sample is kept."""
        return self.build.record

    @property
    def given_start(self) -> bool:
        """Whether the start is handed over."""
        return self.build.given_start

    @property
    def grid(self) -> bool:
        """Whether neighbours are found by cells."""
        return self.build.grid

    @property
    def absence(self) -> bool:
        """Whether agents may be absent."""
        return self.build.absence

    def of(self, law: int) -> "Plan":
        """The same flight as the stages of one law see it: its model, and its numbers under the letter p."""
        if not self.laws or law == 0:
            return replace(self, law=law) if self.laws else self
        own, letters = self.laws[law - 1], {"p": "p0", f"p{law}": "p"}
        numbers = tuple((letters.get(letter, letter), fields) for letter, fields in self.numbers)
        varied = own.varied + tuple(each for each in self.varied if each[0] != "p")
        return replace(self, law=law, model=own.model, model_choices=own.choices, numbers=numbers, varied=varied)

    @property
    def every(self) -> tuple["Plan", ...]:
        """The plan as the stages of each law see it."""
        return tuple(self.of(law) for law in range(len(self.laws) + 1))

    @property
    def memories(self) -> tuple[type | None, ...]:
        """What each law remembers of an agent."""
        return (self.model.Memory, *(own.model.Memory for own in self.laws))

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Rows of what differs among agents, as (letter, name): numbers, which laws share by name, law and group."""
        found = [*self.varied, *(each for own in self.laws for each in own.varied)]
        found += [("", "law")] if self.laws else []
        return tuple(dict.fromkeys([*found, *([("", "group")] if self.grouped else [])]))

    def suffers(self, *rules: str) -> tuple[Fault, ...]:
        """Kinds of fault that have one of these rules."""
        return tuple(kind for kind in self.faults if any(rule in kind.rules for rule in rules))

    @property
    def believes(self) -> bool:
        """Whether what agents measure of themselves is not the truth: it has rows of its own."""
        return self.noisy or bool(self.suffers("sense"))

    @property
    def late(self) -> bool:
        """Whether what is heard comes from the ring of past states."""
        return self.noisy or self.delayed

    @property
    def told(self) -> bool:
        """Whether what others know of an agent is not the truth of this moment: it has rows of its own."""
        return self.late or self.sees or bool(self.suffers("sense", "tell"))

    @property
    def sees(self) -> bool:
        """Whether agents see each other: then nobody is told anything, and what is kept for others is the truth."""
        return self.radio.see is not None

    @property
    def perturbed(self) -> bool:
        """Whether distances as perceived are not the true ones, which decide who is in range."""
        return self.told or self.believes or self.radio.keeps or bool(self.suffers("radio"))

    @property
    def packets(self) -> bool:
        """Whether agents keep the last packet of each other one."""
        return self.radio.keeps or self.silent

    @property
    def missed(self) -> Callable[..., Any] | None:
        """The rule for the probability that nothing arrives, the quicker one where it serves."""
        return self.radio.missed_few if self.few and self.radio.missed_few is not None else self.radio.missed

    @property
    def turns(self) -> bool:
        """Whether the radio carries senders of packets on otherwise than straight forward."""
        return self.radio.carry is not None and self.radio.carry is not forward

    @property
    def draws(self) -> bool:
        """Whether one random number decides whether anything arrives; a rule `receive` draws its own."""
        return self.lossy or self.radio.missed is not None

    def rolls(self, names: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
        """Of these random numbers, in their places, those that the radio's own rules ask for."""
        return tuple((c, name) for c, name in enumerate(names) if self.radio.asks(name))

    @property
    def shades(self) -> bool:
        """Whether the radio is asked with whether something stands between two agents, and something can."""
        return self.radio.asks("clear") and (self.obstacles or self.scene)

    @property
    def waiting(self) -> int:
        """Where the packet that is under way begins among what is kept of a pair; the last of it is when it is due."""
        return 2 * self.dimensions + 1

    @property
    def pocket(self) -> int:
        """Where the Packet of the radio begins among what is kept of a pair."""
        return 2 * self.waiting + 1 if self.radio.late is not None else self.waiting

    @property
    def of_pair(self) -> tuple[float, ...]:
        """What is kept of each pair, as it is before anything was sent.

        Position, velocity and time stamp of the newest packet; where packets come late, the same of the one under way
        and when it is due (GONE: none is under way); the radio's Packet.
        """
        packet = (*(0.0,) * (2 * self.dimensions), NEVER)
        under_way = (*packet, GONE) if self.radio.late is not None else ()
        return (*packet, *under_way, *self.radio.beginnings) if self.packets else packet

    @property
    def hides(self) -> bool:
        """Whether agents are asked whether something stands between them and others."""
        return self.meeting("hidden") and (self.obstacles or self.scene)

    @property
    def placed(self) -> bool:
        """Whether offsets to all who are heard are kept: the topology asks for one of them, or for what is hidden."""
        return self.hides or any(self.meeting(name) for name in ("dx", "dy", "dz"))

    @property
    def fades(self) -> bool:
        """Whether the strength of a signal is drawn."""
        return self.meeting("fade") and self.fading

    @property
    def meets(self) -> Callable[..., None] | None:
        """The rule of the topology."""
        return None if self.topology is None else self.topology.meet

    def meeting(self, name: str) -> bool:
        """Whether the rule of the topology asks for something by this name."""
        return self.topology is not None and self.topology.asks(name)

    def varies(self, letter: str) -> bool:
        """Whether a number of this record differs among agents."""
        return any(of == letter for of, _ in self.varied)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that are flown: x y, or x y z."""
        return ("x", "y", "z")[: self.dimensions]

    @property
    def constants(self) -> dict[str, dict[str, str | float]]:
        """Choices and usual numbers by record name, inlined as constants."""
        wing: dict[str, str | float] = dict(self.wing_choices)
        aero: dict[str, str | float] = dict(self.aero_choices)
        body: dict[str, str | float] = dict(self.body_choices)
        sensor: dict[str, str | float] = dict(self.sensor_choices)
        radio: dict[str, str | float] = dict(self.radio_choices)
        return {"p": dict(self.model_choices), "b": body, "s": sensor, "k": radio, "wing": wing, "aero": aero}

    @property
    def vectors(self) -> dict[str, dict[str, int]]:
        """Of each record of numbers its vectors, with how many components each has."""
        return {letter: vectors_of(names) for letter, names in self.numbers}

    @property
    def senses(self) -> bool:
        """Whether the sensor makes of the true state the one that is believed; else its errors are added."""
        return self.noisy and self.sensor.measure is not None

    @property
    def beginnings(self) -> dict[str, float]:
        """Rows of what bodies and sensors remember, by name, and what they hold before an agent has flown."""
        kept = {"body": self.body.beginnings, "sense": self.sensor.beginnings if self.senses else ()}
        return {f"{row}{c}": value for row, values in kept.items() for c, value in enumerate(values)}

    @property
    def periodic(self) -> bool:
        """Whether offsets are taken to the nearest image."""
        return self.edge is edges.wrap

    @property
    def integration(self) -> str:
        """Whether positions move by the velocity before ("old") or after ("new") the body has moved."""
        return dict(self.body_choices).get("integration", self.body.integration)

    @property
    def records(self) -> dict[str, tuple[str, ...]]:
        """Columns of the parameter row, by record name, in order."""
        return dict(self.numbers)
