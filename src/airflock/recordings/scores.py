"""Scores: order parameters of scenarios over many seeds, and of any recording, by the same rules."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.aero import descent
from airflock.core.contract import Model
from airflock.core.maths import FAR
from airflock.core.parameters import Parameters, declarations, number_names
from airflock.core.radio import Packets
from airflock.core.vocabulary import Own, asks
from airflock.engine import measure_frames, plan_of
from airflock.errors import RecordingError
from airflock.executors.scores import scores
from airflock.metrics import nearest
from airflock.metrics.registry import POWER, SETS, reports
from airflock.recordings.attributes import check_format, flown_with_own_law, measured_by, scenario_document
from airflock.recordings.layout import frames_of
from airflock.recordings.lengths import in_bodies, unsaid
from airflock.recordings.own_kinds import missing_kinds, with_files
from airflock.recordings.score_table import described
from airflock.scenarios.change import variant
from airflock.scenarios.document import keyed
from airflock.scenarios.families import Given
from airflock.scenarios.making import make
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.sections import SECTIONS
from airflock.scenarios.seeds import sound_seeds
from airflock.untrusted import from_outside


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
    scheduler: str | None = None,
    aero: bool = False,
    groups: bool = False,
    body_length: float | None = None,
    trust: bool = False,
) -> pd.DataFrame:
    """Order parameters and fitness as a table: one row per seed of a scenario, or one row for a recording.

    Parameters
    ----------
    what : Scenario, str, path or xarray.Dataset
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
        settings = keyed(settings, "recording")
        settings = in_bodies(body_length) | settings if body_length is not None else settings
        settings = aero_settings(what, settings) if aero else settings
        if groups:
            from airflock.recordings.groups import BETWEEN, group_scores

            table = _about(group_scores(what, settings, trust=trust), scenario_of(what, settings, trust=trust))
            for place, about in (("units", 0), ("meanings", 1)):
                table.attrs[place] |= {name: told[about] for name, told in BETWEEN.items()}
            return table
        values, _ = measure(what, settings, trust=trust)
        scenario = scenario_of(what, settings, trust=trust)
        table = _about(pd.DataFrame([values]), scenario)
        table.attrs["not_told"] = not_told(what, scenario, settings)
        return table
    asked = {"aero": aero, "groups": groups, "body_length": body_length is not None}
    if any(asked.values()):
        names = ", ".join(name for name, given in asked.items() if given)
        raise RecordingError(f"{names}: needs a recording, such as one from airflock.simulate(scenario)")
    scenario, numbers = variant(what, settings, trust=trust), sound_seeds(seeds)
    options: dict[str, Any] = {"threads": threads, "precision": precision, "done": done, "device": device, "say": say}
    rows = scores([scenario] * len(numbers), numbers, scheduler=scheduler, **options)
    return _about(pd.DataFrame(rows, index=pd.Index(numbers, name="seed")), scenario)


def not_told(
    recording: xr.Dataset, scenario: Scenario, settings: Mapping[str, Any] | None = None
) -> dict[str, tuple[str, ...]]:
    """Order parameters that a recording without a scenario does not have for want of a length, with the keys missing.

    scenario : `scenario_of` the recording with these settings
    """
    if scenario_document(recording) is not None:
        return {}
    sampled = (name for metric in scenario.measures.metrics for name in metric.Sample._fields)  # type: ignore[attr-defined]
    names = (*reports(scenario.measures), *sampled)
    return unsaid(names, scenario.measures.name, settings or {}, arena=scenario.world.arena != "none")


def between_frames(recording: xr.Dataset, scenario: Scenario) -> str:
    """What a simulated recording cannot tell as its flight did, which looked between its frames; empty if nothing.

    scenario : `scenario_of` the recording
    """
    if scenario_document(recording) is None or recording.attrs.get("airflock_device") == "fleet":
        return ""
    q, (_, period, _) = scenario.measured_by(), frames_of(recording)
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
    return described(table, of_courses | dict(reports(scenario.measures)))


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
    return _about(measure(recording, settings, trust=trust)[1], scenario_of(recording, settings, trust=trust))


def courses(scenario: Scenario) -> list[str]:
    """Names of the order parameters that have a value at every instant of a flight: the columns of `over_time`."""
    return [name for metric in plan_of(scenario.alike()).metrics for name in metric.Sample._fields]  # type: ignore[attr-defined]


