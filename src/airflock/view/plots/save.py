"""Figures on disk: complete or not there at all, in the format that the file's ending names."""

import io
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from airflock.support import PICTURES, AirflockError, RecordingError, atomic_path, expand_path, suffix_error

# no dates: the same figure gives the same file
UNDATED_METADATA: dict[str, dict[str, Any]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
# TrueType, because many publishers refuse the Type 3 fonts that are Matplotlib's default; and ids in .svg that do not
# differ from time to time. Both can be said only to all of Matplotlib.
FILE_SETTINGS: Any = {"pdf.fonttype": 42, "svg.hashsalt": "airflock"}
_settings_lock = threading.Lock()


class PictureError(RecordingError):
    """A figure or a video cannot be written: names the file and the reason."""


def save_figure(figure: Figure, path: str | os.PathLike[str], *, resolution: float = 200.0) -> Path:
    """Write a figure as .png, .pdf or .svg.

    path       : of the picture; its ending says of which kind it is
    resolution : dots per inch of .png, and of what is drawn as pixels within the others

    Raises PictureError where it cannot be written; then nothing is left behind.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> recording = airflock.simulate(short)
    >>> airflock.plots.save_figure(airflock.plots.trajectories(recording), "flight.png").name
    'flight.png'
    """
    with atomic_picture(path, PICTURES) as temporary, print_settings():
        ending, content = temporary.suffix.lower(), io.BytesIO()
        figure.savefig(  # in memory: the writer of .pdf breaks in its own ways where a disk is full
            content, format=ending[1:], dpi=resolution, metadata=UNDATED_METADATA.get(ending, {}),
            facecolor=figure.get_facecolor(), bbox_inches="tight", pad_inches=0.08,
        )  # fmt: skip
        temporary.write_bytes(content.getvalue())  # no buffer of it: Python 3.12 crashes where an error holds one
    return expand_path(path)


@contextmanager
def print_settings() -> Iterator[None]:
    """Files that are written inside embed their fonts as publishers take them, and are the same each time.

    One thread at a time: the settings are those of all of Matplotlib, and are put back as they were.
    """
    with _settings_lock, rc_context(FILE_SETTINGS):
        yield


@contextmanager
def atomic_picture(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> Iterator[Path]:
    """Yield a temporary path to write to, renamed at the end; every fault on the way is one line."""
    target = expand_path(path)
    fault = suffix_error(target, suffixes)
    if fault:
        raise PictureError(fault)
    if target.is_dir():
        raise PictureError(f"{target}: is a folder; give a file name")
    try:
        with atomic_path(target) as temporary:
            yield temporary
    except (OSError, RuntimeError) as wrong:
        reason = getattr(wrong, "strerror", None) or (str(wrong).splitlines() or [type(wrong).__name__])[0]
        raise PictureError(f"{target}: cannot be written: {reason}; nothing was saved") from wrong


def check_positive(**numbers: float) -> None:
    """Raise an AirflockError that names the first number that is not above zero."""
    for name, number in numbers.items():
        if not number > 0.0:
            raise AirflockError(f"{name} = {number:g} must be above 0")
