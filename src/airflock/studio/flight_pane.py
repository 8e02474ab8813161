"""Flight pane: one open flight that is tuned, its source, its controls, its changes, and the files written from
it.
"""

import math
import os
import shlex
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomlkit
import xarray as xr
from numpy.typing import NDArray

from airflock.core import Choice, Quantity, declarations, format_with_unit
from airflock.engine import Flight, Snapshot
from airflock.recordings import attributes, load_recording, scenario_of_recording, simulate
from airflock.scenarios import (
    Event,
    FaultEntry,
    Scenario,
    entry_of_key,
    fault_declarations,
    fault_key_value,
    group_declarations,
    group_key_value,
    has_fault,
    is_fault_key,
    is_group_key,
    load,
    presets,
    split_key,
    with_old_spread,
)
from airflock.support import FlightError, RecordingError, StudioError, run_in_background

MAX_DURATION = 1e6  # s; an open page has no end of its own


@dataclass(frozen=True)
class FlightSource:
    """Source of flights.

    where     : preset, scenario file or recording, which is flown again with its events
    settings  : keys changed from outside
    law       : a law that flies instead of the file's; trust : whether code that the file names may
                run
    recording : what `where` holds, if it is a recording
    """

    where: str
    settings: Mapping[str, Any]
    law: Any = None
    trust: bool = False
    recording: xr.Dataset | None = None

    @classmethod
    def of(
        cls, name: str, settings: Mapping[str, Any] | None, law: Any = None, *, trust: bool = False
    ) -> "FlightSource":
        """Return the source of a name; raises RecordingError for a recording that cannot be flown again."""
        return cls(
            name,
            dict(settings or {}),
            law,
            trust,
            load_repeatable_recording(name) if name.lower().endswith(".nc") else None,
        )

    def scenario(self) -> Scenario:
        """Load the scenario, with its own duration."""
        if self.recording is not None:
            return scenario_of_recording(self.recording, dict(self.settings))
        return load(self.where, dict(self.settings), self.law, trust=self.trust)

    def flight(self, seed: int, device: str = "cpu") -> tuple[Scenario, Flight]:
        """Open a flight; return its scenario without an end, and the flight. Of a recording it is a compiled one."""
        preset = without_end(self.scenario())
        if self.recording is None:
            return preset, Flight(preset, seed, device=device)
        same = not self.settings and seed == int(self.recording.attrs["airflock_seed"])
        events = attributes.recorded_events(self.recording) if same else []
        return preset, Flight(preset, seed, precision=int(self.recording.attrs["airflock_precision"]), events=events)

    def beside(self, first: "FlightSource") -> str:
        """Return the label beside another source: its name, or the keys that differ."""
        if self.where != first.where:
            return self.where
        return ", ".join(f"{key} = {v}" for key, v in self.settings.items() if first.settings.get(key) != v)

    @property
    def document(self) -> dict[str, Any] | None:
        """Return the scenario of a recording as a document; None for a preset or a file."""
        return None if self.recording is None else attributes.scenario_document(self.recording)


def load_repeatable_recording(path: str) -> xr.Dataset:
    """Load a recording that can be flown again. Raises RecordingError for any other, with the verb that shows it."""
    found = load_recording(path)
    if "airflock_scenario" not in found.attrs or not int(found.attrs.get("random_start", 1)):
        raise RecordingError(f"{path}: was not flown from a scenario and a seed; airflock replay {path} shows it")
    return found


def without_end(scenario: Scenario) -> Scenario:
    """Return the scenario with the longest duration that a flight can have."""
    longest = min(MAX_DURATION, 0.9 * 2**31 * scenario.flight.dt)
    document = {**scenario.document, "duration": longest}
    return replace(scenario, flight=replace(scenario.flight, duration=longest), document=document)


def tuned_toml(
    source: str,
    settings: Mapping[str, Any],
    recorded_document: Mapping[str, Any] | None = None,
    full_document: Mapping[str, Any] | None = None,
) -> str:
    """Return a preset or scenario file with changed keys; comments, units and sources of the others stay.

    given : the scenario of a recording, instead of a file
    whole : what the scenario consists of with all that it extends, for groups and faults that the
            file does not write
    """
    path = presets().get(source) or Path(source)
    text = path.read_text(encoding="utf-8") if recorded_document is None else tomlkit.dumps(recorded_document)
    document: Any = tomlkit.parse(text)
    for key, value in settings.items():
        table, name = _table_and_name(document, key, full_document or {})
        known = table.get(name)
        if is_group_key(key) and not isinstance(value, Mapping):
            table[name] = with_old_spread(known, value)
        elif isinstance(known, Mapping) and "value" in known and not isinstance(value, Mapping):
            known["value"] = value  # type: ignore[index]
            known.pop("unit", None)  # type: ignore[attr-defined]
            known["source"] = f"tuned by hand; before: {known.get('source', 'not given')}"  # type: ignore[index]
        else:
            table[name] = value
    document.pop("published", None)  # those figures belong to the untouched scenario
    return tomlkit.dumps(document)


