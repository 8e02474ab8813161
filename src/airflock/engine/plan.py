"""Plan: what of a scenario is fixed when its driver is generated. Everything else is a number at run time."""

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from itertools import accumulate
from math import cos, sin, tau
from typing import Any, NamedTuple

from airflock.core import (
    FEW_PACKETS,
    Body,
    Fault,
    Metric,
    Model,
    Radio,
    Sensor,
    Topology,
    argument_names,
    choices,
    forward,
    text_state,
    vector_sizes,
)
from airflock.engine.text.probe import probe_body, probe_fault, probe_model, probe_radio, probe_sensor, probe_topology
from airflock.parts import BODIES, RADIOS, SENSORS
from airflock.scenarios import Scenario, box_fits_cells, metrics_use_cells, step_counts, uses_all_cores, uses_cells
from airflock.support import check_precision
from airflock.world import (
    EDGE_RULES,
    arena,
    arena_ray,
    arena_surfaces,
    beyond_nothing,
    edges,
    is_off_centre,
    obstacle_rule,
    rays,
)


class GroupLaw(NamedTuple):
    """A law that groups of a flock fly by, beside that of the others.

    choices : its compile-time constants, by name
    varied  : its numbers that differ among those who fly by it, as (letter, name)
    """

    model: Model
    choices: tuple[tuple[str, str | float], ...]
    varied: tuple[tuple[str, str], ...] = ()


INTEGER_NAMES = (
    "agents", "steps", "decide_every", "sample_every", "collide_every", "delay", "ring", "world", "seed_low",
    "seed_high", "corners", "obstacles", "faces_0", "faces_1", "born", "lag",
)  # fmt: skip

NO_PACKET_TIME = -1e9  # s; time stamp of a packet that has not come
GONE = -1.0  # s; when what is not under way is due


