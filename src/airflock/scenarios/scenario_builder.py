"""Build a scenario from the document of a file or a dict: check it as a whole and report all errors at once.

The order of the work: settings are applied, parts are found, keys expanded and units converted;
then each section is checked, then sections against each other, groups and faults; at last the notes
on what is valid but probably not meant are collected.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from airflock.core import CLOCKS, Metric, Model, Quantity, declarations, telling_digits
from airflock.parts import METRICS, SETS, TOPOLOGIES
from airflock.parts.steering import STEERING
from airflock.scenarios import formats, schema
from airflock.scenarios.cost import cell_notes, metrics_use_cells, uses_all_cores
from airflock.scenarios.fault_entries import read_fault_entries
from airflock.scenarios.flight_world import scene_errors, scene_notes
from airflock.scenarios.groups import GroupLawReader, group_errors, group_number_errors, read_groups
from airflock.scenarios.named_code import MODELS
from airflock.scenarios.part_kinds import (
    NO_CALLER_PARTS,
    PART_KINDS,
    CallerParts,
    collect_parts,
)
from airflock.scenarios.scenario import Part, Scenario, default_separation
from airflock.scenarios.scenario_checks import (
    body_errors,
    field_file_errors,
    largest_extension,
    metric_errors,
    sensor_errors,
    silence_errors,
    stall_errors,
    timing_errors,
    topology_errors,
    update_order_errors,
    uses_lifting_line,
    wing_errors,
    world_errors,
)
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.scenarios.settings import (
    TOP_LEVEL_KEYS,
    apply_settings,
    expand_short_keys,
    settings_dict,
    with_kinds,
)
from airflock.support import ErrorCollector, ParameterError, ScenarioError, is_file, is_number
from airflock.world import edge_rows, obstacle


def build_scenario(
    document: Mapping[str, Any],
    where: str = "scenario",
    settings: Mapping[str, Any] | None = None,
    *,
    folder: Path | None = None,
    caller_parts: CallerParts = NO_CALLER_PARTS,
    errors: ErrorCollector | None = None,
    trust: bool = False,
    started: bool = False,
) -> Scenario:
    """Build a scenario from a nested dict.

    Parameters
    ----------
    where : name of the scenario, at the beginning of each error
    folder : of the scenario file, where its files are looked for
    caller_parts : rules that fly in place of those that the document names
    errors : errors and notes from the reading of the file
    trust : True if code that the document names may run
    started : True if the flight is in the air, so that its start is not checked

    Raises
    ------
    ScenarioError
        With all errors, one line each.
    """
    # Errors are collected from here to the end of all checks: a person sees all of them at once,
    # and not one a run.
    errors = ErrorCollector() if errors is None else errors
    settings = settings_dict(settings, where)
    # Last words are expanded only after the parts are known, since the parts decide which sections
    # have the word.
    short = {key: value for key, value in settings.items() if "." not in key and key not in TOP_LEVEL_KEYS}
    document = with_kinds(formats.to_current_format(document, where), settings, errors)
    whole = apply_settings(document, {key: value for key, value in settings.items() if key not in short}, errors)
    flown, whole = collect_parts(whole, caller_parts, folder, errors, trust=trust)
    records = ({"model": flown.law.Parameters} if flown.law else {}) | flown.records
    named = expand_short_keys(short, records, errors, TOP_LEVEL_KEYS)
    errors.add(*(f"{key} is given twice, once by its last word" for key in named if key in settings))
    whole = apply_settings(whole, named, errors)
    parts = _read_sections(whole, flown, records, errors)
    errors.add(*_errors_between(parts, flown, started))
    individuals = _read_groups_and_faults(whole, parts, flown, folder, errors, trust)
    published = _published(whole.get("published", {}), errors)
    errors.raise_errors(where)
    assert flown.law is not None, "a missing law is an error"
    parts["scene"] = _find_mesh(parts["scene"], folder)
    rules = {"body": flown.body, "sensors": flown.sensors, "radio": flown.radio, "metrics": flown.metrics}
    rules["topology"] = flown.topology or TOPOLOGIES[parts["topology"].kind]
    parts |= {section: Part(rule, parts[section]) for section, rule in rules.items()}
    scenario = Scenario(
        name=where, model=flown.law, published=published, document=formats.numbered(whole), **parts, **individuals
    )
    # These checks need a whole scenario, so they come second and never beside errors of single
    # keys.
    errors.add(*(_derived_errors(scenario) or scene_errors(scenario, started)))
    errors.raise_errors(where)
    more = (*setting_notes(scenario), *dubious_setting_notes(scenario), *scene_notes(scenario))
    return replace(scenario, notes=(*errors.notes, *more))


MOST_CORNERS = 10_000  # of all polygons of a world: each is looked at in each decision


def _read_sections(
    document: dict[str, Any], flown: CallerParts, records: Mapping[str, type], errors: ErrorCollector
) -> dict[str, Any]:
    """Make the records of a scenario by field, None where one has an error; the document gets declared units."""
    kinds = {kind.section: kind for kind in PART_KINDS if kind is not SETS}
    top = {name: document[name] for name, _, _ in declarations(Flight) if name in document}
    parts: dict[str, Any] = {}
    parts["flight"], top = schema.read_section("", top, Flight, errors)
    document |= top
    for section, record in records.items():
        judged = ("kind",) if section == "model" or (section in kinds and not hasattr(record, "kind")) else ()
        made, table = schema.read_section(
            section, document.get(section, {}), record, errors, judged=judged, kinds=kinds.get(section)
        )
        parts["parameters" if section == "model" else section] = made
        if section in document:
            document[section] = table
    return parts


def _derived_errors(scenario: Scenario) -> list[str]:
    """Return errors of numbers that follow from the scenario and lie outside their ranges."""
    try:
        scenario.resolved_metrics()
    except ParameterError as error:
        lines = [f"metrics.{line.partition('.')[2]}" for line in str(error).splitlines()]
        return [f"{line}; it follows from the other keys unless it is given" for line in lines]
    return []


def _read_groups_and_faults(
    document: Mapping[str, Any],
    parts: Mapping[str, Any],
    flown: CallerParts,
    folder: Path | None,
    errors: ErrorCollector,
    trust: bool,
) -> dict[str, Any]:
    """Read the groups and faults of a scenario."""
    flight, law = parts["flight"], flown.law
    if not {"groups", "faults"} & set(document) or flight is None:
        return {}
    records = {"body": flown.body.Parameters, "sensors": flown.sensors.Parameters}
    named = None
    if law is not None:
        records["model"] = law.Parameters
    if law is not None and parts.get("parameters") is not None:
        kind, world = document.get("model", {}).get("kind"), parts["world"]
        walls = world is not None and (world.arena == "polygon" or bool(world.obstacles))
        named = GroupLawReader(law, kind, parts["parameters"], flown.laws, folder, trust, walls)
    count = int(flight.agents)
    of_groups = ErrorCollector()
    flocks = read_groups(document.get("groups", ()), count, records, of_groups, named)
    of_groups.add(*group_number_errors(flocks, law))
    if law is not None and not of_groups:
        of_groups.add(*group_errors(flocks, parts, law, flown.body, flown.sensors))
    errors.merge(of_groups)
    entries = read_fault_entries(
        document.get("faults", ()), flight, flocks, errors, folder, user_kinds=flown.fault_kinds, trust=trust
    )
    return {"groups": flocks, "faults": entries}


def _find_mesh(scene: Any, folder: Path | None) -> Any:
    """Return the scene; its mesh file may lie beside the scenario file."""
    if scene.kind != "mesh" or folder is None or is_file(scene.file) or not is_file(folder / scene.file):
        return scene
    return replace(scene, file=str(folder / scene.file))


def _errors_between(parts: Mapping[str, Any], flown: CallerParts, started: bool) -> list[str]:
    """Return the errors of sections that are valid alone but do not fit each other."""
    errors: list[str] = []
    flight, law, world = parts["flight"], flown.law, parts["world"]
    if flight is not None and flight.agents != int(flight.agents):
        errors.append(f"agents = {telling_digits(flight.agents, lambda v: v != int(v))} is not a whole number")
    begin: Any = parts["start"] or SECTIONS["start"]()
    ours = parts["topology"] is not None and flown.topology is None
    meets = TOPOLOGIES[parts["topology"].kind] if ours else flown.topology
    errors += topology_errors(meets, world, law)
    errors += field_file_errors(world)
    corners = 0 if world is None else len(world.corners) + sum(map(len, world.obstacles))
    if corners > MOST_CORNERS:  # before anything is made of them
        errors.append(f"world.corners and world.obstacles have {corners} corners, more than {MOST_CORNERS}")
        world = None
    if world is not None:
        separation = parts["start"].separation if parts["start"] is not None else 0.0
        if separation is None and law is not None and parts.get("parameters") is not None:
            separation = default_separation(law, parts["parameters"], begin, world)
        count = int(flight.agents) if flight is not None else 1
        errors += world_errors(world, count, separation or 0.0, begin, started=started)
    if flight is not None and parts["sensors"] is not None and parts["metrics"] is not None:
        errors += timing_errors(flight, parts["sensors"].period, parts["metrics"])
        errors += update_order_errors(
            flight, flown.sensors, parts["sensors"], flown.radio, parts["radio"], parts["body"]
        )
        errors += silence_errors(parts["silence"].rule, flight, law) if parts["silence"] is not None else []
        errors += metric_errors(flown.metrics, parts["metrics"], world)
        errors += wing_errors(parts, law, flown.metrics, started)
    return errors + body_errors(flown.body, parts, law, started) + sensor_errors(flown.sensors, parts)


def _published(table: Any, errors: ErrorCollector) -> dict[str, tuple[float, float | None]]:
    """Read a paper's numbers by name, each a mean with or without standard deviation."""
    published: dict[str, tuple[float, float | None]] = {}
    if not isinstance(table, Mapping):
        errors.add(f"published = {table!r} is not a table of order parameters")
        return published
    for key, entry in table.items():
        if isinstance(entry, Mapping) and set(entry) <= {"mean", "sd"}:
            numbers = [entry.get("mean"), *([entry["sd"]] if "sd" in entry else [])]
        else:
            numbers = list(entry) if isinstance(entry, (list, tuple)) else [entry]
        if 1 <= len(numbers) <= 2 and all(is_number(number) and abs(number) < 1e300 for number in numbers):
            published[key] = (float(numbers[0]), float(numbers[1]) if len(numbers) == 2 else None)
        else:
            errors.add(f"published.{key} = {entry!r}: give a number, [mean, sd], or {{ mean = ..., sd = ... }}")
    return published


