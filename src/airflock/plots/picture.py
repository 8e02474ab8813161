"""One door to the pictures of a scenario or a recording, by the name of the kind."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.errors import AirflockError, RecordingError
from airflock.plots.flight import flown_with
from airflock.plots.flocked import flocked
from airflock.plots.rays import rays
from airflock.plots.reception import received
from airflock.plots.rules import rules
from airflock.plots.scene_paths import through
from airflock.plots.series import series
from airflock.plots.trajectories import trajectories
from airflock.plots.transfer import transfer
from airflock.plots.wash import wash
from airflock.recordings.files import load_recording
from airflock.recordings.flights import simulate
from airflock.recordings.flown_scenario import scenario_of
from airflock.scenarios.change import variant
from airflock.scenarios.scenario import Scenario
from airflock.spelling import meant

KINDS = (
    "trajectories", "series", "rules", "transfer", "scene", "space", "rays", "flocked", "wash", "reception",
)  # fmt: skip
OF_A_SCENARIO = ("rules", "transfer")  # pictures that take no flight
What = Scenario | xr.Dataset | str | os.PathLike[str]


def plot(
    what: What,
    kind: str = "trajectories",
    *,
    seed: int = 0,
    start: float | None = None,
    stop: float | None = None,
    settings: Mapping[str, Any] | None = None,
    law: Any = None,
    trust: bool = False,
    ax: Axes | None = None,
) -> Figure:
    """Draw a flight, a recording, or the rules of a model.

    Parameters
    ----------
    what : Scenario, xarray.Dataset, str or path
        A scenario or the name of one, which is flown; or a recording (time, space, keypoint, individual), or a
        file (.nc) of one.
    kind : str
        trajectories, series, flocked; scene, space, rays where something stands in the world; wash of a
        formation of wings; reception, the time since the last packet by distance; rules of a model;
        transfer, the partial fitnesses.
    seed : int
        Seed of the flight, if a scenario is flown.
    start, stop : float, optional
        Window of time, s; which one is shown otherwise stands in the picture's title.
    settings : mapping, optional
        Keys of the scenario to change, such as {"radio.delay": 0.5}; a recording takes none.
    law : optional
        A flocking law of your own, or one by its name or file, that flies instead of the file's, as in `airflock.load`.
    trust : bool
        Whether code that the scenario file names may run.
    ax : matplotlib.axes.Axes, optional
        Axes to draw into, instead of a new figure. A picture of several panels divides their place, which must be one
        of a grid (`figure.subplots`). Trajectories in space need axes with projection="3d".

    Returns
    -------
    matplotlib.figure.Figure
        The figure, also that of `ax`; `airflock.plots.save_figure(figure, "flight.png")` writes it.

    Raises
    ------
    AirflockError
        If there is no such kind, or the kind does not fit what is drawn.

    Examples
    --------
    >>> import airflock
    >>> figure = airflock.plot("vasarhelyi_2018/4ms", "rules")
    >>> len(figure.axes) > 0
    True
    """
    if kind not in KINDS:
        raise AirflockError(f"kind = {kind!r} is none of {', '.join(KINDS)}{meant(kind, KINDS, lead='; ')}")
    if kind in OF_A_SCENARIO:
        _refuse_tracks(what, kind)
        scenario = _scenario(what, settings, law, trust)
        return rules(scenario, ax=ax) if kind == "rules" else transfer(scenario, ax=ax)
    keep = ("heard",) if kind == "reception" else ()
    recording = flight_of(what, seed, settings, law, trust=trust, keep=keep)
    with named(what):
        return _of_recording(recording, kind, start, stop, ax)


def _refuse_tracks(what: What, kind: str) -> None:
    """Raise RecordingError for tracks where a law or a fitness is drawn: they have none."""
    recording = load_recording(what) if _is_file(what) else what  # type: ignore[arg-type]
    if isinstance(recording, xr.Dataset) and flown_with(recording) is None:
        raise RecordingError(f"{_name(what)}: tracks were flown by no scenario, which the kind {kind} draws")


def _of_recording(recording: xr.Dataset, kind: str, start: float | None, stop: float | None, ax: Axes | None) -> Figure:
    if kind in ("scene", "space"):
        return through(recording, start=start, stop=stop, space=kind == "space", ax=ax)
    if kind == "rays":
        return rays(recording, start=start, ax=ax)
    if kind == "wash":
        return wash(recording, start=start, ax=ax)
    if kind == "reception":
        return received(recording, ax=ax)
    if kind == "flocked":
        return flocked(recording, start=start, stop=stop, ax=ax)
    if kind == "series":
        return series(recording, start=start, stop=stop, ax=ax)
    return trajectories(recording, start=start, stop=stop, ax=ax)


def _is_file(what: Any) -> bool:
    return isinstance(what, (str, os.PathLike)) and str(what).lower().endswith(".nc")


def _scenario(what: What, settings: Mapping[str, Any] | None, law: Any, trust: bool) -> Scenario:
    if isinstance(what, xr.Dataset) or _is_file(what):
        return scenario_of(what if isinstance(what, xr.Dataset) else load_recording(what), settings)  # type: ignore[arg-type]
    return variant(what, settings, law, trust=trust)


def flight_of(
    what: What, seed: int, settings: Mapping[str, Any] | None = None, law: Any = None, *, trust: bool = False,
    keep: Sequence[str] = (),
) -> xr.Dataset:  # fmt: skip
    """The recording that is given or named, or a flight of the scenario that is."""
    if isinstance(what, xr.Dataset) or _is_file(what):
        if settings or law is not None:
            raise AirflockError(
                f"{_name(what)}: is a recording; --set, --agents, --duration and --law need a scenario to fly"
            )
        return what if isinstance(what, xr.Dataset) else load_recording(what)  # type: ignore[arg-type]
    return simulate(_scenario(what, settings, law, trust), seed, keep=keep)


@contextmanager
def named(what: Any) -> Iterator[None]:
    """Faults of a recording that are told inside begin with the name of its file, where it is one."""
    try:
        yield
    except RecordingError as fault:
        before, colon, said = str(fault).partition(": ")
        if before != "recording" or not colon or not _is_file(what):
            raise
        raise RecordingError(f"{what}: {said}") from fault


def _name(what: Any) -> str:
    return "recording" if isinstance(what, xr.Dataset) else str(what)
