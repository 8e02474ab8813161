"""Executors fly the flights of a run: in threads of this process, together on a GPU, or (`dask_cluster`) on workers.

Workers are stateless: parameters and a seed in, order parameters out.
"""

import json
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from numbers import Integral
from pathlib import Path
from threading import Lock
from typing import Any, Protocol

from airflock.runs.search_space import with_parameters
from airflock.scenarios import Scenario, build_scenario, uses_all_cores
from airflock.support import AirflockError, FlightError, StudyError, available_cores

ScoreFunction = Callable[[Mapping[str, float], int], Mapping[str, Any]]  # parameters and seed → order parameters
AHEAD = 4  # flights per thread that are handed out at a time
_compile_lock = Lock()  # held while a driver is compiled: other threads wait for the first


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


@dataclass(frozen=True)
class RunProgress:
    """Progress of a run.

    stage, text : what is under way, and a few words on it
    done, total : flights of the stage, those of the store included; total is None where it is not
                  known
    fresh       : flights of the stage that this process has flown
    """

    stage: str
    text: str = ""
    done: int = 0
    total: int | None = None
    fresh: int = 0


OnProgress = Callable[[RunProgress], None]


@dataclass
class ProgressTally:
    """Flights of a stage so far, passed to `watch` after each."""

    stage: str
    total: int
    watch: OnProgress | None
    text: str = ""
    done: int = 0
    fresh: int = 0

    def note(self, is_new: bool) -> None:
        """Count one more flight, flown now or read from the store."""
        self.done, self.fresh = self.done + 1, self.fresh + is_new
        if self.watch:
            self.watch(RunProgress(self.stage, self.text, self.done, max(self.total, self.done), self.fresh))


class Executor(Protocol):
    """Flies flights in any order."""

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over; on Ctrl-C only those in the air."""

    def close(self) -> None:
        """Release threads and connections."""


def fly_task(score: ScoreFunction, task: Flight, worker: str = "") -> FlightResult:
    """Fly one flight; an expected error becomes the reason of a failed flight and does not end the run."""
    begin = time.perf_counter()
    try:
        values, reason = score(task.parameters, task.seed), ""
    except (AirflockError, ArithmeticError) as error:
        values, reason = None, first_line(error)
    return FlightResult(task, values, reason, time.perf_counter() - begin, worker)


def first_line(error: Exception) -> str:
    """Return why a flight failed: the first line of an error, or its name."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


class ScenarioTask:
    """How flights of one scenario are scored, here or on a worker; pickled, it is the scenario's text."""

    def __init__(self, scenario: Scenario, precision: int = 32, device: str = "cpu"):
        self.scenario, self.precision, self.device = scenario, precision, device

    def __getstate__(self) -> dict[str, Any]:
        text = json.dumps(self.scenario.document), self.scenario.name
        return {key: value for key, value in vars(self).items() if key != "flown"} | {"scenario": text}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, scenario=rebuild_scenario(*state["scenario"]))

    @cached_property
    def flown(self) -> Scenario:
        """The scenario whose driver flies."""
        return self.scenario

    def compile(self) -> None:
        """Compile the driver, once for all threads."""
        from airflock.engine import compile_for

        with _compile_lock:
            compile_for(self.flown, precision=self.precision)

    def score(self, parameters: Mapping[str, float], seed: int) -> Mapping[str, Any]:
        """Fly with these parameters; return the order parameters."""
        from airflock.engine import score_flight, score_flights

        varied = with_parameters(self.flown, parameters) if parameters else self.flown
        if self.device == "cpu":
            return score_flight(varied, seed, precision=self.precision)
        return score_flights([varied], [seed], precision=self.precision, device=self.device)[0]

    def __call__(self, parameters: Mapping[str, float], seed: int) -> tuple[Any, str, float, str]:
        """Fly on a worker: order parameters or None, reason, duration (s), who flew."""
        from airflock.runs.dask_cluster import worker_name

        self.compile()
        landed = fly_task(self.score, Flight(0, 0, parameters, seed), worker_name())
        return landed.values, landed.reason, landed.duration, landed.worker


@lru_cache(maxsize=8)
def rebuild_scenario(text: str, where: str) -> Scenario:
    """Scenario from its document as JSON; made once in a worker process."""
    # its law has run where the run began: the user who began it has consented
    return build_scenario(json.loads(text), where, folder=Path(where).parent, trust=True)


