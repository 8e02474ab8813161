"""Video of a flight, MP4 or GIF: agents as darts with short tails, arena, obstacles and a clock.

Frames are drawn one at a time and handed to ffmpeg at once, so that the length of a flight costs no memory.
"""

import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from airflock.recordings import check_recording
from airflock.support import VIDEOS, AirflockError, expand_path
from airflock.view.plots.film_stage import VideoFrame
from airflock.view.plots.flight import time_window
from airflock.view.plots.save import PictureError, atomic_picture, check_positive

Array = NDArray[Any]
# GIF: a palette for each frame, because one for all would need all frames in memory
GIF_PALETTE_FILTER = "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none"


def video(
    recording: xr.Dataset,
    path: str | os.PathLike[str],
    *,
    fps: float = 25.0,
    speed: float = 10.0,
    start: float | None = None,
    stop: float | None = None,
    tail: float = 4.0,
    height: int = 720,
    space: bool | None = None,
    chart: str = "",
    done: Callable[[], None] | None = None,
) -> Path:
    """Write a video of a recording.

    Parameters
    ----------
    recording : xarray.Dataset
        (time, space, keypoint, individual), simulated or flown: position m, velocity m/s.
    path : str or path
        Ends in .mp4 or .gif.
    fps : float
        Pictures per second; `frame_count` says how many there will be.
    speed : float
        Times real time.
    start, stop : float, optional
        Window of time, s; by default all of it.
    tail : float
        Flight behind each agent that is drawn, s; 0 draws none.
    height : int
        Of the picture, pixels; its width follows from the arena; both are made even.
    space : bool, optional
        Seen obliquely, or from above. By default as it was flown.
    chart : str
        Name of an order parameter that is drawn over time beside the picture.
    done : callable, optional
        Called after each picture.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    AirflockError
        For what is no recording, an empty window, or numbers that are not above 0.
    PictureError
        When it cannot be written, then nothing is left behind; or without imageio-ffmpeg
        (`pip install 'airflock[video]'`).

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.video(airflock.simulate(short), "flight.gif", fps=5, height=120).name
    'flight.gif'
    """
    instants = _frame_times(recording, fps, speed, start, stop)
    check_positive(height=height)
    import_ffmpeg()
    with atomic_picture(path, VIDEOS) as temporary:
        stage = VideoFrame(recording, start, stop, tail=tail, height=height, speed=speed, space=space, chart=chart)
        film = _film(temporary, stage.size, fps)
        try:
            for number, instant in enumerate(instants):
                try:
                    film.send(stage.render(float(instant)))
                except OSError as fault:  # a broken pipe: ffmpeg is gone and does not say why
                    raise RuntimeError(f"ffmpeg stopped after {number} pictures; is the disk full?") from fault
                if done is not None:
                    done()
        finally:
            film.close()
        _complete(temporary, len(instants))
    return expand_path(path)


def import_ffmpeg() -> Any:
    """The package imageio_ffmpeg, which brings an ffmpeg; raises PictureError with what to install."""
    try:
        import imageio_ffmpeg
    except ModuleNotFoundError as fault:
        raise PictureError(
            "videos need imageio-ffmpeg: pip install 'airflock[video]'; airflock replay makes a page without it"
        ) from fault
    return imageio_ffmpeg


def frame_count(
    recording: xr.Dataset,
    *,
    fps: float = 25.0,
    speed: float = 10.0,
    start: float | None = None,
    stop: float | None = None,
) -> int:
    """Number of pictures in such a video."""
    return len(_frame_times(recording, fps, speed, start, stop))


def _frame_times(recording: xr.Dataset, fps: float, speed: float, start: float | None, stop: float | None) -> Array:
    """Instants of the pictures, s."""
    check_positive(fps=fps, speed=speed)
    if fps > 240.0:
        raise AirflockError(f"fps = {fps:g} lies outside (0, 240] 1/s")
    check_recording(recording)
    times = recording["time"].values.astype(float)
    begin, end = time_window(times, start, stop)
    begin, end = max(begin, float(times[0])), min(end, float(times[-1]))
    count = max(1, math.floor((end - begin) * fps / speed + 1e-9) + 1)
    return begin + np.arange(count) * (speed / fps)


def _film(path: Path, size: tuple[int, int], fps: float) -> Any:
    """A running ffmpeg that takes one picture at a time."""
    given: dict[str, Any] = {"fps": fps, "pix_fmt_in": "rgba", "macro_block_size": 1, "ffmpeg_log_level": "quiet"}
    if path.suffix.lower() == ".gif":
        given |= {
            "codec": "gif",
            "pix_fmt_out": "pal8",
            "output_params": ["-filter_complex", GIF_PALETTE_FILTER],
            "quality": None,
        }
    else:
        given |= {"codec": "libx264", "quality": 8, "output_params": ["-movflags", "+faststart", "-f", "mp4"]}
    film: Iterator[Any] = import_ffmpeg().write_frames(str(path), size, **given)
    next(film)
    return film


def _complete(path: Path, frames: int) -> None:
    """Raise unless the file holds what was handed over; ffmpeg itself says nothing about a full disk at the end."""
    try:
        found, _ = import_ffmpeg().count_frames_and_secs(str(path))
    except (RuntimeError, OSError) as fault:
        raise RuntimeError("ffmpeg wrote no complete video; is the disk full?") from fault
    if found != frames:
        raise RuntimeError(f"ffmpeg kept {found} of {frames} pictures; is the disk full?")
