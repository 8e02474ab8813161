"""The page of a replay: a recording, what stands in its world, and the JavaScript that plays it, in one HTML file."""

import base64
import html
import json
import math
import os
import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from airflock.parts.metrics import scalar_names
from airflock.recordings import attributes, recording_frames, scenario_of_recording
from airflock.scenarios import Scenario, to_events
from airflock.support import PAGES, RecordingError, atomic, expand_path, suffix_error, suggest
from airflock.view.agent_colours import (
    CATEGORIES,
    COLOURING_NOTES,
    GOLDEN_TURN,
    IDENTITIES,
    NO_VALUE_COLOUR,
    NUMBERS,
    RAMP_STOPS,
    WHEEL_STOPS,
    AgentColours,
    category_colours,
    cluster_distance,
    cluster_labels,
    fault_colours,
    group_colours,
    number_colours,
    varied_colours,
    varied_number_units,
)
from airflock.view.scene import SceneGeometry, scenario_geometry
from airflock.world import half_sizes

MAX_QUANTA = 65535  # of 16 bits


class PackedPositions(NamedTuple):
    """Positions as bytes.

    low     : smallest coordinate of each axis, m
    quantum : of each axis, m; positions are kept to half of it
    shape   : frames, axes, agents
    data    : zlib stream of the low bytes of all differences and then of the high ones; in both,
              each axis after the other, each agent after the other, frame by frame; then the
              differences of each row of bytes
    """

    low: list[float]
    step: list[float]
    shape: tuple[int, int, int]
    data: bytes


def pack_positions(position: NDArray[Any], rows: Sequence[NDArray[np.uint8]] = ()) -> PackedPositions:
    """Pack positions (time, axis, agent), m, all finite, and rows of bytes (time, agent) beside them."""
    positions = np.asarray(position, float)
    low, high = positions.min(axis=(0, 2)), positions.max(axis=(0, 2))
    quantum = np.maximum((high - low) / MAX_QUANTA, 1e-12)
    # Differences modulo 2^16 never clip and add up without loss: a minute of 1,000 drones takes 5
    # MB, the export of viser 15.
    whole = np.round((positions - low[:, None]) / quantum[:, None]).astype(np.uint16)
    steps = whole.copy()
    steps[1:] -= whole[:-1]  # modulo 2^16, which adding up undoes
    # Low and high bytes apart: slow agents leave the high ones at 0 or 255, which zlib packs to
    # almost nothing.
    series = np.ascontiguousarray(steps.transpose(1, 2, 0)).ravel()
    data = (series & 0xFF).astype(np.uint8).tobytes() + (series >> 8).astype(np.uint8).tobytes()
    data += b"".join(np.diff(row, axis=0, prepend=row[:1] * 0).T.tobytes() for row in rows)  # modulo 2^8
    frames, axes, agents = positions.shape
    return PackedPositions(low.tolist(), quantum.tolist(), (frames, axes, agents), zlib.compress(data, 9))


def unpack_positions(packed: PackedPositions) -> tuple[NDArray[np.float64], list[NDArray[np.uint8]]]:
    """Return positions (time, axis, agent), m, within half a quantum of those packed, and the rows of bytes."""
    frames, axes, agents = packed.shape
    data = np.frombuffer(zlib.decompress(packed.data), np.uint8)
    halves = data[: 2 * frames * axes * agents].reshape(2, -1).astype(np.uint16)
    series = (halves[0] | halves[1] << 8).reshape(axes, agents, frames)
    whole = np.add.accumulate(series, axis=2, dtype=np.uint16)
    scaled = whole * np.array(packed.step)[:, None, None] + np.array(packed.low)[:, None, None]
    rest = data[2 * frames * axes * agents :].reshape(-1, agents, frames)
    rows = [np.add.accumulate(row, axis=1, dtype=np.uint8).T for row in rest]
    return np.asarray(scaled.transpose(2, 0, 1)), rows


NO_VALUE = 255  # no value
MAX_CLUSTERED_POSITIONS = 1e6  # positions of which clusters are looked for; of more every so many frames
NO_LAYER_VARIABLES = {"position", "velocity", "confidence"}  # what needs no layer