def make_executor(
    tasks: Sequence[ScenarioTask],
    *,
    scheduler: str | None = None,
    threads: int | None = None,
    timeout: float | None = None,
    is_stored: bool = True,
) -> Executor:
    """Make what flies the tasks of a run: threads of this process, its GPU, or the workers of a dask scheduler.

    timeout : s that one flight may take on a worker; is_stored : as `DaskCluster` takes it
    Nothing is compiled before something flies. Raises StudyError for code that exists only in this
    process, where workers would need it, and for a scheduler that does not answer.
    """
    if scheduler is not None:
        from airflock.runs.dask_cluster import DaskCluster

        for task in tasks:
            try:
                rebuild_scenario(*task.__getstate__()["scenario"])
            except AirflockError as error:
                where = f"{task.scenario.name}: workers cannot rebuild this scenario"
                raise StudyError(f"{where}; put its law into a file: {error}") from error
        return DaskCluster(tasks, scheduler, timeout=timeout, is_stored=is_stored)
    if tasks[0].device == "cuda":
        return BatchExecutor(tasks)
    alone = tasks[0].device == "python" or any(uses_all_cores(task.flown) for task in tasks)

    def compile_all() -> None:
        # before threads ask for it; a second processor has nothing to do until then
        for task in tasks if tasks[0].device == "cpu" else ():
            task.compile()

    scores = [task.score for task in tasks]
    return ThreadExecutor(scores[0], 1 if alone else threads or available_cores(), scores[1:], compile_all)


class ThreadExecutor:
    """Executor of this process: a pool of threads."""

    def __init__(
        self, score: ScoreFunction, threads: int, other_scores: Sequence[ScoreFunction] = (),
        prepare: Callable[[], None] = lambda: None,
    ):  # fmt: skip
        """`score` turns parameters and a seed into order parameters; it is called from `threads` threads.

        other_scores : functions of further scenarios of the run
        prepare      : called before the first flights
        """
        self.scores, self.name = (score, *other_scores), f"{platform.node()}:{os.getpid()}"
        self.prepare, self.ahead = prepare, AHEAD * max(1, threads)
        # Plain threads, one flight each: a compiled flight releases the interpreter. prange would
        # need a second compilation and see Ctrl-C only at the end.
        self.pool = ThreadPoolExecutor(max(1, threads))

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over."""
        left = iter(flights)
        out: set[Future[FlightResult]] = set()
        if flights:
            self.prepare()
        try:
            while True:
                # A few at a time: to wait for one of very many futures takes a time that grows with their number.
                more = islice(left, self.ahead - len(out))
                out |= {self.pool.submit(fly_task, self.scores[f.place], f, self.name) for f in more}
                if not out:
                    return
                # a timeout, so that Ctrl-C is heard while flights are in the air
                over, out = wait(out, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in over:
                    yield future.result()
        except KeyboardInterrupt:
            # Flights cannot be interrupted: those in the air end and are stored, those that wait
            # are cancelled.
            for future in [future for future in out if not future.cancel()]:
                yield future.result()
            raise
        finally:
            for future in out:
                future.cancel()

    def close(self) -> None:
        """End the threads after the flights in the air."""
        self.pool.shutdown(wait=True, cancel_futures=True)


class BatchExecutor:
    """Fly a batch in one call of the engine; bisect it to find a flight with an error, and keep the others."""

    def __init__(self, tasks: Sequence[ScenarioTask]):
        self.tasks = tasks

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield all flights of a scenario once they are over."""
        for place in sorted({flight.place for flight in flights}):
            yield from self._fly(self.tasks[place], [flight for flight in flights if flight.place == place])

    def _fly(self, task: ScenarioTask, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        from airflock.engine import score_flights

        begin, device = time.perf_counter(), task.device
        try:
            varied = [with_parameters(task.flown, flight.parameters) for flight in flights]
            rows = score_flights(varied, [f.seed for f in flights], precision=task.precision, device=device)
        except (AirflockError, ArithmeticError) as error:
            if len(flights) == 1:
                yield FlightResult(flights[0], None, first_line(error), time.perf_counter() - begin, device)
                return
            # One bad flight ends the whole batch. Halving finds it in log2 steps, and all others
            # keep their result.
            half = len(flights) // 2
            yield from self._fly(task, flights[:half])
            yield from self._fly(task, flights[half:])
            return
        each = (time.perf_counter() - begin) / len(flights)
        for flight, values in zip(flights, rows, strict=True):
            yield FlightResult(flight, values, "", each, device)

    def close(self) -> None:
        """Release nothing: this executor holds no threads."""


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

    scheduler : address of a dask scheduler whose workers fly; None: this process, with so many
                threads on a device
    Raises FlightError for a flight that goes wrong, StudyError for a scheduler that does not
    answer.
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
    from airflock.runs.dask_cluster import check_worker_device

    check_worker_device(scheduler, device)
    distinct = {id(scenario): scenario for scenario in scenarios}
    places = {key: place for place, key in enumerate(distinct)}
    pairs = zip(scenarios, seeds, strict=True)
    flights = [Flight(i, 0, {}, seed, places[id(scenario)]) for i, (scenario, seed) in enumerate(pairs)]
    rows: dict[int, dict[str, Any]] = {}
    tasks = [ScenarioTask(scenario, precision) for scenario in distinct.values()]
    cluster = make_executor(tasks, scheduler=scheduler, is_stored=False)
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
