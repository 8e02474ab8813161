"""Making: a scenario from the document of a file or from a dict, checked as a whole, with all its faults at once."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.scenarios import (
    checks,
    fault_keys,
    faulty,
    filled_in,
    formats,
    geometry,
    group_keys,
    group_laws,
    groups,
    places,
    schema,
    short_keys,
    timing,
    units,
    wings,
)
from airflock.scenarios.advice import dubious_setting_notes
from airflock.scenarios.cells import cell_notes, metrics_use_cells, uses_all_cores
from airflock.scenarios.document import TOP_LEVEL_KEYS, settings_dict, with_kinds, with_settings, with_vector_components
from airflock.scenarios.families import METRIC_SET_KIND, NO_CALLER_PARTS, PART_KINDS, TOPOLOGY_KIND, CallerParts
from airflock.scenarios.gathering import ScenarioParts, collect_parts
from airflock.scenarios.ground import field_file_errors
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.support import ParameterError, ScenarioError, is_file


def build_scenario(
    document: Mapping[str, Any],
    where: str = "scenario",
    settings: Mapping[str, Any] | None = None,
    *,
    folder: Path | None = None,
    caller_parts: CallerParts = NO_CALLER_PARTS,
    notes: tuple[str, ...] = (),
    known_errors: tuple[str, ...] = (),
    trust: bool = False,
    started: bool = False,
) -> Scenario:
    """Scenario from a nested dict.

    where : names it in faults; notes : what is known of it already; known_faults : what is wrong already
    given : rules that fly in place of those that the document names
    trust : whether code that the document names may run
    started : whether the flight is in the air, so that nothing is asked about its start
    """
    settings = settings_dict(settings, where)
    document, settings, faults = group_keys.with_group_keys(formats.to_current_format(document, where), settings)
    document, settings, wrong = fault_keys.with_fault_keys(document, settings)
    faults += wrong
    short = {key: value for key, value in settings.items() if "." not in key and key not in TOP_LEVEL_KEYS}
    document, left_out = with_kinds(document, settings)
    whole, unknown = with_settings(document, {key: value for key, value in settings.items() if key not in short})
    flown, whole, more = collect_parts(whole, caller_parts, folder, trust=trust)
    faults = [*known_errors, *unknown, *faults, *more]
    records = ({"model": flown.law.Parameters} if flown.law else {}) | flown.records
    whole, told, more = _written_out(whole, settings, short, records)
    faults += more
    parts, more = _parts(whole, flown)
    faults += more + _faults_between(parts, flown, started)
    individuals, told_of, more = _individuals(whole, parts, flown, caller_parts, folder, trust)
    published, wrong = _published(whole.get("published", {}))
    faults += more + wrong
    if faults or flown.law is None:
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    parts["scene"] = _beside(parts["scene"], folder)
    scenario = Scenario(
        name=where, model=flown.law, vehicle=flown.vehicle, sensor=flown.sensor, transceiver=flown.transceiver,
        measures=flown.measures, own_topology=flown.own_topology, published=published,
        document=whole, **parts, **individuals,
    )  # fmt: skip
    if faults := _derived_faults(scenario) or places.scene_errors(scenario, started):
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    notes = (
        *notes,
        *left_out,
        *told,
        *told_of,
        *_notes(scenario),
        *dubious_setting_notes(scenario),
        *places.scene_notes(scenario),
    )
    return replace(scenario, notes=notes)


def _written_out(
    document: dict[str, Any], settings: Mapping[str, Any], short: Mapping[str, Any], records: Mapping[str, type]
) -> tuple[dict[str, Any], list[str], list[str]]:
    """A document with keys given by their last word, vectors as components, all in SI units; notes; what is wrong."""
    named, told, faults = short_keys.expand_short_keys(short, records, TOP_LEVEL_KEYS)
    faults += [f"{key} is given twice, once by its last word" for key in named if key in settings]
    document, more = with_vector_components(with_settings(document, named)[0], records)
    faults += more
    document, converted, more = units.convert_units(document, {"": Flight, **records})
    return document, [*told, *converted], faults + more


def _derived_faults(scenario: Scenario) -> list[str]:
    """Numbers that follow from the scenario and lie outside their ranges: what loads can fly."""
    try:
        scenario.resolved_metrics()
    except ParameterError as fault:
        told = [f"metrics.{line.partition('.')[2]}" for line in str(fault).splitlines()]
        return [f"{line}; it follows from the other keys unless it is given" for line in told]
    return []


def _individuals(
    document: Mapping[str, Any],
    parts: Mapping[str, Any],
    flown: ScenarioParts,
    given: CallerParts,
    folder: Path | None,
    trust: bool,
) -> tuple[dict[str, Any], list[str], list[str]]:
    """Groups and faults of a scenario, notes, and what is wrong with them."""
    flight, law = parts["flight"], flown.law
    if not {"groups", "faults"} & set(document) or flight is None:
        return {}, [], []
    records = {"body": flown.vehicle.Parameters, "sensors": flown.sensor.Parameters}
    named = None
    if law is not None:
        records["model"] = law.Parameters
    if law is not None and parts.get("parameters") is not None:
        kind, world = document.get("model", {}).get("kind"), parts["world"]
        walls = world is not None and (world.arena == "polygon" or bool(world.obstacles))
        named = group_laws.GroupLawReader(law, kind, parts["parameters"], given.laws, folder, trust, walls)
    count = int(flight.agents)
    flocks, notes, faults = groups.read_groups(document.get("groups", ()), count, records, named)
    faults += groups.group_number_errors(flocks, law)
    if law is not None and not faults:
        faults += group_laws.group_errors(flocks, parts, law, flown.vehicle, flown.sensor)
    sequential = flight.update == "sequential"
    made, told, more = faulty.read_fault_entries(
        document.get("faults", ()), count, flocks, sequential, folder, user_kinds=given.fault_kinds, trust=trust
    )
    return {"groups": flocks, "faults": made}, notes + told, faults + more


def _beside(scene: Any, folder: Path | None) -> Any:
    """A scene whose mesh file is looked for beside the scenario file, if it is not where the name says."""
    if scene.kind != "mesh" or folder is None or is_file(scene.file) or not is_file(folder / scene.file):
        return scene
    return replace(scene, file=str(folder / scene.file))


def _parts(document: Mapping[str, Any], flown: ScenarioParts) -> tuple[dict[str, Any], list[str]]:
    """The records of a scenario by section, None where one is faulty; and all their faults."""
    parts: dict[str, Any] = {}
    faults: list[str] = []
    kinds = {family.section: family.records for family in PART_KINDS if family is not METRIC_SET_KIND}
    for section, record in flown.records.items():
        given = document.get(section, {})
        if section in kinds and isinstance(given, Mapping) and not hasattr(record, "kind"):
            given = {key: value for key, value in given.items() if key != "kind"}
        parts[section], more = schema.read_section(section, given, record, kinds=kinds.get(section))
        faults += more
    top: dict[str, Any] = {key: document[key] for key in ("agents", "duration", "dt", "update") if key in document}
    parts["flight"], more = schema.read_section("", top, Flight)
    faults += more
    table = document.get("model", {})
    if flown.law is not None and isinstance(table, Mapping):
        keys = {key: value for key, value in table.items() if key != "kind"}
        parts["parameters"], more = schema.read_section("model", keys, flown.law.Parameters)
        faults += more
    return parts, faults


def _faults_between(parts: Mapping[str, Any], flown: ScenarioParts, started: bool) -> list[str]:
    """Faults of sections that are sound alone but do not fit each other."""
    faults: list[str] = []
    flight, law, world = parts["flight"], flown.law, parts["world"]
    if flight is not None and flight.agents != int(flight.agents):
        faults.append(f"agents = {flight.agents:g} is not a whole number")
    begin: Any = parts["start"] or SECTIONS["start"]()
    ours = parts["topology"] is not None and flown.own_topology is None
    meets = TOPOLOGY_KIND.shipped[parts["topology"].kind] if ours else flown.own_topology
    faults += checks.topology_errors(meets, world, law)
    faults += field_file_errors(world)
    if world is not None:
        separation = parts["start"].separation if parts["start"] is not None else 0.0
        if separation is None and law is not None and parts.get("parameters") is not None:
            separation = filled_in.default_separation(law, parts["parameters"], begin, world)
        count = int(flight.agents) if flight is not None else 1
        faults += geometry.world_errors(world, count, separation or 0.0, begin, started=started)
    if flight is not None and parts["sensors"] is not None and parts["metrics"] is not None:
        faults += timing.timing_errors(flight, parts["sensors"].period, parts["metrics"])
        faults += checks.update_order_errors(flight, flown.sensor, parts["sensors"], flown.transceiver, parts["radio"])
        faults += checks.silence_errors(parts["silence"].rule, flight, law) if parts["silence"] is not None else []
        faults += checks.metric_errors(flown.measures, parts["metrics"], world)
        faults += wings.wing_errors(parts, law, flown.measures, started)
    return faults + checks.body_errors(flown.vehicle, parts, law, started) + checks.sensor_errors(flown.sensor, parts)


def _published(table: Any) -> tuple[dict[str, tuple[float, float | None]], list[str]]:
    """Numbers of a paper by name: mean, and standard deviation where it is given; and what is none, one line each."""
    if not isinstance(table, Mapping):
        return {}, [f"published = {table!r} is not a table of order parameters"]
    found: dict[str, tuple[float, float | None]] = {}
    faults: list[str] = []
    for key, entry in table.items():
        if isinstance(entry, Mapping) and set(entry) <= {"mean", "sd"}:
            told = [entry.get("mean"), *([entry["sd"]] if "sd" in entry else [])]
        else:
            told = list(entry) if isinstance(entry, (list, tuple)) else [entry]
        if 1 <= len(told) <= 2 and all(map(_finite, told)):
            found[key] = (float(told[0]), float(told[1]) if len(told) == 2 else None)
        else:
            faults.append(f"published.{key} = {entry!r}: give a number, [mean, sd], or {{ mean = ..., sd = ... }}")
    return found, faults


def _finite(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300


def _after(scenario: Scenario) -> str:
    """What becomes of a drone whose motors have stopped."""
    if scenario.can_land:
        return ", and on the ground it is absent"
    if scenario.dimensions == 3:
        return ", and it falls without end, and counts; give a ground: world.arena with world.floor, or scene.ground"
    return ", and it stays in the plane and counts"


def _notes(scenario: Scenario) -> list[str]:
    """What cannot be meant, for a person to read; nothing here stops a flight."""
    cells = uses_all_cores(scenario) and metrics_use_cells(scenario)
    notes = checks.pair_notes(scenario.flight, scenario.metrics, scenario.order_parameters, cells)
    notes += timing.timing_notes(scenario) + wings.wing_notes(scenario) + cell_notes(scenario)
    p = scenario.parameters
    body, duration = scenario.body, scenario.flight.duration
    if getattr(body, "battery", "endless") == "lithium" and getattr(body, "hover_power", 0.0) > 0.0:
        lasts = body.capacity / body.hover_power
        if lasts < duration:
            notes.append(
                f"body.capacity = {body.capacity:g} J lasts about {lasts:.3g} s of hovering, less than duration = "
                f"{duration:g} s: then its motors stop{_after(scenario)}"
            )
    if getattr(p, "r0_frict", None) is not None and p.r0_frict < getattr(p, "r0_rep", 0.0):
        notes.append(
            f"model.r0_frict = {p.r0_frict:g} m lies below model.r0_rep = {p.r0_rep:g} m: agents may not flock"
        )
    if getattr(p, "v_shill", None) is not None and p.v_shill < p.v_flock:
        notes.append(
            f"model.v_shill = {p.v_shill:g} m/s lies below model.v_flock = {p.v_flock:g} m/s: walls may not hold"
        )
    return notes