class ColourLayer(NamedTuple):
    """One value of all agents at all frames.

    shade : its name, kind and key, without values
    bytes : (time, agent): scales from 0 to 254, numbers of names, hues of marks of 255 to a turn;
            255 for no value
    """

    colours: AgentColours
    bytes: NDArray[np.uint8]


def colour_layers(
    recording: xr.Dataset, scenario: Scenario | None, position: NDArray[Any], present: NDArray[np.bool_], stride: int
) -> list[ColourLayer]:
    """Return the layers of a recording: clusters, groups, faults, numbers that differ among agents, its own
    variables.

    position : (frame, axis, agent), m, and present : (frame, agent), of every `stride`-th instant
    """
    frames, agents = present.shape
    layers = [] if scenario is None else list(_cluster_layer(scenario, position, present))
    if scenario is not None and scenario.agents == agents:
        fixed = [group_colours(scenario.groups, agents)] if scenario.groups else []
        seed = attributes.read_integer(recording, "airflock_seed", 0)
        fixed += [varied_colours(scenario, key, seed) for key in varied_number_units(scenario)]
        layers += [_to_layer(shade, np.tile(shade.values, (frames, 1))) for shade in fixed]
    faults = attributes.recorded_faults(recording)
    armed = [] if scenario is None else [entry.fault.name for entry in scenario.faults]
    if faults or armed:
        times = recording["time"].values[::stride]
        kinds = tuple(dict.fromkeys([*armed, *(str(fault["kind"]) for fault in faults)]))
        shade = fault_colours(faults, 0.0, agents, kinds)
        layers.append(_to_layer(shade, np.array([fault_colours(faults, t, agents, kinds).values for t in times])))
    return [*layers, *_variable_layers(recording, stride)]


def scenario_layer_names(scenario: Scenario) -> list[str]:
    """Return the names of the layers of a flight of a scenario, before it is flown."""
    clustered = math.isfinite(cluster_distance(scenario))
    return [
        *(["cluster"] if clustered else []),
        *(["group"] if scenario.groups else []),
        *varied_number_units(scenario),
        *(["fault"] if scenario.faults else []),
        "command",
    ]


def _cluster_layer(scenario: Scenario, position: NDArray[Any], present: NDArray[np.bool_]) -> Iterator[ColourLayer]:
    """Return the clusters at each frame, if an order parameter or the law defines how near a neighbour is."""
    reach = cluster_distance(scenario)
    if not math.isfinite(reach):
        return
    frames, axes, agents = position.shape
    world = scenario.world
    box = 2.0 * np.array(half_sizes(world)[:axes]) if world.edges == "periodic" else None
    # Clusters change slowly; on long recordings every n-th frame is clustered and its labels are
    # repeated.
    every = max(1, math.ceil(frames * agents / MAX_CLUSTERED_POSITIONS))
    least = np.full((frames, agents), -1)
    for first in range(0, frames, every):
        there = np.flatnonzero(present[first])
        of = cluster_labels(position[first][:, there].T, reach, box)
        least[first : first + every, there] = np.where(of >= 0, there[of], -1)
    yield _to_layer(
        AgentColours("cluster", IDENTITIES, np.zeros(0), note=f"linked over less than {reach:.3g} m; grey: alone"),
        least,
    )


def _variable_layers(recording: xr.Dataset, stride: int) -> Iterator[ColourLayer]:
    """Return every variable that holds one number for each individual, at each time or for the whole flight."""
    for name, variable in recording.data_vars.items():
        if str(name) in NO_LAYER_VARIABLES or "individual" not in variable.dims or variable.dtype.kind not in "fiub":
            continue
        plain = variable.isel(keypoint=0) if "keypoint" in variable.dims else variable
        if name == "command" and "space" in plain.dims:
            plain = (plain**2).sum("space", skipna=False) ** 0.5
        if set(plain.dims) <= {"time", "individual"}:
            values = plain.broadcast_like(recording["time"]).transpose("time", "individual").values.astype(float)
            unit = str(variable.attrs.get("units", ""))
            shade = number_colours(str(name), values, "" if unit == "1" else unit)
            yield _to_layer(shade, values[::stride])


