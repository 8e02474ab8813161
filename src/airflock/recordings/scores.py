"""Scores: order parameters of scenarios over many seeds, and of any recording, by the same rules."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.core import FAR
from airflock.engine import measure_frames, plan_of
from airflock.parts.metrics import nearest, reported_values
from airflock.recordings.attributes import scenario_document
from airflock.recordings.flown_scenario import power_settings, scenario_of_recording
from airflock.recordings.layout import recording_frames
from airflock.recordings.lengths import body_length_settings, undefined_metrics
from airflock.recordings.score_table import with_units
from airflock.runs import score_scenarios
from airflock.scenarios import Scenario, check_seeds, scenario_variant, settings_dict
from airflock.support import RecordingError


def score(
    scenario_or_recording: Scenario | str | os.PathLike[str] | xr.Dataset,
    seeds: int | Iterable[int] = 1,
    *,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = None,
    scheduler: str | None = None,
    aero: bool = False,
    groups: bool = False,
    body_length: float | None = None,
    trust: bool = False,
) -> pd.DataFrame:
    """Order parameters and fitness as a table: one row per seed of a scenario, or one row for a recording.

    Parameters
    ----------
    scenario_or_recording : Scenario, str, path or xarray.Dataset
        A scenario, or the name of a preset or scenario file, which is flown; or a recording (time, space,
        keypoint, individual), which is measured.
    seeds : int or iterable of int
        A number of flights, with seeds 0, 1, 2, ..., or the seeds themselves.
    settings : mapping, optional
        Keys such as {"metrics.r_coll": 2.0} that replace those of the scenario, or those a recording was flown with.
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
    scheduler : str, optional
        Address of a dask scheduler whose workers fly, instead of this process.
    aero : bool
        For a recording, measure the power that its geometry saves.
    groups : bool
        For a recording, one row for all, one for each group of its scenario, and one for what is between each two.
    body_length : float, optional
        For tracks, length of a body in m, by which it is judged who is near; see `airflock.recordings.lengths`.
    trust : bool
        Whether code that a file or settings name may run, such as {"metrics.kind": "mine.py"}.

    Returns
    -------
    pandas.DataFrame
        One row per flight, one column per order parameter; `attrs["units"]` and `attrs["meanings"]` say what they are.
        Of tracks, which bring no scenario, what depends on a length that nobody gave is no column; `attrs["not_told"]`
        names it, with the keys that it needs.

    Raises
    ------
    ScenarioError, RuleError, RecordingError, FlightError, ParameterError, DeviceError, StudyError
        If the scenario, one of its rules, the recording, the flight, the seeds or the device is faulty, or the
        scheduler does not answer.

    Notes
    -----
    Which order parameters there are is the key `metrics.kind`; their sources stand beside them in
    `airflock.parts.metrics`.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> table = airflock.score(short, seeds=3)
    >>> table.index.tolist(), table.attrs["units"]["phi_vel"]
    ([0, 1, 2], 'm/s')
    """
    if isinstance(scenario_or_recording, xr.Dataset):
        return _of_recording(
            scenario_or_recording, settings, aero=aero, groups=groups, body_length=body_length, trust=trust
        )
    asked = {"aero": aero, "groups": groups, "body_length": body_length is not None}
    if any(asked.values()):
        names = ", ".join(name for name, given in asked.items() if given)
        raise RecordingError(f"{names}: needs a recording, such as one from airflock.simulate(scenario)")
    scenario, numbers = scenario_variant(scenario_or_recording, settings, trust=trust), check_seeds(seeds)
    options: dict[str, Any] = {
        "threads": threads,
        "precision": precision,
        "on_done": done,
        "device": device,
        "notify": say,
    }
    rows = score_scenarios([scenario] * len(numbers), numbers, scheduler=scheduler, **options)
    return _about(pd.DataFrame(rows, index=pd.Index(numbers, name="seed")), scenario)


def _of_recording(
    recording: xr.Dataset,
    given: Mapping[str, Any] | None,
    *,
    aero: bool,
    groups: bool,
    body_length: float | None,
    trust: bool,
) -> pd.DataFrame:
    """The table of a recording."""
    settings = settings_dict(given, "recording")
    settings = body_length_settings(body_length) | settings if body_length is not None else settings
    settings = power_settings(recording, settings) if aero else settings
    scenario = scenario_of_recording(recording, settings, trust=trust)
    if groups:
        from airflock.recordings.groups import PAIR_METRICS, group_scores

        table = _about(group_scores(recording, settings, trust=trust), scenario)
        for place, about in (("units", 0), ("meanings", 1)):
            table.attrs[place] |= {name: told[about] for name, told in PAIR_METRICS.items()}
        return table
    table = _about(pd.DataFrame([measure_recording(recording, settings, trust=trust)[0]]), scenario)
    table.attrs["not_told"] = undefined_metrics_of(recording, scenario, settings)
    return table


def undefined_metrics_of(
    recording: xr.Dataset, scenario: Scenario, settings: Mapping[str, Any] | None = None
) -> dict[str, tuple[str, ...]]:
    """Order parameters that a recording without a scenario does not have for want of a length, with the keys missing.

    scenario : `scenario_of` the recording with these settings
    """
    if scenario_document(recording) is not None:
        return {}
    sampled = (name for metric in scenario.measures.metrics for name in metric.Sample._fields)
    names = (*reported_values(scenario.measures), *sampled)
    return undefined_metrics(names, scenario.measures.name, settings or {}, arena=scenario.world.arena != "none")


def between_frames_note(recording: xr.Dataset, scenario: Scenario) -> str:
    """What a simulated recording cannot tell as its flight did, which looked between its frames; empty if nothing.

    scenario : `scenario_of` the recording
    """
    if scenario_document(recording) is None or recording.attrs.get("airflock_device") == "fleet":
        return ""
    q, (_, period, _) = scenario.resolved_metrics(), recording_frames(recording)
    names = [name for each in scenario.measures.of(q) if each.clock == "collision" for name in each.reports]
    looked = q.collision_period or period
    if not names or looked > 0.99 * period:
        return ""
    return (
        f"{', '.join(names)} and what follows from them: by frames {period:g} s apart; its flight looked every "
        f"{looked:g} s, and told others"
    )


def _about(table: pd.DataFrame, scenario: Scenario) -> pd.DataFrame:
    """A table with units and meanings of its columns among its attributes."""
    of_courses = {name: about for each in scenario.measures.metrics for name, about in each.courses.items()}
    return with_units(table, of_courses | dict(reported_values(scenario.measures)))


def over_time(recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False) -> pd.DataFrame:
    """Order parameters at every instant of a recording.

    Parameters
    ----------
    recording : xarray.Dataset
        (time, space, keypoint, individual), simulated, flown or loaded from a file.
    settings : mapping, optional
        Keys such as {"metrics.r_coll": 2.0} that replace those it was flown with.
    trust : bool
        Whether code that settings name may run, such as {"metrics.kind": "mine.py"}.

    Returns
    -------
    pandas.DataFrame
        One row per frame that is measured, with the time in s as index, and one column per order parameter;
        `attrs["units"]` and `attrs["meanings"]` say what they are (a set of your own says it in REPORTS and COURSES).

    Raises
    ------
    RecordingError
        If positions are missing or frames are not evenly spaced.
    ScenarioError
        If the settings are none that its scenario takes.

    Examples
    --------
    >>> import airflock
    >>> short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    >>> airflock.over_time(airflock.simulate(short))["phi_vel"].shape
    (6,)
    """
    return _about(
        measure_recording(recording, settings, trust=trust)[1], scenario_of_recording(recording, settings, trust=trust)
    )


def time_series_names(scenario: Scenario) -> list[str]:
    """Names of the order parameters that have a value at every instant of a flight: the columns of `over_time`."""
    return [name for metric in plan_of(scenario.alike()).metrics for name in metric.Sample._fields]


def measure_recording(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Order parameters of a recording, and their course over time.

    Frames are taken every metrics.period, or each one if they are farther apart; collisions every
    metrics.collision_period. Where a number is missing (nan) the individual is not there: an instant counts with those
    who are, means over time are means over instants at which at least two are, and the value `present` tells the share
    of individuals and instants that is there. What tracks do not have for want of a length (`undefined_metrics_of`) is
    left out.
    """
    frames, period, present = recording_frames(recording)
    scenario = scenario_of_recording(recording, settings, trust=trust)
    precision = 64 if frames.dtype == np.float64 else 32
    q = scenario.resolved_metrics()
    every = max(1, round(q.period / period)), max(1, round((q.collision_period or period) / period))
    values, series = measure_frames(scenario.alike(), frames, period, precision=precision, every=every, present=present)
    times = pd.Index(recording["time"].values.astype(float), name="time")
    course = pd.DataFrame(series, index=times)
    course = course.mask(course >= 0.5 * FAR)  # a clearance where nothing stands, a time of what has not happened
    if frames.shape[2] == 1:  # no pair, no distance
        course[[name for name in nearest.PAIRED if name in series]] = np.nan
    scores = replace(scenario, flight=replace(scenario.flight, agents=frames.shape[2])).judged(values)
    scores |= {} if present.all() else {"present": float(present.mean())}
    untold = undefined_metrics_of(recording, scenario, settings)
    kept = {name: value for name, value in scores.items() if name not in untold}
    return kept, course[[name for name in course if name not in untold]]
