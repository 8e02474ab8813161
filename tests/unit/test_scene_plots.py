"""Pictures of flights in scenes, drawn from recordings made by hand: nothing is compiled."""

import json
from importlib import import_module

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.cli import tables
from airflock.errors import RecordingError
from airflock.plots.flocked import flocked
from airflock.plots.rays import cast_at, rays
from airflock.plots.scene import paths_of
from airflock.plots.through import nearby, scenery, through
from airflock.plots.video import video
from airflock.recordings.flights import plain
from airflock.recordings.layout import dataset


def recording(name="kidger/city", **keys):
    """Four boids that fly east along a street at 60 m/s towards a building's corner."""
    found = airflock.load(name, {key.replace("__", "."): value for key, value in keys.items()} | {"agents": 4})
    dims, times = found.dimensions, np.arange(40) / 60.0
    frames = np.zeros((len(times), 3 * dims, 4))
    frames[:, 0] = -25.0 + 60.0 * times[:, None]
    frames[:, 1] = 6.0 + 2.0 * np.arange(4)
    if dims == 3:
        frames[:, 2] = 8.0
    frames[:, dims] = 60.0
    about = {"airflock_scenario": json.dumps(plain(found.document)), "airflock_name": name, "airflock_seed": 0}
    return dataset(frames, dims, 1.0 / 60.0, about, "velocity")


@pytest.mark.parametrize("name", ["kidger/city", "kidger/forest", "kidger/final_2d"])
def test_paths_through_a_scene_show_what_stands_there(name):
    made = recording(name)
    figure = through(made)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "east (m)"
    shown = nearby(airflock.load(name), paths_of(made))
    assert len(shown) and len(scenery(made, paths_of(made))) >= len(shown)
    if name == "kidger/city":
        assert len(axes.collections[0].get_paths()) == len(shown)  # a ground plan of each building
        assert through(made, space=True).axes[0].get_zlabel() == "up (m)"
    if name == "kidger/final_2d":
        with pytest.raises(RecordingError, match="flown in a plane"):
            through(made, space=True)


def test_rays_of_an_agent_are_those_that_its_model_casts():
    made = recording()
    found, command = cast_at(made, 3, 20)
    free = [ray for ray in found if ray.free >= ray.length]
    assert len(found) > 1 and found[0].free < found[0].length  # the building ahead
    assert free == found[-1:]  # it stops at the first free ray and flies there
    assert np.array(command) / np.linalg.norm(command) == pytest.approx(found[-1][:3], abs=1e-6)
    assert len(rays(made, start=20 / 60, agent=3).axes[0].collections[1].get_segments()) == len(found)
    with pytest.raises(RecordingError, match="has no agent 9"):
        rays(made, agent=9)


def test_share_flocked_is_drawn_with_goals_and_collisions(monkeypatch):
    module = import_module("airflock.plots.flocked")
    index = pd.Index(np.arange(40) / 60.0, name="time")
    course = pd.DataFrame({"flocked": 1.0, "polarisation": 0.5, "n_clusters": 1.0, "n_coll": 1.0}, index=index)
    monkeypatch.setattr(module, "measure", lambda *_: ({"time_to_goal": [0.2, np.nan]}, course))
    upper, lower = flocked(recording()).axes
    assert len(upper.lines) == 3  # share, polarisation, and the goal that was reached
    assert lower.lines[1].get_ydata()[-1] == 40.0 and lower.get_yscale() == "symlog"
    few = course.assign(n_coll=[1.0] * 4 + [0.0] * 36)
    monkeypatch.setattr(module, "measure", lambda *_: ({}, few))
    lower = flocked(recording()).axes[1]
    lower.figure.canvas.draw()
    low, high = lower.get_ylim()
    assert sum(low <= tick <= high and bool(text.get_text()) for tick, text in
               zip(lower.get_yticks(), lower.get_yticklabels(), strict=True)) >= 3  # fmt: skip
    monkeypatch.setattr(module, "measure", lambda *_: ({}, course.drop(columns="flocked")))
    with pytest.raises(RecordingError, match="metrics.kind = 'kidger'"):
        flocked(recording())


def test_a_video_shows_the_scene(tmp_path):
    video(recording(), tmp_path / "city.gif", fps=10, speed=1.0, height=120)
    assert (tmp_path / "city.gif").stat().st_size > 1000


def test_statistics_of_lists_and_of_what_never_happened():
    rows = [{"time_to_goal": [1.0, 4.0], "t": float("nan")}, {"time_to_goal": [3.0, float("nan")], "t": float("nan")}]
    found = tables.statistics(rows)
    assert found["mean"]["time_to_goal"] == [2.0, 4.0] and found["median"]["time_to_goal"] == [2.0, 4.0]
    assert tables.clean(found)["mean"]["t"] is None and tables.clean(rows[1]) == {
        "time_to_goal": [3.0, None],
        "t": None,
    }
    assert tables.number([1.25, float("nan")]) == "1.25, never"


def test_only_the_time_of_an_event_is_never(capsys):
    nan = float("nan")
    rows = [{"time_to_flock": nan, "time_to_goal": [1.0, nan], "r_min": nan, "power": float("inf")}] * 2
    for count in (1, 2):
        tables.score_table("flight", rows[:count], {}, {})
        shown = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if line.strip()}
        assert shown["time_to_flock"] == ["never"] * count and shown["time_to_goal"][:2] == ["1,", "never"]
        assert shown["r_min"] == ["nan"] * count and shown["power"][0] == "inf"
