"""A reader of files that is forked from this process instead of started, so that a case takes milliseconds.

It is what `recordings.reader_process` makes of `subprocess.Popen`, as far as that is used there. That a reader of its
own is started as it should be is tested elsewhere (test_recordings_apart.py).
"""

import json
import os
import signal
import time

from airflock.recordings import reader_process as isolated

SHORT = 2.0  # s of a processor that a small file may take, without the start of an interpreter


class Forked:
    """A process that answers as `isolated.START` does."""

    def __init__(self, *_, **__):
        asked, asking = os.pipe()
        telling, told = os.pipe()
        self.returncode, self.pid = None, os.fork()
        if self.pid == 0:
            try:
                os.dup2(asked, 0)
                os.dup2(told, 1)
                os.closerange(3, 256)
                isolated.run_reader(json.loads(os.fdopen(0).readline()))
                os._exit(0)
            finally:
                os._exit(1)
        os.close(asked)
        os.close(told)
        self.stdin, self.stdout = os.fdopen(asking, "wb"), os.fdopen(telling, "rb")

    def kill(self):
        """End it, if it has not ended."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self, timeout=None):
        """Its status, or minus the signal that ended it."""
        until = time.monotonic() + (1e9 if timeout is None else timeout)
        while self.returncode is None and time.monotonic() < until:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
            else:
                time.sleep(0.0005)
        return self.returncode


class Started:
    """The part of the module subprocess that `recordings.reader_process` uses."""

    PIPE = DEVNULL = None
    Popen = Forked


def readers_are_forked():
    """From now on this process forks its readers; their libraries are imported here, once."""
    import h5netcdf  # noqa: F401

    try:
        import pymavlink.DFReader
        import pymavlink.mavutil  # noqa: F401
    except ImportError:  # an extra
        pass
    isolated.subprocess, isolated.LEAST_TIME = Started, SHORT
