"""Origin: where the flights of a page come from: a preset, a scenario file, or a recording that is flown again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import xarray as xr

from airflock.engine import Flight
from airflock.recordings import attributes, load_recording, scenario_of_recording
from airflock.scenarios import Scenario, load
from airflock.support import RecordingError

MAX_DURATION = 1e6  # s; an open page has no end of its own


@dataclass(frozen=True)
class FlightSource:
    """Where flights come from.

    where     : preset, scenario file or recording, which is flown again with its events
    settings  : keys changed from outside
    law       : a law that flies instead of the file's; trust : whether code that the file names may run
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
        """An origin by its name; raises RecordingError for a recording that cannot be flown again."""
        return cls(
            name,
            dict(settings or {}),
            law,
            trust,
            load_repeatable_recording(name) if name.lower().endswith(".nc") else None,
        )

    def scenario(self) -> Scenario:
        """The scenario, with its own duration."""
        if self.recording is not None:
            return scenario_of_recording(self.recording, dict(self.settings))
        return load(self.where, dict(self.settings), self.law, trust=self.trust)

    def flight(self, seed: int, device: str = "cpu") -> tuple[Scenario, Flight]:
        """The scenario without an end, and an open flight of it; that of a recording is a compiled one."""
        preset = without_end(self.scenario())
        if self.recording is None:
            return preset, Flight(preset, seed, device=device)
        same = not self.settings and seed == int(self.recording.attrs["airflock_seed"])
        events = attributes.recorded_events(self.recording) if same else []
        return preset, Flight(preset, seed, precision=int(self.recording.attrs["airflock_precision"]), events=events)

    def beside(self, first: "FlightSource") -> str:
        """What it is called beside another one: its name, or the keys that set it apart."""
        if self.where != first.where:
            return self.where
        return ", ".join(f"{key} = {v}" for key, v in self.settings.items() if first.settings.get(key) != v)

    @property
    def document(self) -> dict[str, Any] | None:
        """The scenario of a recording as a document; None of a preset or a file."""
        return None if self.recording is None else attributes.scenario_document(self.recording)


def load_repeatable_recording(path: str) -> xr.Dataset:
    """A recording that can be flown again. Raises RecordingError for any other, and says what shows it."""
    found = load_recording(path)
    if "airflock_scenario" not in found.attrs or not int(found.attrs.get("random_start", 1)):
        raise RecordingError(f"{path}: was not flown from a scenario and a seed; airflock replay {path} shows it")
    return found


def without_end(scenario: Scenario) -> Scenario:
    """The scenario with the longest duration that a flight can have."""
    longest = min(MAX_DURATION, 0.9 * 2**31 * scenario.flight.dt)
    document = {**scenario.document, "duration": longest}
    return replace(scenario, flight=replace(scenario.flight, duration=longest), document=document)
