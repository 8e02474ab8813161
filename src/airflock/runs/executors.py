"""Executors fly the flights of a study: in threads of this process, or (`dask_cluster`) on workers of a scheduler.

Workers are stateless: parameters and a seed in, order parameters out.
"""

import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from numbers import Integral
from typing import Any, Protocol

from airflock.scenarios import Scenario
from airflock.support import AirflockError, FlightError

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
        """Release threads and connections."""


def fly_task(score: ScoreFunction, task: Flight, worker: str = "") -> FlightResult:
    """Fly one flight; an expected error becomes the reason of a failed flight and does not end the study."""
    begin = time.perf_counter()
    try:
        values, reason = score(task.parameters, task.seed), ""
    except (AirflockError, ArithmeticError) as error:
        values, reason = None, str(error).splitlines()[0] if str(error) else type(error).__name__
    return FlightResult(task, values, reason, time.perf_counter() - begin, worker)


class ThreadExecutor:
    """Executor of this process: a pool of threads."""

    def __init__(self, score: ScoreFunction, threads: int, other_scores: Sequence[ScoreFunction] = ()):
        """`score` turns parameters and a seed into order parameters; it is called from `threads` threads.

        other_scores : functions of further scenarios of the study
        """
        self.scores, self.name = (score, *other_scores), f"{platform.node()}:{os.getpid()}"
        # Plain threads, one flight each: a compiled flight releases the interpreter. prange would
        # need a second compilation and see Ctrl-C only at the end.
        self.pool = ThreadPoolExecutor(max(1, threads))

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over."""
        waiting: set[Future[FlightResult]] = {
            self.pool.submit(fly_task, self.scores[f.place], f, self.name) for f in flights
        }
        try:
            while waiting:
                # a timeout, so that Ctrl-C is heard while flights are in the air
                over, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in over:
                    yield future.result()
        except KeyboardInterrupt:
            # Flights cannot be interrupted: those in the air end and are stored, those that wait
            # are cancelled.
            in_the_air = [future for future in waiting if not future.cancel()]
            for future in in_the_air:
                yield future.result()
            raise
        finally:
            for future in waiting:
                future.cancel()

    def close(self) -> None:
        """End the threads after the flights in the air."""
        self.pool.shutdown(wait=True, cancel_futures=True)


def score_scenarios(
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    *,
    scheduler: str | None = None,
    threads: int | None = None,
    precision: int = 32,
    on_done: Callable[[], None] | None = None,
    device: str = "cpu",
    notify: Callable[[str], None] | None = None,
) -> list[dict[str, Any]]:
    """Return the order parameters of flight i of scenarios[i] with seeds[i].

    scheduler : address of a dask scheduler whose workers fly; None: this process, with so many threads on a device
    Raises FlightError for a flight that goes wrong, StudyError for a scheduler that does not answer.
    """
    from airflock.engine import pick_device, score_flights

    if threads is not None and not isinstance(threads, Integral):
        raise FlightError(f"threads = {threads!r} is not a whole number of flights side by side")
    if scheduler is not None:
        return _on_workers(scheduler, scenarios, seeds, precision, device, on_done)
    device = pick_device(scenarios, device, precision=precision, notify=notify)
    return score_flights(scenarios, seeds, threads=threads, precision=precision, on_done=on_done, device=device)


def _on_workers(
    scheduler: str, scenarios: Sequence[Scenario], seeds: Sequence[int], precision: int, device: str,
    done: Callable[[], None] | None,
) -> list[dict[str, Any]]:  # fmt: skip
    from airflock.runs.dask_cluster import DaskCluster, ScenarioTask, check_worker_device

    check_worker_device(scheduler, device)
    distinct = {id(scenario): scenario for scenario in scenarios}
    places = {key: place for place, key in enumerate(distinct)}
    tasks = [ScenarioTask(scenario, precision) for scenario in distinct.values()]
    pairs = zip(scenarios, seeds, strict=True)
    flights = [Flight(i, 0, {}, seed, places[id(scenario)]) for i, (scenario, seed) in enumerate(pairs)]
    rows: dict[int, dict[str, Any]] = {}
    cluster = DaskCluster(tasks, scheduler, is_stored=False)
    try:
        for landed in cluster.fly(flights):
            if landed.values is None:
                raise FlightError(landed.reason)
            rows[landed.flight.candidate_index] = dict(landed.values)
            if done is not None:
                done()
    finally:
        cluster.close()
    return [rows[i] for i in range(len(flights))]