def measure(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Order parameters of a recording, and their course over time.

    Frames are taken every metrics.period, or each one if they are farther apart; collisions every
    metrics.collision_period. Where a number is missing (nan) the individual is not there: an instant counts with those
    who are, means over time are means over instants at which at least two are, and the value `present` tells the share
    of individuals and instants that is there. What tracks do not have for want of a length (`not_told`) is left out.
    """
    frames, period, present = frames_of(recording)
    scenario = scenario_of(recording, settings, trust=trust)
    precision = 64 if frames.dtype == np.float64 else 32
    q = scenario.measured_by()
    every = max(1, round(q.period / period)), max(1, round((q.collision_period or period) / period))
    values, series = measure_frames(scenario.alike(), frames, period, precision=precision, every=every, present=present)
    times = pd.Index(recording["time"].values.astype(float), name="time")
    course = pd.DataFrame(series, index=times)
    course = course.mask(course >= 0.5 * FAR)  # a clearance where nothing stands, a time of what has not happened
    if frames.shape[2] == 1:  # no pair, no distance
        course[[name for name in nearest.PAIRED if name in series]] = np.nan
    scores = replace(scenario, flight=replace(scenario.flight, agents=frames.shape[2])).judged(values)
    scores |= {} if present.all() else {"present": float(present.mean())}
    untold = not_told(recording, scenario, settings)
    kept = {name: value for name, value in scores.items() if name not in untold}
    return kept, course[[name for name in course if name not in untold]]


class _Nothing(Parameters):
    """A law without a parameter."""


def _on(own: Own) -> tuple[float, float, float]:
    """Keep the velocity."""
    return own.vx, own.vy, own.vz


# Stands where the law of a recording is not known: it is measured, not flown.
UNKNOWN = Model(name="unknown", Parameters=_Nothing, command="velocity", decide=_on)


def aero_settings(recording: xr.Dataset, changed: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Settings that measure the power of a recording's geometry; `changed` goes before them.

    A law that solves for the wings of the flock flies in a frame that moves with the air; elsewhere forward is the
    flock's mean heading.
    """
    law = scenario_of(recording).model
    on_wings = law.flock is not None and law.flock is not descent.flock and "wing" in asks(law.flock, "flock")
    frame = {} if on_wings else {"wing.frame": "ground"}
    return {**POWER, **frame, **(changed or {})}


def scenario_of(recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False) -> Scenario:
    """Scenario that a recording was flown with, or for a flight log one that only says how to score it.

    A law, a body or a metric set of the user's own is not in the file: the law is unknown then, and the others are the
    usual ones, unless settings give a file ({"metrics.kind": "mine.py"}), which runs with `trust`. A log brings no
    arena: it is open unless settings name one, and v_flock is its mean speed.
    """
    check_format(recording)
    document = scenario_document(recording)
    settings = keyed(settings, str(recording.attrs.get("airflock_name", "recording")))
    if document is not None:
        with from_outside(str(recording.attrs.get("airflock_name", "recording")), RecordingError):
            return _flown(document, settings, recording, trust)
    frames, period, _ = frames_of(recording)
    dims = frames.shape[1] // 2
    speed = float(np.nanmean(np.linalg.norm(frames[:, dims:], axis=1)))
    document = {
        "agents": 1,
        "dt": period,
        "sensors": {"period": period},
        "start": {"separation": 0.0},
        "metrics": {"v_flock": max(speed, 0.01), "r_cluster": 80.0, "r_comm": 80.0, "period": period},
        "world": {"dimensions": str(dims), "arena": "none"},
    }
    return make(document, "recording", settings, given=Given(law=UNKNOWN), trust=trust)


def _flown(document: dict[str, Any], given: Mapping[str, Any], recording: xr.Dataset, trust: bool) -> Scenario:
    """Scenario of a simulated recording, with stand-ins for what the file does not hold and nobody gave."""
    name = str(recording.attrs.get("airflock_name", "recording"))
    missing = missing_kinds(document, given)
    document, settings = with_files(document, given)
    if "metrics" in missing:
        document = {**document, "metrics": _usual_metrics(document["metrics"])}
    if "body" in missing:
        document = {**{key: value for key, value in document.items() if key != "groups"}, "body": {}}
    if "sensors" in missing:
        document = {**document, "sensors": {k: v for k, v in document["sensors"].items() if k == "period"}}
    if "radio" in missing:
        common = {key: value for key, value in document["radio"].items() if key in number_names(Packets)}
        document = {**document, "radio": common}
    if "topology" in missing:
        document = {key: value for key, value in document.items() if key != "topology"}
    if not flown_with_own_law(recording):
        return make(document, name, settings, trust=trust)
    measured = measured_by(recording)
    kept = measured if str(measured.get("kind", "")) in ("", *SETS) else _usual_metrics(measured)
    kept = document["metrics"] if str(given.get("metrics.kind")).endswith(".py") and "metrics" in document else kept
    stand_in = {**document, "model": {}, "body": {}, "metrics": {k: v for k, v in kept.items() if v is not None}}
    stand_in = {key: value for key, value in stand_in.items() if key not in ("groups", "faults")}
    if isinstance(document.get("groups"), list):  # who is in which is told even where nobody knows how they fly
        stand_in["groups"] = [
            {key: group[key] for key in ("name", "agents") if key in group} if isinstance(group, Mapping) else group
            for group in document["groups"]
        ]
    others = {key: value for key, value in settings.items() if not key.startswith("model.")}
    return make(stand_in, name, others, given=Given(law=UNKNOWN), trust=trust)


def _usual_metrics(table: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a section metrics that every set has."""
    known = {key for key, _, _ in declarations(SECTIONS["metrics"])} - {"kind"}
    return {key: value for key, value in table.items() if key in known}
