"""A user's script as a type checker sees it: mypy reads it beside the package; nothing here is run."""

from pathlib import Path
from typing import Any, assert_type

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

import airflock
from airflock.core.model import Model
from airflock.scenarios.keys import Key


def script() -> None:
    """Fly, score, sweep, draw and save."""
    scenario = airflock.load("vasarhelyi_2018/4ms", {"radio.delay": 0.5})
    assert_type(scenario, airflock.Scenario)
    assert_type(scenario.radio.numbers.delay, float)
    assert_type(scenario.notes, tuple[str, ...])
    recording = airflock.simulate(scenario, seed=7)
    assert_type(recording, xr.Dataset)
    assert_type(airflock.score(scenario, seeds=4), pd.DataFrame)
    assert_type(airflock.over_time(recording), pd.DataFrame)
    assert_type(airflock.sweep(scenario, {"radio.delay": [0.0, 1.0]}, seeds=2), pd.DataFrame)
    assert_type(airflock.plot(recording, "series"), Figure)
    assert_type(airflock.plots.trajectories(recording), Figure)
    assert_type(airflock.save(recording, "flight.nc"), Path)
    assert_type(airflock.video(recording, "flight.mp4"), Path)
    assert_type(airflock.presets(), dict[str, Path])
    assert_type(airflock.keys("radio"), list[Key])
    assert_type(airflock.model(globals()), Model)
    assert_type(airflock.doctor(), dict[str, Any])
    assert_type(airflock.harden(scenario, range(2))[0].fitness, float)
    assert_type(airflock.evolve(scenario, "study", generations=2).fitness, float)
    assert_type(airflock.display(["AIR"], 20).shape_reports[0].collisions, int)
    airflock.simulate(scenario, sed=7)  # type: ignore[call-arg]
    airflock.sweeep(scenario)  # type: ignore[attr-defined]