FIXED_KEYS = {"agents": "the number of agents", "dt": "the motion step"}  # keys at the top that a flight cannot change


def rebuilt(scenario: Scenario, settings: Mapping[str, Any], *, started: bool = False) -> Scenario:
    """Return the scenario with keys changed, checked as a whole as if it came from a file.

    Parts of the user's own (law, body, sensor, radio, topology and order parameters) stay as they
    are, unless their kind is changed. The start is not checked again for a flight that has
    `started`. Raises ScenarioError with one line per error.
    """
    # Building again from the document runs every check; changing records directly would skip those
    # between sections.
    document = {**scenario.document}
    if scenario.scene.kind == "mesh":  # which was looked for beside the scenario file
        document["scene"] = {**document.get("scene", {}), "file": scenario.scene.file}
    shipped = document.get("model", {}).get("kind") in MODELS
    # The law of the scenario already has drag descent in it, and building it again would add it
    # twice.
    if not shipped and scenario.is_aerodynamic:
        raise ScenarioError(["aero: a law of one's own with drag descent cannot be changed in flight"])
    own = {
        each.section: getattr(scenario, each.section).rule
        for each in PART_KINDS
        if f"{each.section}.kind" not in settings and document.get(each.section, {}).get("kind", "") not in ("", *each)
    }
    kinds = {entry.fault.name: entry.fault for entry in scenario.faults}
    # Files of faults were run when the scenario was loaded; here their kinds are passed by name and
    # no code runs.
    if "faults" not in settings and "faults" in document:
        document["faults"] = named_fault_entries(scenario)
    law = None if shipped or "model.kind" in settings else scenario.model
    caller_parts = CallerParts(law=law, fault_kinds=kinds, laws=user_laws(scenario), **own)
    return build_scenario(document, scenario.name, settings, caller_parts=caller_parts, started=started)


