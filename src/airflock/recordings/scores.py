"""Score scenarios over many seeds, and any recording by the same rules: a table of order parameters.

Groups of a recording, and lengths that a recording of tracks does not have, are treated here, too.
"""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from html import escape
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from airflock.core import FAR
from airflock.engine import measure_frames, plan_of
from airflock.parts.metrics import nearest, reported_values
from airflock.recordings import dataset
from airflock.recordings.attributes import scenario_document
from airflock.recordings.dataset import recording_frames
from airflock.recordings.flown_scenario import power_settings, scenario_of_recording
from airflock.runs import score_scenarios
from airflock.scenarios import Scenario, check_seeds, scenario_variant, settings_dict
from airflock.support import RecordingError, is_number, log


def score(
    scenario_or_recording: Scenario | str | os.PathLike[str] | xr.Dataset,
    seeds: int | Iterable[int] = 1,
    *,
    settings: Mapping[str, Any] | None = None,
    threads: int | None = None,
    precision: int = 32,
    done: Callable[[], None] | None = None,
    device: str = "cpu",
    say: Callable[[str], None] | None = log,
    scheduler: str | None = None,
    aero: bool = False,
    groups: bool = False,
    body_length: float | None = None,
    trust: bool = False,
) -> pd.DataFrame:
    """Score a scenario, one row of order parameters per seed, or a recording, one row.

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
        cpu, cuda (a GPU, all flights together), python, or auto, which reports its choice to `say`.
    say : callable, optional
        Called with the choice of auto; by default the logger `airflock`.
    scheduler : str, optional
        Address of a dask scheduler whose workers fly, instead of this process.
    aero : bool
        For a recording, measure the power saved by flying in each other's upwash; wing.span and the like set the wing.
    groups : bool
        For a recording, one row for all, one for each group of its scenario, and one for what is between each two.
    body_length : float (METRES), optional
        For tracks, length of a body in m, which sets what counts as near; see `airflock.recordings.scores`.
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
        recording, given = scenario_or_recording, settings_dict(settings, "recording")
        # Explicit settings have priority over what follows from the length of a body.
        given = body_length_settings(body_length) | given if body_length is not None else given
        given = power_settings(recording, given) if aero else given
        scenario = scenario_of_recording(recording, given, trust=trust)
        if groups:
            return _about(group_scores(recording, given, trust=trust), scenario)
        table = _about(pd.DataFrame([measure_recording(recording, given, trust=trust)[0]]), scenario)
        table.attrs["not_told"] = undefined_metrics_of(recording, scenario, given)
        return table
    recording_options = {"aero": aero, "groups": groups, "body_length": body_length is not None}
    if any(recording_options.values()):
        names = ", ".join(name for name, given in recording_options.items() if given)
        raise RecordingError(f"{names}: needs a recording, such as one from airflock.simulate(scenario)")
    scenario, numbers = scenario_variant(scenario_or_recording, settings, trust=trust), check_seeds(seeds)
    how: dict[str, Any] = {"threads": threads, "precision": precision, "on_done": done, "device": device, "notify": say}
    rows = score_scenarios([scenario] * len(numbers), numbers, scheduler=scheduler, **how)
    return _about(pd.DataFrame(rows, index=pd.Index(numbers, name="seed")), scenario)


def undefined_metrics_of(
    recording: xr.Dataset, scenario: Scenario, settings: Mapping[str, Any] | None = None
) -> dict[str, tuple[str, ...]]:
    """Return the order parameters that tracks lack because nobody gave a length, with the missing keys.

    scenario : `scenario_of` the recording with these settings
    """
    if scenario_document(recording) is not None:
        return {}
    sampled = (name for metric in scenario.metrics.rule.metrics for name in metric.Sample._fields)
    needs = scenario.metrics.rule.needs
    missing = {
        name: tuple(key for key in needs.get(name, ()) if f"metrics.{key}" not in (settings or {}))
        for name in (*reported_values(scenario.metrics.rule), *sampled)
    }
    # Without an arena nobody is ever outside of it.
    outside = {"phi_wall": ("world.arena",)} if "phi_wall" in missing and scenario.world.arena == "none" else {}
    return {name: keys for name, keys in missing.items() if keys} | outside


PRESENCE_METRICS = {"present_measured": ("", "share that is present, without gaps that the import bridged")}
SLOW = 1.0  # s between frames: our choice; an animal turns, and a drone passes another one, within less


def between_frames_note(recording: xr.Dataset, scenario: Scenario) -> str:
    """Return a note on order parameters that depend on what is between the recorded frames; empty if there are none.

    scenario : `scenario_of` the recording
    """
    if recording.attrs.get("airflock_device") == "fleet":
        return ""
    q, (_, period, _) = scenario.resolved_metrics(), recording_frames(recording)
    names = [name for each in scenario.metrics.rule.of(q) if each.clock == "collision" for name in each.reports]
    if scenario_document(recording) is None:  # tracks: nobody looked in between
        between = f"nothing is known in between, so {', '.join(names)} are of these instants; " if names else ""
        straight = "speeds and headings that no log gives are those of straight lines over two frames"
        return f"frames are {period:g} s apart: {between}{straight}" if period > SLOW else ""
    looked = q.collision_period or period
    if not names or looked > 0.99 * period:
        return ""
    return (
        f"{', '.join(names)} and what follows from them: by frames {period:g} s apart; its flight looked every "
        f"{looked:g} s, and told others"
    )


def _about(table: pd.DataFrame, scenario: Scenario) -> pd.DataFrame:
    """Add units and meanings of the columns to the attributes of a table."""
    of_courses = {name: about for each in scenario.metrics.rule.metrics for name, about in each.courses.items()}
    return with_units(
        table, of_courses | dict(reported_values(scenario.metrics.rule)) | PRESENCE_METRICS | PAIR_METRICS
    )


def over_time(recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False) -> pd.DataFrame:
    """Compute order parameters at every instant of a recording.

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
    """Return the names of the order parameters with a value at every instant: the columns of `over_time`."""
    return [name for metric in plan_of(scenario.alike()).metrics for name in metric.Sample._fields]


