"""Formats by the ending of a file: to add one, write a reader and name it here."""

from collections.abc import Callable
from pathlib import Path

from airflock.recordings.imports import arrays, dataflash, movement, node_log, tables, ulog
from airflock.recordings.imports.track import ImportedTrack, ImportOptions, ImportReport
from airflock.recordings.packed import refuse_archive, refuse_pickle_file
from airflock.support import RecordingError, as_error

Reader = Callable[[Path, ImportOptions, ImportReport], list[ImportedTrack]]
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

AUTOPILOT_SUFFIXES = (".ulg", ".bin", ".tlog", ".log")  # their axes are those of the ground


def read_file(path: Path, options: ImportOptions, findings: ImportReport) -> list[ImportedTrack]:
    """Tracks of a file; raises RecordingError for what is no known format."""
    if path.is_dir():
        raise RecordingError(f"{path}: is a folder; name the files in it")
    if not path.is_file():
        raise RecordingError(f"{path}: no such file")
    ending = path.suffix.lower()
    refuse_archive(path)
    refuse_pickle_file(path)
    if ending not in READERS:
        known = ", ".join(READERS)
        raise RecordingError(f"{path}: {ending or 'a name without an ending'}: unknown format; known: {known}")
    with as_error(path, RecordingError):  # libraries raise whatever they happen to where a file is damaged
        return READERS[ending][1](path, options, findings)
