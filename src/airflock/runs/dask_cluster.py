"""Flights on many machines, through a scheduler of dask.distributed.

Workers hold no state: a task carries the scenario as text, parameters and a seed, and returns order
parameters. A worker that dies costs only time: its flights are flown again elsewhere, with the same
seeds and therefore the same results. A flight that goes wrong by itself is a result with a reason,
as in one process; one that takes too long is tried again on a fresh worker process and then
recorded as failed.
"""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from airflock.runs.executors import Flight, FlightResult
from airflock.support import StudyError, processor_name

ANSWER = 10.0  # s to wait for a scheduler
AHEAD = 2  # flights per thread that are handed out at a time
RETRIES = 2  # further tries of a flight that took too long
DESERTED = 300.0  # s without a single worker after which nobody is expected to come back
FRESH = 15.0  # s to wait for a fresh worker process
LOSSES = 20  # worker processes that one flight may lose before it is held to be the cause
FlyFunction = Callable[[Mapping[str, float], int], tuple[Any, str, float, str]]  # as `ScenarioTask.__call__`


def check_worker_device(scheduler: str | None, device: str) -> None:
    """Refuse another device where workers fly. Raises StudyError."""
    if scheduler is not None and device != "cpu":
        raise StudyError(f"device = {device}: workers of a scheduler fly on their cpu; leave out one of the two")


def check_timeout(timeout: float | None) -> None:
    """Refuse a time limit in which no flight could fly. Raises StudyError."""
    if timeout is not None and not timeout > 0.0:
        raise StudyError(f"timeout = {timeout:g} s must be above 0")


class DaskCluster:
    """Workers of a dask scheduler."""

    def __init__(
        self,
        tasks: Sequence[FlyFunction],
        address: str,
        *,
        timeout: float | None = None,
        connect_timeout: float = ANSWER,
        is_stored: bool = True,
    ):
        """Connect.

        tasks           : called on a worker, by the place of a flight
        timeout         : s that one flight may take
        connect_timeout : s to wait for the scheduler
        is_stored       : True if landed flights are stored, so that the run can be resumed

        Raises StudyError if nobody answers at the address, or nobody works there.
        """
        try:
            from distributed import Client
        except ModuleNotFoundError as error:
            raise StudyError("--scheduler needs distributed: pip install 'airflock[cluster]'") from error
        self.tasks, self.timeout, self.kept = tuple(tasks), timeout, is_stored
        self.seen = 0.0  # when there was a worker, s of the monotonic clock
        try:
            self.client: Any = Client(address, timeout=connect_timeout, set_as_default=False)
            self.client.wait_for_workers(1, timeout=connect_timeout)
        except Exception as error:  # whatever the network and its libraries raise
            reason = "has no workers" if hasattr(self, "client") else "does not answer"
            if hasattr(self, "client"):
                self.client.close()
            raise StudyError(f"--scheduler {address}: {reason} ({connect_timeout:g} s waited)") from error
        self._warn_of_mixed_processors()

    def _warn_of_mixed_processors(self) -> None:
        # a worker may die before it answers
        models = sorted(set(self.client.run(processor_name, on_error="ignore").values()))
        if len(models) > 1:
            warnings.warn(
                f"workers have different processors ({'; '.join(models)}): flights may differ in the last bits, and "
                "a resumed study may then end differently",
                stacklevel=3,
            )

    def fly(self, flights: Sequence[Flight]) -> Iterator[FlightResult]:
        """Yield each flight as soon as it is over; hand out only so many at a time."""
        from distributed import wait

        waiting = list(reversed(flights))
        tries: dict[tuple[int, int], int] = {}
        out: dict[Any, tuple[Flight, float]] = {}
        self.seen = time.monotonic()
        try:
            while waiting or out:
                threads = max(self._threads(), 1)
                # With a time limit one flight per thread: waiting in a worker's queue must not count as
                # flying.
                while waiting and len(out) < threads * (1 if self.timeout else AHEAD):
                    flight = waiting.pop()
                    # impure: equal flights are equal anyway, and dask must not forget or share one
                    future = self.client.submit(
                        self.tasks[flight.place], dict(flight.parameters), flight.seed, pure=False
                    )
                    out[future] = flight, time.monotonic()
                try:
                    with self.client.as_current():
                        over = wait(list(out), timeout=0.2, return_when="FIRST_COMPLETED").done
                except TimeoutError:
                    over = set()
                for future in over:
                    flight, began = out.pop(future)
                    landed = self._landed(future, flight, began, tries)
                    if landed is None:
                        waiting.append(flight)
                    else:
                        yield landed
                yield from self._late(out, waiting, tries)
        finally:
            self.client.cancel(list(out), force=True)

    def _threads(self) -> int:
        """Threads of all workers; StudyError once the scheduler has gone, or all workers for too long."""
        after = "; what has landed is stored, continue with --resume" if self.kept else ""
        try:
            threads = int(sum(self.client.nthreads().values()))
        except Exception as error:  # whatever the network raises
            raise StudyError(f"the scheduler answers no more{after}") from error
        if threads:
            self.seen = time.monotonic()
        elif time.monotonic() - self.seen > DESERTED:
            raise StudyError(f"the scheduler has had no workers for {DESERTED:g} s{after}")
        return threads

    def _landed(
        self, future: Any, flight: Flight, began: float, tries: dict[tuple[int, int], int]
    ) -> FlightResult | None:
        """Return the result of a task that is over; None if it has to fly again."""
        key = (flight.candidate_index, flight.repeat)
        if future.status == "finished":
            values, reason, duration, worker = future.result()
            return FlightResult(flight, values, reason, duration, worker)
        fault = future.exception() if future.status == "error" else None
        lost = fault is None or type(fault).__name__ in ("KilledWorker", "CommClosedError", "CancelledError")
        tries[key] = tries.get(key, 0) + 1
        # A flight is rarely the cause of a lost worker, so it flies again; after LOSSES workers it
        # fails.
        if lost and tries[key] < LOSSES:
            return None
        reason = f"its worker was lost {tries[key]} times" if lost else f"{type(fault).__name__}: {fault}"
        return FlightResult(flight, None, reason.splitlines()[0], time.monotonic() - began)

    def _late(
        self, out: dict[Any, tuple[Flight, float]], waiting: list[Flight], tries: dict[tuple[int, int], int]
    ) -> Iterator[FlightResult]:
        """Take back flights that take too long: their worker process is started again, and they fly again or fail."""
        if not self.timeout:
            return
        late = [future for future, (_, began) in out.items() if time.monotonic() - began > self.timeout]
        if not late:
            return
        # A running flight cannot be stopped: its worker process is restarted.
        flying = self.client.who_has() | self.client.processing()
        workers = [worker for worker, keys in flying.items() if {future.key for future in late} & set(keys)]
        for future in late:
            flight, began = out.pop(future)
            future.cancel(force=True)
            key = (flight.candidate_index, flight.repeat)
            tries[key] = tries.get(key, 0) + 1
            if tries[key] <= RETRIES:
                waiting.append(flight)
            else:
                reason = f"took longer than {self.timeout:g} s, {tries[key]} times"
                yield FlightResult(flight, None, reason, time.monotonic() - began)
        if workers:
            self.client.restart_workers(workers, timeout=FRESH, raise_for_error=False)

    def close(self) -> None:
        """Leave the scheduler; its workers are not ours to end."""
        self.client.close()


def worker_name() -> str:
    """Address of the worker that runs this."""
    from distributed import get_worker

    try:
        return str(get_worker().address)
    except ValueError:
        return ""
