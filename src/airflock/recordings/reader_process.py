"""Open a file in a process of its own, with limits of time and memory, and get plain arrays back.

HDF5 is a large library in C. A damaged file of 34 kB keeps it busy for ever, and no thread and no
Ctrl-C ends it; others crash it. Readers of ArduPilot's logs loop without end in some files.
`ReaderProcess` is the side of the caller. It starts the process at once, so that the process works
while the caller still imports.

The process gets one line of JSON, its request. It answers with lines of JSON: any number of
{"share": of the file that has been read}, then {"error": text} or a header of attributes and
variables, and after that the bytes of the variables.
"""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from airflock.recordings.imports import formats
from airflock.support import RecordingError, as_error, is_file, to_path

# Archives, compressed files and pickles are no recordings, whatever their names say; one line names
# the remedy.
ARCHIVES = (".zip", ".gz", ".7z", ".tar", ".rar", ".xz", ".bz2")
STARTS = {b"PK\x03\x04": "a zip archive; unpack it first: unzip", b"\x1f\x8b": "compressed; unpack it first: gunzip"}
PICKLES = (".pkl", ".pickle")


def refuse_archive(path: Path) -> None:
    """Raise a RecordingError for an archive, where one of NumPy's (.npz) is none, and for what is called a pickle."""
    with path.open("rb") as file:
        start = file.read(4)
    for mark, what in STARTS.items():
        if start.startswith(mark) and path.suffix.lower() != ".npz":
            raise RecordingError(f"{path}: is {what} {path.name}")
    if path.suffix.lower() in ARCHIVES:
        raise RecordingError(f"{path}: is an archive; unpack it first")
    if path.suffix.lower() in PICKLES:
        raise RecordingError(
            f"{path}: holds pickled Python objects, which could run code when read; if you trust the file and it is a "
            f"table of pandas, python -c \"import pandas as pd; pd.read_pickle('{path.name}').to_csv('tracks.csv')\""
        )


# A file of 34 kB with 350 zeroed bytes keeps HDF5 busy for ever, beyond Ctrl-C. Not a fork: a
# process with threads may fork while a lock is taken.
LEAST_TIME = 15.0  # s of a processor that a file of any size may take
WAIT = 4.0  # time by the clock over that of a processor, for machines that are busy with other things
MOST_HEADER = 200_000_000  # bytes of names and attributes
SPARE = 4 * 2**30  # bytes of address space besides the arrays: libraries, buffers
RECORDING = "a netCDF recording"
ENDED_LATE = tuple(-getattr(signal, name) for name in ("SIGXCPU", "SIGKILL") if hasattr(signal, name))
START = """import json, sys
request = json.loads(sys.stdin.readline())
sys.path[:] = request["paths"]
from airflock.recordings.reader_process import run_reader
run_reader(request)"""

OnShare = Callable[[float], None]
# attributes of a file, and its variables by name: dimensions if they have names, attributes, values
Contents = tuple[dict[str, Any], dict[str, tuple[list[str] | None, dict[str, Any], Any]]]


def read_netcdf_arrays(path: str, max_bytes: int, _: OnShare) -> Contents:
    """Read a netCDF file; raise ValueError for what reaches outside the file or is too large."""
    import h5netcdf

    _refuse_outside(path, max_bytes)
    with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
        return _to_json(file.attrs), {
            name: (list(variable.dimensions), _to_json(variable.attrs), variable[...])
            for name, variable in file.variables.items()
        }


def read_hdf5_arrays(path: str, max_bytes: int, _: OnShare) -> Contents:
    """Read the arrays at the root of any HDF5 file; raise ValueError as `read_netcdf_arrays` does."""
    import h5py

    _refuse_outside(path, max_bytes)
    with h5py.File(path, "r") as file:
        arrays = {name: file[name] for name in file if isinstance(file[name], h5py.Dataset)}
        groups = {"groups": ", ".join(name for name in file if name not in arrays)}
        return _to_json({**file.attrs, **groups}), {name: (None, {}, array[()]) for name, array in arrays.items()}


def read_mat_arrays(path: str, max_bytes: int, _: OnShare) -> Contents:
    """Read the numbers in a file of MATLAB of the format before 7.3; raise ValueError for what is too large."""
    from scipy.io import loadmat, whosmat

    shapes = [shape for _, shape, _ in whosmat(path)]
    if sum(8.0 * math.prod(map(float, shape)) for shape in shapes) > max_bytes:
        raise ValueError(f"its arrays are too large; there is room for {max_bytes / 1e9:.3g} GB")
    arrays = {name: value for name, value in loadmat(path).items() if not name.startswith("__")}
    return {}, {name: (None, {}, value) for name, value in arrays.items() if value.dtype.kind in "fiu"}


