"""Scenario: model, body, radio, sensors, world, number of agents, duration and sampling; frozen data."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from html import escape
from typing import Any, Generic, TypeVar

from airflock.core import (
    Body,
    BodyParameters,
    Fault,
    Metric,
    MetricSet,
    Model,
    PacketParameters,
    Quantity,
    Radio,
    Sensor,
    SilenceParameters,
    Topology,
    column_places,
    declarations,
    format_with_unit,
    number_names,
    random,
    with_defaults,
)
from airflock.parts import SENSORS, TOPOLOGIES, steering
from airflock.parts.aero import descent, wing as wings
from airflock.parts.bodies import wind
from airflock.parts.metrics import parameters as metric_parameters
from airflock.scenarios.fault_entries import FaultEntry
from airflock.scenarios.groups import FlownLaw, Group, agent_values, flown_laws, varied_numbers
from airflock.scenarios.scenario_checks import largest_extension
from airflock.scenarios.sections import ORDER, Flight
from airflock.world import Scene, arena, goals, scene_of, scenery, start, waypoints

Rule = TypeVar("Rule")
Numbers = TypeVar("Numbers")


@dataclass(frozen=True)
class Part(Generic[Rule, Numbers]):
    """A part of a scenario: its rule, and the numbers that it flies with.

    A number can be read of the part itself: `scenario.radio.delay` is
    `scenario.radio.numbers.delay`.
    """

    rule: Rule
    numbers: Numbers

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("rule", "numbers"):  # what copying and pickling look for
            raise AttributeError(name)
        return getattr(self.numbers, name)

    def with_numbers(self, **numbers: Any) -> "Part[Rule, Numbers]":
        """Return the part with some numbers changed."""
        return replace(self, numbers=replace(self.numbers, **numbers))  # type: ignore[type-var]


@dataclass(frozen=True)
class Scenario:
    """Everything about a flight but the seed; `airflock.load` makes one.

    model and parameters : the flocking law and its numbers
    body, sensors, radio, topology, metrics : parts, each a rule and its numbers; SI units
    wind, world, scene, goals, start, wing, aero, silence, steer : numbers of the other sections
    flight    : number of agents, duration (s), motion step (s)
    groups    : agents that share numbers or a law; faults: faults of single agents
    published : order parameter → (mean, SD or None) that a paper reports for exactly this scenario
    document  : the plain nested dict that this scenario was made from
    notes     : adjustments and warnings, for a person to read

    Examples
    --------
    >>> import airflock
    >>> airflock.load("vasarhelyi_2018/4ms", {"radio.delay": 0.5})
    <Scenario vasarhelyi_2018/4ms: 100 agents, 600 s, model vasarhelyi_2018, multirotor, square arena of 250 m>
    """

    name: str
    model: Model
    parameters: Any
    body: Part[Body, Any]
    sensors: Part[Sensor, Any]
    radio: Part[Radio, PacketParameters]
    wind: wind.Parameters
    world: arena.Parameters
    scene: scenery.Parameters
    goals: goals.Parameters
    start: start.Parameters
    wing: wings.Parameters
    aero: descent.Parameters
    silence: SilenceParameters
    steer: steering.Parameters
    metrics: Part[MetricSet, metric_parameters.Parameters]
    topology: Part[Topology | None, Any]
    flight: Flight
    groups: tuple[Group, ...] = ()
    faults: tuple[FaultEntry, ...] = ()
    published: Mapping[str, tuple[float, float | None]] = field(default_factory=dict)
    document: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Scenario {summary(self)}>"

    def _repr_html_(self) -> str:
        """Return tables of all keys that differ from their defaults, for a notebook."""
        rows = []
        for section, record in {"": self.flight, "model": self.parameters, **self.records}.items():
            for name, declared, default in declarations(record):
                if (value := getattr(record, name)) == default:
                    continue
                text = str(value)
                if isinstance(declared, Quantity):
                    text = format_with_unit(f"{value:g}", declared.unit)
                elif isinstance(value, tuple) and len(value) > SHOWN:
                    text = f"{len(value)} entries"
                rows.append((f"{section}.{name}".lstrip("."), text, declared.meaning))
        notes = "".join(f"<li>{escape(note)}</li>" for note in self.notes)
        keys = html_table(("changed key", "value", "meaning"), rows)
        return f"<p><b>{escape(summary(self))}</b></p>{keys}{f'<ul>{notes}</ul>' if notes else ''}"

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: cached properties are derived again after unpickling."""
        # Cached properties may hold compiled drivers, which no other process can use.
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def engine_cache(self) -> dict[Any, Any]:
        """A cache of the engine for flights of this scenario with other seeds, by keys of its own; empty at first."""
        # A cached property and no field: two scenarios are equal whatever an engine has prepared
        # for them.
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
        """True if agents measure themselves with errors."""
        own = [{key: v for (letter, key), v in group.numbers.items() if letter == "s"} for group in self.groups]
        spread = any(letter == "s" and sd > 0.0 for group in self.groups for (letter, _), sd in group.spread.items())
        kinds = (self.sensors.numbers, *(replace(self.sensors.numbers, **numbers) for numbers in own))
        return spread or not all(map(self.sensors.rule.is_exact, kinds))

    @property
    def without_sensor_errors(self) -> "Scenario":
        """The scenario with agents that know their own states exactly."""
        exact, groups = SENSORS["perfect"], tuple(group.without("s") for group in self.groups)
        return replace(self, sensors=Part(exact, exact.Parameters(period=self.sensors.period)), groups=groups)

    @property
    def is_aerodynamic(self) -> bool:
        """True if drag descent is added to the model (the section [aero])."""
        return self.model.flock is descent.flock

    @property
    def records(self) -> dict[str, Any]:
        """Key of a section → its record of parameters; the empty key holds those at the top."""
        values = {section.key: getattr(self, section.field) for section in ORDER}
        return {key: value.numbers if isinstance(value, Part) else value for key, value in values.items()}

    def with_records(self, records: Mapping[str, Any]) -> "Scenario":
        """Return the scenario with other records of parameters, by the keys of their sections."""
        changed: dict[str, Any] = {}
        for section in ORDER:
            if section.key in records:
                before, record = getattr(self, section.field), records[section.key]
                changed[section.field] = replace(before, numbers=record) if isinstance(before, Part) else record
        return replace(self, **changed)

    @cached_property
    def numbers(self) -> dict[str, tuple[str, ...]]:
        """Letter of each record that drivers read → its numbers: the columns of a driver's row."""
        records = self.records
        columns: dict[str, tuple[str, ...]] = {
            each.letter: each.driver_record._fields if each.driver_record else number_names(records[each.key])
            for each in ORDER
            if each.letter
        }
        # The dead time is counted in steps (`step_counts`); no rule of a body reads it.
        columns["b"] = tuple(name for name in columns["b"] if name not in number_names(BodyParameters))
        if not self.steers:
            del columns["steer"]
        columns["p"] += column_places(self.parameters)
        more = {f"p{k}": law.parameters for k, law in enumerate(self.laws) if k}
        return columns | {letter: number_names(p) + column_places(p) for letter, p in more.items()}

    @cached_property
    def order_parameters(self) -> tuple[Metric, ...]:
        """The metrics that measure a flight."""
        return self.metrics.rule.of(self.metrics.numbers)

    @property
    def own_topology(self) -> Topology | None:
        """The rule that selects neighbours if it is not of the package, else None."""
        return None if self.topology.rule in TOPOLOGIES.values() else self.topology.rule

    @cached_property
    def fault_kinds(self) -> tuple[Fault, ...]:
        """Kinds of fault that may occur."""
        duration = self.flight.duration
        return tuple(dict.fromkeys(entry.fault for entry in self.faults if entry.can_occur(duration)))

    @cached_property
    def varied(self) -> tuple[tuple[str, str], ...]:
        """Numbers that differ among agents, as (letter, name); of other laws of groups: `laws`."""
        return self.laws[0].varied + varied_numbers(self.groups, {"b": self.body.numbers, "s": self.sensors.numbers})

    @cached_property
    def laws(self) -> tuple[FlownLaw, ...]:
        """Laws that fly: that of the flock, and behind it those of groups; one for each text."""
        return flown_laws(self.model, self.parameters, self.groups, self.agents)

    @cached_property
    def law_indices(self) -> tuple[int, ...]:
        """Index in `laws` of each agent's law."""
        return self._numbered([law.agents for law in self.laws[1:]], 1)

    def law_of(self, agent: int) -> FlownLaw:
        """Return the law that an agent flies by."""
        return self.laws[self.law_indices[agent]]

    @cached_property
    def group_indices(self) -> tuple[int, ...]:
        """Number of each agent's group in [[groups]]; -1 where it is in none."""
        return self._numbered([group.agents for group in self.groups])

    def _numbered(self, members: Sequence[Sequence[int]], first: int = 0) -> tuple[int, ...]:
        """Return the number of the list that each agent is in, from `first` on; the one before where it is in none."""
        indices = [first - 1] * self.agents
        for number, agents in enumerate(members, first):
            for agent in agents:
                indices[agent] = number
        return tuple(indices)

    def agent_values(self, letter: str, name: str, seed: int) -> list[float]:
        """Return one number of every agent, with its tolerance as a seed draws it."""
        record = {"p": self.parameters, "b": self.body.numbers, "s": self.sensors.numbers}[letter]
        return agent_values(self.groups, self.agents, letter, name, record, seed)

    def alike(self) -> "Scenario":
        """Return the scenario without groups and faults, by which a recording is measured."""
        return replace(self, groups=(), faults=()) if self.groups or self.faults else self

    def with_drawn_scene(self, seed: int) -> "Scenario":
        """Return the scenario of one flight: where scene.draw = "flight", with the scene that this flight draws.

        Examples
        --------
        >>> import airflock
        >>> city = airflock.load("kidger/city", {"scene.draw": "flight"})
        >>> city.with_drawn_scene(1).scene.seed != city.with_drawn_scene(2).scene.seed  # each seed its own city
        True
        """
        if self.scene.draw == "once":
            return self
        # Shifted by one bit: a random word has 32 bits, and scene.seed is at most 2^31.
        own = {"seed": random.random_words(seed, random.SCENE, 0, 0, int(self.scene.seed))[0] >> 1, "draw": "once"}
        document = {**self.document, "scene": {**self.document.get("scene", {}), **own}}
        return replace(self, scene=replace(self.scene, **own), document=document)

    @cached_property
    def has_scene(self) -> bool:
        """True if the world has shapes that agents see with rays, feel, or must not touch."""
        # A scene that each flight draws anew is not built here, as its shapes need a seed.
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
        """True if batteries run empty."""
        return self.body.rule.endures is not None and getattr(self.body, "battery", "") != "endless"

    @property
    def can_land(self) -> bool:
        """True if agents whose batteries are empty may come to the ground: then they are absent."""
        return self.uses_battery and self.ground is not None

    def stands(self) -> Scene:
        """Return the shapes that stand in the world; for a model that casts rays, polygons are walls of it too.

        Raises SceneError for a mesh that cannot be read, and for a scene without free room.

        Examples
        --------
        >>> import airflock
        >>> len(airflock.load("kidger/city").stands().shapes) > 0
        True
        """
        polygons = self.world.obstacles
        if self.world.arena == "polygon":
            polygons = (self.world.corners, *polygons)
        # A law that casts rays must see the walls of the field; any other law feels them as
        # surfaces.
        if all(law.model.sight is None for law in self.laws):
            return scene_of(self.scene, self.dimensions)
        return scene_of(self.scene, self.dimensions, polygons, self.world.heights)

    def waypoints(self) -> Any:
        """Return goals in their order (goal, 3), m.

        Raises SceneError where the scene has no room for its goals.

        Examples
        --------
        >>> import airflock
        >>> airflock.load("kidger/city").waypoints().shape[1]
        3
        """
        return waypoints(self.goals, self.scene, self.dimensions)

    def resolved_metrics(self) -> metric_parameters.Parameters:
        """Return the metric parameters, open ones derived from the rest of the scenario."""
        return self._measured

    @cached_property
    def _measured(self) -> metric_parameters.Parameters:
        """Metric parameters without open ones."""
        given, p, model = self.metrics.numbers, self.parameters, self.model
        open_numbers = {name for name, value in vars(given).items() if value is None}
        speed = (self.steer.speed or 1.0) if model.preferred_speed is None else model.speed(p)
        speed = speed if given.v_flock is None else given.v_flock
        # Two agents are of one cluster if they interact; a law without a finite range leaves the
        # radio's.
        known = model.interaction_range or model.reach
        # The largest extension is the largest number where nothing bounds it; then `unmeasured`.
        extension = given.max_e if given.max_e is not None else largest_extension(self.world) or 1e7
        derived = {
            "v_flock": speed, "v_tol": 0.375 * speed, "r_comm": self.radio.range,
            "r_cluster": min(float(known(p)) if known else self.radio.range, 1e6),
            "collision_period": self.flight.dt, "max_e": extension, "k": extension,
        }  # fmt: skip
        return replace(given, **{name: value for name, value in derived.items() if name in open_numbers})

    def judged(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Add the fitness of the metric set and its parts to the order parameters of a flight."""
        found = self.metrics.rule.judged(values, self.agents, self.flight.duration, self.resolved_metrics())
        return found | dict.fromkeys(self.unmeasured & set(found), math.nan)

    @property
    def unmeasured(self) -> set[str]:
        """Names of order parameters that need metrics.max_e, where neither it nor an arena says how large that is."""
        known = self.metrics.numbers.max_e is not None or largest_extension(self.world)
        return set() if known else {"cns_ext", "quality", "cns_ext_groups", "quality_groups"}

    @property
    def steers(self) -> bool:
        """True if the command of the flock's law, or of a group's, is converted for the body."""
        return any(law.model.steer for law in self.laws)

    def resolved_steer(self) -> steering.Parameters:
        """Return how commands are converted, open numbers derived from the law, the fitness and the body."""
        speed = self.resolved_metrics().v_flock if self.steer.speed is None else self.steer.speed
        response = getattr(self.body.numbers, "tau", self.sensors.period or self.flight.dt)
        turn = steering.NO_LIMIT if self.steer.turn is None else self.steer.turn
        return replace(self.steer, speed=speed, turn=turn, response=self.steer.response or response)

    @cached_property
    def _silent(self) -> SilenceParameters:
        """The rule of silence without open numbers."""
        return with_defaults(self.silence, self.model.speed(self.parameters), self.radio.delay)

    def resolved_silence(self) -> SilenceParameters:
        """Return the rule of silence, open numbers derived from the rest of the scenario."""
        return self._silent

    def separation(self) -> float:
        """Return the smallest distance of two agents at the start, m.

        Examples
        --------
        >>> import airflock
        >>> airflock.load("vasarhelyi_2018/4ms", {"start.separation": 7.0}).separation()
        7.0
        """
        distance = self.start.separation
        return default_separation(self.model, self.parameters, self.start, self.world) if distance is None else distance


SHOWN = 8  # lists of points longer than this are counted, not printed


def summary(scenario: Scenario) -> str:
    """Return name, size, law, body and arena in one line."""
    world = scenario.world
    size = {"square": f" of {world.side:g} m", "circle": f" of radius {world.radius:g} m"}.get(world.arena, "")
    arena = "no arena" if world.arena == "none" else f"{world.arena} arena{size}"
    return (
        f"{scenario.name}: {scenario.agents} agents, {scenario.flight.duration:g} s, model {scenario.model.name}, "
        f"{scenario.body.rule.name}, {arena}"
    )


def format_number(value: float) -> str:
    """Format a number with four digits, as tables show it."""
    return f"{value:.4g}"


def html_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of plain texts in HTML."""
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def default_separation(model: Model, parameters: Any, start_record: start.Parameters, world: arena.Parameters) -> float:
    """Return the default of start.separation, m: 2 s of flight at the preferred speed, at least 3 m.

    In a ball, a box or a periodic world agents may start anywhere: 0. Source: authors' program of
    Vásárhelyi et al. 2018.
    """
    if start_record.kind != "arena" or world.edges == "periodic":
        return 0.0
    return max(3.0, 2.0 * model.speed(parameters))
