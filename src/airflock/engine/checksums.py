"""Numba's files of compiled code under checksums of our own: what is damaged is compiled once more, never loaded.

The index and the code of a driver are pickles, which Numba loads without looking. Each gets a seal beside it, written
last: a hash of the driver's digest, the file's name and its content. A seal does not keep out somebody who may write
into the folder; that the folder is the user's alone does (`engine.store`).
"""

import hashlib
import io
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from numba.core.caching import IndexDataCacheFile

from airflock.engine.compile_lock import locked_compile

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
