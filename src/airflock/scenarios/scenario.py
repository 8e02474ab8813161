"""Scenario: model, body, radio, sensors, world, number of agents, duration and sampling; frozen data."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

from airflock.core import (
    Body,
    Fault,
    Metric,
    MetricSet,
    Model,
    PacketParameters,
    Radio,
    Sensor,
    SilenceParameters,
    Topology,
    number_names,
    random,
)
from airflock.parts.aero import descent, wing as wings
from airflock.parts.bodies import wind
from airflock.parts.metrics import parameters as metric_parameters
from airflock.parts.sensors import SENSORS
from airflock.parts.topologies import TOPOLOGIES
from airflock.scenarios import filled_in
from airflock.scenarios.faulty import FaultEntry
from airflock.scenarios.group_laws import FlownLaw, flown_laws
from airflock.scenarios.groups import Group, agent_values, varied_numbers
from airflock.scenarios.portrait import scenario_html, summary
from airflock.scenarios.sections import ORDER, Flight
from airflock.world import Scene, arena, goals, scene_of, scenery, start, waypoints


@dataclass(frozen=True)
class Scenario:
    """Everything about a flight but the seed; `airflock.load` makes one.

    model and parameters : the flocking law and its numbers
    body, sensors, radio, topology, wind, world, scene, goals, start, wing, aero, silence, metrics : records, SI units
    flight    : number of agents, duration (s), motion step (s)
    vehicle, sensor, transceiver, measures : what `body`, `sensors`, `radio` and `metrics` hold the numbers of
    groups    : agents that share numbers or a law; faults: what befalls single agents
    published : order parameter → (mean, SD or None) that a paper reports for exactly this scenario
    document  : the plain nested dict that this scenario was made from
    notes     : what was adjusted, for a person to read

    Examples
    --------
    >>> import airflock
    >>> airflock.load("vasarhelyi_2018/4ms", {"radio.delay": 0.5})
    <Scenario vasarhelyi_2018/4ms: 100 agents, 600 s, model vasarhelyi_2018, multirotor, square arena of 250 m>
    """

    name: str
    model: Model
    parameters: Any
    body: Any
    sensors: Any
    radio: PacketParameters
    wind: wind.Parameters
    world: arena.Parameters
    scene: scenery.Parameters
    goals: goals.Parameters
    start: start.Parameters
    wing: wings.Parameters
    aero: descent.Parameters
    silence: SilenceParameters
    metrics: metric_parameters.Parameters
    topology: Any
    flight: Flight
    vehicle: Body
    sensor: Sensor
    transceiver: Radio
    measures: MetricSet
    own_topology: Topology | None = None
    groups: tuple[Group, ...] = ()
    faults: tuple[FaultEntry, ...] = ()
    published: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)
    document: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Scenario {summary(self)}>"

    def _repr_html_(self) -> str:
        """Tables of all keys that differ from their defaults, for a notebook."""
        return scenario_html(self)

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone: what follows from them is found again wherever it is asked for."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def engine_cache(self) -> dict[Any, Any]:
        """What an engine has made of this scenario for flights with other seeds, by keys of its own; empty at first."""
        return {}

    @property
    def agents(self) -> int:
        """Number of agents."""
        return int(self.flight.agents)

    @property
    def dimensions(self) -> int:
        """2 or 3."""
        return int(self.world.dimensions)

    @cached_property
    def has_sensor_error(self) -> bool:
        """Whether agents measure themselves with errors."""
        own = [{key: v for (letter, key), v in group.numbers.items() if letter == "s"} for group in self.groups]
        spread = any(letter == "s" and sd > 0.0 for group in self.groups for (letter, _), sd in group.spread.items())
        kinds = (self.sensors, *(replace(self.sensors, **numbers) for numbers in own))
        return spread or not all(map(self.sensor.is_exact, kinds))

    @property
    def without_sensor_errors(self) -> "Scenario":
        """The same scenario with agents that know their own states as they are."""
        exact, groups = SENSORS["perfect"], tuple(group.without("s") for group in self.groups)
        return replace(self, sensor=exact, sensors=exact.Parameters(period=self.sensors.period), groups=groups)

    @property
    def is_aerodynamic(self) -> bool:
        """Whether drag descent is added to the model (the section [aero])."""
        return self.model.flock is descent.flock

    @property
    def records(self) -> dict[str, Any]:
        """Key of a section → its record of parameters; the empty key holds those at the top."""
        return {section.key: getattr(self, section.field) for section in ORDER}

    @cached_property
    def numbers(self) -> dict[str, tuple[str, ...]]:
        """Letter of each record that drivers read → its numbers: the columns of a driver's row, in order."""
        records = self.records
        found: dict[str, tuple[str, ...]] = {
            each.letter: each.driver_record._fields if each.driver_record else number_names(records[each.key])
            for each in ORDER
            if each.letter
        }
        return found | {f"p{k}": number_names(law.parameters) for k, law in enumerate(self.laws) if k}

    @cached_property
    def order_parameters(self) -> tuple[Metric, ...]:
        """The metrics that measure a flight."""
        return self.measures.of(self.metrics)

    @property
    def topology_rule(self) -> Topology | None:
        """Which of those whom an agent hears it meets; None: all of them."""
        return self.own_topology or TOPOLOGIES[self.topology.kind]

    @cached_property
    def fault_kinds(self) -> tuple[Fault, ...]:
        """Kinds of fault that may occur."""
        duration = self.flight.duration
        return tuple(dict.fromkeys(entry.fault for entry in self.faults if entry.can_occur(duration)))

    @cached_property
    def varied(self) -> tuple[tuple[str, str], ...]:
        """Numbers that differ among agents, as (letter, name); of laws that groups fly by their own: `laws`."""
        return self.laws[0].varied + varied_numbers(self.groups, {"b": self.body, "s": self.sensors})

    @cached_property
    def laws(self) -> tuple[FlownLaw, ...]:
        """Laws that fly: that of the flock, and behind it those of groups; one for each text."""
        return flown_laws(self.model, self.parameters, self.groups, self.agents)

    @cached_property
    def law_indices(self) -> tuple[int, ...]:
        """Of each agent which of `laws` it flies by."""
        found = [0] * self.agents
        for number, law in enumerate(self.laws[1:], 1):
            for agent in law.agents:
                found[agent] = number
        return tuple(found)

    def law_of(self, agent: int) -> FlownLaw:
        """The law that an agent flies by."""
        return self.laws[self.law_indices[agent]]

    @cached_property
    def group_indices(self) -> tuple[int, ...]:
        """Of each agent the number of its group in [[groups]]; -1 where it is in none."""
        found = [-1] * self.agents
        for number, group in enumerate(self.groups):
            for agent in group.agents:
                found[agent] = number
        return tuple(found)

    def agent_values(self, letter: str, name: str, seed: int) -> list[float]:
        """One number of every agent, with its tolerance as a seed draws it."""
        record = {"p": self.parameters, "b": self.body, "s": self.sensors}[letter]
        return agent_values(self.groups, self.agents, letter, name, record, seed)

    def alike(self) -> "Scenario":
        """The same scenario without groups and faults: what a recording is measured by."""
        return replace(self, groups=(), faults=()) if self.groups or self.faults else self

    def with_drawn_scene(self, seed: int) -> "Scenario":
        """The scenario of one flight: where scene.draw = "flight", with the scene that this flight draws.

        Examples
        --------
        >>> import airflock
        >>> city = airflock.load("kidger/city", {"scene.draw": "flight"})
        >>> city.in_flight(1).scene.seed != city.in_flight(2).scene.seed  # each seed its own city
        True
        """
        if self.scene.draw == "once":
            return self
        own = {"seed": random.random_words(seed, random.SCENE, 0, 0, int(self.scene.seed))[0] >> 1, "draw": "once"}
        document = {**self.document, "scene": {**self.document.get("scene", {}), **own}}
        return replace(self, scene=replace(self.scene, **own), document=document)

    @cached_property
    def has_scene(self) -> bool:
        """Whether something stands in the world that agents see with rays, feel, or must not touch."""
        return self.scene.draw == "flight" or bool(len(self.stands().shapes))

    @property
    def ground(self) -> float | None:
        """Height of the ground, m: that of the scene, or the floor of the arena; None where nothing lies below."""
        if self.dimensions != 3:
            return None
        if self.scene.kind != "none" and self.scene.ground == "yes":
            return 0.0
        walled = self.world.arena != "none" and self.world.edges != "periodic"
        return arena.heights_of(self.world)[0] if walled else None

    @property
    def uses_battery(self) -> bool:
        """Whether batteries run empty."""
        return self.vehicle.endures is not None and getattr(self.body, "battery", "") != "endless"

    @property
    def can_land(self) -> bool:
        """Whether agents whose batteries are empty may come to the ground: then they are absent."""
        return self.uses_battery and self.ground is not None

    def stands(self) -> Scene:
        """What stands in the world; for a model that casts, polygons are walls of it too.

        Raises SceneError for a mesh that cannot be read, and for a scene without free room.

        Examples
        --------
        >>> import airflock
        >>> len(airflock.load("vasarhelyi_2018/4ms").stands().lists) > 0
        True
        """
        polygons = self.world.obstacles
        if self.world.arena == "polygon":
            polygons = (self.world.corners, *polygons)
        if all(law.model.sight is None for law in self.laws):
            return scene_of(self.scene, self.dimensions)
        return scene_of(self.scene, self.dimensions, polygons, self.world.heights)

    def waypoints(self) -> Any:
        """Goals in their order (goal, 3), m.

        Raises SceneError where the scene has no room for its goals.

        Examples
        --------
        >>> import airflock
        >>> airflock.load("kidger/city").waypoints().shape[1]
        3
        """
        return waypoints(self.goals, self.scene, self.dimensions)

    def resolved_metrics(self) -> metric_parameters.Parameters:
        """Metric parameters with everything that was left to the scenario filled in."""
        return self._measured

    @cached_property
    def _measured(self) -> metric_parameters.Parameters:
        return filled_in.default_metrics(self)

    def judged(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Order parameters of a flight with what the metric set makes of them: partial fitnesses and fitness."""
        return self.measures.judged(values, self.agents, self.flight.duration, self.resolved_metrics())

    def resolved_silence(self) -> SilenceParameters:
        """The rule of silence with everything that was left to the scenario filled in."""
        return self._silent

    @cached_property
    def _silent(self) -> SilenceParameters:
        return filled_in.default_silence(self)

    def separation(self) -> float:
        """Smallest distance of two agents at the start, m.

        Examples
        --------
        >>> import airflock
        >>> airflock.load("vasarhelyi_2018/4ms", {"start.separation": 7.0}).separation()
        7.0
        """
        given = self.start.separation
        return (
            filled_in.default_separation(self.model, self.parameters, self.start, self.world)
            if given is None
            else given
        )