@dataclass(frozen=True)
class Plan:
    """Compile-time side of a flight: what the scenario says, how its driver is built, and what follows from both.

    It is made by `plan_of` alone; `built` gives the same flight with another driver.

    numbers   : letter of each record of numbers and its fields: the columns of a driver's row, in
                order
    surfaces  : surface function of each family of walls, in the order of the faces table
    dryden    : gusts are those of the Dryden spectrum
    polygon   : the arena is a polygon, whose edges are walls; raised: the middle of its heights is
                not 0
    obstacle  : surface function of an obstacle
    excursion : how far outside a position is
    ray       : free distance along a direction
    body      : what turns commands into motion; body_choices its compile-time constants
    sensor    : what agents measure of themselves by; sensor_choices its compile-time constants
    noisy     : it errs
    edge      : what happens to a coordinate beyond the arena's faces, if anything
    start     : region in which agents start
    scene     : something stands in the world that agents see with rays, feel, or must not touch;
                spheres: among it
    goals     : the flock has goals; herd: the goal is a shepherd
    own       : each agent has a goal of its own
    stop      : the flight ends at its first collision
    wing_choices : compile-time constants of the wing, where a rule solves for the whole flock
    aero_choices : those of drag descent, where it is added to the model
    radio     : which packets arrive; radio_choices its compile-time constants. lossy: some are lost
                by radio.loss
    few       : each of its rates sends at most `core.radio.FEW` packets in a decision
    silent    : an agent stops while a neighbour that it has lost could be near
    sequential: one agent after another perceives, decides and moves
    lags      : commands wait for body.delay before the body follows them
    faults    : kinds of fault that may occur
    varied    : numbers that differ among agents, as (letter, name); each is a row
    topology  : which of the agents that it hears an agent meets; None: all. fading: signals differ
                by chance
    laws      : laws of groups, beside `model`; the numbers of the first have the letter p1, and so
                on
    law       : which of all laws the stages are made for that ask one: 0 is `model`; None where
                there is no other
    grouped   : a rule asks for the groups of agents
    own_text  : state of the text of rules that are no part of the package: no driver outlives a
                change of them
    bits      : 32 or 64 per number
    record    : keep every sample (position, velocity, command) besides the running sums
    given_start : the flight starts from positions and velocities that are handed over
    grid      : neighbours by cells, all cores for one flock; else all pairs, one core
    near      : with `grid`: order parameters look at pairs and links by cells, too, where their
                rules allow it
    absence   : agents may be absent: they lie behind those who are there
                (`engine.absence_and_faults`)
    observe   : how many of the nearest that it hears each agent keeps as rows, and rays around it
                (`stages.observe`)
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
    sensor: Sensor = SENSORS[SENSORS.default]
    sensor_choices: tuple[tuple[str, str], ...] = ()
    edge_rule: Callable[..., Any] | None = None
    start: str = "arena"
    scene: bool = False
    spheres: bool = False
    has_mesh: bool = False
    goals: bool = False
    stop: bool = False
    wing_choices: tuple[tuple[str, str], ...] = ()
    aero_choices: tuple[tuple[str, str], ...] = ()
    is_shepherd: bool = False
    own: bool = False
    sequential: bool = False
    lags: bool = False
    dimensions: int = 2
    has_sensor_error: bool = True
    delayed: bool = True
    lossy: bool = False
    radio: Radio = RADIOS[RADIOS.default]
    radio_choices: tuple[tuple[str, str], ...] = ()
    few: bool = True
    stops_for_lost: bool = False
    windy: bool = False
    dryden: bool = False
    obstacles: bool = False
    obstacle: Callable[..., Any] = arena.convex_obstacle
    polygonal: bool = False
    off_centre_height: bool = False
    faults: tuple[Fault, ...] = ()
    varied: tuple[tuple[str, str], ...] = ()
    topology: Topology | None = None
    fading: bool = False
    laws: tuple[GroupLaw, ...] = ()
    law: int | None = None
    uses_groups: bool = False
    own_text: Hashable = ()
    bits: int = 32
    record: bool = False
    given_start: bool = False
    grid: bool = False
    near: bool = False
    absence: bool = False
    observe: tuple[int, int] = (0, 0)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Taken once: what a plan leads to is looked up several times in each flight."""
        return hash(tuple(getattr(self, each.name) for each in fields(self)))

    def built(self, **changes: Any) -> "Plan":
        """Return this plan with other values of bits, record, given_start, grid, near, absence or observe."""
        return replace(self, **changes if changes.get("grid", self.grid) else changes | {"near": False})

    @property
    def observes(self) -> bool:
        """Return True if agents keep rows of what they observe."""
        return any(self.observe)

    @cached_property
    def ray_directions(self) -> tuple[tuple[float, float, float], ...]:
        """Unit vectors of the rays that are observed: evenly around from east on; in space, then up and down."""
        turns = [tau * c / self.observe[1] for c in range(self.observe[1])]
        flat = [(round(cos(turn), 12), round(sin(turn), 12), 0.0) for turn in turns]
        return (*flat, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0))[: len(flat) + (2 if flat and self.dimensions == 3 else 0)]

    @cached_property
    def observed(self) -> dict[str, range]:
        """Columns of what is observed, by name; of each neighbour its offset, relative velocity, age and 1 if heard."""
        counts = {
            "velocity": self.dimensions,
            "goal": self.dimensions if self.goals or self.own else 0,
            "free": len(self.ray_directions),
            "neighbours": self.observe[0] * (2 * self.dimensions + 2),
        }
        ends = accumulate(counts.values())
        return {name: range(end - counts[name], end) for name, end in zip(counts, ends, strict=True)}

    def of(self, law: int) -> "Plan":
        """Return this plan as the stages of one law see it: its model, and its numbers under the letter p."""
        if not self.laws or law == 0:
            return replace(self, law=law) if self.laws else self
        # Stages read the numbers of any law under the letter p, so that one text serves all laws;
        # those of the first law give way as p0.
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
        """Return the Memory record of each law."""
        return (self.model.Memory, *(own.model.Memory for own in self.laws))

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Rows of what differs among agents, as (letter, name): numbers, which laws share by name, law and group."""
        found = [*self.varied, *(each for own in self.laws for each in own.varied)]
        found += [("", "law")] if self.laws else []
        # No agent flies by two laws, so a row serves all laws that vary a number of one name.
        return tuple(dict.fromkeys([*found, *([("", "group")] if self.uses_groups else [])]))

    def suffers(self, *rules: str) -> tuple[Fault, ...]:
        """Kinds of fault that have one of these rules."""
        return tuple(kind for kind in self.faults if any(rule in kind.rules for rule in rules))

    @property
    def bounded(self) -> bool:
        """Return True if a place may lie outside: there is an arena, or something stands in the world."""
        return self.excursion is not beyond_nothing or bool(self.obstacles) or self.scene

    @property
    def struck(self) -> bool:
        """Return True if a motion step masks the lanes that a fault affects: all agents move at once."""
        return bool(self.suffers("motion")) and not self.sequential

    @property
    def believes(self) -> bool:
        """Return True if what agents measure of themselves is not the truth: it has rows of its own."""
        return self.has_sensor_error or bool(self.suffers("sense"))

    @property
    def late(self) -> bool:
        """Return True if what is heard comes from the ring of past states."""
        return self.has_sensor_error or self.delayed

    @property
    def sent_faults(self) -> tuple[tuple[int, str, str], ...]:
        """Columns of faults that lie in the ring beside the state that is sent: place, kind, and which of its numbers.

        What is heard was sent a delay ago, by the faults and the clock of then, whatever has begun
        or ended since.
        """
        # Who is seen reports nothing: the errors of its own sensor do not reach the observer.
        rules = ("clock",) if self.sees else ("sense", "tell", "clock")
        # Without a delay what is heard was sent now, so the present columns of the faults serve.
        kinds = self.suffers(*rules) if self.late else ()
        found = [(kind.name, what) for kind in kinds for what in ("onset", "lasts", *kind.fields)]
        return tuple((2 * self.dimensions + c, kind, what) for c, (kind, what) in enumerate(found))

    @property
    def in_ring(self) -> int:
        """How many numbers of each agent a slot of the ring holds: its state, columns of faults, then its command."""
        return self.command_in_ring + self.dimensions * self.lags

    @property
    def command_in_ring(self) -> int:
        """Where in a slot of the ring the command of its decision begins."""
        return 2 * self.dimensions + len(self.sent_faults)

    @property
    def remembers(self) -> bool:
        """Return True if the ring is in use: for what is heard, or for commands that wait."""
        return self.late or self.lags

    @property
    def told(self) -> bool:
        """Return True if what others know of an agent is not the truth of this moment: it has rows of its own."""
        return self.late or self.sees or bool(self.suffers("sense", "tell"))

    @property
    def sees(self) -> bool:
        """Return True if agents see each other: nothing is sent, and the ring holds true states."""
        return self.radio.see is not None

    @property
    def perturbed(self) -> bool:
        """Return True if distances as perceived are not the true ones, which decide who is in range."""
        return self.told or self.believes or self.radio.keeps_packets or bool(self.suffers("radio"))

    @property
    def packets(self) -> bool:
        """Return True if agents keep the last packet of each other one."""
        return self.radio.keeps_packets or self.stops_for_lost

    @property
    def missed(self) -> Callable[..., Any] | None:
        """The rule for the probability that nothing arrives, the quicker one where it serves."""
        return self.radio.missed_few if self.few and self.radio.missed_few is not None else self.radio.missed

    @property
    def turns(self) -> bool:
        """Return True if the radio carries senders of packets on otherwise than straight forward."""
        return self.radio.carry is not None and self.radio.carry is not forward

    @property
    def draws(self) -> bool:
        """Return True if one random number decides whether anything arrives; a rule `receive` draws its own."""
        return self.lossy or self.radio.missed is not None

    def rolls(self, names: tuple[str, ...]) -> tuple[tuple[int, str], ...]:
        """Of these random numbers, in their places, those that the radio's own rules ask for."""
        return tuple((c, name) for c, name in enumerate(names) if self.radio.asks_for(name))

    @property
    def shades(self) -> bool:
        """Return True if the radio needs to know whether something stands between two agents, and something can."""
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
        """Return the initial record of a pair, before anything was sent.

        Position, velocity and time stamp of the newest packet; where packets come late, the same of
        the one under way and when it is due (GONE: none is under way); the radio's Packet.
        """
        packet = (*(0.0,) * (2 * self.dimensions), NO_PACKET_TIME)
        under_way = (*packet, GONE) if self.radio.late is not None else ()
        return (*packet, *under_way, *self.radio.initial_packet) if self.packets else packet

    @property
    def hides(self) -> bool:
        """Return True if flights test whether something stands between agents."""
        return self.meeting("hidden") and (self.obstacles or self.scene)

    @property
    def placed(self) -> bool:
        """Return True if offsets to all heard agents are kept: the topology reads them, or what is hidden."""
        return self.hides or any(self.meeting(name) for name in ("dx", "dy", "dz"))

    @property
    def fades(self) -> bool:
        """Return True if the strength of a signal is drawn."""
        return self.meeting("fade") and self.fading

    @property
    def meets(self) -> Callable[..., None] | None:
        """The rule of the topology."""
        return None if self.topology is None else self.topology.meet

    def meeting(self, name: str) -> bool:
        """Return True if the rule of the topology asks for something by this name."""
        return self.topology is not None and self.topology.asks_for(name)

    def varies(self, letter: str) -> bool:
        """Return True if a number of this record differs among agents."""
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
        """Return True if the sensor makes of the true state the one that is believed; else its errors are added."""
        return self.has_sensor_error and self.sensor.measure is not None

    @property
    def beginnings(self) -> dict[str, float]:
        """Rows of what bodies and sensors remember, by name, and what they hold before an agent has flown."""
        kept = {"body": self.body.initial_memory, "sense": self.sensor.initial_memory if self.senses else ()}
        return {f"{row}{c}": value for row, values in kept.items() for c, value in enumerate(values)}

    @property
    def periodic(self) -> bool:
        """Return True if offsets are taken to the nearest image."""
        return self.edge_rule is edges.wrap

    @property
    def flows(self) -> bool:
        """Return True if agents approach by their velocities alone, all in one step; not where faces throw back."""
        return not self.sequential and (self.edge_rule is None or self.periodic)

    @property
    def integration(self) -> str:
        """Return True if positions move by the velocity before ("old") or after ("new") the body has moved."""
        return dict(self.body_choices).get("integration", self.body.integration)

    @property
    def records(self) -> dict[str, tuple[str, ...]]:
        """Columns of the parameter row, by record name, in order."""
        return dict(self.numbers)

    def fields(self, letter: str) -> tuple[str, ...]:
        """Fields of a record of numbers."""
        return field_names(self.records[letter])

    @cached_property
    def spans(self) -> dict[str, slice]:
        """Where the numbers of each record stand in the parameter row."""
        ends = accumulate(len(names) for _, names in self.numbers)
        return {letter: slice(end - len(names), end) for (letter, names), end in zip(self.numbers, ends, strict=True)}