def _table_and_name(document: Any, key: str, full_document: Mapping[str, Any]) -> tuple[Any, str]:
    """Return the table of a document that holds a key, made if missing, and the key's name in it."""
    section, _, name = key.partition(".")
    if not name:
        return document, section
    if not (is_group_key(key) or is_fault_key(key)):
        return document.setdefault(section, tomlkit.table()), name
    if section not in document:
        document[section] = [dict(entry) for entry in full_document.get(section, ())]
    if is_fault_key(key):
        number, name = entry_of_key(document[section], key)
        return document[section][number], name
    group, part, name = split_key(key)
    names = [entry.get("name", f"group_{number}") for number, entry in enumerate(document[section])]
    return document[section][names.index(group)].setdefault(part, tomlkit.inline_table()), name


def free_path(path: Path) -> Path:
    """Return an unused name: flight.nc, flight-2.nc, ..."""
    found, number = path, 2
    while found.exists():
        found, number = path.with_name(f"{path.stem}-{number}{path.suffix}"), number + 1
    return found


def refly(flight: Flight) -> xr.Dataset:
    """Fly an open flight again without a page, from its scenario, seed and events, and return its recording.

    Raises FlightError where the end of it has other bits than the flight at hand.
    """
    if flight.step < 1:
        raise FlightError("nothing has been flown yet")
    scenario, seed, precision, start = flight.origin
    document = {**scenario.document, "duration": flight.time}
    short = replace(scenario, flight=replace(scenario.flight, duration=flight.time), document=document)
    events = [event for event in flight.events if event.step < flight.step]
    again = Flight(short, seed, precision=precision, start=start, events=events)
    again.advance(steps=flight.step)
    if len(events) == len(flight.events) and not np.array_equal(again.state, flight.state, equal_nan=True):
        raise FlightError(f"{scenario.name}: flown again, the positions at t = {flight.time:g} s differ")
    return simulate(short, seed, precision=precision, start=start, events=events)


CONTROL_SECTIONS = ("model", "body", "sensors", "radio", "topology", "wind", "goals", "wing", "metrics")
DEFAULT_SPAN_FACTOR = 4.0  # a slider ends at so many times the preset's value
SLIDER_STEPS = 400  # of a slider


class ParameterControl(NamedTuple):
    """Control of a parameter: a number with a span, or a choice with options.

    key   : as in a scenario file, such as model.p_rep
    label : name and unit
    hint  : meaning, allowed range and source
    value : of the scenario at hand
    low, high, step : of the slider; nan for a choice
    """

    key: str
    label: str
    hint: str
    value: Any
    low: float = math.nan
    high: float = math.nan
    step: float = math.nan
    options: tuple[str, ...] = ()


def scenario_controls(
    scenario: Scenario, default_spans: Mapping[str, tuple[float, float]] | None = None
) -> dict[str, list[ParameterControl]]:
    """Return controls by section, in the order in which the parameters are declared; empty sections are left out.

    The law's section is sorted into the parts that the law names, "model: repulsion" and so on.
    Numbers that a group has of its own follow: those that the file names for it, and all of a law
    of its own.
    usual : spans of sliders by key, as a study of the law has them

    A number that is derived from the rest of the scenario (None) gets no control, nor do lists and
    texts.
    """
    parts = scenario.model.parts
    part_of = {f"model.{name}": f"model: {part}" for part, names in parts.items() for name in names}
    found: dict[str, list[ParameterControl]] = {f"model: {part}": [] for part in parts}
    for section in CONTROL_SECTIONS:
        record = scenario.records[section]
        for name, declared, _ in declarations(record):
            value = getattr(record, name)
            key = f"{section}.{name}"
            if isinstance(declared, Quantity) and value is not None:
                made = make_slider(key, declared, value, (default_spans or {}).get(key))
            elif isinstance(declared, Choice):
                hint = _hint_text(declared.meaning, "", declared.source)
                made = ParameterControl(key, name, hint, value, options=declared.options)
            else:
                continue
            found.setdefault(part_of.get(key, section), []).append(made)
    for key, declared, value in group_declarations(scenario):
        if isinstance(declared, Quantity) and value is not None:
            group, section, _ = split_key(key)
            found.setdefault(f"group {group}: {section}", []).append(make_slider(key, declared, value))
    return {part: made for part, made in found.items() if made}


