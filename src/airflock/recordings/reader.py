"""A process of its own that opens one file and hands over plain arrays; run as a script by `recordings.isolated`.

HDF5 is a large library in C that a damaged file can stop, crash or keep busy for ever, and it cannot be interrupted;
readers of ArduPilot's logs go round and round in some. So they work here, on borrowed time and memory, and the
process that asked reads plain bytes from a pipe. This file imports nothing of Airflock, so that it starts quickly.

Asked on standard input, one JSON object: paths (of modules), file, how (one of READ), most (bytes of all arrays),
seconds (of a processor).
Answers on standard output: 8 bytes, the length of a JSON object; the object; then the arrays in its order.
The object holds attributes and variables; of each variable name, dims, attributes, shape, and either dtype (its array
follows) or strings; or instead of all this the one key fault. Objects of the one key share may come before it: how much
of the file has been read.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

SPARE = 4 * 2**30  # bytes of address space besides the arrays: libraries, buffers


def main() -> None:
    """Read the question, answer it."""
    asked = json.load(sys.stdin)
    sys.path[:] = asked["paths"]
    _limit(asked["most"], asked["seconds"])
    with os.fdopen(os.dup(1), "wb") as out:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # libraries print there what they think of a file

        def tell(about: dict[str, Any]) -> None:
            text = json.dumps(about).encode()
            out.write(len(text).to_bytes(8, "little") + text)
            out.flush()

        try:
            about, arrays = READ[asked["how"]](asked["file"], asked["most"], _at_times(tell))
        except Exception as fault:  # a damaged file may raise anything
            reason = (str(fault).splitlines() or [""])[0]
            about, arrays = {"fault": reason or type(fault).__name__}, []
        tell(about)
        for array in arrays:
            out.write(array)


def _at_times(tell: Callable[[dict[str, Any]], None]) -> "Share":
    """A function that tells the share that was read, ten times a second at most."""
    last = 0.0

    def share(done: float) -> None:
        nonlocal last
        if time.monotonic() > last + 0.1:
            last = time.monotonic()
            tell({"share": done})

    return share


def _limit(most: int, seconds: int) -> None:
    """No core file, no file written, no more memory than the arrays may need, so many seconds of a processor."""
    try:
        import resource
    except ImportError:  # Windows has no such limits
        return
    limits = ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_FSIZE, 0), (resource.RLIMIT_AS, 3 * most + SPARE))
    for kind, value in (*limits, (resource.RLIMIT_CPU, seconds)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


Share = Callable[[float], None]
Read = tuple[dict[str, Any], list[Any]]  # what is told of a file, and its arrays


def netcdf(path: str, most: int, _: Share) -> Read:
    """What a netCDF file holds; raises ValueError for what reaches outside the file or is too large."""
    import h5netcdf
    import numpy as np

    _inside(path, most)
    with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
        found: list[dict[str, Any]] = []
        arrays: list[Any] = []
        for name, variable in file.variables.items():
            about = {"name": name, "dims": list(variable.dimensions), "attributes": _attributes(variable.attrs)}
            found.append(about | _told(name, np.asarray(variable[...]), arrays))
        return {"attributes": _attributes(file.attrs), "variables": found}, arrays


def hdf5(path: str, most: int, _: Share) -> Read:
    """The arrays at the root of any HDF5 file, their dimensions without names; raises ValueError as `netcdf` does."""
    import h5py
    import numpy as np

    _inside(path, most)
    with h5py.File(path, "r") as file:
        found: list[dict[str, Any]] = []
        arrays: list[Any] = []
        for name in file:
            if isinstance(file[name], h5py.Dataset):
                values = np.asarray(file[name][()])
                about = {"name": name, "dims": [f"{name}_{k}" for k in range(values.ndim)], "attributes": {}}
                found.append(about | _told(name, values, arrays))
        return {"attributes": _attributes(file.attrs), "variables": found}, arrays


PARTS = ("PSCN", "PSCE", "PSCD")  # position control: north, east, down


def dataflash(path: str, _: int, share: Share) -> Read:
    """Rows of an ArduPilot log: time (µs), position, velocity, commanded velocity of each axis; origin; GPS times."""
    from pymavlink import DFReader

    log = DFReader.DFReader_binary(path)
    rows: dict[str, list[Any]] = {**{part: [] for part in PARTS}, "ORGN": [], "GPS": []}
    names: dict[str, tuple[str, ...]] = {
        part: ("TimeUS", f"P{part[-1]}", f"V{part[-1]}", f"TV{part[-1]}") for part in PARTS
    }
    names |= {"ORGN": ("Lat", "Lng", "Alt"), "GPS": ("TimeUS", "GWk", "GMS", "I")}
    while (message := log.recv_match(type=[*rows])) is not None:
        kind = message.get_type()
        rows[kind].append([getattr(message, name, 0.0 if name == "I" else float("nan")) for name in names[kind]])
        share(getattr(log, "percent", 0.0) / 100.0)
    return _tables(rows)


def telemetry(path: str, _: int, share: Share) -> Read:
    """Rows of a telemetry log: vehicle, time (s) and six numbers of states, three of wishes and of origins."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(path)
    names = {
        "LOCAL_POSITION_NED": ("x", "y", "z", "vx", "vy", "vz"),
        "POSITION_TARGET_LOCAL_NED": ("vx", "vy", "vz"),
        "GPS_GLOBAL_ORIGIN": ("latitude", "longitude", "altitude"),
    }
    rows: dict[str, list[Any]] = {kind: [] for kind in names}
    while (message := log.recv_match(type=[*rows])) is not None:
        kind, when = message.get_type(), float(getattr(message, "_timestamp", 0.0))
        rows[kind].append([message.get_srcSystem(), when, *(getattr(message, name) for name in names[kind])])
        share(getattr(log, "percent", 0.0) / 100.0)
    return _tables(rows)


