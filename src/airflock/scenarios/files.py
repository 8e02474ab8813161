"""Scenario files: TOML with units and sources, presets by name, and keys changed from outside."""

import os
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from importlib import import_module, resources
from pathlib import Path
from typing import Any

from airflock.core.contract import Body, MetricSet, Model, model
from airflock.core.contract import body as gathered_body
from airflock.core.fault import Fault, fault
from airflock.core.sensor import Sensor
from airflock.core.sensor import sensor as gathered_sensor
from airflock.doors import from_outside, is_file, read_toml
from airflock.errors import AirflockError, ScenarioError
from airflock.metrics.registry import as_set
from airflock.scenarios import checks, faulty, formats, geometry, groups, places, schema, short_keys, units, wings
from airflock.scenarios.advice import advice
from airflock.scenarios.extends import extended
from airflock.scenarios.ground import file_faults, with_ground
from airflock.scenarios.own_code import own_code
from airflock.scenarios.scenario import Scenario, start_separation
from airflock.scenarios.sections import SECTIONS, Flight
from airflock.sensors.registry import USUAL as USUAL_SENSOR

MODELS = (
    "vasarhelyi_2018", "viragh_2014", "reynolds_1987", "vicsek_1995", "couzin_2002", "kidger", "formation",
    "dimock_2003",
)  # fmt: skip
TOP = ("model", *SECTIONS, "groups", "faults", "agents", "duration", "dt", "update", "published", "title")


def presets() -> dict[str, Path]:
    """Name and file of every preset that comes with the package.

    Returns
    -------
    dict
        Name such as "vasarhelyi_2018/4ms" → path of its file.

    Examples
    --------
    >>> import airflock
    >>> "vicsek_1995/ordered" in airflock.presets()
    True
    """
    root = Path(str(resources.files("airflock"))) / "presets"
    return {str(path.relative_to(root).with_suffix("")): path for path in sorted(root.rglob("*.toml"))}


def load(
    name: str | os.PathLike[str],
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    *,
    metrics: Any = None,
    body: Any = None,
    sensor: Any = None,
    faults: Any = None,
    trust: bool = False,
) -> Scenario:
    """Scenario from a preset's name or a file.

    Parameters
    ----------
    name : str or path
        A preset's name or a scenario file (TOML).
    settings : mapping, optional
        Keys with the values that replace the file's: whole keys such as "model.p_rep", or their last word where only
        one section has it. A value may carry a unit: {"delay": "400 ms"}. What is read otherwise than it is written
        stands in the scenario's `notes`.
    law : optional
        A flocking law of your own (a module, a class, a mapping such as globals(), or a Model) flies instead of the
        file's, or one by its name or its file. Its parameters start from their defaults.
    metrics : optional
        Order parameters of your own measure the flight: a `MetricSet`, a metric, a list of metrics and of names of
        ours, or a namespace such as globals(); likewise the name of a set or a file.
    body : optional
        A body of your own carries the agents: a `Body`, a namespace, or a name or file.
    sensor : optional
        A sensor of your own by which agents know themselves: a `Sensor`, a namespace, or a name or file.
    faults : optional
        Kinds of fault of your own, which entries of [[faults]] may name: a namespace such as a module, what
        `airflock.fault` gives, or a list of these.
    trust : bool
        Whether code that the file names, or a file that it extends, may run: a law, a body, a sensor, order
        parameters.

    Returns
    -------
    Scenario
        Everything about a flight but the seed, in SI units.

    Raises
    ------
    ScenarioError
        With one line per fault: file, key, value, unit, allowed range, and the nearest right key.

    Examples
    --------
    >>> import airflock
    >>> scenario = airflock.load("vasarhelyi_2018/4ms", {"delay": "400 ms", "agents": 30})
    >>> scenario.radio.delay, scenario.agents
    (0.4, 30)
    >>> airflock.load("vasarhelyi_2018/4ms", {"radio.delay": 60.0})
    Traceback (most recent call last):
    airflock.errors.ScenarioError: vasarhelyi_2018/4ms: radio.delay = 60 s lies outside [0, 30] s
    """
    text = str(name)
    where = text if text in presets() else str(Path(text))
    with from_outside(where):
        document, folder = _read(where, None)
        document, base = extended(document, where, folder, _read)
        document, own = _given(document, metrics, body, sensor)
        own["kinds"] = _kinds(faults)
        own["notes"] = (f"extends {base}: what is not given here is taken from there",) if base else ()
        document, settings, told = with_ground(document, settings or {}, folder)
        own["notes"] += told
        if law is None:
            return make(document, where, settings, folder=folder, trust=trust, **own)
        flown = given_law(law)
        kind = str(Path(law).absolute()) if str(law).endswith(".py") else flown.name
        document = {**document, "model": {"kind": kind}, "published": {}}
        return make(document, where, settings, folder=folder, law=flown, trust=trust, **own)