def measure_recording(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Measure the order parameters of a recording, and their course over time.

    Frames are taken every metrics.period, or each one if they are farther apart; collisions every
    metrics.collision_period. Where a number is missing (nan) the individual is not there: an
    instant counts with those who are, means over time are means over instants at which at least two
    are, and the value `present` is the share of individuals and instants that is there. What tracks
    do not have for want of a length (`undefined_metrics_of`) is left out.
    """
    frames, period, present = recording_frames(recording)
    scenario = scenario_of_recording(recording, settings, trust=trust)
    precision = 64 if frames.dtype == np.float64 else 32
    q = scenario.resolved_metrics()
    # Frames farther apart than the metrics' period are used one by one; they are never
    # interpolated.
    every = max(1, round(q.period / period)), max(1, round((q.collision_period or period) / period))
    # The very stages of a flight measure, so a score never depends on where it was computed.
    values, series = measure_frames(scenario.alike(), frames, period, precision=precision, every=every, present=present)
    times = pd.Index(recording["time"].values.astype(float), name="time")
    course = pd.DataFrame(series, index=times)
    course = course.mask(course >= 0.5 * FAR)  # a clearance where nothing stands, a time of what has not happened
    if frames.shape[2] == 1:  # no pair, no distance
        course[[name for name in nearest.PAIRED if name in series]] = np.nan
    scores = replace(scenario, flight=replace(scenario.flight, agents=frames.shape[2])).judged(values)
    if not course.notna().any(axis=None):  # a mean over no instants is no 0
        scores = dict.fromkeys(scores, np.nan)
    scores |= {} if present.all() else {"present": float(present.mean())}
    bridged = (recording["confidence"] == 0.5) if "confidence" in recording else np.zeros(())
    scores |= {"present_measured": float(present.mean() - bridged.mean())} if bridged.any() else {}
    undefined = {*undefined_metrics_of(recording, scenario, settings), *scenario.unmeasured}
    kept = {name: value for name, value in scores.items() if name not in undefined}
    return kept, course[[name for name in course if name not in undefined]]


PAIR_METRICS = {
    "r_centres": ("m", "mean distance between the centres of two groups; nan in a periodic world"),
    "r_between": ("m", "smallest distance between agents of the two groups"),
    "phi_between": ("", "velocity correlation between agents of the two groups"),
}
PART = 200  # instants at once


def group_scores(
    recording: xr.Dataset, settings: Mapping[str, Any] | None = None, *, trust: bool = False
) -> pd.DataFrame:
    """Score groups: a row for all agents, one for each group, and one for each two groups.

    A group is measured as if the others were not there. What is between two groups, `PAIR_METRICS`,
    stands in rows named "one to other"; an instant counts where both have somebody there. Of a
    group that is never there all but `present` is nan. Raises RecordingError where the recording's
    scenario has no groups.
    """
    scenario = scenario_of_recording(recording, settings, trust=trust)
    groups = [group for group in scenario.groups if group.agents]
    if not groups:
        raise RecordingError("recording: its scenario has no [[groups]]")
    rows: dict[str, dict[str, Any]] = {"all": measure_recording(recording, settings, trust=trust)[0]}
    frames, _, present = recording_frames(recording)
    for group in groups:
        members = list(group.agents)
        rows[group.name] = {"present": 0.0}
        if present[:, members].any():
            rows[group.name] = measure_recording(recording.isel(individual=members), settings, trust=trust)[0]
    dims, world = frames.shape[1] // 2, scenario.world
    box = dataset.box_sides(world, dims)
    for one, other in combinations(groups, 2):
        pair = (list(one.agents), list(other.agents))
        rows[f"{one.name} to {other.name}"] = _between(frames, present, pair, dims, box)
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("group")


def _between(
    frames: NDArray[Any],
    present: NDArray[np.bool_],
    pair: tuple[list[int], list[int]],
    dims: int,
    box: NDArray[Any] | None,
) -> dict[str, float]:
    """Measure two groups of agents against each other; box : sides of a periodic world, m."""
    x, v = frames[:, :dims].astype(float), frames[:, dims : 2 * dims].astype(float)
    heading = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)
    both = np.logical_and(np.any(present[:, pair[0]], axis=1), np.any(present[:, pair[1]], axis=1))
    apart, nearest, cosines = [], np.inf, []
    # In parts of 200 instants: all pairs of two large groups at all instants would not fit in
    # memory.
    for first in range(0, len(x), PART):
        part = np.flatnonzero(both[first : first + PART]) + first
        if not len(part):
            continue
        (xa, xb), (ha, hb) = ([array[part][:, :, who] for who in pair] for array in (x, heading))
        gap = dataset.nearest_image(xb[:, :, None, :] - xa[:, :, :, None], box, axis=1)
        nearest = min(nearest, float(np.nanmin(np.linalg.norm(gap, axis=1))))
        apart += np.linalg.norm(np.nanmean(xb, axis=2) - np.nanmean(xa, axis=2), axis=1).tolist()
        cosines += np.nanmean((hb[:, :, None, :] * ha[:, :, :, None]).sum(axis=1), axis=(1, 2)).tolist()
    if not apart:
        return dict.fromkeys(PAIR_METRICS, np.nan)
    return {
        "r_centres": float(np.mean(apart)) if box is None else np.nan,
        "r_between": nearest,
        "phi_between": float(np.mean(cosines)),
    }


# Lengths: without one that fits, some order parameters of tracks say nothing. Fish of 4 cm were
# scored with lengths of drones: all in collision at 3 m. A recording without a scenario gets no
# order parameter whose length, centre or wanted speed nobody gave. Excursions and rotations are
# left out, too: the origin may be a corner of a picture.
IN_BODIES = {"r_coll": 0.5, "r_body": 0.5, "r_b": 0.5, "r_safe": 1.0, "r_cluster": 5.0, "r_comm": 5.0}


def body_length_settings(length: float) -> dict[str, float]:
    """Return settings that measure distances in lengths of a body.

    Two bodies touch where their centres are half a length apart, and belong together up to five
    lengths: our choice, since nothing that is published fits all animals. Say `metrics.r_cluster`
    and the like where you know better.

    Parameters
    ----------
    length : float
        Length of a body, m.

    Returns
    -------
    dict
        Keys of a scenario and lengths in m.

    Raises
    ------
    RecordingError
        If the length is not a positive number.
    """
    if not is_number(length):
        raise RecordingError(f"body_length = {length!r} is not a number; give (0, 1000] m")
    if not 0.0 < length <= 1000.0:
        raise RecordingError(f"body_length = {length:g} m lies outside (0, 1000] m")
    return {f"metrics.{key}": share * length for key, share in IN_BODIES.items()}


def missing_lengths_note(undefined: Mapping[str, tuple[str, ...]]) -> str:
    """Return one line that names the missing order parameters and the keys that they need."""
    keys = sorted({key for needed in undefined.values() for key in needed})
    lengths = " or ".join(filter(None, (
        "--body-length 0.04" if set(keys) & IN_BODIES.keys() else "",
        " ".join(f"--set {key if '.' in key else f'metrics.{key}'}=..." for key in keys),
    )))  # fmt: skip
    return f"not shown, as tracks do not say what is near, fast or the centre: {', '.join(undefined)}; give {lengths}"


def nearness_note(recording: xr.Dataset, scenario: Scenario, names: Iterable[str]) -> str:
    """Return one line with the radii that decide what is near in these order parameters; empty for a flight."""
    users: dict[str, list[str]] = {}
    for name in names if scenario_document(recording) is None else ():
        for key in scenario.metrics.rule.needs.get(name, ()):
            users.setdefault(key, []).append(name)
    q = scenario.resolved_metrics()
    radii = [
        f"metrics.{key} = {getattr(q, key):g} m ({', '.join(own)})" for key, own in users.items() if key in IN_BODIES
    ]
    return f"near is within {', '.join(radii)}" if radii else ""


# A subclass and no wrapper: everything that takes a DataFrame takes it.
class ScoreTable(pd.DataFrame):  # type: ignore[misc]  # pandas has no types here
    """Table of order parameters, a column each; `attrs["units"]` and `attrs["meanings"]` describe them.

    It is a DataFrame in all but its heads in a notebook: below each name stands the unit, and
    pointing at a name shows the meaning. What pandas makes of it is such a table, too, as long as
    it keeps the attributes.
    """

    @property
    def _constructor(self) -> Callable[..., "ScoreTable"]:
        return ScoreTable

    def _repr_html_(self) -> str | None:
        """Return the table as pandas writes it, with units and meanings in the column headers."""
        page: Any = super()._repr_html_()
        if page is None:  # pandas is set to show text
            return None
        head, end, rest = str(page).partition("</thead>")
        meanings = self.attrs.get("meanings", {})
        for name, unit in self.attrs.get("units", {}).items():
            written = escape(str(name))
            cell = f'<th title="{escape(meanings.get(name, ""))}">{written}<br>{escape(unit) or "&nbsp;"}</th>'
            head = head.replace(f"<th>{written}</th>", cell, 1)
        return head + end + rest


def with_units(table: pd.DataFrame, descriptions: dict[str, tuple[str, str]]) -> ScoreTable:
    """Return a table with the units and meanings of its known columns; descriptions : name → unit, meaning."""
    made = ScoreTable(table)
    made.attrs |= table.attrs
    for place, about in (("units", 0), ("meanings", 1)):
        made.attrs[place] = {name: descriptions[name][about] for name in table.columns if name in descriptions}
    return made
