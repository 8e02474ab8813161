"""Archives, compressed files and pickles are no recordings, whatever their names say; one line tells what to do."""

from pathlib import Path

from airflock.support import RecordingError

ARCHIVES = (".zip", ".gz", ".7z", ".tar", ".rar", ".xz", ".bz2")
STARTS = {b"PK\x03\x04": "a zip archive; unpack it first: unzip", b"\x1f\x8b": "compressed; unpack it first: gunzip"}
PICKLES = (".pkl", ".pickle")


def refuse_archive(path: Path) -> None:
    """Raise a RecordingError for an archive; one of NumPy's (.npz) is none."""
    with path.open("rb") as file:
        start = file.read(4)
    for mark, what in STARTS.items():
        if start.startswith(mark) and path.suffix.lower() != ".npz":
            raise RecordingError(f"{path}: is {what} {path.name}")
    if path.suffix.lower() in ARCHIVES:
        raise RecordingError(f"{path}: is an archive; unpack it first")


def refuse_pickle_file(path: Path) -> None:
    """Raise a RecordingError for a file that is called a pickle."""
    if path.suffix.lower() in PICKLES:
        raise RecordingError(
            f"{path}: holds pickled Python objects, which could run code when read; if you trust the file and it is a "
            f"table of pandas, python -c \"import pandas as pd; pd.read_pickle('{path.name}').to_csv('tracks.csv')\""
        )
