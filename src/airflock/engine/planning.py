"""Planning: the plan of a scenario's flight. Its rules are called once on the way, so that their faults appear."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from airflock.core import FEW_PACKETS, Metric, Model, argument_names, choices
from airflock.engine.facts import BuildOptions, GroupLaw
from airflock.engine.plan import Plan
from airflock.engine.text.probe import probe_body, probe_fault, probe_model, probe_radio, probe_sensor, probe_topology
from airflock.scenarios import Scenario, box_fits_cells, metrics_use_cells, step_counts, uses_all_cores, uses_cells
from airflock.support import check_precision
from airflock.world import EDGE_RULES, arena, arena_ray, arena_surfaces, is_off_centre, obstacle_rule


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

    grid        : neighbours by cells or all pairs; by default what is faster, all pairs in a box too small for cells
    near        : where neighbours are found by cells, order parameters go by cells, too; by default in large flocks
    given_start : the start is handed over with each flight
    absence     : agents may be absent; where a fault takes agents out, or empty batteries do, they may in any case
    """
    check_precision(precision)
    key = "plan", precision, record, metrics, grid, near, given_start, absence
    if key not in scenario.engine_cache:
        build = _build(scenario, precision, record, grid, near, given_start, absence)
        scenario.engine_cache[key] = _planned(scenario, metrics, build)
    found: Plan = scenario.engine_cache[key]
    return found


def _build(
    scenario: Scenario,
    precision: int,
    record: bool,
    grid: bool | None,
    near: bool | None,
    given_start: bool,
    absence: bool,
) -> BuildOptions:
    """How the driver of a scenario is built."""
    cells = (uses_all_cores(scenario) if grid is None else grid) and box_fits_cells(scenario) and uses_cells(scenario)
    return BuildOptions(
        bits=precision,
        keep_frames=record,
        given_start=given_start,
        grid=cells,
        near=cells and (metrics_use_cells(scenario) if near is None else near),
        absence=absence or scenario.can_land or any(kind.leaves is not None for kind in scenario.fault_kinds),
    )


def _planned(scenario: Scenario, metrics: tuple[Metric, ...] | None, build: BuildOptions) -> Plan:
    """The plan itself."""
    _probe_rules(scenario)
    laws, kinds = scenario.laws, scenario.fault_kinds
    return make_plan(
        scenario.model,
        scenario.parameters,
        scenario.order_parameters if metrics is None else metrics,
        scenario.world,
        scenario.numbers,
        build=build,
        body=scenario.vehicle,
        body_choices=_chosen(scenario.body),
        sequential=scenario.flight.update == "sequential",
        stop=scenario.metrics.stop == "collision",
        wing_choices=_wing_choices(scenario, metrics),
        aero_choices=_chosen(scenario.aero) if scenario.is_aerodynamic else (),
        faults=kinds,
        varied=scenario.varied,
        laws=tuple(GroupLaw(law.model, constants_of(*law[:2], law.varied), law.varied) for law in laws[1:]),
        uses_groups=bool(scenario.groups) and any(law.uses_groups for law in laws),
        **_sensing(scenario),
        **_hearing(scenario),
        **_surroundings(scenario),
    )


def _probe_rules(scenario: Scenario) -> None:
    """Call every rule of a scenario once, but those of its order parameters. Raises RuleError."""
    for law in scenario.laws:
        _probed(law.model, tuple(choices(law.parameters).items()))
    for kind in scenario.fault_kinds:
        probe_fault(kind)
    probe_body(scenario.vehicle, _chosen(scenario.body))
    if scenario.has_sensor_error:
        probe_sensor(scenario.sensor)
    probe_radio(scenario.transceiver)
    if scenario.own_topology is not None:
        probe_topology(scenario.own_topology)


def _chosen(record: Any) -> tuple[tuple[str, str], ...]:
    """Choices of a record, in the order of their names."""
    return tuple(sorted(choices(record).items()))


def _surroundings(scenario: Scenario) -> dict[str, Any]:
    """What a plan says of start, scene, goals and wind."""
    kind, wind = scenario.goals.kind, scenario.wind
    return {
        "start": scenario.start.kind,
        "scene": scenario.has_scene,
        "has_mesh": scenario.scene.kind == "mesh",
        "goals": kind in ("points", "scene"),
        "is_shepherd": kind in ("points", "scene") and scenario.goals.role == "herd",
        "own": kind == "own",
        "windy": wind.kind == "dryden" or any((wind.east, wind.north, wind.up, wind.gust)),
        "dryden": wind.kind == "dryden",
    }


def _hearing(scenario: Scenario) -> dict[str, Any]:
    """What a plan says of the radio, and of whom agents meet of those whom they hear."""
    return {
        "radio": scenario.transceiver,
        # the kind of radios that share a record is none of the choices that rules can read
        "radio_choices": tuple(pair for pair in _chosen(scenario.radio) if pair[0] != "kind"),
        "few": _few_packets(scenario),
        "delayed": step_counts(scenario)["delay"] > 0,
        "lossy": scenario.radio.loss > 0.0,
        "stops_for_lost": scenario.silence.rule == "stop",
        "topology": scenario.topology_rule if any(law.model.neighbour is not None for law in scenario.laws) else None,
        "fading": scenario.own_topology is not None or scenario.topology.fading > 0.0,
    }


def _sensing(scenario: Scenario) -> dict[str, Any]:
    """What a plan says of a sensor: nothing of one that tells the truth, so that all such flights share a driver."""
    if not scenario.has_sensor_error:
        return {"has_sensor_error": False}
    return {"has_sensor_error": True, "sensor": scenario.sensor, "sensor_choices": _chosen(scenario.sensors)}


def _few_packets(scenario: Scenario) -> bool:
    """Whether each rate of the radio sends at most FEW packets between two decisions; True where it has none."""
    rates = [getattr(scenario.radio, name) for name in scenario.transceiver.rates]
    period = step_counts(scenario)["decide_every"] * scenario.flight.dt
    return max(rates, default=0.0) * period <= FEW_PACKETS - 0.1  # rounding may make it one packet more


def _wing_choices(scenario: Scenario, metrics: tuple[Metric, ...] | None) -> tuple[tuple[str, str], ...]:
    """Choices of the wing where a rule solves for the whole flock; elsewhere they are nobody's business."""
    found = scenario.order_parameters if metrics is None else metrics
    used = scenario.model.flock is not None or any(
        "wing" in argument_names(metric.survey, "survey") for metric in found if metric.survey
    )
    return _chosen(scenario.wing) if used else ()


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
        edge_rule=EDGE_RULES[world.edges],
        dimensions=int(world.dimensions),
        obstacles=bool(world.obstacles),
        obstacle=obstacle_rule(world),
        polygonal=world.arena == "polygon" and world.edges != "periodic",
        off_centre_height=is_off_centre(world),
        **options,
    )