class ReaderProcess:
    """A file that another process is opening. `answer` waits for it; `close` ends the process in any case."""

    def __init__(
        self, path: str | os.PathLike[str], read: Callable[[str, int, OnShare], Contents] = read_netcdf_arrays,
        kind: str = RECORDING, *, pace: float = 5e6, limit: float | None = None,
    ):  # fmt: skip
        """Start the process.

        read  : runs there, on the path, the bytes that all arrays may take, and a function that
                reports the share read
        kind  : of file, for messages; pace : bytes of it that are read in a second
        limit : s of a processor, by default 15 s and what the file takes at its pace

        Raises RecordingError where there is no such file or no process can be started.
        """
        self.path, self.kind, self.decoded = to_path(path), kind, read is read_netcdf_arrays
        if not is_file(self.path):
            raise RecordingError(f"{self.path}: no such file")
        ending = self.path.suffix.lower()
        if kind == RECORDING and ending != ".nc" and any(ending in one.suffixes for one in formats()):
            raise RecordingError(
                f"{self.path}: holds tracks, not a recording: airflock import {self.path.name} --save FILE.nc"
            )
        with as_error(self.path, RecordingError):
            refuse_archive(self.path)
        self.limit = LEAST_TIME + self.path.stat().st_size / pace if limit is None else limit
        posix = hasattr(os, "sysconf")  # Windows does not tell its memory: 8 GB there
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if posix else 8 << 30
        request = {
            "paths": [path for path in sys.path if os.path.isabs(path)], "file": str(self.path.absolute()),
            "read": [read.__module__, read.__name__], "room": memory // 4, "seconds": math.ceil(self.limit),
        }  # fmt: skip
        # isolated (-I, -S): neither the folder of the recording nor a start-up file decides what is
        # imported
        command = [sys.executable or "", "-I", "-S", "-c", START]
        # one thread, and no filter of HDF5 from outside its own library
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "HDF5_PLUGIN_PRELOAD": "::"}
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        try:
            self.process = subprocess.Popen(command, env=environment, **pipes)
        except OSError as error:
            raise RecordingError(f"{self.path}: no process can be started to open it: {error.strerror}") from error
        # the limit of a processor's time does not end a process that waits, and Windows has none
        self.clock = threading.Timer(WAIT * self.limit, self.process.kill)
        self.clock.daemon, self.deadline = True, time.monotonic() + WAIT * self.limit
        self.clock.start()
        self.stdout: Any = self.process.stdout
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as pipe:  # if the process has ended, `answer` says so
            pipe.write(json.dumps(request).encode() + b"\n")

    def __enter__(self) -> "ReaderProcess":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self.clock.cancel()
        self.process.kill()
        self.process.wait()
        self.stdout.close()

    def answer(self, on_progress: OnShare | None = None) -> Any:
        """Return the file as an xarray Dataset, a netCDF file decoded; `done` is called with the share that was read.

        Raises RecordingError where it is of another kind, or takes too long.
        """
        import numpy as np
        import xarray as xr

        with self, as_error(self.path, RecordingError):
            header: dict[str, Any] = {"share": 0.0}
            # Reports of progress come first, any number of them; the header of the arrays ends
            # them.
            while "share" in header:
                if on_progress is not None:
                    on_progress(min(0.99, header["share"]))
                line = self.stdout.readline()
                if not line.endswith(b"\n"):
                    raise self._ended()
                header = json.loads(line)
            if "error" in header:
                raise RecordingError(f"{self.path}: is not {self.kind} that can be read: {header['error']}")
            variables = {}
            for name, dims, attributes, dtype, shape in header["variables"]:
                # Arrays arrive as plain bytes behind the header: no pickle, and no copy.
                values = np.empty(shape, dtype)
                if self.stdout.readinto(_bytes_of(values)) < values.nbytes:
                    raise self._ended()
                variables[name] = xr.Variable(dims, values, _from_json(attributes))
            dataset = xr.Dataset(variables, attrs=_from_json(header["attributes"]))
            return xr.decode_cf(dataset) if self.decoded else dataset

    def _ended(self) -> RecordingError:
        """Return the error that says why the process ended before its answer was complete."""
        code = self.process.wait(timeout=10.0)
        if code in ENDED_LATE or time.monotonic() >= self.deadline:
            return RecordingError(f"{self.path}: could not be opened within {self.limit:.0f} s; it may be damaged")
        how = f"signal {-code}" if code < 0 else f"status {code}"
        return RecordingError(f"{self.path}: is damaged: the process that opened it ended with {how}")