def _read(name: str, folder: Path | None) -> tuple[dict[str, Any], Path]:
    """Document of a preset or of a file, looked for in a folder, in today's format, and the folder that it lies in."""
    known = presets()
    path = known.get(name) or (Path(name) if folder is None else folder / name)
    if not is_file(path):
        near = get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]}?" if near else "; airflock presets lists the presets"
        raise ScenarioError([f"{name}: no such file or preset{hint}"])
    with from_outside(name):
        document = read_toml(path)
    if tells_of_study(document) and not {"model", "extends"} & set(document):
        raise ScenarioError([f"{name}: is a study, not a scenario; check it with airflock validate, or evolve it"])
    return {**formats.current(document, name), formats.KEY: formats.FORMAT}, path.parent


def _given(document: Mapping[str, Any], metrics: Any, body: Any, sensor: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """A document that names the metrics, the body and the sensor which the caller gives, and these for `make`.

    Giving them is consent to run them. Raises ScenarioError.
    """
    document = dict(document)
    own: dict[str, Any] = {}
    faults: list[str] = []
    if isinstance(metrics, (str, os.PathLike)):
        own["measures"], faults = checks.metrics_set({"kind": str(metrics)}, trust=True)
    elif metrics is not None:
        own["measures"] = as_set(metrics)
    if metrics is not None:
        document["metrics"] = {**document.get("metrics", {}), "kind": own["measures"].name}
    if isinstance(body, (str, os.PathLike)):
        own["vehicle"], more = checks.body_of({"kind": str(body)}, None, trust=True)
        faults = [*faults, *more]
    elif body is not None:
        own["vehicle"] = body if isinstance(body, Body) else gathered_body(body)
    if body is not None:
        document["body"] = {"kind": own["vehicle"].name}
    if isinstance(sensor, (str, os.PathLike)):
        own["sensor"], more = checks.sensor_of({"kind": str(sensor)}, trust=True)
        faults = [*faults, *more]
    elif sensor is not None:
        own["sensor"] = sensor if isinstance(sensor, Sensor) else gathered_sensor(sensor)
    if sensor is not None:
        period = {key: value for key, value in document.get("sensors", {}).items() if key == "period"}
        document["sensors"] = {**period, "kind": own["sensor"].name}
    if faults:
        raise ScenarioError(faults)
    return document, own


def given_law(law: Any) -> Model:
    """Model of a law that the caller gives: which is consent to run it."""
    if isinstance(law, Model):
        return law
    if isinstance(law, (str, os.PathLike)):
        return find_model(str(law), told="law", trust=True)
    if isinstance(law, Mapping) or hasattr(law, "__dict__"):
        return model(law)
    raise ScenarioError(
        [f"law = {law!r} is not a law; give a module, a class, a mapping, or one of {', '.join(MODELS)}"]
    )


def loaded(what: Any) -> Scenario:
    """A scenario, or the one that a name stands for."""
    if isinstance(what, Scenario):
        return what
    if isinstance(what, (str, os.PathLike)):
        return load(what)
    raise ScenarioError(
        [f"{type(what).__name__} is not a scenario; give a Scenario, a preset's name or a scenario file"]
    )


def tells_of_study(document: Mapping[str, Any]) -> bool:
    """Whether a document has a table or key that only studies have."""
    return bool({"space", "scenario", "objective", "search"} & set(document))


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
    kinds: Mapping[str, Fault] | None = None,
    notes: tuple[str, ...] = (),
    trust: bool = False,
) -> Scenario:
    """Scenario from a nested dict.

    where : names it in faults; notes : what is known of it already
    law, measures, vehicle, sensor : a model, a metric set, a body, a sensor given directly, not by name
    kinds : kinds of fault given directly, by name
    trust : whether code that the document names may run
    """
    document = formats.current(document, where)
    short = {key: value for key, value in (settings or {}).items() if "." not in key and key not in TOP}
    document, left_out = _with_kinds(document, settings or {})
    merged, faults = _merged(document, {key: value for key, value in (settings or {}).items() if key not in short})
    table, more = _model_table(merged)
    faults += more
    found = law
    if found is None:
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
    if measures is None:
        measures, more = checks.metrics_set(merged.get("metrics", {}), folder, trust=trust)
        faults += more
    if sensor is None:
        sensor, more = checks.sensor_of(merged.get("sensors", {}), folder, trust=trust)
        faults += more
    own = SECTIONS | {"body": vehicle.Parameters, "sensors": sensor.Parameters, "metrics": measures.Parameters}
    records = ({"model": found.Parameters} if found else {}) | own
    named, told, more = short_keys.whole_keys(short, records, TOP)
    faults += more + [f"{key} is given twice, once by its last word" for key in named if key in (settings or {})]
    merged, converted, more = units.converted(_merged(merged, named)[0], {"": Flight, **records})
    faults += more
    parts, more = _parts(merged, merged.get("model", {}), found, own)
    faults += more + _faults_between(parts, found, sensor, measures)
    faults += checks.body_faults(vehicle, parts, found) + checks.sensor_faults(sensor, parts)
    single, told_of, more = _individuals(merged, parts, found, vehicle, folder, kinds, trust)
    faults += more
    if faults or found is None:
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    published = _published(merged.get("published", {}))
    parts["scene"] = _beside(parts["scene"], folder)
    scenario = Scenario(
        name=where, model=found, vehicle=vehicle, sensor=sensor, measures=measures, published=published,
        document=merged, **parts, **single,
    )  # fmt: skip
    faults = places.place_faults(scenario)
    if faults:
        raise ScenarioError([f"{where}: {fault}" for fault in faults])
    notes = (*notes, *left_out, *told, *converted, *told_of, *_notes(scenario), *advice(scenario))
    notes = (*notes, *places.place_notes(scenario))
    return replace(scenario, notes=notes)