# The plan of a scenario. Its rules are called once on the way, so that their errors appear.


def plan_of(
    scenario: Scenario,
    *,
    precision: int = 32,
    record: bool = False,
    metrics: tuple[Metric, ...] | None = None,
    grid: bool | None = None,
    near: bool | None = None,
    given_start: bool = False,
    absence: bool = False,
) -> Plan:
    """Plan of a scenario's flight; its metrics are those that metrics.kind names, unless given.

    grid        : neighbours by cells or all pairs; by default what is faster, all pairs in a box
                  too small for cells
    near        : where neighbours are found by cells, order parameters go by cells, too; by default
                  in large flocks
    given_start : the start is handed over with each flight
    absence     : agents may be absent; where a fault takes agents out, or empty batteries do, they
                  may in any case
    """
    check_precision(precision)
    own_text = _own_text(scenario, metrics)
    key = "plan", precision, record, metrics, grid, near, given_start, absence, own_text
    if key not in scenario.engine_cache:
        cells = uses_all_cores(scenario) if grid is None else grid
        cells = cells and box_fits_cells(scenario) and uses_cells(scenario)
        scenario.engine_cache[key] = replace(
            _planned(scenario, metrics),
            own_text=own_text,
            bits=precision,
            record=record,
            given_start=given_start,
            grid=cells,
            near=cells and (metrics_use_cells(scenario) if near is None else near),
            absence=absence or scenario.can_land or any(kind.leaves is not None for kind in scenario.fault_kinds),
        )
    found: Plan = scenario.engine_cache[key]
    return found


