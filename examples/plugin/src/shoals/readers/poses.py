"""Files of a motion capture of our own: a line `POSES`, then `name, seconds, x, y, z` in metres, a pose a line."""

from pathlib import Path
from typing import Any

import pandas as pd

from airflock.recordings.imports import reader
from airflock.recordings.imports.track import ImportedTrack


@reader("poses", suffixes=(".poses",), sniff=lambda start: start.startswith(b"POSES"))
def read_poses(path: Path, options: Any, findings: Any) -> list[ImportedTrack]:
    """Name, time and place of each body."""
    table = pd.read_csv(path, skiprows=1, names=["name", "t", "x", "y", "z"], skipinitialspace=True)
    return [
        ImportedTrack(
            str(name),
            str(path),
            rows["t"].to_numpy(float),
            {axis: rows[axis].to_numpy(float) for axis in "xyz"},
            rows.index.to_numpy() + 2,  # the first pose stands in the second line, for messages
        )
        for name, rows in table.groupby("name", sort=False)
    ]