def run_reader(request: Mapping[str, Any]) -> None:
    """Read a file in this process, and write the answer to standard output."""
    _limit(request["room"], request["seconds"])
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries print there what they think of a file

        def send(header: dict[str, Any]) -> None:
            text = json.dumps(header).encode()
            if len(text) > MOST_HEADER:
                raise ValueError(f"its names and attributes take {len(text) / 1e6:.0f} MB")
            out.write(text + b"\n")
            out.flush()

        try:
            module, name = request["read"]
            read = getattr(import_module(module), name)
            attributes, variables = read(request["file"], request["room"], lambda share: send({"share": share}))
            entries, arrays = [], []
            for name, (dims, own, values) in variables.items():
                array = _plain(name, values)
                dims = dims or [f"{name}_{axis}" for axis in range(array.ndim)]
                entries.append([name, dims, own, array.dtype.str, list(array.shape)])
                arrays.append(array)
            send({"attributes": attributes, "variables": entries})
        # The process must answer with one line, whatever a damaged file makes a library raise.
        except Exception as error:  # a damaged file may raise anything
            send({"error": (str(error).splitlines() or [""])[0] or type(error).__name__})
            return
        for array in arrays:
            out.write(_bytes_of(array))


def _limit(room: int, seconds: int) -> None:
    """Limit this process: no core file, no file written, memory for the arrays, and seconds of a processor."""
    try:
        import resource
    except ImportError:  # Windows has no such limits
        return
    # Three times the arrays: decoding and copying need more memory than the result.
    limits = {"CORE": 0, "FSIZE": 0, "AS": 3 * room + SPARE, "CPU": seconds}
    for kind, value in ((getattr(resource, f"RLIMIT_{name}"), value) for name, value in limits.items()):
        with suppress(ValueError):  # a hard limit below this one stays
            resource.setrlimit(kind, (value, resource.getrlimit(kind)[1]))


def _refuse_outside(path: str, room: int) -> None:
    """Refuse arrays that take too many bytes, links to other files, and arrays whose bytes or parts lie in others."""
    import h5py

    total = 0.0
    with h5py.File(path, "r") as file:
        # A link or a virtual dataset could read any file of this user into the recording.
        for name in file:
            if isinstance(file.get(name, getlink=True), h5py.ExternalLink):
                raise ValueError(f"{name} is a link to another file")
            member = file[name]
            if isinstance(member, h5py.Dataset):
                if member.external or member.is_virtual:
                    raise ValueError(f"{name} keeps its values in another file")
                total += math.prod(map(float, member.shape or ())) * member.dtype.itemsize
    if total > room:
        raise ValueError(f"its arrays take {total / 1e9:.3g} GB; there is room for {room / 1e9:.3g} GB")


def _plain(name: str, values: Any) -> Any:
    """Return the values of a variable as a contiguous array of numbers or texts."""
    import numpy as np

    array = np.asarray(values, order="C")
    if array.dtype.kind == "O":
        array = np.array([_text(value) for value in array.ravel().tolist()], str).reshape(array.shape)
    if array.dtype.kind not in "fiubSU":
        raise ValueError(f"variable {name} is of kind {array.dtype}")
    return array


def _bytes_of(array: Any) -> memoryview:
    view: memoryview = array.reshape(-1).view("u1").data
    return view


def _to_json(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as JSON has them: a text, a list of texts, or dtype and numbers; others are left out."""
    import numpy as np

    entries: dict[str, Any] = {}
    for name, value in attributes.items():
        array = np.asarray(value)
        if isinstance(value, (str, bytes)):
            entries[name] = _text(value)
        elif array.dtype.kind in "OUS":
            entries[name] = [_text(each) for each in array.ravel().tolist()]
        elif array.dtype.kind in "fiub":
            entries[name] = {"dtype": array.dtype.str, "numbers": array.tolist()}
    return entries


def _from_json(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as xarray has them: texts, numbers of NumPy, arrays."""
    import numpy as np

    numbers = {k: np.array(v["numbers"], v["dtype"])[()] for k, v in entries.items() if isinstance(v, dict)}
    return {**entries, **numbers}


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if not isinstance(value, str):
        raise ValueError(f"a value of kind {type(value).__name__} where words are expected")
    return value
