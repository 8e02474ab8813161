"""Recordings opened by another process, with a time limit: this process reads plain arrays and never opens HDF5.

A damaged file of 34 kB keeps HDF5 busy for ever, and neither a thread nor Ctrl-C can end it. An `Opening`
starts its process at once, so that it works while this one imports.
"""

import json
import math
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from airflock.errors import RecordingError
from airflock.recordings.packed import refuse_packed, refuse_pickle
from airflock.untrusted import from_outside, is_file, path_of

LEAST_TIME = 15.0  # s of a processor that a file of any size may take
WAIT = 4.0  # times as long it may take where processors are busy with other things
PACE = 5e6  # bytes per second that a file of any size is read at
MOST_ABOUT = 200_000_000  # bytes of names and attributes
FOREIGN = (".csv", ".tsv", ".parquet", ".ulg", ".bin", ".tlog", ".npy", ".npz", ".h5")  # what airflock import reads
ENDED_LATE = tuple(-getattr(signal, name) for name in ("SIGXCPU", "SIGKILL") if hasattr(signal, name))
READER = Path(__file__).with_name("reader.py")


KINDS = {
    "recording": "a netCDF recording", "netcdf": "a netCDF file",
    "hdf5": "a HDF5 file", "dataflash": "a DataFlash log", "telemetry": "telemetry",
}  # fmt: skip
PACES = {"dataflash": 1e5, "telemetry": 1e5}  # bytes per second; read by Python, row by row


def _memory() -> int:
    """Bytes of this machine's memory; 8 GB where the system does not tell, as Windows."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8 << 30


class Opening:
    """A file that another process is opening. `answer` waits for it; `close` ends the process in any case."""

    def __init__(self, path: str | os.PathLike[str], *, how: str = "recording", limit: float | None = None):
        """Start the process; how: a recording, or one of `reader.READ`.

        limit : s of a processor, by default 15 s and a second for each 5 MB of the file (0.1 MB of an ArduPilot log)

        Raises RecordingError where there is no such file or no process can be started.
        """
        self.path = path_of(path)
        if not is_file(self.path):
            raise RecordingError(f"{self.path}: no such file")
        if how == "recording" and self.path.suffix.lower() in FOREIGN:
            raise RecordingError(
                f"{self.path}: holds tracks, not a recording: airflock import {self.path.name} --save FILE.nc"
            )
        with from_outside(self.path, RecordingError):
            refuse_packed(self.path)
            refuse_pickle(self.path)
        self.how = how
        self.limit = LEAST_TIME + self.path.stat().st_size / PACES.get(how, PACE) if limit is None else limit
        most = _memory() // 4
        paths = [path for path in sys.path if os.path.isabs(path)]
        asked = {"paths": paths, "file": str(self.path.absolute()), "most": most}
        asked["how"] = "netcdf" if how == "recording" else how
        asked["seconds"] = math.ceil(self.limit)
        # isolated (-I, -S): neither the folder of the recording nor a start-up file decides what is imported
        command = [sys.executable, "-I", "-S", str(READER)]
        # one thread, and no filter of HDF5 from outside its own library
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        if not sys.executable:  # a program that has Python inside
            raise RecordingError(f"{self.path}: cannot be opened: Python does not know its own path")
        try:
            self.process = subprocess.Popen(command, env=environment, bufsize=0, **pipes)
        except OSError as fault:
            raise RecordingError(f"{self.path}: no process can be started to open it: {fault.strerror}") from fault
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as question:  # if it has ended, `answer` says so
            question.write(json.dumps(asked).encode())
        self.until = time.monotonic() + WAIT * self.limit

    def __enter__(self) -> "Opening":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()

    def answer(self, done: Callable[[float], None] | None = None) -> Any:
        """The file as an xarray Dataset, a netCDF file decoded; `done` is called with the share that has been read.

        Raises RecordingError where it is of another kind, or takes too long.
        """
        with self, from_outside(self.path, RecordingError):
            about: dict[str, Any] = {"share": 0.0}
            while set(about) == {"share"}:
                if done is not None:
                    done(min(0.99, float(about["share"])))
                length = int.from_bytes(self._take(bytearray(8)), "little")
                if length > MOST_ABOUT:
                    raise RecordingError(f"{self.path}: its names and attributes take {length / 1e6:.0f} MB")
                about = json.loads(self._take(bytearray(length)))
            if "fault" in about:
                raise RecordingError(f"{self.path}: is not {KINDS[self.how]} that can be read: {about['fault']}")
            return self._dataset(about)

    def _dataset(self, about: dict[str, Any]) -> Any:
        import numpy as np
        import xarray as xr

        variables = {}
        for given in about["variables"]:
            if "strings" in given:
                values = np.array(given["strings"], str).reshape(given["shape"])
            else:
                dtype = np.dtype(given["dtype"])
                if dtype.kind not in "fiubS":
                    raise RecordingError(f"{self.path}: a variable is of kind {dtype}")
                values = np.empty(given["shape"], dtype)
                self._take(values.reshape(-1).view(np.uint8).data)
            variables[given["name"]] = xr.Variable(given["dims"], values, _attributes(given["attributes"]))
        raw = xr.Dataset(variables, attrs=_attributes(about["attributes"]))
        return xr.decode_cf(raw) if self.how in ("recording", "netcdf") else raw

    def _late(self) -> RecordingError:
        return RecordingError(f"{self.path}: could not be opened within {self.limit:.0f} s; it may be damaged")

    def _take(self, into: Any) -> Any:
        """Fill a buffer from the pipe, in time."""
        assert self.process.stdout is not None
        view, pipe = memoryview(into), self.process.stdout.fileno()
        while len(view):
            count = self._piece(pipe, view[: 1 << 20])
            if not count:
                code = self.process.wait(timeout=10.0)
                if code in ENDED_LATE:
                    raise self._late()
                how = f"signal {-code}" if code < 0 else f"status {code}"
                raise RecordingError(f"{self.path}: is damaged: the process that opened it ended with {how}")
            view = view[count:]
        return into

    def _piece(self, pipe: int, view: memoryview) -> int:
        """Read into a buffer what the pipe has, in time; how many bytes, 0 where it has ended."""
        left = self.until - time.monotonic()
        if hasattr(os, "readv"):
            if left <= 0.0 or not select.select([pipe], [], [], left)[0]:
                raise self._late()
            return os.readv(pipe, [view])
        clock = threading.Timer(max(left, 0.0), self.process.kill)  # Windows cannot wait for a pipe
        clock.start()
        try:
            data = os.read(pipe, len(view))
        finally:
            clock.cancel()
        if not data and time.monotonic() >= self.until:
            raise self._late()
        view[: len(data)] = data
        return len(data)


def _attributes(given: dict[str, Any]) -> dict[str, Any]:
    """Attributes as xarray has them: texts, numbers of NumPy, arrays."""
    import numpy as np

    found: dict[str, Any] = {}
    for name, value in given.items():
        if isinstance(value, dict):
            array = np.array(value["values"], np.dtype(value["dtype"])).reshape(value["shape"])
            found[name] = array[()] if array.ndim == 0 else array
        else:
            found[name] = value
    return found
