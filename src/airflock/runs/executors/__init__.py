"""Executors: who flies the flights of a study. Workers are stateless: (parameters, seed) in, order parameters out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

ScoreFunction = Callable[[Mapping[str, float], int], Mapping[str, Any]]  # parameters and seed → order parameters


@dataclass(frozen=True)
class Flight:
    """One flight to be flown: `candidate_index` and `repeat` say which of a generation, `seed` decides all its chance.

    place : which of the study's scenarios
    """

    candidate_index: int
    repeat: int
    parameters: Mapping[str, float]
    seed: int
    place: int = 0


@dataclass(frozen=True)
class FlightResult:
    """A flight that is over: its order parameters, or why there are none.

    duration : s from take-off to landing; worker : who flew it
    """

    flight: Flight
    values: Mapping[str, Any] | None
    reason: str = ""
    duration: float = 0.0
    worker: str = ""


class Executor(Protocol):
    """Flies flights in any order."""

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over; on Ctrl-C only those in the air."""

    def close(self) -> None:
        """Give back what was taken."""
