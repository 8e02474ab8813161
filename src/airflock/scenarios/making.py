"""Making: a scenario from the document of a file or from a dict, checked as a whole, with all its faults at once."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.body.registry import BODIES
from airflock.core.contract import Body, MetricSet, Model
from airflock.core.fault import Fault
from airflock.core.parameters import declarations, number_names
from airflock.core.radio import Packets, Radio
from airflock.core.sensor import Sensor
from airflock.core.topology import Topology
from airflock.core.vectors import expanded, overruled
from airflock.doors import is_file
from airflock.errors import AirflockError, ParameterError, ScenarioError
from airflock.radios.registry import RADIOS
from airflock.radios.registry import USUAL as USUAL_RADIO
from airflock.scenarios import (
    checks,
    faulty,
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
from airflock.scenarios.advice import advice
from airflock.scenarios.cells import measured_by_cells, takes_all_cores
from airflock.scenarios.ground import file_faults
from airflock.scenarios.laws import find_model
from airflock.scenarios.scenario import Scenario, start_separation
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.sensors.registry import SENSORS
from airflock.sensors.registry import USUAL as USUAL_SENSOR
from airflock.spelling import meant
from airflock.topology.registry import TOPOLOGIES

TOP = ("model", *SECTIONS, "groups", "faults", "agents", "duration", "dt", "update", "published", "title")
FAMILIES: Mapping[str, Mapping[str, Any]] = {"body": BODIES, "sensors": SENSORS, "radio": RADIOS}
OURS = tuple(TOPOLOGIES)
KINDS = {  # usual kind; keys of every kind
    "body": ("multirotor", ()), "sensors": (USUAL_SENSOR, ("period",)), "radio": (USUAL_RADIO, number_names(Packets)),
    "topology": ("range", ()),
}  # fmt: skip


def make(
    document: Mapping[str, Any],
    where: str = "scenario",
    settings: Mapping[str, Any] | None = None,
    *,
    folder: Path | None = None,
    law: Model | None = None,
    measures: MetricSet | None = None,
    vehicle: Body | None = None,
    sensor: Sensor | None = None,
    transceiver: Radio | None = None,
    own_topology: Topology | None = None,
    kinds: Mapping[str, Fault] | None = None,
    laws: Mapping[str, Model] | None = None,
    notes: tuple[str, ...] = (),
    trust: bool = False,
) -> Scenario:
    """Scenario from a nested dict.

    where : names it in faults; notes : what is known of it already
    law, measures, vehicle, sensor, transceiver : a model, a metric set, a body, a sensor, a radio given directly
    own_topology : a topology given directly
    kinds : kinds of fault given directly, by name; laws : laws that groups may name
    trust : whether code that the document names may run
    """
    document = formats.current(document, where)
    document, settings, in_groups = group_keys.with_groups(document, settings or {})
    short = {key: value for key, value in (settings or {}).items() if "." not in key and key not in TOP}
    document, left_out = _with_kinds(document, settings or {})
    merged, faults = _merged(document, {key: value for key, value in (settings or {}).items() if key not in short})
    table, more = _model_table(merged)
    faults += in_groups + more
    found = law
    if found is None and not more:
        try:
            found = find_model(table.get("kind"), folder, trust=trust)
        except AirflockError as fault:
            faults += str(fault).splitlines()
    if found is not None and "aero" in merged:
        more = wings.descent_faults(found)
        faults += more
        found = found if more else wings.descending(found)
    if vehicle is None:
        vehicle, more = checks.body_of(merged.get("body", {}), found, folder, trust=trust)
    else:
        more = checks.carries(vehicle, found, vehicle.name)
    faults += more
    merged = _understood(merged, "body", vehicle.Parameters) if more else merged
    if measures is None:
        measures, more = checks.metrics_set(merged.get("metrics", {}), folder, trust=trust)
        faults += more
    if sensor is None:
        sensor, more = checks.sensor_of(merged.get("sensors", {}), folder, trust=trust)
        faults += more
        merged = _understood(merged, "sensors", sensor.Parameters) if more else merged
    if transceiver is None:
        transceiver, more = checks.radio_of(merged.get("radio", {}), folder, trust=trust)
        faults += more
        merged = _understood(merged, "radio", transceiver.Parameters) if more else merged
    if own_topology is None:
        own_topology, more = checks.topology_of(merged.get("topology", {}), folder, trust=trust)
        faults += more
        merged = {**merged, "topology": {}} if more else merged
    own = SECTIONS | {"body": vehicle.Parameters, "sensors": sensor.Parameters, "metrics": measures.Parameters}
    own |= {"radio": transceiver.Parameters}
    own |= {"topology": own_topology.Parameters} if own_topology and own_topology.Parameters else {}
    records = ({"model": found.Parameters} if found else {}) | own
    named, told, more = short_keys.whole_keys(short, records, TOP)
    faults += more + [f"{key} is given twice, once by its last word" for key in named if key in (settings or {})]
    merged, more = _components(_merged(merged, named)[0], records)
    faults += more
    merged, converted, more = units.converted(merged, {"": Flight, **records})
    faults += more
    parts, more = _parts(merged, merged.get("model", {}), found, own)
    faults += more + _faults_between(parts, found, sensor, transceiver, measures, own_topology)
    faults += checks.body_faults(vehicle, parts, found) + checks.sensor_faults(sensor, parts)
    single, told_of, more = _individuals(merged, parts, found, (vehicle, sensor), folder, kinds, laws, trust)
    faults += more
    if faults or found is None:
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    published = _published(merged.get("published", {}))
    parts["scene"] = _beside(parts["scene"], folder)
    scenario = Scenario(
        name=where, model=found, vehicle=vehicle, sensor=sensor, transceiver=transceiver, measures=measures,
        own_topology=own_topology, published=published, document=merged, **parts, **single,
    )  # fmt: skip
    faults = _derived_faults(scenario) or places.place_faults(scenario)
    if faults:
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    notes = (*notes, *left_out, *told, *converted, *told_of, *_notes(scenario), *advice(scenario))
    notes = (*notes, *places.place_notes(scenario))
    return replace(scenario, notes=notes)


def _derived_faults(scenario: Scenario) -> list[str]:
    """Numbers that follow from the scenario and lie outside their ranges: what loads can fly."""
    try:
        scenario.measured_by()
    except ParameterError as fault:
        told = [f"metrics.{line.partition('.')[2]}" for line in str(fault).splitlines()]
        return [f"{line}; it follows from the other keys unless it is given" for line in told]
    return []


def _individuals(
    merged: Mapping[str, Any], parts: Mapping[str, Any], found: Model | None, carried: tuple[Body, Sensor],
    folder: Path | None, kinds: Mapping[str, Fault] | None, laws: Mapping[str, Model] | None, trust: bool,
) -> tuple[dict[str, Any], list[str], list[str]]:  # fmt: skip
    """Groups and faults of a scenario, notes, and what is wrong with them."""
    if not {"groups", "faults"} & set(merged) or parts["flight"] is None:
        return {}, [], []
    count, flight = int(parts["flight"].agents), parts["flight"]
    vehicle, sensor = carried
    records = {"body": vehicle.Parameters, "sensors": sensor.Parameters} | (
        {"model": found.Parameters} if found else {}
    )
    named = None
    if found is not None and parts.get("parameters") is not None:
        kind, world = merged.get("model", {}).get("kind"), parts["world"]
        walls = world is not None and (world.arena == "polygon" or bool(world.obstacles))
        named = group_laws.Laws(found, kind, parts["parameters"], laws or {}, folder, trust, walls)
    flocks, notes, faults = groups.groups_of(merged.get("groups", ()), count, records, named)
    faults += groups.group_faults(flocks, found)
    if found is not None and not faults:
        faults += group_laws.misfits(flocks, parts, found, vehicle, sensor)
    sequential = flight.update == "sequential"
    made, told, more = faulty.entries(
        merged.get("faults", ()), count, flocks, sequential, folder, own=kinds, trust=trust
    )
    return {"groups": flocks, "faults": made}, notes + told, faults + more


def _beside(scene: Any, folder: Path | None) -> Any:
    """A scene whose mesh file is looked for beside the scenario file, if it is not where the name says."""
    if scene.kind != "mesh" or folder is None or is_file(scene.file) or not is_file(folder / scene.file):
        return scene
    return replace(scene, file=str(folder / scene.file))


def _with_kinds(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """A document without the numbers of its body, sensor or radio, where settings name another kind; notes of it."""
    notes: list[str] = []
    for section, (usual, shared) in KINDS.items():
        given, key = document.get(section, {}), f"{section}.kind"
        if key not in settings or not isinstance(given, Mapping) or settings[key] == given.get("kind"):
            continue
        if section == "radio" and _share_a_record(settings[key], given.get("kind", usual)):
            continue
        if section == "topology" and settings[key] in OURS and given.get("kind", usual) in OURS:
            continue
        if set(given) - {"kind", *shared}:
            kind = given.get("kind", usual)
            notes.append(f"{key} = {settings[key]!r}: the numbers of the file's {kind} are left out")
        document = {**document, section: {name: given[name] for name in shared if name in given}}
    return document, tuple(notes)


def _share_a_record(one: Any, other: Any) -> bool:
    """Whether two radios have the same numbers, so that a scenario may change from one to the other by the kind."""
    known = [RADIOS.get(kind) if isinstance(kind, str) else None for kind in (one, other)]
    return all(known) and len({radio.Parameters for radio in known if radio}) == 1


def _merged(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """A copy of a document with keys like "model.p_rep" set, and the keys that nobody knows."""
    merged: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in document.items()}
    faults: list[str] = []
    for key, value in settings.items():
        section, _, name = key.partition(".")
        if name and not isinstance(merged.setdefault(section, {}), dict):
            faults.append(f"{key}: unknown key")
        elif name:
            merged[section] = {**overruled(merged[section], {name: value}), name: value}
        else:
            merged[section] = value
    for key in merged:
        if key not in TOP:
            faults.append(f"{key}: unknown key; {meant(key, TOP, 'known: ' + ', '.join(TOP))}")
    return merged, faults


def _understood(merged: dict[str, Any], section: str, record: type) -> dict[str, Any]:
    """A document without the numbers of a section whose kind cannot be had; its stand-in judges those that it knows."""
    known = {name for name, _, _ in declarations(record)} | {"kind"}
    given = merged.get(section, {})
    if not isinstance(given, Mapping):
        return merged
    return {**merged, section: {key: value for key, value in given.items() if key in known}}


def _components(merged: dict[str, Any], records: Mapping[str, type]) -> tuple[dict[str, Any], list[str]]:
    """A document in which each vector is its components, and what is wrong with those that are given whole."""
    faults: list[str] = []
    for section, record in records.items():
        if isinstance(given := merged.get(section), Mapping) and getattr(record, "VECTORS", None):
            merged[section], more = expanded(section, given, record)
            faults += more
    return merged, faults


def _model_table(merged: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[str]]:
    table = merged.get("model", {})
    if isinstance(table, Mapping):
        return table, []
    return {}, [f"model = {table!r} is not a table; write model.kind = {table!r}"]


def _parts(
    merged: Mapping[str, Any], table: Any, found: Model | None, records: Mapping[str, type]
) -> tuple[dict[str, Any], list[str]]:
    """The records of a scenario by section, None where one is faulty; and all their faults."""
    parts: dict[str, Any] = {}
    faults: list[str] = []
    for section, record in records.items():
        given = merged.get(section, {})
        if section in KINDS and isinstance(given, Mapping) and not hasattr(record, "kind"):
            given = {key: value for key, value in given.items() if key != "kind"}
        kinds = {name: member.Parameters for name, member in FAMILIES.get(section, {}).items()}
        parts[section], more = schema.check(section, given, record, kinds=kinds)
        faults += more
    top: dict[str, Any] = {key: merged[key] for key in ("agents", "duration", "dt", "update") if key in merged}
    parts["flight"], more = schema.check("", top, Flight)
    faults += more
    if found is not None and isinstance(table, Mapping):
        keys = {key: value for key, value in table.items() if key != "kind"}
        parts["parameters"], more = schema.check("model", keys, found.Parameters)
        faults += more
    return parts, faults


def _faults_between(
    parts: Mapping[str, Any], found: Model | None, sensor: Sensor, transceiver: Radio, measures: MetricSet,
    own_topology: Topology | None,
) -> list[str]:  # fmt: skip
    """Faults of sections that are sound alone but do not fit each other."""
    faults: list[str] = []
    flight = parts["flight"]
    if flight is not None and flight.agents != int(flight.agents):
        faults.append(f"agents = {flight.agents:g} is not a whole number")
    begin: Any = parts["start"] or SECTIONS["start"]()
    meets = own_topology or (TOPOLOGIES[parts["topology"].kind] if parts["topology"] is not None else None)
    faults += checks.topology_faults(meets, parts["world"], found)
    faults += file_faults(parts["world"])
    if parts["world"] is not None:
        separation = parts["start"].separation if parts["start"] is not None else 0.0
        if separation is None and found is not None and parts.get("parameters") is not None:
            separation = start_separation(found, parts["parameters"], begin, parts["world"])
        count = int(flight.agents) if flight is not None else 1
        faults += geometry.faults(parts["world"], count, separation or 0.0, begin)
    if flight is not None and parts["sensors"] is not None and parts["metrics"] is not None:
        faults += timing.faults(flight, parts["sensors"].period, parts["metrics"])
        faults += checks.order_faults(flight, sensor, parts["sensors"], transceiver, parts["radio"])
        faults += checks.silence_faults(parts["silence"].rule, flight, found) if parts["silence"] is not None else []
        faults += checks.metric_faults(measures, parts["metrics"], parts["world"])
        faults += wings.faults(parts, found, measures)
    return faults


def _published(table: Any) -> dict[str, tuple[float, float | None]]:
    """Numbers of a paper by name: mean, and standard deviation where it is given; what is no number is left out."""

    def number(value: Any) -> bool:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300

    found: dict[str, tuple[float, float | None]] = {}
    for key, entry in (table if isinstance(table, Mapping) else {}).items():
        if isinstance(entry, Mapping) and number(entry.get("mean")):
            spread = entry.get("sd")
            found[key] = (float(entry["mean"]), float(spread or 0.0) if number(spread) else None)
    return found


def _notes(scenario: Scenario) -> list[str]:
    """What cannot be meant, for a person to read; nothing here stops a flight."""
    cells = takes_all_cores(scenario) and measured_by_cells(scenario)
    notes = checks.pair_notes(scenario.flight, scenario.metrics, scenario.order_parameters, cells)
    notes += timing.notes(scenario) + wings.notes(scenario)
    p = scenario.parameters
    if getattr(p, "r0_frict", None) is not None and p.r0_frict < getattr(p, "r0_rep", 0.0):
        notes.append(
            f"model.r0_frict = {p.r0_frict:g} m lies below model.r0_rep = {p.r0_rep:g} m: agents may not flock"
        )
    if getattr(p, "v_shill", None) is not None and p.v_shill < p.v_flock:
        notes.append(
            f"model.v_shill = {p.v_shill:g} m/s lies below model.v_flock = {p.v_flock:g} m/s: walls may not hold"
        )
    return notes