def fault_controls(entries: Sequence[FaultEntry]) -> dict[str, list[ParameterControl]]:
    """Return controls of the numbers of each fault of a scenario, in the order of its entries; many kinds have
    none.
    """
    found: dict[str, list[ParameterControl]] = {}
    for key, kind, declared, value in fault_declarations(entries):
        if isinstance(declared, Quantity):
            found.setdefault(f"fault {key.split('.')[1]}: {kind}", []).append(make_slider(key, declared, value))
    return found


def make_slider(
    key: str, declared: Quantity, value: float, study_span: tuple[float, float] | None = None
) -> ParameterControl:
    """Make the slider of a number, over a study's span or the declared usual one, widened to hold the value.

    Without either from 0 to 4 times the value, or as far on both sides of 0, within the declared
    range.
    """
    usual = study_span or declared.usual
    low, high = (
        (min(usual[0], value), max(usual[1], value)) if usual else slider_span(declared.low, declared.high, value)
    )
    label = format_with_unit(key.rpartition(".")[2], f"({declared.unit})" if declared.unit not in ("", "1") else "")
    hint = _hint_text(declared.meaning, declared.span, declared.source)
    step = _round_step((high - low) / SLIDER_STEPS)
    return ParameterControl(key, label, hint, value, low, high, max(1.0, round(step)) if declared.whole else step)


def slider_span(low: float, high: float, value: float) -> tuple[float, float]:
    """Return the ends of a slider: inside [low, high], around the value, and narrow enough to set it by hand."""
    reach = DEFAULT_SPAN_FACTOR * abs(value) if value else min(1.0, max(abs(low), abs(high)))
    begin, end = max(low, -reach if low < 0.0 else 0.0), min(high, reach)
    return min(begin, value), max(end, value)


def set_options(settings: Mapping[str, Any]) -> str:
    """Return keys and values as options of the command: --set model.p_rep=0.2 ..."""
    return " ".join(f"--set {shlex.quote(f'{key}={_toml_text(value)}')}" for key, value in settings.items())


def _toml_text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def _round_step(step: float) -> float:
    """Return a step of 1, 2 or 5 times a power of ten, at most as large."""
    if step <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(step))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= step * (1.0 + 1e-9))


def _hint_text(meaning: str, allowed: str, source: str) -> str:
    return "; ".join(part for part in (meaning, allowed and f"allowed {allowed}", source) if part)


ABSENT_HEIGHT, ABSENT_SPACING = -1e7, 1e4  # m; where agents that have left are shown: nowhere
MAX_INTERPRETED_AGENTS = 400  # agents; of more, one interpreted step holds a page up