def _individuals(
    merged: Mapping[str, Any], parts: Mapping[str, Any], found: Model | None, vehicle: Body, folder: Path | None,
    kinds: Mapping[str, Fault] | None, trust: bool,
) -> tuple[dict[str, Any], list[str], list[str]]:  # fmt: skip
    """Groups and faults of a scenario, notes, and what is wrong with them."""
    if not {"groups", "faults"} & set(merged) or parts["flight"] is None:
        return {}, [], []
    count, flight = int(parts["flight"].agents), parts["flight"]
    records = {"body": vehicle.Parameters} | ({"model": found.Parameters} if found else {})
    flocks, notes, faults = groups.groups_of(merged.get("groups", ()), count, records)
    faults += groups.group_faults(flocks, found)
    sequential = flight.update == "sequential"
    made, told, more = faulty.entries(
        merged.get("faults", ()), count, flocks, sequential, folder, own=kinds, trust=trust
    )
    return {"groups": flocks, "faults": made}, notes + told, faults + more


def _kinds(given: Any) -> dict[str, Fault]:
    """Kinds of fault that the caller gives, by name."""
    if given is None:
        return {}
    several = given if isinstance(given, (list, tuple)) else [given]
    found = [kind if isinstance(kind, Fault) else fault(kind) for kind in several]
    return {kind.name: kind for kind in found}


def _beside(scene: Any, folder: Path | None) -> Any:
    """A scene whose mesh file is looked for beside the scenario file, if it is not where the name says."""
    if scene.kind != "mesh" or folder is None or is_file(scene.file) or not is_file(folder / scene.file):
        return scene
    return replace(scene, file=str(folder / scene.file))


KINDS = {"body": ("multirotor", ()), "sensors": (USUAL_SENSOR, ("period",))}  # usual kind; keys of every kind


