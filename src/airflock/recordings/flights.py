"""Flights: simulate a scenario and keep its trajectories."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import PurePath
from typing import Any

import numpy as np
import xarray as xr

from airflock import __version__
from airflock.engine import Flight, driver_text, fly_world, pick_device
from airflock.recordings.attributes import FAULTS_ATTRIBUTE
from airflock.recordings.layout import make_dataset
from airflock.recordings.perception import check_keep, finish_keeping
from airflock.scenarios import MODELS, Event, Scenario, check_seed, group_names, law_hash, load_if_named, step_counts
from airflock.support import FlightError, processor_name, toolchain_versions


def simulate(
    scenario: Scenario | str | os.PathLike[str],
    seed: int = 0,
    *,
    precision: int = 32,
    start: Any = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = None,
    events: Sequence[Event | Mapping[str, Any]] = (),
    keep: Sequence[str] = (),
) -> xr.Dataset:
    """Fly a scenario once and return the recording, sampled every `metrics.period`.

    Parameters
    ----------
    scenario : Scenario, str or path
        A scenario, or the name of a preset or scenario file.
    seed : int
        From 0 to 2^64 - 1; the same seed gives the same bits.
    precision : int
        Bits per number, 32 or 64.
    start : array, optional
        Positions and velocities to start from, (component, agent) in m and m/s, instead of random ones.
    device : str
        cpu, cuda (a GPU), python (no compiler, for debuggers), or auto, which tells `say` what it picked.
    say : callable, optional
        Told what auto picked.
    events : sequence of mappings, optional
        What is done to the flight on its way, as `Flight.events` or `recordings.attributes.events` tell it.
    keep : sequence of str
        measured: the variables measured_position and measured_velocity, as agents last measured their own; heard: the
        variable age (time, receiver, sender), s since what was last heard had been sent, nan where nothing was. The
        flight's bits are the same.

    Returns
    -------
    xarray.Dataset
        position (m), velocity (m/s) and command, each (time, space, keypoint, individual). Its attributes hold the
        scenario, the seed, versions and processor, so that it can be flown again.

    Raises
    ------
    ScenarioError, FlightError, ParameterError, DeviceError
        If the scenario, the flight, the seed or the device is faulty.

    Notes
    -----
    The layout follows the package movement (time, space, keypoint, individual).

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short, seed=7)
    >>> dict(recording.position.sizes)
    {'time': 6, 'space': 2, 'keypoint': 1, 'individual': 4}
    """
    seed = check_seed(seed)
    scenario = load_if_named(scenario).with_drawn_scene(seed)
    check_keep(keep, events, scenario)
    device = pick_device([scenario], device, precision=precision, record=True, notify=say)
    if device in Flight.DEVICES:
        flight = Flight(scenario, seed, precision=precision, record=True, start=start, events=events, device=device)
        perceived = finish_keeping(flight, keep) if keep else {}
        flight.finish()
        return recording_of(flight).assign(perceived)
    if events or keep:
        raise FlightError(
            f"{'events' if events else 'keep'}: a flight on device = {device} takes none; choose device = cpu or python"
        )
    flown = fly_world(scenario, seed, precision=precision, record=True, start=start, device=device)
    assert flown.frames is not None
    times = np.arange(len(flown.frames)) * step_counts(scenario)["sample_every"] * scenario.flight.dt
    attributes = provenance(scenario, seed, precision) | {"random_start": int(start is None), "airflock_device": device}
    return make_dataset(
        flown.frames,
        scenario.dimensions,
        times,
        attributes,
        scenario.model.command,
        group_names(scenario.groups, scenario.agents),
    )


def recording_of(flight: Flight) -> xr.Dataset:
    """Recording of what an open flight has flown so far.

    Parameters
    ----------
    flight : Flight
        It must have been opened with record=True.

    Returns
    -------
    xarray.Dataset
        As `airflock.simulate` returns it. Its attribute airflock_events holds what was done to the flight; with
        scenario and seed it gives the same bits.

    Raises
    ------
    FlightError
        Where the flight keeps no frames.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> flight = airflock.open(short, seed=1, record=True).advance(0.5)
    >>> airflock.recording_of(flight).sizes["time"]
    3
    """
    if not isinstance(flight, Flight):
        raise FlightError(f"{type(flight).__name__} is no open flight; airflock.open gives one")
    scenario, seed, precision, start = flight.origin
    attributes = provenance(scenario, seed, precision) | {"random_start": int(start is None)}
    attributes |= {"airflock_device": flight.device} if flight.device != "cpu" else {}
    if flight.events:
        attributes["airflock_events"] = json.dumps(
            {"events": [to_plain_values(event.plain()) for event in flight.events]}
        )
    if flight.faults:
        attributes[FAULTS_ATTRIBUTE] = json.dumps({"faults": to_plain_values(flight.faults)})
    return make_dataset(
        flight.frames, scenario.dimensions, flight.frame_times, attributes, scenario.model.command,
        group_names(scenario.groups, scenario.agents),
    )  # fmt: skip


def provenance(scenario: Scenario, seed: int, precision: int) -> dict[str, Any]:
    """Everything that decides the bits of a flight, as plain attributes."""
    text = driver_text(scenario, precision=precision)
    own = scenario.document.get("model", {}).get("kind") not in MODELS
    return {
        "airflock_scenario": json.dumps(bare_document(scenario)),
        "airflock_name": scenario.name,
        "airflock_metrics": json.dumps(asdict(scenario.resolved_metrics())),
        "airflock_seed": seed,
        "airflock_precision": precision,
        "airflock_version": __version__,
        "airflock_sources": hashlib.sha256(text.encode()).hexdigest(),
        "airflock_toolchain": toolchain_versions(),
        "airflock_processor": processor_name(),
        **({"airflock_law": law_hash(scenario.model)} if own else {}),
    }


def bare_document(scenario: Scenario) -> dict[str, Any]:
    """The scenario as plain values, of which code of the user's own is its bare name: no file, and no place of one."""
    document: dict[str, Any] = to_plain_values(scenario.document)
    for section in ("model", "body", "sensors", "metrics"):
        table = document.get(section, {})
        kind = table.get("kind") if isinstance(table, dict) else None
        if isinstance(kind, str) and kind.endswith(".py"):
            table["kind"] = PurePath(kind).stem
    tables = [entry["model"] for entry in document.get("groups", ()) if isinstance(entry.get("model"), dict)]
    for entry in (*document.get("faults", ()), *tables):
        if str(entry.get("kind", "")).endswith(".py"):
            entry["kind"] = PurePath(entry["kind"]).stem
    return document


def to_plain_values(value: Any) -> Any:
    """A nested dict of plain Python values, for JSON."""
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): to_plain_values(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_plain_values(entry) for entry in value]
    return value
