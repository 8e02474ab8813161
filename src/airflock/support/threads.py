"""Threads: many flights side by side; compiled ones release the interpreter."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Event, Thread, local
from typing import Any

_thread = local()  # of each worker: the event that makes it abandon its flight


class Interrupted(Exception):
    """A flight was abandoned because its work was interrupted."""


def check_interrupted() -> None:
    """Raise Interrupted, which nobody waits for, if the work of this thread was interrupted."""
    event = getattr(_thread, "interrupted", None)
    if event is not None and event.is_set():
        raise Interrupted


def available_cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_in_threads(
    jobs: Sequence[Callable[[], Any]], threads: int | None = None, on_done: Callable[[], None] | None = None
) -> Iterator[Any]:
    """Yield results of jobs in their order, computed by several threads (compiled flights release the interpreter).

    `on_done` is called after each. Ctrl-C abandons the running flights at any moment: this thread
    shares no lock of Python's with the others, which an interruption between taking and releasing
    would leave taken (futures have one).
    """
    workers = max(1, min(threads or available_cores(), len(jobs)))
    if workers == 1:
        for job in jobs:
            yield job()
            if on_done:
                on_done()
        return
    # A queue whose put and get are single calls of C: an interruption cannot leave it locked.
    ended: SimpleQueue[_Ended] = SimpleQueue()
    interrupted, turns = Event(), iter(range(len(jobs)))
    team = [Thread(target=_work, args=(jobs, turns, ended, interrupted), daemon=True) for _ in range(workers)]
    for thread in team:
        thread.start()
    kept: dict[int, _Ended] = {}
    try:
        for number in range(len(jobs)):
            # Results arrive in any order and are handed on in the order of the jobs, so that output
            # never depends on timing.
            while number not in kept:
                latest = ended.get()
                kept[latest.number] = latest
                if on_done and latest.error is None:
                    on_done()
            mine = kept.pop(number)
            if mine.error is not None:
                raise mine.error
            yield mine.result
    finally:
        # Also where the caller stops iterating: the workers abandon their flights at the next
        # check.
        interrupted.set()
        for thread in team:
            thread.join()


@dataclass(frozen=True)
class _Ended:
    number: int
    result: Any = None
    error: BaseException | None = None


def _work(
    jobs: Sequence[Callable[[], Any]], turns: Iterator[int], ended: "SimpleQueue[_Ended]", interrupted: Event
) -> None:
    """Run one job after the other until none is left; the interpreter hands each turn to one thread only."""
    _thread.interrupted = interrupted
    for number in turns:
        if interrupted.is_set():
            return
        try:
            ended.put(_Ended(number, jobs[number]()))
        except BaseException as error:  # raised again where the result is read
            ended.put(_Ended(number, error=error))


def run_in_background(work: Callable[[], Any]) -> Future[Any]:
    """Run some work in a thread of its own, which ends with the program.

    It begins when the caller goes on: a thread that begins at once keeps the interpreter, and its
    caller waiting, for 5 ms.
    """
    future: Future[Any] = Future()
    released = Event()

    def run() -> None:
        released.wait()
        try:
            future.set_result(work())
        except Exception as error:  # raised again where the result is read
            future.set_exception(error)

    # A daemon, so that a compilation in the background does not keep the program from ending.
    Thread(target=run, daemon=True).start()
    released.set()
    return future
