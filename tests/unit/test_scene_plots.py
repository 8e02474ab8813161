"""Pictures of flights in scenes, drawn from recordings made by hand: nothing is compiled."""

import json
from importlib import import_module

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection

import airflock
from airflock.cli import terminal
from airflock.parts.aero.wing import pitch
from airflock.recordings.dataset import make_dataset
from airflock.recordings.simulation import to_plain_values
from airflock.support.errors import RecordingError
from airflock.support.rendering import format_cell
from airflock.view.flight_paths import paths_in_window, projection
from airflock.view.order_parameter_plots import flocked
from airflock.view.rules_plot import downwash, solve_formation, wash
from airflock.view.trajectory_plots import (
    VIEW_ELEVATION_DEG,
    outlines_in_space,
    rays,
    rays_at_frame,
    scenery_lines,
    shapes_near_paths,
    through,
    trajectories,
)
from airflock.view.video_writer import VideoFrame, video
from airflock.world.shapes import BOX, CYLINDER


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
    about = {
        "airflock_scenario": json.dumps(to_plain_values(found.document)),
        "airflock_name": name,
        "airflock_seed": 0,
    }
    return make_dataset(frames, dims, 1.0 / 60.0, about, "velocity")


@pytest.mark.parametrize("name", ["kidger/city", "kidger/forest", "kidger/final_2d"])
def test_paths_through_a_scene_show_what_stands_there(name):
    made = recording(name)
    figure = through(made)
    axes = figure.axes[0]
    assert axes.get_xlabel() == "east (m)"
    shown = shapes_near_paths(airflock.load(name), paths_in_window(made))
    assert len(shown) and len(scenery_lines(made, paths_in_window(made))) >= len(shown)
    if name == "kidger/city":
        assert len(axes.collections[0].get_paths()) == len(shown)  # a ground plan of each building
        named = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
        assert named == ["at the end", "goal"]
        assert [axes.get_ylabel() for axes in figure.axes[1:]] == ["height of the scene (m)", "speed (m/s)"]
        assert len(trajectories(made).axes[0].collections[0].get_paths()) == len(shown)  # so does run --plot
    if name == "kidger/final_2d":
        with pytest.raises(RecordingError, match="flown in a plane"):
            through(made, space=True)


def test_rays_of_an_agent_are_those_that_its_model_casts():
    made = recording(model__separation="normalised")  # so that they go on side by side
    found, command = rays_at_frame(made, 3, 20)
    free = [ray for ray in found if ray.free >= ray.length]
    assert len(found) > 1 and found[0].free < found[0].length  # the building ahead
    assert free == found[-1:]  # it stops at the first free ray and flies there
    assert np.array(command) / np.linalg.norm(command) == pytest.approx(found[-1][:3], abs=1e-6)
    assert len(rays(made, start=20 / 60, agent=3).axes[0].collections[1].get_segments()) == len(found)
    with pytest.raises(RecordingError, match="has no agent 9"):
        rays(made, agent=9)


def test_share_flocked_is_drawn_with_goals_and_collisions(monkeypatch):
    module = import_module("airflock.view.order_parameter_plots")
    index = pd.Index(np.arange(40) / 60.0, name="time")
    course = pd.DataFrame({"flocked": 1.0, "polarisation": 0.5, "n_clusters": 1.0, "n_coll": 1.0}, index=index)
    monkeypatch.setattr(module, "measure_recording", lambda *_: ({"time_to_goal": [0.2, np.nan]}, course))
    upper, lower = flocked(recording()).axes
    assert len(upper.lines) == 3  # share, polarisation, and the goal that was reached
    assert [text.get_text() for text in upper.get_legend().texts] == ["flocked", "polarisation", "goal reached"]
    assert lower.lines[1].get_ydata()[-1] == 40.0 and lower.get_yscale() == "symlog"
    few = course.assign(n_coll=[1.0] * 4 + [0.0] * 36)
    monkeypatch.setattr(module, "measure_recording", lambda *_: ({}, few))
    lower = flocked(recording()).axes[1]
    lower.figure.canvas.draw()
    low, high = lower.get_ylim()
    assert sum(low <= tick <= high and bool(text.get_text()) for tick, text in
               zip(lower.get_yticks(), lower.get_yticklabels(), strict=True)) >= 3  # fmt: skip
    monkeypatch.setattr(module, "measure_recording", lambda *_: ({}, course.drop(columns="flocked")))
    with pytest.raises(RecordingError, match="metrics.kind = 'kidger'"):
        flocked(recording())


def test_a_video_shows_the_scene(tmp_path):
    video(recording(), tmp_path / "city.gif", fps=10, speed=1.0, height=120)
    assert (tmp_path / "city.gif").stat().st_size > 1000


def test_statistics_of_lists_and_of_what_never_happened():
    rows = [{"time_to_goal": [1.0, 4.0], "t": float("nan")}, {"time_to_goal": [3.0, float("nan")], "t": float("nan")}]
    found = terminal.column_statistics(rows)
    assert found["mean"]["time_to_goal"] == [2.0, 4.0] and found["median"]["time_to_goal"] == [2.0, 4.0]
    assert terminal.to_json_value(found)["mean"]["t"] is None and terminal.to_json_value(rows[1]) == {
        "time_to_goal": [3.0, None],
        "t": None,
    }
    assert format_cell([1.25, float("nan")]) == "1.25, never"


