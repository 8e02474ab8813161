"""The accessor `recording.flock` of xarray: scores, measures, pictures and replays of a dataset in one line.

Importing the layout of recordings registers it. It imports what it calls only when it is called, so
that this costs a flight nothing; pictures come from a room above this one, by the public names.
"""

from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from typing import Any

import xarray as xr

PUBLIC = ("score", "over_time", "plot", "replay")  # public functions whose first argument is a recording


@xr.register_dataset_accessor("flock")  # type: ignore[no-untyped-call]
class FlockAccessor:
    """What Airflock makes of a dataset, one of its own or one of `movement`: `recording.flock.milling()`.

    score, over_time, plot, replay : as the public functions of these names
    milling, leadership, nearest_distances, ... : the functions of `airflock.measures`

    A dataset of `movement` is read as `airflock.load_tracks` reads it. Where that asks for a unit or a rate, call the
    accessor with them: `dataset.flock(unit="px", scale=0.0005).milling()`.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.simulate(short).flock.milling().shape
    (6,)
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def __call__(self, **options: Any) -> "FlockAccessor":
        """Return the accessor of the tracks that a dataset holds; options as of `airflock.load_tracks`."""
        return FlockAccessor(import_module("airflock").load_tracks(self._dataset, **options))

    @property
    def recording(self) -> xr.Dataset:
        """Return the dataset itself if it is a recording, else the tracks that it holds."""
        own = str(self._dataset.attrs.get("source_software", "")).startswith("airflock")
        return self._dataset if own and "individual" in self._dataset.dims else self()._dataset

    def __getattr__(self, name: str) -> Callable[..., Any]:
        found = getattr(import_module("airflock"), name) if name in PUBLIC else measures().get(name)
        if found is None:
            suggest = import_module("airflock.support").suggest
            known = (*PUBLIC, *measures())
            usual = f"known: {', '.join(known)}"
            raise AttributeError(f"flock has no {name}; {suggest(name, known, usual)}")
        function: Callable[..., Any] = found
        return wraps(function)(lambda *given, **options: function(self.recording, *given, **options))

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *PUBLIC, *measures()})


@cache
def measures() -> dict[str, Callable[..., Any]]:
    """Return the measures of groups by the names of their functions."""
    rooms = import_module("airflock.recordings.measures")
    modules = [getattr(rooms, name) for name in rooms.__all__]
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if getattr(value, "__module__", "") == module.__name__ and not name.startswith("_") and callable(value)
    }
