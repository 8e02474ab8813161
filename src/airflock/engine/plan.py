"""Plan: what of a scenario is fixed when its driver is generated. Everything else is a number at run time."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

from airflock.core import Fault, forward, vector_sizes
from airflock.engine.facts import PlanProperties
from airflock.world import beyond_nothing, edges

INTEGER_NAMES = (
    "agents", "steps", "decide_every", "sample_every", "collide_every", "delay", "ring", "world", "seed_low",
    "seed_high", "corners", "obstacles", "faces_0", "faces_1", "born",
)  # fmt: skip

NO_PACKET_TIME = -1e9  # s; time stamp of a packet that has not come
GONE = -1.0  # s; when what is not under way is due


class Plan(PlanProperties):
    """The facts of a flight, and what follows from them.

    It is made by `engine.plan_of` alone; whoever needs the same flight built otherwise asks for `built`.
    """

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
        return self.build.keep_frames

    @property
    def given_start(self) -> bool:
        """Whether the start is handed over."""
        return self.build.given_start

    @property
    def grid(self) -> bool:
        """Whether neighbours are found by cells."""
        return self.build.grid

    @property
    def near(self) -> bool:
        """Whether order parameters look at pairs and links by cells."""
        return self.build.grid and self.build.near

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
        return tuple(dict.fromkeys([*found, *([("", "group")] if self.uses_groups else [])]))

    def suffers(self, *rules: str) -> tuple[Fault, ...]:
        """Kinds of fault that have one of these rules."""
        return tuple(kind for kind in self.faults if any(rule in kind.rules for rule in rules))

    @property
    def bounded(self) -> bool:
        """Whether a place may lie outside: there is an arena, or something stands in the world."""
        return self.excursion is not beyond_nothing or bool(self.obstacles) or self.scene

    @property
    def struck(self) -> bool:
        """Whether a motion step asks which lanes suffer from a fault: all move at once, and there are such faults."""
        return bool(self.suffers("motion")) and not self.sequential

    @property
    def believes(self) -> bool:
        """Whether what agents measure of themselves is not the truth: it has rows of its own."""
        return self.has_sensor_error or bool(self.suffers("sense"))

    @property
    def late(self) -> bool:
        """Whether what is heard comes from the ring of past states."""
        return self.has_sensor_error or self.delayed

    @property
    def sent_faults(self) -> tuple[tuple[int, str, str], ...]:
        """Columns of faults that lie in the ring beside the state that is sent: place, kind, and which of its numbers.

        What is heard was sent a delay ago, by the faults and the clock of then, whatever has begun or ended since.
        """
        rules = ("clock",) if self.sees else ("sense", "tell", "clock")
        kinds = self.suffers(*rules) if self.late else ()
        found = [(kind.name, what) for kind in kinds for what in ("onset", "lasts", *kind.fields)]
        return tuple((2 * self.dimensions + c, kind, what) for c, (kind, what) in enumerate(found))

    @property
    def in_ring(self) -> int:
        """How many numbers of each agent a slot of the ring holds: its state, then columns of faults."""
        return 2 * self.dimensions + len(self.sent_faults)

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
        return self.told or self.believes or self.radio.keeps_packets or bool(self.suffers("radio"))

    @property
    def packets(self) -> bool:
        """Whether agents keep the last packet of each other one."""
        return self.radio.keeps_packets or self.stops_for_lost

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
        return tuple((c, name) for c, name in enumerate(names) if self.radio.asks_for(name))

    @property
    def shades(self) -> bool:
        """Whether the radio is asked with whether something stands between two agents, and something can."""
        return self.radio.asks_for("clear") and (self.obstacles or self.scene)

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
        packet = (*(0.0,) * (2 * self.dimensions), NO_PACKET_TIME)
        under_way = (*packet, GONE) if self.radio.late is not None else ()
        return (*packet, *under_way, *self.radio.initial_packet) if self.packets else packet

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
        return self.topology is not None and self.topology.asks_for(name)

    def varies(self, letter: str) -> bool:
        """Whether a number of this record differs among agents."""
        return any(of == letter for of, _ in self.varied)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that are flown: x y, or x y z."""
        return ("x", "y", "z")[: self.dimensions]

    @property
    def motion(self) -> tuple[str, ...]:
        """Rows of positions and velocities: x y vx vy, or x y z vx vy vz."""
        return (*self.axes, *(f"v{axis}" for axis in self.axes))

    @property
    def constants(self) -> dict[str, dict[str, str | float]]:
        """Choices and usual numbers by record name, inlined as constants."""
        chosen: dict[str, tuple[tuple[str, str | float], ...]] = {
            "p": self.model_choices, "b": self.body_choices, "s": self.sensor_choices, "k": self.radio_choices,
            "wing": self.wing_choices, "aero": self.aero_choices,
        }  # fmt: skip
        return {letter: dict(found) for letter, found in chosen.items()}

    @property
    def vectors(self) -> dict[str, dict[str, int]]:
        """Of each record of numbers its vectors, with how many components each has."""
        return {letter: vector_sizes(names) for letter, names in self.numbers}

    @property
    def senses(self) -> bool:
        """Whether the sensor makes of the true state the one that is believed; else its errors are added."""
        return self.has_sensor_error and self.sensor.measure is not None

    @property
    def beginnings(self) -> dict[str, float]:
        """Rows of what bodies and sensors remember, by name, and what they hold before an agent has flown."""
        kept = {"body": self.body.initial_memory, "sense": self.sensor.initial_memory if self.senses else ()}
        return {f"{row}{c}": value for row, values in kept.items() for c, value in enumerate(values)}

    @property
    def periodic(self) -> bool:
        """Whether offsets are taken to the nearest image."""
        return self.edge_rule is edges.wrap

    @property
    def flows(self) -> bool:
        """Whether agents come nearer by their velocities alone, all in the same step; not where faces throw back."""
        return not self.sequential and (self.edge_rule is None or self.periodic)

    @property
    def integration(self) -> str:
        """Whether positions move by the velocity before ("old") or after ("new") the body has moved."""
        return dict(self.body_choices).get("integration", self.body.integration)

    @property
    def records(self) -> dict[str, tuple[str, ...]]:
        """Columns of the parameter row, by record name, in order."""
        return dict(self.numbers)

    @cached_property
    def spans(self) -> dict[str, slice]:
        """Where the numbers of each record stand in the parameter row."""
        ends = accumulate(len(names) for _, names in self.numbers)
        return {letter: slice(end - len(names), end) for (letter, names), end in zip(self.numbers, ends, strict=True)}
