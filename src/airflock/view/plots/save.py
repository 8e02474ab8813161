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

from airflock.support.atomic import atomic
from airflock.support.errors import AirflockError, RecordingError
from airflock.support.suffixes import PICTURES, suffix_fault
from airflock.support.untrusted import own_path

# no dates: the same figure gives the same file
DATES: dict[str, dict[str, Any]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
# TrueType, because many publishers refuse the Type 3 fonts that are Matplotlib's default; and ids in .svg that do not
# differ from time to time. Both can be said only to all of Matplotlib.
FILES: Any = {"pdf.fonttype": 42, "svg.hashsalt": "airflock"}
_writing = threading.Lock()


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
    with complete_or_absent(path, PICTURES) as temporary, fit_to_print():
        ending, content = temporary.suffix.lower(), io.BytesIO()
        figure.savefig(  # in memory: the writer of .pdf breaks in its own ways where a disk is full
            content, format=ending[1:], dpi=resolution, metadata=DATES.get(ending, {}),
            facecolor=figure.get_facecolor(), bbox_inches="tight", pad_inches=0.08,
        )  # fmt: skip
        temporary.write_bytes(content.getvalue())  # no buffer of it: Python 3.12 crashes where an error holds one
    return own_path(path)


@contextmanager
def fit_to_print() -> Iterator[None]:
    """Files that are written inside embed their fonts as publishers take them, and are the same each time.

    One thread at a time: the settings are those of all of Matplotlib, and are put back as they were.
    """
    with _writing, rc_context(FILES):
        yield


@contextmanager
def complete_or_absent(path: str | os.PathLike[str], endings: tuple[str, ...]) -> Iterator[Path]:
    """Yield a temporary path to write to, renamed at the end; every fault on the way is one line."""
    target = own_path(path)
    fault = suffix_fault(target, endings)
    if fault:
        raise PictureError(fault)
    if target.is_dir():
        raise PictureError(f"{target}: is a folder; give a file name")
    try:
        with atomic(target) as temporary:
            yield temporary
    except (OSError, RuntimeError) as wrong:
        reason = getattr(wrong, "strerror", None) or (str(wrong).splitlines() or [type(wrong).__name__])[0]
        raise PictureError(f"{target}: cannot be written: {reason}; nothing was saved") from wrong


def positive(**numbers: float) -> None:
    """Raise an AirflockError that names the first number that is not above zero."""
    for name, number in numbers.items():
        if not number > 0.0:
            raise AirflockError(f"{name} = {number:g} must be above 0")
