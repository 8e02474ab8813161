"""A process of its own that opens one netCDF file and hands over plain arrays; run as a script by `recordings.opened`.

HDF5 is a large library in C that a damaged file can stop, crash or keep busy for ever, and it cannot be interrupted.
So it works here, on borrowed time and memory, and whoever asked reads plain bytes from a pipe. This file imports
nothing of Airflock, so that it starts quickly.

Asked on standard input, one JSON object: paths (of modules), file, most (bytes of all arrays), seconds (of
a processor).
Answers on standard output: 8 bytes, the length of a JSON object; the object; then the arrays in its order.
The object holds attributes and variables; of each variable name, dims, attributes, shape, and either dtype (its array
follows) or strings; or instead of all this the one key fault.
"""

import json
import sys
from typing import Any

SPARE = 4 * 2**30  # bytes of address space besides the arrays: libraries, buffers


def main() -> None:
    """Read the question, answer it."""
    asked = json.load(sys.stdin)
    sys.path[:] = asked["paths"]
    _limit(asked["most"], asked["seconds"])
    try:
        about, arrays = read(asked["file"], asked["most"])
    except Exception as fault:  # a damaged file may raise anything
        reason = (str(fault).splitlines() or [""])[0]
        about, arrays = {"fault": reason or type(fault).__name__}, []
    text = json.dumps(about).encode()
    out = sys.stdout.buffer
    out.write(len(text).to_bytes(8, "little") + text)
    for array in arrays:
        out.write(array)
    out.flush()


def _limit(most: int, seconds: int) -> None:
    """No core file, no file written, no more memory than the arrays may need, so many seconds of a processor."""
    import resource

    limits = ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_FSIZE, 0), (resource.RLIMIT_AS, 3 * most + SPARE))
    for kind, value in (*limits, (resource.RLIMIT_CPU, seconds)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))


def read(path: str, most: int) -> tuple[dict[str, Any], list[Any]]:
    """What a file holds, and its arrays; raises ValueError for what reaches outside the file or is too large."""
    import h5netcdf
    import numpy as np

    total = _inside(path)
    if total > most:
        raise ValueError(f"its arrays take {total / 1e9:.3g} GB; there is room for {most / 1e9:.3g} GB")
    with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
        found, arrays = [], []
        for name, variable in file.variables.items():
            values = np.asarray(variable[...])
            about = {"name": name, "dims": list(variable.dimensions), "attributes": _attributes(variable.attrs)}
            about["shape"] = list(values.shape)
            if values.dtype.kind in "OU":
                about["strings"] = [_word(value) for value in values.ravel().tolist()]
            elif values.dtype.kind in "fiubS":
                about["dtype"] = values.dtype.str
                arrays.append(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
            else:
                raise ValueError(f"variable {name} is of kind {values.dtype}")
            found.append(about)
        return {"attributes": _attributes(file.attrs), "variables": found}, arrays


def _inside(path: str) -> float:
    """Bytes of all arrays; refuses links to other files, and arrays whose bytes or parts lie in other files."""
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
    return total


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
