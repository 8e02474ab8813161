"""Scenario files: TOML with units and sources, presets by name, and keys changed from outside."""

import os
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from airflock.core.contract import Body
from airflock.core.contract import body as gathered_body
from airflock.core.fault import Fault, fault
from airflock.core.parameters import number_names
from airflock.core.radio import Packets, Radio
from airflock.core.radio import radio as gathered_radio
from airflock.core.sensor import Sensor
from airflock.core.sensor import sensor as gathered_sensor
from airflock.core.topology import Topology
from airflock.core.topology import topology as gathered_topology
from airflock.doors import from_outside, is_file, read_toml
from airflock.errors import ScenarioError
from airflock.metrics.registry import as_set
from airflock.scenarios import checks, formats
from airflock.scenarios.extends import extended
from airflock.scenarios.ground import with_ground
from airflock.scenarios.laws import given_law
from airflock.scenarios.making import make
from airflock.scenarios.scenario import Scenario
from airflock.spelling import meant
from airflock.topology.registry import TOPOLOGIES


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
    return dict(_shipped())


@cache
def _shipped() -> tuple[tuple[str, Path], ...]:
    """Name and file of every preset: what is installed does not change while a process runs."""
    root = Path(str(resources.files("airflock"))) / "presets"
    return tuple((str(path.relative_to(root).with_suffix("")), path) for path in sorted(root.rglob("*.toml")))


def load(
    name: str | os.PathLike[str],
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    *,
    metrics: Any = None,
    body: Any = None,
    sensor: Any = None,
    radio: Any = None,
    topology: Any = None,
    faults: Any = None,
    laws: Any = None,
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
    radio : optional
        A radio of your own by which agents hear each other: a `Radio`, a namespace, or a name or file.
    topology : optional
        A topology of your own, which says whom of those that they hear agents meet: a namespace, or a name or file.
    faults : optional
        Kinds of fault of your own, which entries of [[faults]] may name: a namespace such as a module, what
        `airflock.fault` gives, or a list of these.
    laws : optional
        Laws of your own, which groups may name as their model.kind: a namespace such as a module, what
        `airflock.model` gives, or a list of these.
    trust : bool
        Whether code that the file names, or a file that it extends, may run: a law, also of a group, a body, a sensor,
        a radio, a topology, order parameters.

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
        document, own = _given(document, metrics, body, sensor, radio, topology)
        own["kinds"] = _kinds(faults)
        own["laws"] = {law.name: law for law in map(given_law, _several(laws))}
        own["notes"] = (f"extends {base}: what is not given here is taken from there",) if base else ()
        document, settings, told, own["known_faults"] = with_ground(document, settings or {}, folder)
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
        hint = meant(name, known, "; airflock presets lists the presets", lead="; ", cutoff=0.4)
        raise ScenarioError([f"{name}: no such file or preset{hint}"])
    with from_outside(name):
        document = read_toml(path)
    if tells_of_study(document) and not {"model", "extends"} & set(document):
        raise ScenarioError([f"{name}: is a study, not a scenario; check it with airflock validate, or evolve it"])
    return {**formats.current(document, name), formats.KEY: formats.FORMAT}, path.parent


def _given(
    document: Mapping[str, Any], metrics: Any, body: Any, sensor: Any, radio: Any, topology: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    """A document that names the metrics, body, sensor, radio and topology that the caller gives, and these.

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
    if isinstance(radio, (str, os.PathLike)):
        own["transceiver"], more = checks.radio_of({"kind": str(radio)}, trust=True)
        faults = [*faults, *more]
    elif radio is not None:
        own["transceiver"] = radio if isinstance(radio, Radio) else gathered_radio(radio)
    if radio is not None:
        kept = {key: value for key, value in document.get("radio", {}).items() if key in number_names(Packets)}
        document["radio"] = {**kept, "kind": own["transceiver"].name}
    meets, more = _topology(topology)
    own |= {"own_topology": meets} if isinstance(meets, Topology) else {}
    document |= _meeting(document, meets)
    faults = [*faults, *more]
    if faults:
        raise ScenarioError(faults)
    return document, own


def _meeting(document: Mapping[str, Any], meets: Topology | str | None) -> dict[str, Any]:
    """The section of a topology that the caller gives: ours share their numbers, another one has its own."""
    if meets is None:
        return {}
    kept = document.get("topology", {}) if isinstance(meets, str) else {}
    return {"topology": {**kept, "kind": meets if isinstance(meets, str) else meets.name}}


def _topology(given: Any) -> tuple[Topology | str | None, list[str]]:
    """A topology that the caller gives, or the name of one of ours; and what is wrong with it."""
    if given is None or isinstance(given, Topology):
        return given, []
    if not isinstance(given, (str, os.PathLike)):
        return gathered_topology(given), []
    name = str(given)
    if name in TOPOLOGIES or name.endswith(".py"):
        return (name, []) if name in TOPOLOGIES else checks.topology_of({"kind": name}, trust=True)
    hint = meant(name, TOPOLOGIES, f"known: {', '.join(TOPOLOGIES)}, or a file that ends in .py", cutoff=0.4)
    return None, [f"topology = {name!r}: unknown topology; {hint}"]


def _kinds(given: Any) -> dict[str, Fault]:
    """Kinds of fault that the caller gives, by name."""
    found = [kind if isinstance(kind, Fault) else fault(kind) for kind in _several(given)]
    return {kind.name: kind for kind in found}


def _several(given: Any) -> list[Any]:
    """What a caller gives as one thing, as a list, or not at all."""
    return [] if given is None else list(given) if isinstance(given, (list, tuple)) else [given]


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
    return bool({"space", "scenario", "scenarios", "objective", "search"} & set(document))