def user_laws(scenario: Scenario) -> dict[str, Model]:
    """Return the laws of groups that are not of the package, by their names in the document."""
    given = zip(scenario.document.get("groups", ()), scenario.groups, strict=True)
    kinds = {table.get("model", {}).get("kind"): group.law for table, group in given}
    return {kind: law[0] for kind, law in kinds.items() if law is not None and kind is not None and kind not in MODELS}


def named_fault_entries(scenario: Scenario) -> list[dict[str, Any]]:
    """Return the entries of [[faults]], with kinds from files of the user's own by their names in the flight."""
    given = scenario.document.get("faults", ())
    return [{**entry, "kind": found.fault.name} for entry, found in zip(given, scenario.faults, strict=True)]


def with_faults_starting(scenario: Scenario, count: int, at: float) -> Scenario:
    """Return the scenario with its last `count` faults beginning at a time, s."""
    entries = named_fault_entries(scenario)
    last = entries[len(entries) - count :]
    if all(entry["at"] == at for entry in last):
        return scenario
    return rebuilt(
        scenario, {"faults": [*entries[: len(entries) - count], *({**entry, "at": at} for entry in last)]}, started=True
    )


def with_settings(scenario: Scenario, settings: Mapping[str, Any]) -> Scenario:
    """Return the scenario with keys like "model.p_rep" changed, for a flight in the air.

    A flight can take all keys of a scenario file but the number of agents, the dimensions, the
    motion step and the start. Raises ScenarioError with one line per error.
    """
    # Compare after building: a setting may say the same in other units, or change nothing.
    new = rebuilt(scenario, settings, started=True)
    errors = [
        f"{key} = {getattr(new.flight, key):g}: {what} cannot change in flight; open another flight"
        for key, what in FIXED_KEYS.items()
        if getattr(new.flight, key) != getattr(scenario.flight, key)
    ]
    if new.dimensions != scenario.dimensions:
        errors.append(f"world.dimensions = {new.dimensions}: cannot change in flight; open another flight")
    if new.start != scenario.start:
        errors.append("start: the flight has started; open another flight")
    if errors:
        raise ScenarioError([f"{scenario.name}: {error}" for error in errors])
    return new


