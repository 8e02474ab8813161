"""Compile lock: of several processes that need a driver nobody has compiled yet, one compiles it, the others load it.

The lock is one of the system's on a file beside the driver: it ends with the process that holds it, however that ends.
"""

import gc
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.event import trigger_event

from airflock.engine.compile_shortcuts import import_numpy_implementations, rare_gc
from airflock.engine.thread_waiting import short_spin
from airflock.support import locks

NAME = "lock"
LOOK = 0.05  # s from one try to the next
# Workers that all compile the same driver take as many times the processor time. A lock ends with
# its process; one that is stopped while it has the lock delays the others by five minutes at most.
PATIENCE = 300.0  # s; whoever holds a lock for longer has been stopped, and is waited for no more


def locked_compile(compile_: Callable[[Any], Any], folder: Path) -> Callable[[Any], Any]:
    """Wrap a compilation so that one process at a time compiles, or loads from the folder.

    Where the folder holds an index, the function is loaded, for which nobody waits.
    """

    def under_lock(signature: Any) -> Any:
        with (
            global_compiler_lock,
            rare_gc(),
            short_spin(),
        ):  # the first of all reads half of Numba's modules
            import_numpy_implementations()
            return compile_(signature)

    def locked(signature: Any) -> Any:
        if any(folder.glob("*.nbi")):
            return under_lock(signature)
        with folder_lock(folder):
            found = under_lock(signature)  # which loads what another process has compiled meanwhile
        if gc.isenabled():
            gc.collect()  # what a compiler leaves: whoever flies would have to wait for it soon
        return found

    return locked


@contextmanager
def folder_lock(folder: Path, timeout: float = PATIENCE) -> Iterator[bool]:
    """Hold the lock of a folder; whether it is held. It is not where the file system knows no locks.

    While it waits, who listens to the compiler's passes is told of each try: an interruption is heard.
    """
    handle = -1
    try:
        with suppress(OSError):  # a folder that was removed meanwhile, a full disk: then all compile
            handle = os.open(folder / NAME, os.O_RDWR | os.O_CREAT, 0o600)
        yield handle >= 0 and _taken(handle, time.monotonic() + timeout)
    finally:
        if handle >= 0:
            os.close(handle)


def _taken(handle: int, until: float) -> bool:
    """Return True if the lock was free in time."""
    while True:
        try:
            locks.lock(handle)
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            with trigger_event("numba:run_pass", {"name": "waiting for another process"}):
                time.sleep(LOOK)
        except OSError:
            return False
        else:
            return True
