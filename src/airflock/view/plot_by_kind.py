"""`airflock.plot`: draw a scenario or a recording, by the name of the kind of picture."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from inspect import signature
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from airflock.recordings import load_recording, scenario_of_recording, simulate
from airflock.scenarios import Scenario, scenario_variant
from airflock.support import AirflockError, RecordingError, suggest
from airflock.view.flight_paths import scenario_or_none
from airflock.view.order_parameter_plots import flocked, series, transfer
from airflock.view.result_plots import received
from airflock.view.rules_plot import rules, wash
from airflock.view.trajectory_plots import rays, through, trajectories

KINDS = (
    "trajectories", "series", "rules", "transfer", "scene", "space", "rays", "flocked", "wash", "reception",
)  # fmt: skip
DRAWINGS: dict[str, Callable[..., Figure]] = {
    "trajectories": trajectories,
    "series": series,
    "flocked": flocked,
    "scene": through,
    "space": partial(through, space=True),
    "rays": rays,
    "wash": wash,
    "reception": received,
}  # of a flight; the other two kinds are of a scenario
PlotSource = Scenario | xr.Dataset | str | os.PathLike[str]


def plot(
    source: PlotSource,
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
    source : Scenario, xarray.Dataset, str or path (PRESET|FILE)
        A scenario or the name or file of one, which is flown; or a recording (time, space, keypoint, individual),
        or a file (.nc) of one.
    kind : {"trajectories", "series", "rules", "transfer", "scene", "space", "rays", "flocked", "wash", "reception"}
        trajectories, series, flocked; scene, space, rays where something stands in the world; wash of a
        formation of wings; reception, the time since the last packet by distance; rules of a model;
        transfer, the partial fitnesses.
    seed : int in [0, inf]
        Seed of the flight, if a scenario is flown.
    start : float, optional
        First instant shown, s; by default see the picture's title.
    stop : float, optional
        Last instant shown, s; by default the end.
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
        raise AirflockError(f"kind = {kind!r} is none of {', '.join(KINDS)}{suggest(kind, KINDS, lead='; ')}")
    if kind not in DRAWINGS:
        opened = _opened(source)
        if opened is not None and scenario_or_none(opened) is None:
            raise RecordingError(
                f"{_source_name(source)}: tracks were flown by no scenario, which the kind {kind} draws"
            )
        if opened is not None:
            scenario = scenario_of_recording(opened, settings)
        else:
            scenario = scenario_variant(source, settings, law, trust=trust)  # type: ignore[arg-type]
        return rules(scenario, ax=ax) if kind == "rules" else transfer(scenario, ax=ax)
    keep = ("heard",) if kind == "reception" else ()
    recording = recording_or_flight(source, seed, settings, law, trust=trust, keep=keep)
    with naming_file(source):
        draw, window = DRAWINGS[kind], {"start": start, "stop": stop}
        taken = signature(draw).parameters
        return draw(recording, ax=ax, **{name: moment for name, moment in window.items() if name in taken})


def _is_recording_file(source: Any) -> bool:
    return isinstance(source, (str, os.PathLike)) and str(source).lower().endswith(".nc")


def _opened(source: PlotSource) -> xr.Dataset | None:
    """Return a recording, opened where its file is named; None of a scenario."""
    if isinstance(source, xr.Dataset):
        return source
    return load_recording(source) if _is_recording_file(source) else None  # type: ignore[arg-type]


def recording_or_flight(
    source: PlotSource, seed: int, settings: Mapping[str, Any] | None = None, law: Any = None, *, trust: bool = False,
    keep: Sequence[str] = (),
) -> xr.Dataset:  # fmt: skip
    """Return the recording, open the named recording, or fly the scenario."""
    if (settings or law is not None) and (isinstance(source, xr.Dataset) or _is_recording_file(source)):
        raise AirflockError(
            f"{_source_name(source)}: is a recording; --set, --agents, --duration and --law need a scenario to fly"
        )
    opened = _opened(source)
    if opened is not None:
        return opened
    return simulate(scenario_variant(source, settings, law, trust=trust), seed, keep=keep)  # type: ignore[arg-type]


@contextmanager
def naming_file(source: Any) -> Iterator[None]:
    """Put the name of the recording's file in front of the RecordingErrors raised inside."""
    try:
        yield
    except RecordingError as error:
        before, colon, rest = str(error).partition(": ")
        if before != "recording" or not colon or not _is_recording_file(source):
            raise
        raise RecordingError(f"{source}: {rest}") from error


def _source_name(source: Any) -> str:
    return "recording" if isinstance(source, xr.Dataset) else str(source)