def _to_layer(shade: AgentColours, values: NDArray[Any]) -> ColourLayer:
    """Encode values (time, agent) as bytes."""
    whole = np.asarray(values, float)
    known = np.isfinite(whole) & ((whole >= 0.0) | (shade.kind == NUMBERS))
    part = np.where(known, whole, 0.0)
    if shade.kind == NUMBERS:
        part = (NO_VALUE - 1) * np.clip((part - shade.low) / max(shade.high - shade.low, 1e-300), 0.0, 1.0)
    elif shade.kind == IDENTITIES:
        # Marks are stored as hues: the page then needs no list of identities.
        part = np.round(part * GOLDEN_TURN % 1.0 * NO_VALUE) % NO_VALUE
    bytes_ = np.where(known & ((part < NO_VALUE) | (shade.kind != CATEGORIES)), np.round(part), NO_VALUE)
    return ColourLayer(shade._replace(values=np.zeros(0)), bytes_.astype(np.uint8))


MAX_RATE = 10.0  # frames per second that are kept at most; the page draws between them
MAX_EVENTS = 500
SCRIPT_NAMES = ("data", "colours", "scene", "trails", "charts", "replay")  # in the order in which they need each other
COLLISION_METRICS = {"n_coll", "phi_coll", "collisions"}  # order parameters of flocks that can collide


