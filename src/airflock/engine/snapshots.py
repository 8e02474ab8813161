"""Snapshots: a stretch of a flight with its scores, and a moment of one to go back to."""

import pickle
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.state import DriverState
from airflock.scenarios import Event, FaultOnset, Scenario
from airflock.support import FlightError


@dataclass(frozen=True)
class Window:
    """A stretch of a flight under one scenario: its order parameters belong to it alone.

    begin, end : s; scores : order parameters and fitness
    """

    scenario: Scenario
    begin: float
    end: float
    scores: dict[str, Any]


@dataclass(frozen=True)
class Snapshot:
    """A moment of a flight: all that it had carried so far, as one block of bytes, and what had been noted of it."""

    version: str
    origin: tuple[Scenario, int, int, Any]
    scenario: Scenario
    state: DriverState
    bytes: NDArray[np.uint8]
    step: int
    has_sensed: bool
    begin: int
    events: tuple[Event, ...]
    windows: tuple[Window, ...]
    frames: tuple[NDArray[Any], ...]
    sampled_values: tuple[NDArray[Any], ...]
    due: tuple[FaultOnset, ...]

    def __repr__(self) -> str:
        """Of which flight it is, and when."""
        time = self.step * self.scenario.flight.dt
        return f"<Snapshot of {self.origin[0].name}, seed {self.origin[1]}, at {time:g} s>"

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled. Raises FlightError where another process could not import a law."""
        check_sendable(self.origin[0], self.scenario)
        return vars(self)


def check_sendable(*scenarios: Scenario) -> None:
    """Raise FlightError where a scenario has code of its own, which another process could not import."""
    for scenario in scenarios:
        try:
            pickle.dumps(scenario)
        except (pickle.PicklingError, AttributeError, TypeError) as fault:  # as pickle says it of functions and classes
            raise FlightError(
                f"{scenario.name}: its own code cannot be sent to another process; open it there by its file, "
                "with the seed and the events of this flight, which then has the same bits"
            ) from fault
