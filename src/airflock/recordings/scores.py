"""Scores: order parameters of scenarios over many seeds, and of any recording, by the same rules."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from airflock.doors import from_outside
from airflock.engine import cpu
from airflock.engine.passes.build import columns
from airflock.engine.plan import WHOLE
from airflock.engine.simulate import finish, plan_of, score_flights
from airflock.engine.tables import tables
from airflock.errors import RecordingError
from airflock.metrics import nearest
from airflock.recordings.attributes import check_format, flown_with_own_law, measured_by, scenario_document
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
) -> pd.DataFrame:
    """Order parameters and fitness as a table: one row per seed of a scenario, or one row for a recording.

    what     : scenario, or the name of a preset or scenario file (flown with `seeds`: a number of them, or the seeds
               themselves), or recording
    settings : for a recording, keys such as {"metrics.r_coll": 2.0} that replace those it was flown with
    threads  : flights side by side; by default one per core
    done     : called after each flight
    device   : cpu, cuda (a GPU, all flights together), python, or auto, which tells `say` what it picked
    """
    if isinstance(what, xr.Dataset):
        values, _ = measure(what, settings)
        return pd.DataFrame([values])
    scenario, found = loaded(what), sound_seeds(seeds)
    options: dict[str, Any] = {"threads": threads, "precision": precision, "done": done, "device": device, "say": say}
    rows = score_flights([scenario] * len(found), found, **options)
    return pd.DataFrame(rows, index=pd.Index(found, name="seed"))


def over_time(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> pd.DataFrame:
    """Order parameters at every instant of a recording; the index is time in s."""
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
    document = scenario_document(recording) or {}
    birds = document.get("model", {}).get("kind") == "dimock_2003"
    frame = {} if birds else {"wing.frame": "ground"}
    return {"metrics.kind": "dimock", "metrics.fitness": "sound", **frame, **(changed or {})}


def scenario_of(recording: xr.Dataset, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Scenario that a recording was flown with, or for a flight log one that only says how to score it.

    A log brings no arena and no model: its arena is open unless settings name one, and v_flock is its mean speed.
    """
    check_format(recording)
    document = scenario_document(recording)
    if document is not None:
        name = str(recording.attrs.get("airflock_name", "recording"))
        with from_outside(name, RecordingError):
            if not flown_with_own_law(recording):
                return make(document, name, settings)
            # a law of the user's own is not in the recording: what it is measured by is kept, and needs no law
            stand_in = {**document, "model": {"kind": MODELS[0]}, "metrics": measured_by(recording)}
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