def _tables(rows: dict[str, list[Any]]) -> Read:
    """Tables of float64 by name; an empty one is left out."""
    import numpy as np

    found: list[dict[str, Any]] = []
    arrays: list[Any] = []
    for name, table in rows.items():
        if table:
            about = {"name": name, "dims": [f"{name}_row", f"{name}_column"], "attributes": {}}
            found.append(about | _told(name, np.array(table, float), arrays))
    return {"attributes": {}, "variables": found}, arrays


READ: dict[str, Callable[[str, int, Share], Read]] = {
    "netcdf": netcdf, "hdf5": hdf5, "dataflash": dataflash, "telemetry": telemetry,
}  # fmt: skip


def _told(name: str, values: Any, arrays: list[Any]) -> dict[str, Any]:
    """Shape and kind of a variable, whose bytes join the arrays, or its strings."""
    import numpy as np

    if values.dtype.kind in "OU":
        return {"shape": list(values.shape), "strings": [_word(value) for value in values.ravel().tolist()]}
    if values.dtype.kind not in "fiubS":
        raise ValueError(f"variable {name} is of kind {values.dtype}")
    arrays.append(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return {"shape": list(values.shape), "dtype": values.dtype.str}


def _inside(path: str, most: int) -> None:
    """Refuse arrays that take too many bytes, links to other files, and arrays whose bytes or parts lie in others."""
    import math

    import h5py

    total = 0.0
    with h5py.File(path, "r") as file:
        for name in file:
            if isinstance(file.get(name, getlink=True), h5py.ExternalLink):
                raise ValueError(f"{name} is a link to another file")
            found = file[name]
            if isinstance(found, h5py.Dataset):
                if found.external or found.is_virtual:
                    raise ValueError(f"{name} keeps its values in another file")
                total += math.prod(map(float, found.shape or ())) * found.dtype.itemsize
    if total > most:
        raise ValueError(f"its arrays take {total / 1e9:.3g} GB; there is room for {most / 1e9:.3g} GB")


def _word(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    if not isinstance(value, str):
        raise ValueError(f"a value of kind {type(value).__name__} where words are expected")
    return value


def _attributes(given: Any) -> dict[str, Any]:
    """Attributes by name: a text as it is, numbers as [dtype, shape, list], an empty one left out."""
    import numpy as np

    found: dict[str, Any] = {}
    for name in given:
        value = given[name]
        if isinstance(value, (str, bytes)):
            found[name] = _word(value)
            continue
        array = np.asarray(value)
        if array.dtype.kind in "OUS":
            found[name] = [_word(entry) for entry in array.ravel().tolist()]
        elif array.dtype.kind in "fiub":
            found[name] = {"dtype": array.dtype.str, "shape": list(array.shape), "values": array.ravel().tolist()}
    return found


if __name__ == "__main__":
    main()
