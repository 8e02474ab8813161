"""Locks on open files, one holder at a time; the system releases them however the holder ends.

POSIX locks the whole file with `flock`; Windows locks one byte with `msvcrt`, far beyond the end of
every file of ours, so that others may still read it. Nothing waits here. Windows was not run by us.
"""

import errno
import os

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

CAN_RENAME_OPEN_FILES = fcntl is not None  # whether a file may be renamed or removed while it is open
BYTE = 1 << 30  # which byte is locked, where it is bytes that are locked


def lock(handle: int) -> None:
    """Lock an open file for this handle, until it is closed.

    Raises BlockingIOError where another process has it, and another OSError where the file system
    knows no locks.
    """
    if fcntl is not None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    else:
        _lock_byte(handle)


def _lock_byte(handle: int) -> None:
    """Lock the byte that stands for all of a file."""
    import msvcrt

    # msvcrt locks from the current position on, so it is moved and put back.
    place = os.lseek(handle, 0, os.SEEK_CUR)
    os.lseek(handle, BYTE, os.SEEK_SET)
    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
    except OSError as error:
        # Windows reports a lock of another process with either of these two.
        if error.errno in (errno.EACCES, errno.EDEADLK):
            raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN)) from error
        raise
    finally:
        os.lseek(handle, place, os.SEEK_SET)
