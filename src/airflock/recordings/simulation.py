"""Simulate a scenario, and keep the flight as a recording; on request with what agents perceived."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import PurePath
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock import __version__
from airflock.core import radio, random
from airflock.engine import Flight, driver_text, fly_world, pick_device
from airflock.recordings.attributes import FAULTS_ATTRIBUTE, part_tables
from airflock.recordings.dataset import DIMENSIONS, VARIABLE_UNITS, box_sides, make_dataset, nearest_image
from airflock.scenarios import MODELS, Event, Scenario, check_seed, group_names, law_hash, load_if_named, step_counts
from airflock.support import FlightError, log, processor_name, toolchain_versions

Array = NDArray[Any]


def simulate(
    scenario: Scenario | str | os.PathLike[str],
    seed: int = 0,
    *,
    precision: int = 32,
    start: Any = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = log,
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
        cpu, cuda (a GPU), python (no compiler, for debuggers), or auto, which reports its choice to `say`.
    say : callable, optional
        Called with the choice of auto; by default the logger `airflock`.
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
    # Open flights exist on these devices only; others fly the whole flight in one launch.
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
    return _recording(scenario, flown.frames, times, attributes)


def _recording(scenario: Scenario, frames: Array, times: Array, attributes: dict[str, Any]) -> xr.Dataset:
    groups = group_names(scenario.groups, scenario.agents)
    return make_dataset(frames, scenario.dimensions, times, attributes, scenario.model.command, groups)


def recording_of(flight: Flight) -> xr.Dataset:
    """Make a recording of an open flight up to now.

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
    return _recording(scenario, flight.frames, flight.frame_times, attributes)


def provenance(scenario: Scenario, seed: int, precision: int) -> dict[str, Any]:
    """Return everything that decides the bits of a flight, as plain attributes."""
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
    """Return the scenario as plain values; code of the user's own is its bare name, without a file."""
    document: dict[str, Any] = to_plain_values(scenario.document)
    for table in part_tables(document):
        if str(table.get("kind", "")).endswith(".py"):
            table["kind"] = PurePath(table["kind"]).stem
    return document


def to_plain_values(value: Any) -> Any:
    """Convert nested values to plain Python values, for JSON."""
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): to_plain_values(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_plain_values(entry) for entry in value]
    return value


# What agents measured and received, beside a recording. The flight is the closed one, bit for bit:
# it is cut at its decisions, where an open flight may be cut. Measured states are read from it;
# packets of a plain radio are drawn again from the same counters as in the driver.
KINDS = ("measured", "heard")
FARTHEST = 1e8  # m; the limit of any range in a driver


def check_keep(keep: Sequence[str], events: Sequence[Any], scenario: Scenario) -> None:
    """Refuse what cannot be kept, one line each."""
    if isinstance(keep, str) or not isinstance(keep, Iterable):
        raise FlightError(f"keep = {keep!r} is not a list; give some of {', '.join(KINDS)}, such as keep=('measured',)")
    errors = [f"keep = {kind!r} is none of {', '.join(KINDS)}" for kind in keep if kind not in KINDS]
    if keep and events:
        errors.append("keep: a flight with events is cut by them already; keep nothing, or give no events")
    if keep and scenario.flight.update == "sequential":
        errors.append("keep: with update = 'sequential' each agent moves before the next one perceives")
    if errors:
        raise FlightError("\n".join(errors))


def finish_keeping(flight: Flight, keep: Sequence[str]) -> dict[str, xr.Variable]:
    """Fly to the end and return what was perceived, as variables of the recording.

    measured_position (m), measured_velocity (m/s) : (time, space, keypoint, individual), as last
    measured
    age : (time, receiver, sender), s since what was last heard had been sent; nan: never heard
    """
    scenario, n = flight.scenario, flight.agents
    times, dt = step_counts(scenario), scenario.flight.dt
    every, sample = times["decide_every"], times["sample_every"]
    late = times["delay"] * dt
    stamps = np.full((n, n), np.nan)
    known: list[tuple[Array | None, Array | None]] = []  # of each frame: own states, ages (s) of the others'

    def note(end: int) -> None:
        """Note what agents know at all frames before a step."""
        for frame in range(len(known), -(-end // sample)):
            ages = frame * sample * dt - stamps if "heard" in keep else None
            known.append((flight.measured if "measured" in keep else None, ages))

    # One turn per decision: sense, note what the frames until the next decision see, then fly on.
    while not flight.over:
        flight.sense()
        last = min(flight.step + every, times["steps"])
        if "heard" in keep:
            stamps = _stamps(flight, stamps, flight.step // every, flight.step * dt, late)
        note(last)
        flight.advance(steps=last - flight.step)
    note(times["steps"] + 1)
    flight.finish()
    found: dict[str, xr.Variable] = {}
    del known[len(flight.frame_times) :]
    if "measured" in keep:
        table = np.array([own for own, _ in known])[:, :, None, :]
        for c, name in enumerate(("position", "velocity")):
            part = table[:, c * scenario.dimensions : (c + 1) * scenario.dimensions]
            found[f"measured_{name}"] = xr.Variable(DIMENSIONS, part, {"units": VARIABLE_UNITS[name]})
    if "heard" in keep:
        every_age = np.array([ages for _, ages in known], np.float32)
        found["age"] = xr.Variable(("time", "receiver", "sender"), every_age, {"units": "s"})
    return found


def packet_uniforms(seed: int, world: int, decision: int, agents: int) -> Array:
    """Draw the uniform number of each pair (receiver, sender) in a decision: `core.random.pair_uniform` of a whole
    flock.
    """
    # The driver draws for four receivers by one Philox call; the same grouping here gives the same
    # numbers.
    fours, senders = -(-agents // 4), np.arange(agents, dtype=np.uint64)
    first = random.pair_number(4 * np.arange(fours, dtype=np.uint64)[:, None], senders, agents)
    zero = np.zeros_like(first)
    drawn = random.philox(
        first, zero + np.uint64(decision), zero + np.uint64(random.PACKET), zero + np.uint64(world), seed, seed >> 32
    )
    return np.asarray(random.uniform(np.stack(drawn, axis=1).reshape(4 * fours, agents)[:agents]))


def _stamps(flight: Flight, stamps: Array, number: int, now: float, late: float) -> Array:
    """Return the time stamps (s) of the states that each agent knows of each other one after a decision; nan: never
    heard.
    """
    k, n = flight.scenario.radio.numbers, flight.agents
    # Such a radio keeps the stamps in the flight itself; only a plain one must be drawn again.
    if flight.scenario.radio.rule.keeps_packets:
        return np.where(np.eye(n, dtype=bool), np.nan, flight.sent)
    place = flight.state[: flight.scenario.dimensions].astype(float)
    offset = place[:, None, :] - place[:, :, None]  # from receiver (first) to sender
    offset = nearest_image(offset, box_sides(flight.scenario.world, len(place)))
    apart = np.sqrt((offset**2).sum(axis=0))
    heard = (apart <= min(k.range, FARTHEST)) & ~np.eye(n, dtype=bool)
    # Probabilities only for pairs in range: the rule is a Python call for each pair.
    if k.loss > 0.0:
        i, j = np.nonzero(heard)
        lost = np.array([radio.lost(float(d), k) for d in apart[i, j]])
        heard[i, j] = packet_uniforms(flight.seed, flight.world, number, n)[i, j] >= lost
    return np.where(heard, now - late, stamps)
