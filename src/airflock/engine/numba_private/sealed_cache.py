"""Compiled drivers on disk: checksums of Numba's files, and a lock so that one process compiles and the others load.

The index and the code of a driver are pickles, which Numba loads without looking. Each gets a seal
beside it, written last: a hash of the driver's digest, the file's name and its content. A file that
does not fit its seal is compiled once more, never loaded. A seal does not keep out somebody who may
write into the folder; that the folder is the user's alone does (`engine.store`).
"""

import gc
import hashlib
import io
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core.caching import IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock
from numba.core.event import trigger_event

from airflock.engine.never_collected import frozen_imports
from airflock.support import locks

ENDING = ".seal"


class SealedFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Index and code of one compiled function, read only under an unbroken seal."""

    def __init__(self, original: IndexDataCacheFile, digest: str):
        """Take the place of Numba's own for a driver of this digest."""
        self.__dict__.update(vars(original))
        self._digest = digest

    def load(self, key: Any) -> Any:
        """Code for a signature; None, and nothing left of it, where it cannot be loaded."""
        try:
            return super().load(key)
        except Exception:  # a sealed file of another make; whatever a pickle raises, it is compiled once more
            for path in Path(self._cache_path).glob(f"{Path(self._index_name).stem}.*"):
                _remove(path)
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep code; a disk that is full costs a compilation later, and not this flight."""
        with suppress(OSError):
            super().save(key, data)

    def _load_index(self) -> Any:
        return super()._load_index() if self._sound(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        if not self._sound(path):
            raise FileNotFoundError(path)  # which Numba takes for code that is yet to be compiled
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        content = io.BytesIO()
        yield content
        path = Path(filepath)
        for target, given in ((path, content.getvalue()), (_seal(path), self._seal_of(path, content.getvalue()))):
            with super()._open_for_write(str(target)) as file:
                file.write(given)

    def _sound(self, path: Path) -> bool:
        """Return True if a file is as it was sealed; one that is not is removed."""
        try:
            sound = _seal(path).read_bytes() == self._seal_of(path, path.read_bytes())
        except OSError:
            sound = False
        if not sound:
            _remove(path)
        return sound

    def _seal_of(self, path: Path, content: bytes) -> bytes:
        found = hashlib.sha256(f"{self._digest} {path.name}\n".encode())
        found.update(content)
        return found.hexdigest().encode()


def seal_functions(module: ModuleType, digest: str) -> None:
    """Put the compiled functions of a driver under seals, and have one process at a time compile them."""
    for found in vars(module).values():
        cache: Any = getattr(found, "_cache", None)
        files = getattr(cache, "_cache_file", None)
        if isinstance(files, IndexDataCacheFile):
            cache._cache_file = SealedFiles(files, digest)
            cache._impl.rebuild = _or_nothing(cache._impl.rebuild)
            found.compile = locked_compile(found.compile, Path(cache.cache_path))


def _or_nothing(rebuild: Callable[..., Any]) -> Callable[..., Any]:
    """Loading of code that gives None, for "compile it", where a processor or a library is not as it was."""

    def loaded(*given: Any) -> Any:
        try:
            return rebuild(*given)
        except Exception:  # whatever LLVM raises about code that it does not take
            return None

    return loaded


def _seal(path: Path) -> Path:
    return path.with_name(path.name + ENDING)


def _remove(path: Path) -> None:
    for found in (path, _seal(path)):
        with suppress(OSError):
            os.unlink(found)


# One process compiles a driver, the others wait and load it.
# The lock is one of the system's, on a file beside the driver: it ends with the process that holds it.

LOCK_NAME = "lock"
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

    While it waits, who listens to the compiler's passes is told of each try: an interruption is
    heard.
    """
    handle = -1
    try:
        with suppress(OSError):  # a folder that was removed meanwhile, a full disk: then all compile
            handle = os.open(folder / LOCK_NAME, os.O_RDWR | os.O_CREAT, 0o600)
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


SELDOM = (100_000, 50, 50)  # for gc: a compilation makes millions of objects that stay; to look at them takes a tenth


@contextmanager
def rare_gc() -> Iterator[None]:
    """Look for garbage seldom; to be held below Numba's lock, one thread at a time."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], SELDOM[0]) if usual[0] else 0, *map(max, usual[1:], SELDOM[1:]))
    try:
        yield
    finally:
        gc.set_threshold(*usual)


def import_numpy_implementations() -> None:
    """Read the modules in which Numba implements NumPy without SciPy, which takes longer than all the others.

    Numba imports it to learn that it is there; what needs it looks again when it is called. Below
    Numba's lock.
    """
    if "numba.np.arraymath" in sys.modules:
        return
    with frozen_imports():
        from numba.np import linalg

        usual = linalg.ensure_blas
        linalg.ensure_blas = _there
        try:
            from numba.np import arraymath

            arraymath.ensure_blas = usual  # type: ignore[attr-defined]  # Numba has no types, here and below
        finally:
            linalg.ensure_blas = usual


def _there() -> None:
    """Nothing: SciPy is required by this package."""


# GNU's OpenMP lets a thread that has nothing to do look for work 300,000 times before it sleeps. A motion step of a
# large flock has several loops over threads. Where another process needs one of the processors, each of them waits
# until the system takes a processor away from a thread that only waits: a flight takes up to 100 times as long.
# 4,000 boids beside one busy process take 404 ms at the library's 300,000, 55 ms at 30,000, and 6
# ms if threads sleep at once, which costs up to three times as much alone.
# 30,000 is as fast as 300,000 on idle processors, and 4 to 7 times as fast beside other processes.
SPIN_COUNT = "30000"
SPIN_NAME = "GOMP_SPINCOUNT"
CHOSEN = SPIN_NAME, "OMP_WAIT_POLICY"


@contextmanager
def short_spin() -> Iterator[None]:
    """Around what loads the library of threads, which reads its environment once; what a user has chosen stands."""
    if any(name in os.environ for name in CHOSEN):
        yield
        return
    os.environ[SPIN_NAME] = SPIN_COUNT
    try:
        yield
    finally:
        os.environ.pop(SPIN_NAME, None)
