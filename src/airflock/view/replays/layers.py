"""Layers: values of agents beside their motion, one byte each at each frame, by which a replay colours them."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import attributes
from airflock.scenarios.scenario import Scenario
from airflock.view.stage import shades
from airflock.view.stage.clusters import clusters, reach_of
from airflock.view.stage.shades import GOLDEN, MARKS, NAMES, SCALE, Shade
from airflock.world.place import half_sizes

NONE = 255  # no value
MOST = 1e6  # positions of which clusters are looked for; of more every so many frames
TOLD = {"position", "velocity", "confidence"}  # what needs no layer


class Layer(NamedTuple):
    """One value of all agents at all frames.

    shade : its name, kind and key, without values
    bytes : (time, agent): scales from 0 to 254, numbers of names, hues of marks of 255 to a turn; 255 for no value
    """

    shade: Shade
    bytes: NDArray[np.uint8]


def layers(
    recording: xr.Dataset, scenario: Scenario | None, position: NDArray[Any], present: NDArray[np.bool_], stride: int
) -> list[Layer]:
    """Layers of a recording: clusters, groups, faults, numbers that differ among agents, and its own variables.

    position : (frame, axis, agent), m, and present : (frame, agent), of every `stride`-th instant
    """
    frames, agents = present.shape
    found = [] if scenario is None else list(_clusters(scenario, position, present))
    if scenario is not None and scenario.agents == agents:
        fixed = [shades.of_groups(scenario.groups, agents)] if scenario.groups else []
        seed = attributes.whole_number(recording, "airflock_seed", 0)
        fixed += [shades.of_own(scenario, key, seed) for key in shades.own_numbers(scenario)]
        found += [_layer(shade, np.tile(shade.values, (frames, 1))) for shade in fixed]
    faults = attributes.faults(recording)
    armed = [] if scenario is None else [entry.fault.name for entry in scenario.faults]
    if faults or armed:
        times = recording["time"].values[::stride]
        kinds = tuple(dict.fromkeys([*armed, *(str(fault["kind"]) for fault in faults)]))
        shade = shades.of_faults(faults, 0.0, agents, kinds)
        found.append(_layer(shade, np.array([shades.of_faults(faults, t, agents, kinds).values for t in times])))
    return [*found, *_variables(recording, stride)]


def flown_layers(scenario: Scenario) -> list[str]:
    """Names of the layers of a flight of a scenario, before it is flown."""
    clustered = math.isfinite(reach_of(scenario))
    return [
        *(["cluster"] if clustered else []), *(["group"] if scenario.groups else []), *shades.own_numbers(scenario),
        *(["fault"] if scenario.faults else []), "command",
    ]  # fmt: skip


def _clusters(scenario: Scenario, position: NDArray[Any], present: NDArray[np.bool_]) -> Iterator[Layer]:
    """Clusters at each frame, of a scenario whose order parameters or law say how near a neighbour is."""
    reach = reach_of(scenario)
    if not math.isfinite(reach):
        return
    frames, axes, agents = position.shape
    world = scenario.world
    box = 2.0 * np.array(half_sizes(world)[:axes]) if world.edges == "periodic" else None
    every = max(1, math.ceil(frames * agents / MOST))
    least = np.full((frames, agents), -1)
    for first in range(0, frames, every):
        there = np.flatnonzero(present[first])
        of = clusters(position[first][:, there].T, reach, box)
        least[first : first + every, there] = np.where(of >= 0, there[of], -1)
    yield _layer(Shade("cluster", MARKS, np.zeros(0), told=f"linked over less than {reach:.3g} m; grey: alone"), least)


def _variables(recording: xr.Dataset, stride: int) -> Iterator[Layer]:
    """Every variable of the recording that holds one number for each individual, at each time or for good."""
    for name, variable in recording.data_vars.items():
        sizes = dict(variable.sizes)
        if str(name) in TOLD or "individual" not in sizes or variable.dtype.kind not in "fiub":
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
        shade = shades.of_numbers(label, values.astype(float), "" if unit == "1" else unit)
        yield _layer(shade._replace(values=np.zeros(0)), values[::stride].astype(float))


def _layer(shade: Shade, values: NDArray[Any]) -> Layer:
    """Values (time, agent) as bytes."""
    whole = np.asarray(values, float)
    known = np.isfinite(whole) & ((whole >= 0.0) | (shade.kind == SCALE))
    part = np.where(known, whole, 0.0)
    if shade.kind == SCALE:
        part = (NONE - 1) * np.clip((part - shade.low) / max(shade.high - shade.low, 1e-300), 0.0, 1.0)
    elif shade.kind == MARKS:
        part = np.round(part * GOLDEN % 1.0 * NONE) % NONE
    bytes_ = np.where(known & ((part < NONE) | (shade.kind != NAMES)), np.round(part), NONE)
    return Layer(shade._replace(values=np.zeros(0)), bytes_.astype(np.uint8))
