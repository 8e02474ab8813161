"""Scores: order parameters of scenarios over many seeds, and of any recording, by the same rules."""

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.engine import cpu
from airflock.engine.passes.build import columns
from airflock.engine.plan import WHOLE
from airflock.engine.simulate import finish, plan_of, score_flights
from airflock.engine.tables import tables
from airflock.errors import RecordingError
from airflock.metrics import nearest
from airflock.metrics.registry import reports
from airflock.recordings.layout import frames_of
from airflock.scenarios.files import MODELS, loaded, make
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.seeds import sound_seeds


def score(
    what: Scenario | str | os.PathLike[str] | xr.Dataset,
    seeds: int | Iterable[int] = 1,
    *,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = None,
    aero: bool = False,
) -> pd.DataFrame:
    """Order parameters and fitness as a table: one row per seed of a scenario, or one row for a recording.

    Parameters
    ----------
    what : Scenario, str, path or xarray.Dataset
        A scenario, or the name of a preset or scenario file, which is flown; or a recording, which is measured.
    seeds : int or iterable of int
        A number of flights, with seeds 0, 1, 2, ..., or the seeds themselves.
    settings : mapping, optional
        For a recording, keys such as {"metrics.r_coll": 2.0} that replace those it was flown with.
    threads : int, optional
        Flights side by side; by default one per core.
    precision : int
        Bits per number, 32 or 64.
    done : callable, optional
        Called after each flight.
    device : str
        cpu, cuda (a GPU, all flights together), python, or auto, which tells `say` what it picked.
    say : callable, optional
        Told what auto picked.
    aero : bool
        For a recording, measure the power that its geometry saves.

    Returns
    -------
    pandas.DataFrame
        One row per flight, one column per order parameter; `attrs["units"]` and `attrs["meanings"]` say what they are.

    Raises
    ------
    ScenarioError, RecordingError, FlightError
        If the scenario, the recording or the flight is faulty.

    Notes
    -----
    Which order parameters there are is the key `metrics.kind`; their sources stand beside them in `airflock.metrics`.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> table = airflock.score(short, seeds=3)
    >>> table.index.tolist(), table.attrs["units"]["phi_vel"]
    ([0, 1, 2], 'm/s')
    """
    if isinstance(what, xr.Dataset):
        settings = aero_settings(what, settings) if aero else settings
        values, _ = measure(what, settings)
        return _about(pd.DataFrame([values]), scenario_of(what, settings))
    scenario, found = loaded(what), sound_seeds(seeds)
    options: dict[str, Any] = {"threads": threads, "precision": precision, "done": done, "device": device, "say": say}
    rows = score_flights([scenario] * len(found), found, **options)
    return _about(pd.DataFrame(rows, index=pd.Index(found, name="seed")), scenario)


def _about(table: pd.DataFrame, scenario: Scenario) -> pd.DataFrame:
    """A table with units and meanings of its columns among its attributes."""
    known = reports(scenario.metrics.kind)
    table.attrs["units"] = {name: known[name][0] for name in table.columns if name in known}
    table.attrs["meanings"] = {name: known[name][1] for name in table.columns if name in known}
    return table


def over_time(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> pd.DataFrame:
    """Order parameters at every instant of a recording.

    Parameters
    ----------
    recording : xarray.Dataset
        Simulated, flown or loaded from a file.
    settings : mapping, optional
        Keys such as {"metrics.r_coll": 2.0} that replace those it was flown with.

    Returns
    -------
    pandas.DataFrame
        One row per frame that is measured, with the time in s as index, and one column per order parameter.

    Raises
    ------
    RecordingError
        If positions are missing or frames are not evenly spaced.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.over_time(airflock.simulate(short))["phi_vel"].shape
    (6,)
    """
    return measure(recording, settings)[1]


def measure(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> tuple[dict[str, Any], pd.DataFrame]:
    """Order parameters of a recording, and their course over time.

    Frames are taken every metrics.period, or each one if they are farther apart; collisions every
    metrics.collision_period.
    """
    frames, period = frames_of(recording)
    scenario = scenario_of(recording, settings)
    precision = 64 if frames.dtype == np.float64 else 32
    plan = replace(plan_of(scenario, precision=precision), record=False)
    found = tables(scenario, plan, 0)
    q = scenario.measured_by()
    every = {"sample_every": q.period, "collide_every": q.collision_period or period}
    for name, seconds in every.items():
        found.whole[WHOLE.index(name)] = max(1, round(seconds / period))
    found.whole[WHOLE.index("agents")] = frames.shape[2]
    values, series = cpu.measure_frames(plan, found, frames, period)
    names = [name for name, _, _ in columns(plan.metrics)]
    times = pd.Index(recording["time"].values.astype(float), name="time")
    course = pd.DataFrame(series, index=times, columns=names)
    if frames.shape[2] == 1:  # no pair, no distance
        course[[name for name in nearest.PAIRED if name in names]] = np.nan
    return finish(replace(scenario, flight=replace(scenario.flight, agents=frames.shape[2])), values), course


def aero_settings(recording: xr.Dataset, changed: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Settings that measure the power of a recording's geometry; `changed` goes before them.

    A flock of birds was flown in a frame that moves with the air; elsewhere forward is the flock's mean heading.
    """
    document = json.loads(str(recording.attrs.get("airflock_scenario") or "{}"))
    birds = document.get("model", {}).get("kind") == "dimock_2003"
    frame = {} if birds else {"wing.frame": "ground"}
    return {"metrics.kind": "dimock", "metrics.fitness": "sound", **frame, **(changed or {})}


def scenario_of(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Scenario that a recording was flown with, or for a flight log one that only says how to score it.

    A log brings no arena and no model: its arena is open unless settings name one, and v_flock is its mean speed.
    """
    text = recording.attrs.get("airflock_scenario")
    if text:
        try:
            document = json.loads(text)
        except json.JSONDecodeError as fault:
            raise RecordingError(f"recording: attribute airflock_scenario is damaged: {fault}") from fault
        name = str(recording.attrs.get("airflock_name", "recording"))
        kind = document.get("model", {}).get("kind", "")
        if kind in MODELS or str(kind).endswith(".py"):
            return make(document, name, settings)
        # flown with a law that was given directly: its parameters are gone, what it is measured by is kept
        measured = json.loads(str(recording.attrs.get("airflock_metrics", "{}")))
        stand_in = {**document, "model": {"kind": MODELS[0]}, "metrics": measured}
        return make(stand_in, name, {k: v for k, v in (settings or {}).items() if not k.startswith("model.")})
    frames, period = frames_of(recording)
    dims = frames.shape[1] // 2
    speed = float(np.linalg.norm(frames[:, dims:], axis=1).mean())
    document = {
        "agents": 1,
        "dt": period,
        "model": {"kind": "vasarhelyi_2018"},
        "sensors": {"period": period},
        "start": {"separation": 0.0},
        "metrics": {"v_flock": max(speed, 0.01), "r_cluster": 80.0, "r_comm": 80.0, "period": period},
        "world": {"dimensions": str(dims), "arena": "none"},
    }
    return make(document, "recording", settings)
