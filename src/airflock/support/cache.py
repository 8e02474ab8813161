"""The cache: a folder that belongs to the user alone, for compiled drivers and studies behind papers.

`AIRFLOCK_CACHE` names another place than the user's cache folder. The least recently used drivers
go first.
"""

import atexit
import os
import re
import shutil
import stat
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

ROOM = 20_000_000  # bytes that must be free for a driver and its compiled code
MOST = 500_000_000  # bytes of all drivers; beyond it the ones that were not used for longest go
IN_USE = 3600.0  # s since its last use in which no driver is removed
DRIVERS = "drivers"
OWNERS = hasattr(os, "geteuid")  # Windows has none: there a user's own folder is closed to others by its rights


def cache_folder() -> Path:
    """Return the folder that is kept between runs; one of this process alone if that is full or not safe to use."""
    base = default_cache_folder()
    return base if not cache_folder_error(base) else private_folder()


def default_cache_folder() -> Path:
    """Return the folder that the environment names, or the user's cache folder."""
    named = os.environ.get("AIRFLOCK_CACHE")
    return Path(named) if named else Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "airflock"


def cache_folder_error(base: Path) -> str:
    """Return why a folder cannot keep compiled code; empty if it can. A missing folder is made."""
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = base.stat()
        if OWNERS and status.st_uid not in (0, os.geteuid()):
            return f"{base} belongs to another user"
        # Whoever writes to this folder runs code as this user, as drivers are loaded from it.
        if OWNERS and status.st_mode & 0o022 and not status.st_mode & stat.S_ISVTX:
            return f"{base} may be written by other users"
        (base / DRIVERS).mkdir(mode=0o700, exist_ok=True)
        # lstat and not stat: a link could lead to a folder of another user.
        inner = os.lstat(base / DRIVERS)
        if not stat.S_ISDIR(inner.st_mode) or (OWNERS and inner.st_uid != os.geteuid()):
            return f"{base / DRIVERS} is not a folder of this user's"
        if OWNERS and inner.st_mode & 0o077:
            if inner.st_mode & 0o022:  # others may have put code there
                _empty(base / DRIVERS)
            (base / DRIVERS).chmod(0o700)
        with tempfile.TemporaryFile(dir=base / DRIVERS):
            return "" if shutil.disk_usage(base).free > ROOM else f"{base} has less than {ROOM / 1e6:.0f} MB free"
    except OSError as error:
        return f"{base} cannot be written: {error.strerror or error}"


@cache
def private_folder() -> Path:
    """Make a folder of this process alone, whose name nobody can guess; it is removed when the process ends."""
    # A random name for one process: anybody could have made a fixed one such as `/tmp/airflock-UID`
    # before.
    folder = Path(tempfile.mkdtemp(prefix="airflock-"))
    (folder / DRIVERS).mkdir(mode=0o700)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def list_drivers(base: Path) -> list[tuple[float, int, Path]]:
    """Return last use (s since 1970), bytes and folder of every driver, also those of version 0.1, oldest first."""
    drivers = []
    for parent in (base, base / DRIVERS):
        for folder in parent.iterdir() if parent.is_dir() else ():
            # Only names that are digests: other folders of the cache hold studies.
            if re.fullmatch("[0-9a-f]{20}", folder.name) and folder.is_dir() and not folder.is_symlink():
                size = 0
                for path in folder.rglob("*"):
                    with suppress(OSError):  # removed meanwhile
                        size += path.lstat().st_size
                with suppress(OSError):
                    drivers.append((folder.stat().st_mtime, size, folder))
    return sorted(drivers)


def shrink(base: Path, max_bytes: int = MOST) -> int:
    """Remove the least recently used drivers until all take less than `max_bytes` bytes; return how many."""
    known, count = list_drivers(base), 0
    total = sum(size for _, size, _ in known)
    for used, size, folder in known:
        # A driver in use by another process must not vanish between its check and its import.
        if total <= max_bytes or time.time() - used < IN_USE:
            break
        shutil.rmtree(folder, ignore_errors=True)
        total, count = total - size, count + 1
    return count


def clear_cache() -> tuple[int, int]:
    """Remove all compiled drivers. Return how many there were, and their bytes; studies behind papers stay."""
    known = list_drivers(default_cache_folder())
    for _, _, folder in known:
        shutil.rmtree(folder, ignore_errors=True)
    return len(known), sum(size for _, size, _ in known)


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