@dataclass(frozen=True)
class Replay:
    """A recording as a page; a notebook shows it in place. `text` is the whole HTML."""

    text: str
    name: str

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page as .html."""
        target = expand_path(path)
        error = suffix_error(target, PAGES)
        if error:
            raise RecordingError(error)
        atomic.write_file(target, self.text)
        return target

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self.text, quote=True)}" title="{html.escape(self.name)}" '
            'style="width:100%;height:520px;border:1px solid #ddd"></iframe>'
        )


def replay(recording: xr.Dataset, *, rate: float = MAX_RATE, colour: str = "speed") -> Replay:
    """Build a page that plays a recording; it opens from disk without network and displays itself in a notebook.

    Individuals that are absent are not drawn.

    Parameters
    ----------
    recording : xarray.Dataset
        (time, space, keypoint, individual), simulated or flown: position m, velocity m/s.
    rate : float in [0.1, 100]
        Most frames kept per second.
    colour : str (NAME)
        Colour when it opens, as the page's menu names it: speed, heading, height, agent, cluster, group, fault, a
        number that differs among agents, or a variable of the recording with one number for each individual (at each
        time, or for good).

    Returns
    -------
    Replay
        The page: `save(path)` writes it as one HTML file, `text` holds it, and a notebook shows it.

    Raises
    ------
    AirflockError
        RecordingError for a colour that the recording does not know, and for a rate that is none; ScenarioError and
        FlightError where the scenario that it carries cannot be read or flown again.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.replay(airflock.simulate(short)).name
    'vasarhelyi_2018/4ms'
    """
    if not 0.0 < rate < math.inf:
        raise RecordingError(f"rate = {rate:g} frames per second is not above 0")
    frames, period, present = recording_frames(recording)
    axes = frames.shape[1] // 2
    stride = max(1, math.ceil(1.0 / (rate * period) - 1e-6))
    there, every = present[::stride], period * stride
    kept = _held(frames, present)[::stride]
    scenario = scenario_of_recording(recording) if recording.attrs.get("airflock_scenario") else None
    rows = colour_layers(recording, scenario, kept[:, :axes], there, stride)
    whole = there.all()
    flat = np.zeros((kept.shape[2], 3))
    flat[:, :axes] = kept[0, :axes].T
    stage = _scene_json(scenario, kept[:, :axes], flat)
    packed = pack_positions(
        kept[:, :axes], [layer.bytes for layer in rows] + ([] if whole else [there.astype(np.uint8)])
    )
    if scenario is None:  # tracks may lie at 5,000 km north, where single precision resolves half a metre
        packed = packed._replace(low=[*np.subtract(packed.low[:2], stage["centre"][:2]).tolist(), *packed.low[2:]])
        stage["centre"][:2] = 0.0, 0.0
    own = [layer.colours.name for layer in rows]
    ways = [*_motion_colourings(axes), *own]
    _check_colour(colour, ways, "this recording")
    first = float(recording["time"].values[0])
    name = attributes.recording_name(recording)
    speed = np.sqrt((frames[::stride, axes:] ** 2).sum(1))
    mean = np.ma.masked_invalid(speed).mean(axis=1).filled(np.nan)
    # A longer step between two frames is a jump through a periodic face.
    leap = 0.5 * float(scenario.world.side) if scenario and scenario.world.edges == "periodic" else None
    nearest, collisions = _nearest_and_collisions(frames[:, :axes], present, period, scenario)
    about = {
        "name": name, "seed": int(recording.attrs["airflock_seed"]) if "airflock_seed" in recording.attrs else None,
        "first": first, "period": every, "shape": packed.shape, "low": packed.low, "quantum": packed.step,
        "top": float(f"{1.1 * max(float(np.nanquantile(speed, 0.995)), 1e-6):.2g}"),
        "ramp": RAMP_STOPS.astype(int).tolist(), "wheel": WHEEL_STOPS.astype(int).tolist(),
        "blank": NO_VALUE_COLOUR, "way": colour, "ways": ways,
        "layers": [_layer_json(layer.colours) for layer in rows], "whole": bool(whole),
        "height": [float(np.nanmin(frames[:, axes - 1])), float(np.nanmax(frames[:, axes - 1]))],
        "leap": leap, "collisions": [[first + t, i, j] for t, i, j in collisions],
        "events": _event_rows(recording, scenario), "stage": stage,
        "charts": _charts({"mean speed (m/s)": mean, "nearest pair (m)": nearest[::stride]}),
    }  # fmt: skip
    return Replay(_page_html(name, about, packed.data), name)


def check_colour(scenario: Scenario, colour: str) -> None:
    """Raise RecordingError for a colour that the replay of a scenario would refuse, before the flight."""
    _check_colour(colour, [*_motion_colourings(scenario.dimensions), *scenario_layer_names(scenario)], scenario.name)


def _motion_colourings(axes: int) -> list[str]:
    return ["speed", "heading", *(["height"] if axes == 3 else []), "agent"]


def _check_colour(colour: str, colourings: Sequence[str], owner: str) -> None:
    if colour not in colourings:
        hint = suggest(colour, colourings, lead="; ")
        raise RecordingError(f"colour = {colour!r} is none that {owner} knows: {', '.join(colourings)}{hint}")


def _page_html(name: str, about: dict[str, Any], data: bytes) -> str:
    """Fill the template."""
    root = resources.files("airflock.view") / "replays"
    text = (root / "replay.html").read_text(encoding="utf-8")
    parts = {
        "TITLE": html.escape(name),
        "ABOUT": json.dumps(about, allow_nan=False).replace("<", "\\u003c"),
        "DATA": base64.b64encode(data).decode(),
        "THREE": (root / "three.min.js").read_text(encoding="utf-8"),
        "SCRIPT": "\n".join((root / f"{part}.js").read_text(encoding="utf-8") for part in SCRIPT_NAMES),
    }
    return re.sub("@([A-Z]+)@", lambda place: parts[place[1]], text)


def _held(frames: NDArray[Any], present: NDArray[np.bool_]) -> NDArray[Any]:
    """Keep an absent agent at its last position, or at its first one before it appears."""
    if present.all():
        return frames
    known = pd.DataFrame(np.where(present[:, None], frames, np.nan).reshape(len(frames), -1)).ffill().bfill()
    kept, ever = known.to_numpy().reshape(frames.shape).copy(), present.any(axis=0)
    kept[:, :, ~ever] = kept[:, :, [int(ever.argmax())]]
    return np.asarray(kept)


def _charts(courses: Mapping[str, NDArray[Any]]) -> list[list[Any]]:
    """Return charts, as titles and values, of what is known at some time: a lone agent has no nearest pair."""
    return [[title, _rounded(values)] for title, values in courses.items() if np.isfinite(values).any()]


def _layer_json(shade: AgentColours) -> dict[str, Any]:
    """Return the entries of the page for one layer."""
    words = f"{COLOURING_NOTES.get(shade.name, shade.name)}; {shade.note}" if shade.kind == IDENTITIES else shade.note
    return {
        "name": shade.name, "kind": shade.kind, "ends": [f"{shade.low:.3g}", f"{shade.high:.3g} {shade.unit}".strip()],
        "names": list(shade.names), "tones": category_colours(len(shade.names)).tolist(),
        "told": words,
    }  # fmt: skip


def _nearest_and_collisions(
    position: NDArray[Any], present: NDArray[np.bool_], period: float, scenario: Any
) -> tuple[NDArray[Any], list[tuple[float, int, int]]]:
    """Return the smallest distance at each frame (m; nan of one agent), and the collisions: time and pair."""
    measured = scenario.resolved_metrics() if scenario else None
    limit = (
        float(measured.r_coll)
        if measured and COLLISION_METRICS & set(scalar_names(scenario.metrics.rule, measured))
        else 0.0
    )
    nearest, collisions = np.full(len(position), np.nan), []
    # A collision is listed at the frame where a pair comes near, not again while it stays near.
    touching: set[tuple[int, int]] = set()
    for number, frame in enumerate(position):
        who = np.flatnonzero(present[number])
        points = frame.T[who].astype(float)
        if len(points) < 2:
            continue
        box = None
        if scenario and scenario.world.edges == "periodic":
            world = scenario.world
            box = np.array([world.side, world.side, world.height][: points.shape[1]])
            # cKDTree wants coordinates in [0, box); the world has its origin in the middle.
            points = np.mod(points + 0.5 * box, box)
        tree = cKDTree(points, boxsize=box)
        nearest[number] = tree.query(points, k=2)[0][:, 1].min()
        # The nearest pair is known already: most frames need no search for all pairs.
        near = tree.query_pairs(limit) if limit > 0.0 and nearest[number] < limit else set()
        now = {(int(who[i]), int(who[j])) for i, j in near}
        collisions += [(number * period, i, j) for i, j in sorted(now - touching)]
        touching = now
    return nearest, collisions[:MAX_EVENTS]


def _event_rows(recording: xr.Dataset, scenario: Any) -> list[list[Any]]:
    """Return the events of a flight: time, s, and text."""
    events = [] if scenario is None else to_events(attributes.recorded_events(recording))[:MAX_EVENTS]
    texts = [f"{event.kind} " + ", ".join(f"{key} = {value}" for key, value in event.data.items()) for event in events]
    return [[event.step * scenario.flight.dt, text] for event, text in zip(events, texts, strict=True)]


def _scene_json(scenario: Any, position: NDArray[Any], first: NDArray[Any]) -> dict[str, Any]:
    """Return the scene as plain lists."""
    axes = position.shape[1]
    low, high = position.min(axis=(0, 2)), position.max(axis=(0, 2))
    centre, span = [*(0.5 * (low + high)), *[0.0] * (3 - axes)], 0.55 * float(max(np.ptp([low, high], axis=0)))
    solids: list[Any] = []
    lines: list[Any] = []
    if scenario is not None:
        stage: SceneGeometry = scenario_geometry(scenario, first)
        if scenario.world.arena != "none":
            centre, span = stage.centre.tolist(), max(stage.span, 1e-6)
        solids = [[_rounded(s.vertices.ravel()), s.faces.ravel().tolist(), s.colour] for s in stage.solids]
        lines = [[_rounded(line.points.ravel()), line.colour] for line in stage.lines]
    plain = [float(c) for c in centre]
    return {"centre": plain, "span": max(span, 1e-3), "space": axes == 3, "solids": solids, "lines": lines}


def _rounded(values: NDArray[Any]) -> list[float | None]:
    """Round numbers to five digits, for JSON; null for numbers that are not finite."""
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in np.asarray(values, float).tolist()]