def _after_battery(scenario: Scenario) -> str:
    """Return the end of a note: the fate of a drone whose motors have stopped."""
    if scenario.can_land:
        return ", and on the ground it is absent"
    if scenario.dimensions == 3:
        return ", and it falls without end, and counts; give a ground: world.arena with world.floor, or scene.ground"
    return ", and it stays in the plane and counts"


def _steer_note(scenario: Scenario, law: Model) -> str:
    """Return a note: how a law's command is converted for the body, and the numbers that count."""
    q, body = scenario.resolved_steer(), scenario.body
    gives, taken = next(pair for pair, rule in STEERING.items() if rule is law.steer)
    if taken == "heading":  # such a body flies at a speed of its own, whatever the law wants
        own = getattr(body.numbers, "speed", None)
        how = f"by its direction alone, at the body's speed{'' if own is None else f', body.speed = {own:g} m/s'}"
    else:
        how = f"by [steer]: speed = {q.speed:g} m/s, response = {q.response:g} s"
    return f"the {gives} that model {law.name} commands becomes the {taken} that body {body.rule.name} takes, {how}"


def setting_notes(scenario: Scenario) -> list[str]:
    """Return notes on costs, rounded times and numbers that contradict each other."""
    cells = uses_all_cores(scenario) and metrics_use_cells(scenario)
    notes = pair_notes(scenario.flight, scenario.metrics.numbers, scenario.order_parameters, cells)
    notes += timing_notes(scenario) + wing_notes(scenario) + cell_notes(scenario)
    if nan := scenario.unmeasured & {name for item in scenario.order_parameters for name in item.Sample._fields}:
        notes.append(
            f"metrics.max_e is missing: without an arena the largest extension is unknown, so {', '.join(sorted(nan))} "
            "are nan; give metrics.max_e in m"
        )
    notes += [_steer_note(scenario, law.model) for law in scenario.laws if law.model.steer is not None]
    p = scenario.parameters
    body, duration = scenario.body.numbers, scenario.flight.duration
    if getattr(body, "battery", "endless") == "lithium" and getattr(body, "hover_power", 0.0) > 0.0:
        lasts = body.capacity / body.hover_power
        if lasts < duration:
            notes.append(
                f"body.capacity = {body.capacity:g} J lasts about {lasts:.3g} s of hovering, less than duration = "
                f"{duration:g} s: then its motors stop{_after_battery(scenario)}"
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


APART = 100.0  # factor between the lengths of a law and of its arena above which one of them is hardly meant
ON_EDGE = 1e-3  # m inside an arena up to which a point counts as on its edge: `obstacle` rounds by 1e-6 there
SEES_WALLS = {"ray", "cast"}


def dubious_setting_notes(scenario: Scenario) -> list[str]:
    """Return notes that a person should read before flying a scenario."""
    checks = (_speed_alone, _no_walls, _lengths, _all_met, _unsent, _too_late, _about_an_edge)
    return [note for note in (check(scenario) for check in checks) if note]


def _speed_alone(scenario: Scenario) -> str:
    """Note a changed preferred speed beside gains that are those of the default speed."""
    model, p = scenario.model, scenario.parameters
    numbers = {name: default for name, declared, default in declarations(p) if isinstance(declared, Quantity)}
    changed = [name for name, default in numbers.items() if getattr(p, name) != default]
    # Laws of fewer than four numbers have no set of gains that could belong to one speed.
    if changed != ["v_flock"] or len(numbers) < 4:
        return ""
    hint = f"; airflock presets --for-speed {p.v_flock:.4g} gives a starting set"
    return (
        f"model.v_flock = {p.v_flock:.4g} m/s, but the other {len(numbers) - 1} numbers of {model.name} are its set "
        f"for {numbers['v_flock']:g} m/s{hint if model.name == 'vasarhelyi_2018' else ''}"
    )


def _no_walls(scenario: Scenario) -> str:
    """Note an arena with walls that the law does not read."""
    model, world = scenario.model, scenario.world
    code = getattr(model.decide, "__code__", None)
    # A law may look at walls inside its `decide` as well; a callable without code may do anything
    # and is given the benefit of the doubt.
    names = set(code.co_names) if code is not None else SEES_WALLS
    if world.arena == "none" or world.edges != "open" or model.boundary or model.sight or names & SEES_WALLS:
        return ""
    return (
        f"model {model.name} has no rule for walls (boundary), so agents leave the arena; "
        "world.edges = 'bounce' or 'periodic' keeps them in a square, world.arena = 'none' needs no walls"
    )


def _lengths(scenario: Scenario) -> str:
    """Note a law in millimetres in an arena of kilometres, or the other way round."""
    model, size = scenario.model, largest_extension(scenario.world)
    known = model.interaction_range or model.reach
    if not known or not size:
        return ""
    reach = float(known(scenario.parameters))
    if not 0.0 < reach < float("inf") or 1.0 / APART <= reach / (2.0 * size) <= APART:
        return ""
    return (
        f"agents of {model.name} interact within {reach:.3g} m in an arena {2.0 * size:.3g} m across, a factor of "
        f"{max(reach / (2.0 * size), 2.0 * size / reach):.0f}: the lengths of one of them are probably wrong"
    )


def _about_an_edge(scenario: Scenario) -> str:
    """Note a rotation about a point that the flock cannot circle: a corner of the field, or a point outside of it."""
    world, q = scenario.world, scenario.metrics.numbers
    measured = METRICS["rotation"] in scenario.order_parameters and hasattr(q, "centre_x")
    if world.arena != "polygon" or not measured:
        return ""
    edges, corners = edge_rows(world)[:2]
    if obstacle(q.centre_x, q.centre_y, 0.0, edges, 0, corners).distance < -ON_EDGE:
        return ""
    return (
        f"phi_lap measures the rotation about ({q.centre_x:g}, {q.centre_y:g}) m, which does not lie inside the arena; "
        "set metrics.centre_x and metrics.centre_y to another point"
    )


def _unsent(scenario: Scenario) -> str:
    """Note faults of messages where agents see each other and send none."""
    if scenario.radio.rule.see is None:
        return ""
    unsent = [kind for kind in scenario.fault_kinds if set(kind.rules) <= {"tell"} or kind.name == "radio_silent"]
    if not unsent:
        return ""
    return (
        f"radio.kind = {scenario.radio.rule.name!r}: agents send nothing, so these faults have no effect: "
        + ", ".join(kind.name for kind in unsent)
    )


def _too_late(scenario: Scenario) -> str:
    """Note faults that begin after the flight is over."""
    duration = scenario.flight.duration
    late = [(number, entry.at) for number, entry in enumerate(scenario.faults) if (entry.at or 0.0) >= duration]
    if not late:
        return ""
    named = ", ".join(f"faults[{number}].at = {at:g} s" for number, at in late[:3])
    return f"{named}: the flight is over by then, after duration = {duration:g} s; nothing happens"


def _all_met(scenario: Scenario) -> str:
    """Note numbers of a topology by which everybody is met."""
    if scenario.own_topology is not None:
        return ""
    topology, given = scenario.topology.numbers, scenario.document.get("topology", {})
    numbers = [f"topology.{key}" for key in given if key != "kind"]
    if topology.kind == "range" and numbers:
        return (
            f"topology.kind = 'range' does not read {', '.join(numbers)}: agents meet all that they hear; set a kind, "
            "such as topology.kind = 'nearest'"
        )
    if topology.kind in ("nearest", "strongest") and topology.k >= scenario.agents - 1 > 0:
        return f"topology.k = {topology.k:g}: each of {scenario.agents} agents meets all that it hears"
    return ""


MANY = 5000  # agents; below, a look at all pairs costs less than 10 ms


def pair_notes(flight: Any, q: Any, metrics: tuple[Metric, ...], cells: bool) -> list[str]:
    """Note the cost of order parameters over all pairs in a large flock.

    cells : True if neighbours are found by cells. Then order parameters look at pairs by cells if
            all of a clock are
        `settled`, and at links if they have a largest length of links
    """
    # Metrics of one clock are summed in one pass over pairs: one that needs all pairs makes the
    # others as slow.
    near = {
        clock: cells and all(item.settled for item in metrics if item.pair and item.clock == clock) for clock in CLOCKS
    }
    paired = [
        item.name
        for item in metrics
        if (item.pair and not near[item.clock]) or (item.cluster and not (cells and item.linked_within)) or item.survey
    ]
    if flight.agents < MANY or not paired:
        return []
    seconds = 0.4e-9 * flight.agents**2  # measured: 0.4 ns a pair, one core, in vectors
    return [
        f"metrics.kind = {q.kind!r} looks at all pairs of {flight.agents:g} agents ({', '.join(paired)}), about "
        f"{seconds:.2g} s for each sample; metrics.kind = 'order' does not, a longer metrics.period looks less often"
    ]


def timing_notes(scenario: Scenario) -> list[str]:
    """Note times that are rounded to steps."""
    notes, dt = [], scenario.flight.dt
    times = {
        "duration": scenario.flight.duration,
        "sensors.period": scenario.sensors.period,
        "radio.delay": scenario.radio.delay,
        "body.delay": scenario.body.delay,
        "metrics.period": scenario.metrics.period,
        "metrics.collision_period": scenario.metrics.collision_period or dt,
    }
    for key, value in times.items():
        steps = round(value / dt)
        if abs(steps * dt - value) > 1e-9 * max(value, dt):
            rounded = f"{steps * dt:g}"
            text = telling_digits(value, float(rounded).__ne__)
            notes.append(f"{key} = {text} s is rounded to {rounded} s, {steps} steps of dt = {dt:g} s")
    period, delay = scenario.sensors.period, scenario.radio.delay
    if period > 0.0 and abs(delay / period - round(delay / period)) > 1e-9:
        notes.append(
            f"radio.delay = {delay:g} s is not a multiple of sensors.period = {period:g} s: decisions use "
            "states exactly that old, which lie between two measurements"
        )
    return notes


def wing_notes(scenario: Any) -> list[str]:
    """Note wings that are probably not meant."""
    wing = scenario.wing
    if not uses_lifting_line(scenario.model, scenario.order_parameters):
        return []
    lines = stall_errors(wing) if wing.stall == "noted" else []
    if wing.core == 0.0 and wing.positions == "free" and scenario.model.flock is not None:
        lines.append("wing.core = 0 with wing.positions = 'free': the drag has no lower bound where wings overlap")
    return lines