def _with_kinds(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """A document without the numbers of its body or sensor, where the settings name another kind; and notes of it."""
    notes: list[str] = []
    for section, (usual, shared) in KINDS.items():
        given, key = document.get(section, {}), f"{section}.kind"
        if key not in settings or not isinstance(given, Mapping) or settings[key] == given.get("kind"):
            continue
        if set(given) - {"kind", *shared}:
            kind = given.get("kind", usual)
            notes.append(f"{key} = {settings[key]!r}: the numbers of the file's {kind} are left out")
        document = {**document, section: {name: given[name] for name in shared if name in given}}
    return document, tuple(notes)


def _merged(document: Mapping[str, Any], settings: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """A copy of a document with keys like "model.p_rep" set, and the keys that nobody knows."""
    merged: dict[str, Any] = {k: dict(v) if isinstance(v, Mapping) else v for k, v in document.items()}
    faults: list[str] = []
    for key, value in settings.items():
        section, _, name = key.partition(".")
        if name and not isinstance(merged.setdefault(section, {}), dict):
            faults.append(f"{key}: unknown key")
        elif name:
            merged[section][name] = value
        else:
            merged[section] = value
    for key in merged:
        if key not in TOP:
            near = get_close_matches(key, TOP, n=1, cutoff=0.5)
            faults.append(f"{key}: unknown key; {f'did you mean {near[0]}?' if near else 'known: ' + ', '.join(TOP)}")
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
        if section in KINDS and isinstance(given, Mapping):
            given = {key: value for key, value in given.items() if key != "kind"}
        parts[section], more = schema.check(section, given, record)
        faults += more
    top: dict[str, Any] = {key: merged[key] for key in ("agents", "duration", "dt", "update") if key in merged}
    parts["flight"], more = schema.check("", top, Flight)
    faults += more
    if found is not None and isinstance(table, Mapping):
        keys = {key: value for key, value in table.items() if key != "kind"}
        parts["parameters"], more = schema.check("model", keys, found.Parameters)
        faults += more
    return parts, faults


def _faults_between(parts: Mapping[str, Any], found: Model | None, sensor: Sensor, measures: MetricSet) -> list[str]:
    """Faults of sections that are sound alone but do not fit each other."""
    faults: list[str] = []
    flight = parts["flight"]
    if flight is not None and flight.agents != int(flight.agents):
        faults.append(f"agents = {flight.agents:g} is not a whole number")
    begin: Any = parts["start"] or SECTIONS["start"]()
    faults += file_faults(parts["world"])
    if parts["world"] is not None:
        separation = parts["start"].separation if parts["start"] is not None else 0.0
        if separation is None and found is not None and parts.get("parameters") is not None:
            separation = start_separation(found, parts["parameters"], begin, parts["world"])
        count = int(flight.agents) if flight is not None else 1
        faults += geometry.faults(parts["world"], count, separation or 0.0, begin)
    if flight is not None and parts["sensors"] is not None and parts["metrics"] is not None:
        faults += _timing_faults(flight, parts["sensors"].period, parts["metrics"])
        faults += checks.order_faults(flight, sensor, parts["sensors"], parts["radio"])
        faults += checks.metric_faults(measures, parts["metrics"], parts["world"])
        faults += wings.faults(parts, found, measures)
    return faults


def find_model(kind: Any, folder: Path | None = None, *, told: str = "model.kind", trust: bool = False) -> Model:
    """Model by name, or from a user's own Python file (relative to the scenario file), which runs only with `trust`."""
    if not isinstance(kind, str):
        raise ScenarioError([f"{told} = {kind!r} is missing or not a name; known: {', '.join(MODELS)}"])
    if kind in MODELS:
        return model(import_module(f"airflock.models.{kind}"), kind)
    if kind.endswith(".py"):
        return model(own_code(told, kind, folder, trust=trust), Path(kind).stem)
    near = get_close_matches(kind, MODELS, n=1, cutoff=0.4)
    hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(MODELS)}, or a file that ends in .py"
    raise ScenarioError([f"{told} = {kind!r}: unknown model; {hint}"])


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


def _timing_faults(flight: Flight, period: float, metrics: Any) -> list[str]:
    dt = flight.dt
    times = {
        "sensors.period": period,
        "metrics.period": metrics.period,
        "metrics.collision_period": metrics.collision_period or dt,
    }
    found = [
        f"{key} = {value:g} s is shorter than dt = {dt:g} s" for key, value in times.items() if 0.0 < value < 0.5 * dt
    ]
    if flight.duration / dt > 2**31:
        found.append(f"duration = {flight.duration:g} s takes more than 2^31 steps of dt = {dt:g} s")
    return found


def _notes(scenario: Scenario) -> list[str]:
    """What is rounded or cannot be meant, for a person to read; nothing here stops a flight."""
    notes, dt = checks.pair_notes(scenario.flight, scenario.metrics, scenario.order_parameters), scenario.flight.dt
    times = {
        "sensors.period": scenario.sensors.period,
        "radio.delay": scenario.radio.delay,
        "metrics.period": scenario.metrics.period,
        "metrics.collision_period": scenario.metrics.collision_period or dt,
    }
    for key, value in times.items():
        steps = round(value / dt)
        if abs(steps * dt - value) > 1e-9 * max(value, dt):
            notes.append(f"{key} = {value:g} s is rounded to {steps * dt:g} s, {steps} steps of dt = {dt:g} s")
    period, delay = scenario.sensors.period, scenario.radio.delay
    if period > 0.0 and abs(delay / period - round(delay / period)) > 1e-9:
        notes.append(
            f"radio.delay = {delay:g} s is not a multiple of sensors.period = {period:g} s: decisions use the states "
            "of exactly that long ago, taken between two measurements"
        )
    notes += wings.notes(scenario)
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