def test_only_the_time_of_an_event_is_never(capsys):
    nan = float("nan")
    rows = [{"time_to_flock": nan, "time_to_goal": [1.0, nan], "clearance": nan, "power": float("inf")}] * 2
    for count in (1, 2):
        terminal.print_score_table("flight", rows[:count], {}, {})
        out = capsys.readouterr().out
        shown = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.strip()}
        assert shown["time_to_flock"] == ["never"] * count and shown["time_to_goal"][:2] == ["1,", "never"]
        assert "clearance" not in shown and "nothing to measure: clearance" in out and shown["power"][0] == "inf"


def test_a_city_in_space_draws_all_that_was_flown_once():
    made = recording()
    axes = through(made, space=True).axes[0]
    flown = made["position"].values[:, :, 0]
    (paths,) = (
        lines for lines in axes.collections if isinstance(lines, LineCollection) and lines.get_array() is not None
    )
    assert len(paths.get_segments()) == (len(flown) - 1) * 4


@pytest.mark.parametrize("name", ["kidger/city", "kidger/forest"])
def test_outlines_in_space_are_the_corners_and_rims_of_all_shapes(name):
    made = recording(name)
    shown = shapes_near_paths(airflock.load(name), paths_in_window(made))
    axes = through(made, space=True).axes[0]
    outlines = axes.collections[0].get_segments()
    boxes, cylinders = ((shown[:, 6] == kind).sum() for kind in (BOX, CYLINDER))
    assert len(outlines) == 6 * (boxes + cylinders) == 6 * len(shown)  # two rims and four uprights each
    view, points = projection(3, elevation_deg=VIEW_ELEVATION_DEG), np.concatenate(outlines)
    if name == "kidger/city":
        corners = [[row[a], row[b], row[c]] for row in shown for a in (0, 3) for b in (1, 4) for c in (2, 5)]
        expected = np.column_stack(view(np.array(corners)))
        assert {tuple(p) for p in np.round(points, 6)} == {tuple(p) for p in np.round(expected, 6)}
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert (points >= [left, bottom]).all() and (points <= [right, top]).all()  # nothing is cut off


def test_videos_in_space_and_from_above_stand_on_the_same_ground(tmp_path):
    made = recording()
    for space in (True, False):
        stage = VideoFrame(made, None, None, tail=0.1, height=160, speed=1.0, space=space)
        assert stage.render(0.3).shape == (stage.size[1], stage.size[0], 4)
        drawn = sum(len(lines.get_segments()) for lines in stage.axes.collections[:1])
        assert drawn == len(outlines_in_space(shapes_near_paths(airflock.load("kidger/city"), paths_in_window(made))))
    corners = np.array([path.vertices[:4] for path in stage.darts.get_paths()])
    where = made["position"].sel(time=0.3, method="nearest").values[:2, 0].T
    np.testing.assert_allclose(corners[:, 0] + (corners[:, 2] - corners[:, 0]) * (0.6 / 0.82), where, atol=0.05)


def test_the_air_of_a_formation_is_that_of_its_lifting_line():
    scenario = airflock.load("dimock_2003/physical", {"wing.segments": "10"})
    rng = np.random.default_rng(3)
    position = rng.uniform(-4.0, 4.0, (3, 5)) * [[1.0], [1.0], [0.05]]
    found = solve_formation(scenario, position, np.ones((3, 5)))
    m, h = 10, pitch(scenario.wing)
    for bird, place in enumerate(found.place):
        across = place[1] + (np.arange(m) - 0.5 * (m - 1)) * h
        points = np.column_stack([np.full(m, place[0]), across, np.full(m, place[2])])
        np.testing.assert_allclose(downwash(scenario, found, points, without=bird), found.wash[bird], atol=1e-5)
    alone = solve_formation(scenario, np.array([[0.0, 0.0], [-1e5, 1e5], [0.0, 0.0]]), np.ones((3, 2)))
    np.testing.assert_allclose(alone.drag, alone.solo, rtol=1e-6)


def test_a_formation_is_drawn_with_what_each_bird_saves():
    scenario = airflock.load("dimock_2003/physical", {"agents": 3, "wing.segments": "5"})
    span = scenario.wing.span
    frames = np.zeros((1, 9, 3))
    frames[0, 0], frames[0, 1], frames[0, 3] = [0.0, -1.5 * span, -1.5 * span], [0.0, 0.95 * span, -0.95 * span], 13.0
    about = {
        "airflock_scenario": json.dumps(to_plain_values(scenario.document)),
        "airflock_name": "v",
        "airflock_seed": 0,
    }
    axes = wash(make_dataset(frames, 3, 1.0, about, "velocity")).axes[0]
    said = [float(text.get_text().replace(" %", "")) for text in axes.texts if text.get_text().endswith("%")]
    assert len(said) == 3 and said[1] == said[2] < -20.0 and said[1] < said[0]  # who flies behind saves most
    assert len(axes.lines) == 3 and np.ptp(axes.lines[0].get_xdata()) == pytest.approx(span)
    frames[0, 1] = 0.0  # one behind the other, each in the downwash of those ahead
    words = [text.get_text() for text in wash(make_dataset(frames, 3, 1.0, about, "velocity")).axes[0].texts]
    assert any("% above that of lone birds" in said for said in words)
    with pytest.raises(RecordingError, match="fly in space"):
        wash(recording("kidger/final_2d"))