def _own_text(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> Hashable:
    """State of the text of a scenario's rules that are the user's own: a notebook changes what they refer to."""
    models = [model for law in scenario.laws for model in (law.model, law.model.added) if model is not None]
    parts = scenario.body, scenario.sensors, scenario.radio, scenario.topology
    kinds = *(part.rule for part in parts), *scenario.fault_kinds
    measures = scenario.order_parameters if metrics is None else metrics
    return text_state(rule for part in (*models, *kinds, *measures) if part for rule in vars(part).values())


def _planned(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> Plan:
    """The plan itself."""
    _probe_rules(scenario)
    laws, world, wind, goal = scenario.laws, scenario.world, scenario.wind, scenario.goals.kind
    surfaces, beyond = arena_surfaces(world)
    return Plan(
        model=scenario.model,
        model_choices=constants_of(scenario.model, scenario.parameters, scenario.varied),
        numbers=tuple(scenario.numbers.items()),
        metrics=scenario.order_parameters if metrics is None else metrics,
        surfaces=surfaces,
        excursion=beyond,
        ray=arena_ray(world),
        edge_rule=EDGE_RULES[world.edges],
        dimensions=int(world.dimensions),
        obstacles=bool(world.obstacles),
        obstacle=obstacle_rule(world),
        polygonal=world.arena == "polygon" and world.edges != "periodic",
        off_centre_height=is_off_centre(world),
        body=scenario.body.rule,
        body_choices=_chosen(scenario.body.numbers),
        sequential=scenario.flight.update == "sequential",
        lags=step_counts(scenario)["lag"] > 0,
        stop=scenario.metrics.stop == "collision",
        wing_choices=_wing_choices(scenario, metrics),
        aero_choices=_chosen(scenario.aero) if scenario.is_aerodynamic else (),
        faults=scenario.fault_kinds,
        varied=scenario.varied,
        laws=tuple(GroupLaw(law.model, constants_of(*law[:2], law.varied), law.varied) for law in laws[1:]),
        uses_groups=bool(scenario.groups) and any(law.uses_groups for law in laws),
        **_sensing(scenario),
        radio=scenario.radio.rule,
        # the kind of radios that share a record is none of the choices that rules can read
        radio_choices=tuple(pair for pair in _chosen(scenario.radio.numbers) if pair[0] != "kind"),
        few=_few_packets(scenario),
        delayed=step_counts(scenario)["delay"] > 0,
        lossy=scenario.radio.loss > 0.0,
        stops_for_lost=scenario.silence.rule == "stop",
        topology=scenario.topology.rule if any(law.model.neighbour is not None for law in scenario.laws) else None,
        fading=scenario.own_topology is not None or scenario.topology.fading > 0.0,
        start=scenario.start.kind,
        scene=scenario.has_scene,
        spheres=scenario.scene.kind == "boxes" and bool(scenario.scene.spheres),
        has_mesh=scenario.scene.kind == "mesh",
        goals=goal in ("points", "scene"),
        is_shepherd=goal in ("points", "scene") and scenario.goals.role == "herd",
        own=goal == "own",
        windy=wind.kind == "dryden" or any((wind.east, wind.north, wind.up, wind.gust)),
        dryden=wind.kind == "dryden",
    )


def _probe_rules(scenario: Scenario) -> None:
    """Call every rule of a scenario once, but those of its order parameters. Raises RuleError."""
    for law in scenario.laws:
        _probed(law.model, tuple(choices(law.parameters).items()))
    for kind in scenario.fault_kinds:
        probe_fault(kind)
    probe_body(scenario.body.rule, _chosen(scenario.body.numbers))
    if scenario.has_sensor_error:
        probe_sensor(scenario.sensors.rule)
    probe_radio(scenario.radio.rule)
    if scenario.own_topology is not None:
        probe_topology(scenario.own_topology)


def _chosen(record: Any) -> tuple[tuple[str, str], ...]:
    """Choices of a record, in the order of their names."""
    return tuple(sorted(choices(record).items()))


def _sensing(scenario: Scenario) -> dict[str, Any]:
    """Return the properties of a plan that describe the sensor; a perfect one adds none, so that drivers are shared."""
    if not scenario.has_sensor_error:
        return {"has_sensor_error": False}
    sensors = scenario.sensors
    return {"has_sensor_error": True, "sensor": sensors.rule, "sensor_choices": _chosen(sensors.numbers)}


def _few_packets(scenario: Scenario) -> bool:
    """Return True if each rate of the radio sends at most FEW packets between two decisions; True where it has none."""
    rates = [getattr(scenario.radio.numbers, name) for name in scenario.radio.rule.rates]
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    return max(rates, default=0.0) * period <= FEW_PACKETS - 0.1  # rounding may make it one packet more


def _wing_choices(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> tuple[tuple[str, str], ...]:
    """Choices of the wing where a rule solves for the whole flock; elsewhere they are nobody's business."""
    found = scenario.order_parameters if metrics is None else metrics
    used = scenario.model.flock is not None or any(
        "wing" in argument_names(metric.survey, "survey") for metric in found if metric.survey
    )
    return _chosen(scenario.wing) if used else ()


def field_names(columns: Iterable[str]) -> tuple[str, ...]:
    """Return the fields of a record whose numbers have these places in the row: a column is one field."""
    return tuple(dict.fromkeys(name.partition("[")[0] for name in columns))


@lru_cache
def _probed(model: Model, chosen: tuple[tuple[str, str], ...]) -> None:
    """Probe a model once per set of choices; its numbers decide nothing about the rules' text."""
    probe_model(model, model.Parameters(**dict(chosen)))


def constants_of(
    model: Model, parameters: Any, varied: tuple[tuple[str, str], ...]
) -> tuple[tuple[str, str | float], ...]:
    """Choices of a law, and its usual numbers where they are so and do not differ among agents."""
    usual: dict[str, str | float] = {
        name: number
        for name, number in model.usual.items()
        if getattr(parameters, name) == number and ("p", name) not in varied
    }
    return tuple(sorted((usual | choices(parameters)).items()))
