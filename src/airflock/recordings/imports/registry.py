"""Formats by the ending of a file: to add one, write a reader and name it here."""

from collections.abc import Callable
from pathlib import Path

from airflock.recordings.imports import arrays, dataflash, movement, node_log, tables, ulog
from airflock.recordings.imports.track import Findings, Options, Track
from airflock.recordings.packed import refuse_packed, refuse_pickle
from airflock.support.errors import RecordingError
from airflock.support.untrusted import from_outside

Reader = Callable[[Path, Options, Findings], list[Track]]
READERS: dict[str, tuple[str, Reader]] = {
    ".csv": ("table", tables.read_csv),
    ".tsv": ("table", tables.read_csv),
    ".txt": ("table", tables.read_csv),
    ".parquet": ("table", tables.read_parquet),
    ".ulg": ("PX4 ULog", ulog.read_ulog),
    ".bin": ("ArduPilot DataFlash", dataflash.read_dataflash),
    ".tlog": ("MAVLink telemetry", dataflash.read_tlog),
    ".log": ("log of a node on board", node_log.read_node_log),
    ".nc": ("movement netCDF", movement.read_netcdf),
    ".h5": ("movement or idtracker.ai HDF5", movement.read_netcdf),
    ".hdf5": ("movement or idtracker.ai HDF5", movement.read_netcdf),
    ".npy": ("NumPy array", arrays.read_npy),
    ".npz": ("NumPy arrays", arrays.read_npy),
}

OF_AUTOPILOTS = (".ulg", ".bin", ".tlog", ".log")  # their axes are those of the ground


def read(path: Path, options: Options, findings: Findings) -> list[Track]:
    """Tracks of a file; raises RecordingError for what is no known format."""
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; name the files in it")
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    ending = path.suffix.lower()
    refuse_packed(path)
    refuse_pickle(path)
    if ending not in READERS:
        known = ", ".join(READERS)
        raise RecordingError(f"{path}: {ending or 'a name without an ending'}: unknown format; known: {known}")
    with from_outside(path, RecordingError):  # libraries raise whatever they happen to where a file is damaged
        return READERS[ending][1](path, options, findings)
