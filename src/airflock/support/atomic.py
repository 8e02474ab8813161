"""Files that are complete or not there at all: a temporary name in the same folder, then a rename.

A process that is killed leaves its temporary file. It had a lock on it, which the system has
released: so the next process that writes into the folder sees that nobody needs it, and removes it.
The suffix of a file names its format.
"""

import os
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from pathlib import Path

from airflock.support import locks

MARK = ".airflock-"  # in the name of every temporary file
FRESH = 60.0  # s in which a temporary file may not be locked yet
# A stranger may have left a link or a named pipe under such a name: neither is followed nor waited
# for.
FOUND = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # how what was found is opened


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path with the same ending to write to; it takes the final name only if the block succeeds.

    A link is followed: the file that it names is replaced, not the link. Raises OSError, which
    names the path, where it is that of something other than a file, such as a named pipe, and for
    every error while it is written.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not stat.S_ISREG(target.stat().st_mode):
        raise OSError(0, "is there and is not a regular file", str(path))
    remove_leftovers(target.parent)
    try:
        with _beside(target) as temporary:
            yield temporary
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """Yield a temporary file that replaces its target at the end, or vanishes without a trace."""
    # The same folder, since a rename is atomic within one file system only.
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem[:100]}{MARK}", suffix=target.suffix)
    temporary = Path(name)
    try:
        with suppress(OSError):  # some file systems know no locks; then nothing is swept
            locks.lock(handle)
        yield temporary
        # mkstemp makes files that only the user can read; a finished file gets the rights that
        # open() gives.
        temporary.chmod(0o666 & ~_umask())
        handle = _let_go(handle)
        temporary.replace(target)
    except BaseException:
        handle = _let_go(handle)
        temporary.unlink(missing_ok=True)
        raise
    finally:
        if handle >= 0:
            os.close(handle)


def _let_go(handle: int) -> int:
    """Close a file before it is renamed or removed, where the system does that to no open file; else keep it."""
    if locks.CAN_RENAME_OPEN_FILES or handle < 0:
        return handle
    os.close(handle)
    return -1


def write_file(path: str | os.PathLike[str], content: str | bytes | memoryview) -> None:
    """Write text (UTF-8) or bytes; an OSError, which names the path, leaves the old file, or none, in place.

    A memoryview is released in any case: Python 3.12 crashes where an error holds one of a BytesIO
    that has gone.
    """
    with content if isinstance(content, memoryview) else nullcontext(), atomic_path(path) as temporary:
        if isinstance(content, memoryview):
            with open(temporary, "wb") as file:  # Path.write_bytes makes another view, which an error would hold
                file.write(content)
        else:
            temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@cache
def remove_leftovers(folder: Path) -> int:
    """Remove temporary files of killed processes from a folder, once a process; return how many."""
    count = 0
    with suppress(OSError):
        for path in folder.glob(f".*{MARK}????????*"):
            count += _remove(path)
    return count


def _remove(path: Path) -> bool:
    """Remove a temporary file that no process has locked."""
    try:
        handle = os.open(path, FOUND)
    except OSError:
        return False
    try:
        # Between making a file and locking it another process may look: young files are left alone.
        if time.time() - os.fstat(handle).st_mtime < FRESH:
            return False
        # Only a file whose writer is gone can be locked.
        locks.lock(handle)
        handle = _let_go(handle)
        path.unlink()
    except OSError:  # somebody is writing it, or it is not ours
        return False
    finally:
        if handle >= 0:
            os.close(handle)
    return True


def _umask() -> int:
    # The umask can be read only by setting it.
    mask = os.umask(0)
    os.umask(mask)
    return mask


PICTURES = (".png", ".pdf", ".svg")
VIDEOS = (".mp4", ".gif")
RECORDINGS = (".nc",)
TABLES = (".csv",)
PAGES = (".html",)
SCENARIOS = (".toml",)


def suffix_error(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> str:
    """Return why a file cannot be written under this ending; empty if it can."""
    target = Path(path)
    if target.suffix.lower() in suffixes:
        return ""
    ending = f"ending {target.suffix}" if target.suffix else "name without an ending"
    if len(suffixes) == 1:
        return f"{target}: {ending} is not {suffixes[0]}, the only format written here"
    return f"{target}: {ending}: unknown format; give one of {', '.join(suffixes)}"
