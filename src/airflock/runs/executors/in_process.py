"""Flights in this process, side by side on all cores: compiled flights release the interpreter."""

import os
import platform
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from airflock.runs.executors import Flight, FlightResult, ScoreFunction
from airflock.support import AirflockError


def fly_task(score: ScoreFunction, task: Flight, worker: str = "") -> FlightResult:
    """Fly one flight; what goes wrong on purpose is a reason, and no error of the study."""
    begin = time.perf_counter()
    try:
        values, reason = score(task.parameters, task.seed), ""
    except (AirflockError, ArithmeticError) as fault:
        values, reason = None, str(fault).splitlines()[0] if str(fault) else type(fault).__name__
    return FlightResult(task, values, reason, time.perf_counter() - begin, worker)


class ThreadExecutor:
    """A pool of threads, one per core unless told otherwise."""

    def __init__(self, score: ScoreFunction, threads: int, other_scores: Sequence[ScoreFunction] = ()):
        """`score` turns parameters and a seed into order parameters; it is called from `threads` threads.

        others : the same for further scenarios of the study
        """
        self.scores, self.name = (score, *other_scores), f"{platform.node()}:{os.getpid()}"
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