class FlightPane:
    """One flight of a source, with a list of its changes, so that they can be undone.

    at_once : fly interpreted while the driver is compiled, until `switch_to_compiled` (a recording,
              a large flock: compiled)

    Attributes: preset, the scenario at its start; flight; changed, keys that differ from it with
    their values.
    """

    def __init__(self, origin: FlightSource, seed: int, interpret_first: bool = False):
        self.origin = origin
        self.preset, self.flight = origin.flight(seed)
        self._compiled_flight: Future[Flight] | None = None
        if (
            interpret_first
            and origin.recording is None
            and self.flight.agents <= MAX_INTERPRETED_AGENTS
            and not self.flight.ready
        ):
            self._compiled_flight = run_in_background(partial(self.flight.compile, aside=True))
            _, self.flight = origin.flight(seed, "python")
        self.changed: dict[str, Any] = {}
        self._undo_list: list[dict[str, Any]] = []
        self._manual_fault_values: dict[
            str, Any
        ] = {}  # numbers of faults that were set off by hand, as they were at first
        self._gust: tuple[float, dict[str, Any]] | None = None  # how long it blows, s; what is set back after it
        self._gust_end: float | None = None  # when it ends, s

    @property
    def is_compiling(self) -> bool:
        """True while an interpreted flight stands for one that is being compiled."""
        return self._compiled_flight is not None

    @property
    def is_compiled(self) -> bool:
        """True if `switch_to_compiled` has nothing to wait for."""
        return self._compiled_flight is None or self._compiled_flight.done()

    def switch_to_compiled(self) -> Snapshot | None:
        """Replace the flight by the compiled one, flown again to here with all events. Return its start.

        From here on, and in what is saved of it, bits are those of the compiled flight. None where
        nothing is compiled. Raises RuleError.
        """
        if self._compiled_flight is None:
            return None
        # The compiled flight flies from the start to the present step, so that saved bits are those
        # of a compiled flight. Carrying the interpreted state over would save a flight that nobody
        # can fly again.
        interpreted, (self.flight, self._compiled_flight) = self.flight, (self._compiled_flight.result(), None)
        start = self.flight.snapshot()
        self._replay(interpreted.events)
        self._advance_to(interpreted.step * self.scenario.flight.dt)
        return start

    def fork(self) -> "FlightPane":
        """Return another pane that goes on from here, with the same noise."""
        # Not by __init__: a new pane would compile and start again; the flight alone is branched.
        twin = object.__new__(FlightPane)
        twin.__dict__.update(self.__dict__)
        twin.flight = self.flight.branch()
        twin.changed, twin._undo_list = dict(self.changed), []
        return twin

    @property
    def scenario(self) -> Scenario:
        """Scenario in force."""
        return self.flight.scenario

    @property
    def motion(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return positions (agent, 3) in m and velocities (agent, 3) in m/s; the third axis of a plane is 0.

        Agents that have left are far below, each in a place of its own, at rest.
        """
        position, velocity = positions_and_velocities(self.flight.state, self.scenario.dimensions)
        gone = np.flatnonzero(~self.flight.present)
        position[gone] = np.column_stack([ABSENT_SPACING * gone, 0.0 * gone, np.full(len(gone), ABSENT_HEIGHT)])
        velocity[gone] = 0.0
        return position, velocity

    @property
    def settings(self) -> dict[str, Any]:
        """Keys that differ from the file, without those of faults begun by hand, which the file does not have."""
        return {**self.origin.settings, **{key: v for key, v in self.changed.items() if not self._is_manual_fault(key)}}

    def command(self, seed: int) -> str:
        """Command that opens the present scenario again."""
        origin = self.origin
        where = f"./{origin.where}" if origin.where.startswith("-") else origin.where  # not an option
        law = f"--law {shlex.quote(str(origin.law))}" if isinstance(origin.law, str | os.PathLike) else ""
        trust = "--trust" if origin.trust else ""
        parts = ["airflock watch", shlex.quote(where), law, trust, set_options(self.settings), f"--seed {seed}"]
        return " ".join(part for part in parts if part)

    def fly_to(self, time: float) -> None:
        """Fly to a time, s; a gust that ends on the way is ended there."""
        before = self.flight.time
        self._advance_to(time if self._gust_end is None else min(time, self._gust_end))
        if self._gust is None:
            return
        # A change of wind may wait for its driver; the gust lasts from when it begins to blow.
        if self._gust_end is None and not self.flight.waiting:
            self._gust_end = before + self._gust[0]
        if self._gust_end is not None and self.flight.time >= self._gust_end - 1e-9:
            self.flight.change(self._gust[1])  # its driver flew before the gust: nothing is compiled
            self._gust = self._gust_end = None
            self._advance_to(time)

    def _advance_to(self, time: float) -> None:
        steps = round(time / self.scenario.flight.dt) - self.flight.step
        if steps > 0:
            self.flight.advance(steps=steps)

    def again(self, moment: Snapshot, time: float) -> None:
        """Go back to a snapshot, then fly to a time, s, with all events up to there."""
        done = self.flight.events[len(moment.events) :]
        self.restore(moment)
        last = round(time / self.scenario.flight.dt)
        # Events are part of the flight: without them the same seed would lead elsewhere.
        self._replay([event for event in done if event.step < last])
        self._advance_to(time)
        self.changed = self._current_changes()

    def _replay(self, events: Sequence[Event]) -> None:
        for event in events:
            self._advance_to(event.step * self.scenario.flight.dt)
            self.flight.event(event.kind, **event.data)

    def restore(self, moment: Snapshot) -> None:
        """Go back to a snapshot of this flight, s; its later part is dropped."""
        self.flight.restore(moment)
        self._gust = self._gust_end = None
        self.changed, self._undo_list = self._current_changes(), []
        self._manual_fault_values = {
            key: value for key, value in self._manual_fault_values.items() if key in self.changed
        }

    def _current_changes(self) -> dict[str, Any]:
        """Return the keys that are changed at the present moment of the flight, with their values."""
        found: dict[str, Any] = {}
        for event in self.flight.events:
            if event.kind == "change":
                found |= event.data
        return {key: value for key, value in found.items() if value != self._start_value(key)}

    def _start_value(self, key: str) -> Any:
        """Return the value of a key in the preset; for a fault begun by hand, its value at that time."""
        return self._manual_fault_values.get(key) if self._is_manual_fault(key) else scenario_value(self.preset, key)

    def _is_manual_fault(self, key: str) -> bool:
        """Return True if a key belongs to a fault that was begun by hand."""
        return is_fault_key(key) and not has_fault(self.preset, key)

    def change(self, settings: Mapping[str, Any]) -> None:
        """Set keys of the scenario from now on; what must be compiled comes into force when that is done."""
        # Faults begun by hand are not in the file, so their first values must be remembered for
        # undo.
        by_hand = {key: scenario_value(self.scenario, key) for key in settings if self._is_manual_fault(key)}
        self.flight.change(settings, wait=False)
        self._manual_fault_values = {**by_hand, **self._manual_fault_values}
        self._undo_list.append(dict(self.changed))
        self.changed = {**self.changed, **settings}

    def undo(self) -> dict[str, Any]:
        """Take the last change back, as a further change. Returns the keys set, with their values."""
        return self._return_to(self._undo_list.pop()) if self._undo_list else {}

    def undo_all(self) -> dict[str, Any]:
        """Set everything that was changed back to the preset. Returns the keys set, with their values."""
        self._undo_list.append(dict(self.changed))
        return self._return_to({})

    def _return_to(self, target: dict[str, Any]) -> dict[str, Any]:
        keys = [key for key in self.changed if target.get(key) != self.changed[key]]
        values = {key: target[key] if key in target else self._start_value(key) for key in keys}
        if values:
            self.flight.change(values, wait=False)
        self.changed = dict(target)
        return values

    def gust(self, east: float, north: float, seconds: float) -> None:
        """Let the wind blow stronger by so much (m/s) for some seconds, then as it was."""
        wind = self.scenario.wind
        back = {"wind.east": wind.east, "wind.north": wind.north} if self._gust is None else self._gust[1]
        self.flight.change({"wind.east": wind.east + east, "wind.north": wind.north + north}, wait=False)
        self._gust, self._gust_end = (seconds, back), None

    def check_free(self, x: float, y: float, width: float, name: str = "") -> None:
        """Raise StudioError where an agent is inside a square around (x, y), m."""
        position, _ = self.motion
        inside = np.flatnonzero((np.abs(position[:, :2] - (x, y)) <= 0.5 * width).all(axis=1))
        if len(inside):
            raise StudioError(f"agent {inside[0]} {f'of {name} ' if name else ''}is where the obstacle would stand")

    def throw_obstacle(self, x: float, y: float, width: float) -> None:
        """Add a square obstacle of a width, m, around (x, y) to the world."""
        half = 0.5 * width
        corners = [[x - half, y - half], [x + half, y - half], [x + half, y + half], [x - half, y + half]]
        known = [[list(corner) for corner in outline] for outline in self.scenario.world.obstacles]
        self.change({"world.obstacles": [*known, corners]})

    def move_goal(self, number: int, position: Sequence[float]) -> None:
        """Put a goal somewhere else, m; goals that the scene gave are points from then on."""
        dims = self.scenario.dimensions
        points = [[float(c) for c in point] for point in self.scenario.waypoints()]
        if number < len(points):
            points[number][:dims] = [float(c) for c in position[:dims]]
            self.change({"goals.kind": "points", "goals.points": points})


def positions_and_velocities(state: NDArray[Any], dimensions: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return positions and velocities (agent, 3) of a state (component, agent) of two or three dimensions."""
    found = np.zeros((2, state.shape[1], 3), np.float32)
    found[0, :, :dimensions], found[1, :, :dimensions] = state[:dimensions].T, state[dimensions : 2 * dimensions].T
    return found[0], found[1]


def scenario_value(scenario: Scenario, key: str) -> Any:
    """Return the value of a key such as model.p_rep, groups.heavy.body.tau or faults.0.share; None for a missing
    fault.
    """
    if is_group_key(key):
        return group_key_value(scenario, key)
    if is_fault_key(key):
        return fault_key_value(scenario, key)
    section, _, name = key.partition(".")
    if not name:
        return getattr(scenario.flight, section)
    return getattr(scenario.records[section], name)
