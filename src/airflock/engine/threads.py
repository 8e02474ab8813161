"""Threads: many flights side by side; compiled ones release the interpreter."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from threading import Event, Thread, local
from typing import Any

_thread = local()  # of each worker: the event that tells it to give up its flight


class GivenUp(Exception):
    """A flight was given up because the work that it belongs to was interrupted."""


def heed() -> None:
    """Give up the flight of this thread if its work was interrupted. Raises GivenUp, which nobody waits for."""
    event = getattr(_thread, "interrupted", None)
    if event is not None and event.is_set():
        raise GivenUp


def _begin(interrupted: Event) -> None:
    _thread.interrupted = interrupted


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(
    jobs: Sequence[Callable[[], Any]], threads: int | None = None, done: Callable[[], None] | None = None
) -> Iterator[Any]:
    """Results of jobs in their order, computed by several threads (compiled flights release the interpreter).

    `done` is called after each. Ctrl-C gives up the flights in the air.
    """
    workers = max(1, min(threads or cores(), len(jobs)))
    if workers == 1:
        for job in jobs:
            yield job()
            if done:
                done()
        return
    interrupted = Event()
    with ThreadPoolExecutor(workers, initializer=_begin, initargs=(interrupted,)) as pool:
        futures: list[Future[Any]] = [pool.submit(job) for job in jobs]
        waiting = set(futures)
        try:
            for future in futures:
                while not future.done():
                    ready, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                    for _ in ready:
                        if done:
                            done()
                yield future.result()
            if done:
                for _ in waiting:
                    done()
        finally:
            interrupted.set()
            for future in futures:
                future.cancel()


def in_background(work: Callable[[], Any]) -> Future[Any]:
    """Do some work in a thread of its own, which ends with the program."""
    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except Exception as fault:  # told to whoever asks for the result
            future.set_exception(fault)

    Thread(target=run, daemon=True).start()
    return future
