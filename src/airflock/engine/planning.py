"""Planning: the plan of a scenario's flight. Its rules are called once on the way, so that their faults appear."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from airflock.core.contract import Metric, Model
from airflock.core.parameters import choices
from airflock.core.radio import FEW
from airflock.core.vocabulary import asks
from airflock.engine.plan import Build, OwnLaw, Plan
from airflock.errors import ScenarioError
from airflock.rules.probe import probe, probe_fault, probe_radio, probe_sensor, probe_topology
from airflock.scenarios.cells import by_cells, has_room, takes_all_cores
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.timing import clock
from airflock.world import arena
from airflock.world.place import obstacle_rule, raised
from airflock.world.surfaces import EDGES, arena_ray, arena_surfaces


def plan_of(
    scenario: Scenario,
    *,
    precision: int = 32,
    record: bool = False,
    metrics: tuple[Metric, ...] | None = None,
    grid: bool | None = None,
    given_start: bool = False,
    absence: bool = False,
) -> Plan:
    """Plan of a scenario's flight; its metrics are those that metrics.kind names, unless given.

    grid        : neighbours by cells or all pairs; by default what is faster, all pairs in a box too small for cells
    given_start : the start is handed over with each flight
    absence     : agents may be absent; where a fault takes agents out they may in any case
    """
    if precision not in (32, 64):
        raise ScenarioError([f"precision = {precision} is neither 32 nor 64"])
    laws = scenario.laws
    for law in laws:
        _probed(law.model, tuple(choices(law.parameters).items()))
    wind, kinds = scenario.wind, scenario.fault_kinds
    for kind in kinds:
        probe_fault(kind)
    if scenario.errs:
        probe_sensor(scenario.sensor)
    probe_radio(scenario.transceiver)
    if scenario.own_topology is not None:
        probe_topology(scenario.own_topology)
    return make_plan(
        scenario.model,
        scenario.parameters,
        scenario.order_parameters if metrics is None else metrics,
        scenario.world,
        scenario.numbers,
        build=Build(
            bits=precision,
            record=record,
            given_start=given_start,
            grid=(takes_all_cores(scenario) if grid is None else grid) and has_room(scenario) and by_cells(scenario),
            absence=absence or any(kind.leaves is not None for kind in kinds),
        ),
        body=scenario.vehicle,
        body_choices=tuple(sorted(choices(scenario.body).items())),
        **_sensing(scenario),
        start=scenario.start.kind,
        scene=scenario.scenic,
        meshed=scenario.scene.kind == "mesh",
        goals=scenario.goals.kind in ("points", "scene"),
        herd=scenario.goals.kind in ("points", "scene") and scenario.goals.role == "herd",
        own=scenario.goals.kind == "own",
        sequential=scenario.flight.update == "sequential",
        delayed=clock(scenario)["delay"] > 0,
        lossy=scenario.radio.loss > 0.0,
        stop=scenario.metrics.stop == "collision",
        wing_choices=_wing_choices(scenario, metrics),
        aero_choices=tuple(sorted(choices(scenario.aero).items())) if scenario.descends else (),
        radio=scenario.transceiver,
        radio_choices=_radio_choices(scenario),
        few=_few_packets(scenario),
        silent=scenario.silence.rule == "stop",
        faults=kinds,
        varied=scenario.varied,
        topology=scenario.meets if any(law.model.neighbour is not None for law in laws) else None,
        laws=tuple(OwnLaw(law.model, constants_of(*law[:2], law.varied), law.varied) for law in laws[1:]),
        grouped=bool(scenario.groups) and any(law.asks_for_groups for law in laws),
        fading=scenario.own_topology is not None or scenario.topology.fading > 0.0,
        windy=wind.kind == "dryden" or any((wind.east, wind.north, wind.up, wind.gust)),
        dryden=wind.kind == "dryden",
    )


def _sensing(scenario: Scenario) -> dict[str, Any]:
    """What a plan says of a sensor: nothing of one that tells the truth, so that all such flights share a driver."""
    if not scenario.errs:
        return {"noisy": False}
    chosen = tuple(sorted(choices(scenario.sensors).items()))
    return {"noisy": True, "sensor": scenario.sensor, "sensor_choices": chosen}


def _few_packets(scenario: Scenario) -> bool:
    """Whether each rate of the radio sends at most FEW packets between two decisions; True where it has none."""
    rates = [getattr(scenario.radio, name) for name in scenario.transceiver.rates]
    period = clock(scenario)["decide_every"] * scenario.flight.dt
    return max(rates, default=0.0) * period <= FEW - 0.1  # rounding may make it one packet more


def _radio_choices(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """Choices of the radio that its rules can read: the kind of those that share a record is none of them."""
    return tuple(sorted((k, v) for k, v in choices(scenario.radio).items() if k != "kind"))


def _wing_choices(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> tuple[tuple[str, str], ...]:
    """Choices of the wing where a rule solves for the whole flock; elsewhere they are nobody's business."""
    found = scenario.order_parameters if metrics is None else metrics
    used = scenario.model.flock is not None or any(
        "wing" in asks(metric.survey, "survey") for metric in found if metric.survey
    )
    return tuple(sorted(choices(scenario.wing).items())) if used else ()


@lru_cache
def _probed(model: Model, chosen: tuple[tuple[str, str], ...]) -> None:
    """Probe a model once per set of choices; its numbers decide nothing about the rules' text."""
    probe(model, model.Parameters(**dict(chosen)))


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


def make_plan(
    model: Model,
    parameters: Any,
    metrics: tuple[Metric, ...],
    world: arena.Parameters,
    numbers: Mapping[str, tuple[str, ...]],
    **options: Any,
) -> Plan:
    """Plan for a model with these parameters (only their choices matter) in this world; numbers: fields by letter."""
    surfaces, beyond = arena_surfaces(world)
    return Plan(
        model=model,
        model_choices=constants_of(model, parameters, options.get("varied", ())),
        numbers=tuple(numbers.items()),
        metrics=metrics,
        surfaces=surfaces,
        excursion=beyond,
        ray=arena_ray(world),
        edge=EDGES[world.edges],
        dimensions=int(world.dimensions),
        obstacles=bool(world.obstacles),
        obstacle=obstacle_rule(world),
        polygon=world.arena == "polygon" and world.edges != "periodic",
        raised=raised(world),
        **options,
    )
