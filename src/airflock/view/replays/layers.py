"""Layers: values of agents beside their motion, one byte each at each frame, by which a replay colours them."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import attributes
from airflock.scenarios import Scenario
from airflock.view.stage import shades
from airflock.view.stage.clusters import cluster_distance, cluster_labels
from airflock.view.stage.shades import CATEGORIES, GOLDEN_TURN, IDENTITIES, NUMBERS, AgentColours
from airflock.world import half_sizes

NO_VALUE = 255  # no value
MAX_CLUSTERED_POSITIONS = 1e6  # positions of which clusters are looked for; of more every so many frames
NO_LAYER_VARIABLES = {"position", "velocity", "confidence"}  # what needs no layer


class ColourLayer(NamedTuple):
    """One value of all agents at all frames.

    shade : its name, kind and key, without values
    bytes : (time, agent): scales from 0 to 254, numbers of names, hues of marks of 255 to a turn; 255 for no value
    """

    colours: AgentColours
    bytes: NDArray[np.uint8]


def colour_layers(
    recording: xr.Dataset, scenario: Scenario | None, position: NDArray[Any], present: NDArray[np.bool_], stride: int
) -> list[ColourLayer]:
    """Layers of a recording: clusters, groups, faults, numbers that differ among agents, and its own variables.

    position : (frame, axis, agent), m, and present : (frame, agent), of every `stride`-th instant
    """
    frames, agents = present.shape
    found = [] if scenario is None else list(_cluster_layer(scenario, position, present))
    if scenario is not None and scenario.agents == agents:
        fixed = [shades.group_colours(scenario.groups, agents)] if scenario.groups else []
        seed = attributes.read_integer(recording, "airflock_seed", 0)
        fixed += [shades.varied_colours(scenario, key, seed) for key in shades.varied_number_units(scenario)]
        found += [_to_layer(shade, np.tile(shade.values, (frames, 1))) for shade in fixed]
    faults = attributes.recorded_faults(recording)
    armed = [] if scenario is None else [entry.fault.name for entry in scenario.faults]
    if faults or armed:
        times = recording["time"].values[::stride]
        kinds = tuple(dict.fromkeys([*armed, *(str(fault["kind"]) for fault in faults)]))
        shade = shades.fault_colours(faults, 0.0, agents, kinds)
        found.append(_to_layer(shade, np.array([shades.fault_colours(faults, t, agents, kinds).values for t in times])))
    return [*found, *_variable_layers(recording, stride)]


def scenario_layer_names(scenario: Scenario) -> list[str]:
    """Names of the layers of a flight of a scenario, before it is flown."""
    clustered = math.isfinite(cluster_distance(scenario))
    return [
        *(["cluster"] if clustered else []),
        *(["group"] if scenario.groups else []),
        *shades.varied_number_units(scenario),
        *(["fault"] if scenario.faults else []),
        "command",
    ]


def _cluster_layer(scenario: Scenario, position: NDArray[Any], present: NDArray[np.bool_]) -> Iterator[ColourLayer]:
    """Clusters at each frame, of a scenario whose order parameters or law say how near a neighbour is."""
    reach = cluster_distance(scenario)
    if not math.isfinite(reach):
        return
    frames, axes, agents = position.shape
    world = scenario.world
    box = 2.0 * np.array(half_sizes(world)[:axes]) if world.edges == "periodic" else None
    every = max(1, math.ceil(frames * agents / MAX_CLUSTERED_POSITIONS))
    least = np.full((frames, agents), -1)
    for first in range(0, frames, every):
        there = np.flatnonzero(present[first])
        of = cluster_labels(position[first][:, there].T, reach, box)
        least[first : first + every, there] = np.where(of >= 0, there[of], -1)
    yield _to_layer(
        AgentColours("cluster", IDENTITIES, np.zeros(0), told=f"linked over less than {reach:.3g} m; grey: alone"),
        least,
    )


def _variable_layers(recording: xr.Dataset, stride: int) -> Iterator[ColourLayer]:
    """Every variable of the recording that holds one number for each individual, at each time or for good."""
    for name, variable in recording.data_vars.items():
        sizes = dict(variable.sizes)
        if str(name) in NO_LAYER_VARIABLES or "individual" not in sizes or variable.dtype.kind not in "fiub":
            continue
        plain = variable.isel(keypoint=0) if "keypoint" in sizes else variable
        if str(name) == "command" and "space" in sizes:
            values, label = np.sqrt((plain.transpose("time", "space", "individual").values ** 2).sum(axis=1)), "command"
        elif set(plain.dims) == {"time", "individual"}:
            values, label = plain.transpose("time", "individual").values, str(name)
        elif set(plain.dims) == {"individual"}:
            values, label = np.tile(plain.values, (recording.sizes["time"], 1)), str(name)
        else:
            continue
        unit = str(variable.attrs.get("units", ""))
        shade = shades.number_colours(label, values.astype(float), "" if unit == "1" else unit)
        yield _to_layer(shade._replace(values=np.zeros(0)), values[::stride].astype(float))


def _to_layer(shade: AgentColours, values: NDArray[Any]) -> ColourLayer:
    """Values (time, agent) as bytes."""
    whole = np.asarray(values, float)
    known = np.isfinite(whole) & ((whole >= 0.0) | (shade.kind == NUMBERS))
    part = np.where(known, whole, 0.0)
    if shade.kind == NUMBERS:
        part = (NO_VALUE - 1) * np.clip((part - shade.low) / max(shade.high - shade.low, 1e-300), 0.0, 1.0)
    elif shade.kind == IDENTITIES:
        part = np.round(part * GOLDEN_TURN % 1.0 * NO_VALUE) % NO_VALUE
    bytes_ = np.where(known & ((part < NO_VALUE) | (shade.kind != CATEGORIES)), np.round(part), NO_VALUE)
    return ColourLayer(shade._replace(values=np.zeros(0)), bytes_.astype(np.uint8))
