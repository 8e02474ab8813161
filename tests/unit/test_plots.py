"""Figures and videos say what is in the recording: lines, extents, colours, frames; failed writes leave nothing."""

import errno
import gc
import json
import math
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot, rcParams
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.text import Text
from typer.testing import CliRunner

import airflock
from airflock.certificates.limits import take_look
from airflock.cli.main import app
from airflock.core.maths import bell, braking_curve, excess, peak, rising
from airflock.parts.laws import vasarhelyi_2018
from airflock.recordings.dataset import make_dataset
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.recording_files import save
from airflock.recordings.scores import time_series_names
from airflock.scenarios.part_kinds import CallerParts
from airflock.scenarios.scenario_builder import build_scenario
from airflock.support.errors import AirflockError, RecordingError
from airflock.view import (
    flight_paths as flight_view,
    recording_or_flight,  # noqa: F401  (resolved before tests replace it)
    style,
)
from airflock.view.law_vectors import vector_fields
from airflock.view.order_parameter_plots import SmoothedLines, heatmap, rotations, series, transfer
from airflock.view.result_plots import _draw_saturation, extrapolated_tail, plot_certificate
from airflock.view.rules_plot import alignment_curve, allowed_difference_curve, repulsion_curve, rules, wall_curve
from airflock.view.style import PictureError, save_figure
from airflock.view.trajectory_plots import trajectories
from airflock.view.video_writer import VideoFrame, frame_count, video

pytestmark = pytest.mark.usefixtures("scored_plainly")

RADIUS, PACE = 50.0, 4.0


def flight(axes=2, agents=3, seconds=100.0, period=0.5, document=None):
    """Agents that circle the origin anticlockwise at 4 m/s, evenly spaced; in space each at its own height."""
    times = np.arange(0.0, seconds + 1e-9, period)
    angle = times[:, None] * PACE / RADIUS + np.arange(agents) * 2.0 * math.pi / agents
    level = np.broadcast_to(np.arange(agents) * 5.0, angle.shape)
    flat = np.zeros_like(angle)
    position = [RADIUS * np.cos(angle), RADIUS * np.sin(angle), level][:axes]
    velocity = [-PACE * np.sin(angle), PACE * np.cos(angle), flat][:axes]
    attributes = {} if document is None else {"airflock_scenario": json.dumps(document), "airflock_seed": 7}
    return make_dataset(np.stack(position + velocity + velocity, axis=1), axes, period, attributes, "velocity")


SQUARE = {
    "agents": 3,
    "model": {"kind": "vasarhelyi_2018"},
    "world": {"side": 200.0, "obstacles": [[[-10.0, -10.0], [10.0, -10.0], [0.0, 10.0]]]},
}
BOX = {"agents": 3, "model": {"kind": "vasarhelyi_2018"}, "world": {"dimensions": "3", "side": 200.0, "height": 60.0}}


def coloured_paths(figure):
    return [c for c in figure.axes[0].collections if isinstance(c, LineCollection) and c.get_array() is not None]


def test_every_path_is_drawn_once_in_its_window_and_coloured_by_its_speed():
    figure = trajectories(flight(document=SQUARE), start=20.0, stop=30.0, colour="speed")
    paths = coloured_paths(figure)
    assert len(paths) == 3  # two in colour, one in grey
    for path in paths:
        segments = np.array(path.get_segments())
        assert len(segments) == 20
        assert np.allclose(np.hypot(segments[..., 0], segments[..., 1]), RADIUS)
        drawn = np.linalg.norm(np.diff(segments, axis=1), axis=2).sum()
        assert drawn == pytest.approx(10.0 * PACE, rel=1e-3)
        assert np.allclose(path.get_array(), PACE)
    assert sum(path.get_cmap().name == "gray" for path in paths) == 1
    low, high = figure.axes[0].get_xlim()
    assert low < -100.0 and high > 100.0  # the arena fits


def test_trajectories_default_to_the_last_minute_and_say_so():
    figure = trajectories(flight(document=SQUARE))
    texts = " ".join(t.get_text() for t in figure.axes[0].texts)
    assert "40 to 100 s" in texts and "seed 7" in texts and "3 agents" in texts


def test_dots_mark_the_final_positions_and_the_world_is_outlined():
    recording = flight(document=SQUARE)
    axes = trajectories(recording).axes[0]
    dots = next(c for c in axes.collections if c.get_label() == "end")
    assert np.allclose(dots.get_offsets(), recording["position"].values[-1, :, 0].T)
    outline = axes.lines[0].get_xydata()
    assert outline.min() == -100.0 and outline.max() == 100.0
    assert np.allclose(axes.patches[0].get_xy()[:3], SQUARE["world"]["obstacles"][0])


def test_the_highlighted_agent_can_be_chosen_or_left_out():
    chosen = next(p for p in coloured_paths(trajectories(flight(), agent=2)) if p.get_cmap().name == "gray")
    expected = flight()["position"].sel(time=40.0).values[:, 0, 2]
    assert np.allclose(chosen.get_segments()[0][0], expected)
    assert all(p.get_cmap().name != "gray" for p in coloured_paths(trajectories(flight(), highlight=False)))
    with pytest.raises(RecordingError, match="no agent 3"):
        trajectories(flight(), agent=3)


def test_a_recording_in_space_gets_axes_in_space():
    axes = trajectories(flight(axes=3, document=BOX)).axes[0]
    assert axes.name == "3d"
    assert axes.get_zlabel() == "up (m)"
    assert axes.get_zlim()[0] <= -30.0 and axes.get_zlim()[1] >= 30.0


def test_a_window_without_frames_is_refused_in_one_line():
    with pytest.raises(RecordingError, match="from 200 to 300 s; it reaches from 0 to 100 s"):
        trajectories(flight(), start=200.0, stop=300.0)
    with pytest.raises(RecordingError, match="ends before it starts"):
        trajectories(flight(), start=30.0, stop=20.0)


def with_a_gap():
    """Agent 1 has no positions at frames 150 to 159, so that nothing joins frames 149 and 160 (74.5 to 80 s)."""
    recording = flight(document=SQUARE)
    recording["position"].values[150:160, :, :, 1] = np.nan
    return recording


def test_missing_positions_leave_gaps_and_nothing_else():
    whole, gapped = (coloured_paths(trajectories(r, agent=2)) for r in (flight(document=SQUARE), with_a_gap()))
    missing = np.arange(80, 200)  # first frame of each segment: the window is the last 60 s
    missing = (missing >= 149) & (missing < 160)
    for agent, (one, other) in enumerate(zip(whole, gapped, strict=True)):
        full, drawn = (np.array([path.vertices for path in lines.get_paths()]) for lines in (one, other))
        lost = missing if agent == 1 else np.zeros_like(missing)
        assert (np.isnan(drawn).any(axis=(1, 2)) == lost).all()
        assert (drawn[~lost] == full[~lost]).all()
        assert (other.get_array()[~lost] == one.get_array()[~lost]).all()
    save_to_nowhere(trajectories(with_a_gap()))


def save_to_nowhere(figure):
    assert len(figure._repr_png_()) > 1000


def test_a_notebook_shows_a_wide_field_without_empty_paper_above_and_below():
    low = flight()
    low["position"].values[:, 1] *= 0.1
    rows, columns = iio.imread(trajectories(low)._repr_png_()).shape[:2]
    assert rows < 0.5 * columns


def test_series_of_a_circling_flock():
    figure = series(flight(agents=12, document={**SQUARE, "agents": 12}))
    upper, lower, right = figure.axes
    lines = {line.get_label(): line.get_ydata() for axes in figure.axes for line in axes.lines}
    speed = next(v for k, v in lines.items() if "vel" in k)
    assert np.allclose(speed, 1.0, atol=1e-6)
    rotation = next(v for k, v in lines.items() if "LAP" in k)
    assert np.abs(rotation).max() < 0.05  # an even ring has no mean velocity
    nearest = [v for k, v in lines.items() if "r_{ij}" in k]
    assert len(nearest) == 2 and np.allclose(nearest, 2.0 * RADIUS * math.sin(math.pi / 12.0), rtol=1e-5)
    assert "(m)" in right.get_ylabel() and "(s)" in lower.get_xlabel()


def test_rotations_draw_one_line_for_each_flight():
    one = flight(agents=1, document={**SQUARE, "agents": 1})
    axes = rotations({"circle": one, "again": one}).axes[0]
    drawn = [line for line in axes.lines if line.get_label() in ("circle", "again")]
    assert len(drawn) == 2 and np.allclose(drawn[0].get_ydata(), 1.0, atol=1e-6)  # one circling agent: phi_LAP = 1


@pytest.mark.parametrize("name", ["vasarhelyi_2018/4ms", "vasarhelyi_2018/real_8ms"])
def test_drawn_rules_are_the_closed_forms_of_the_paper(name):
    scenario = airflock.load(name)
    p, r = scenario.parameters, np.linspace(0.5, 120.0, 60)
    (push,) = repulsion_curve(scenario.model, p, r)
    assert np.allclose(push.values, p.p_rep * np.maximum(p.r0_rep - r, 0.0), rtol=1e-9, atol=1e-12)
    allowed = np.array([max(p.v_frict, braking_curve(d - p.r0_frict, p.a_frict, p.p_frict)) for d in r])
    assert np.allclose(allowed_difference_curve(scenario.model, p, r), allowed, rtol=1e-9)
    (term,) = alignment_curve(scenario.model, p, r, 4.0)
    assert np.allclose(term.values, [p.c_frict * excess(4.0, a) * 4.0 for a in allowed], atol=1e-12)
    (wall,) = wall_curve(scenario.model, p, r, p.v_flock)
    gap = p.v_shill + p.v_flock
    stop = np.array([braking_curve(d - p.r0_shill, p.a_shill, p.p_shill) for d in r])
    assert np.allclose(wall.values, np.maximum(gap - stop, 0.0), atol=1e-9)


def test_the_figure_of_rules_holds_these_lines_with_units():
    scenario = airflock.load("vasarhelyi_2018/4ms")
    figure = rules(scenario, difference=3.0, farthest=100.0)
    pair, term, wall = figure.axes
    push = next(line for line in pair.lines if line.get_label() == "repulsion")
    p, r = scenario.parameters, push.get_xdata()
    assert r[-1] == 100.0
    assert np.allclose(push.get_ydata(), p.p_rep * np.maximum(p.r0_rep - r, 0.0), atol=1e-12)
    assert "(m)" in pair.get_xlabel() and "(m/s)" in pair.get_ylabel() and "(m/s)" in term.get_ylabel()
    assert any(np.allclose(line.get_ydata(), 3.0) for line in pair.lines)


def test_friction_of_virágh_2014_allows_no_difference_at_all():
    scenario = airflock.load("viragh_2014/4ms")
    assert np.array_equal(
        allowed_difference_curve(scenario.model, scenario.parameters, np.array([1.0, 20.0])), [0.0, 0.0]
    )
    assert len(rules(scenario).axes) == 3


def test_rules_of_any_model_are_drawn_vector_by_vector():
    from typing import NamedTuple

    class Sums(NamedTuple):
        apart_x: float
        apart_y: float
        apart_z: float
        vx: float
        vy: float
        vz: float
        n: float

    assert vector_fields(Sums) == {"apart": ("apart_x", "apart_y"), "v": ("vx", "vy")}

    def neighbour(dx, dy, dz, r2, dvx, dvy, dvz):
        return Sums(-dx / r2, -dy / r2, -dz / r2, dvx, dvy, dvz, 1.0)

    def decide(sums):
        return sums.apart_x, sums.apart_y, sums.apart_z

    found = airflock.model(
        {"Parameters": vasarhelyi_2018.Parameters, "COMMAND": "acceleration", "Sums": Sums, "neighbour": neighbour,
         "decide": decide, "__name__": "own"}
    )  # fmt: skip
    parameters = vasarhelyi_2018.Parameters()
    r = np.array([1.0, 2.0, 4.0])
    apart, velocity = repulsion_curve(found, parameters, r)
    assert np.allclose(apart.values, 1.0 / r) and not velocity.values.any()
    figure = rules(build_scenario({"agents": 3}, "own", caller_parts=CallerParts(law=found)), difference=2.0)
    assert [axes.get_ylabel() for axes in figure.axes] == ["apart", "v"]  # a panel for each vector


def test_transfer_functions_are_those_of_the_fitness():
    scenario = airflock.load("vasarhelyi_2018/4ms")
    q = scenario.resolved_metrics()
    figure = transfer(scenario)
    forms = (lambda v: rising(v, q.v_flock, q.v_tol), lambda v: bell(v, q.r_tol), lambda v: peak(v, q.a_tol))
    for axes, form in zip(figure.axes, forms, strict=True):
        x, y = axes.lines[0].get_data()
        assert np.array_equal(y, [form(float(v)) for v in x])
        assert min(y) >= 0.0 and max(y) <= 1.0
    assert len(transfer().axes) == 3


def sweep():
    return pd.DataFrame(
        [
            {"model.p_rep": p, "radio.range": g, "seed": s, "r_min": 10.0 * p + g + s}
            for p in (0.1, 0.2, 0.5)
            for g in (20, 40)
            for s in (-1, 0, 1)
        ]
    )


def test_a_sweep_of_one_key_is_its_mean_and_standard_deviation():
    table = sweep()
    axes = heatmap(table[table["radio.range"] == 20], ["model.p_rep"], "r_min").axes[0]
    mean = axes.lines[-1]
    assert np.allclose(mean.get_xdata(), [0.1, 0.2, 0.5]) and np.allclose(mean.get_ydata(), [21.0, 22.0, 25.0])
    band = axes.collections[0].get_paths()[0].vertices[:, 1]
    assert band.min() == pytest.approx(20.0) and band.max() == pytest.approx(26.0)
    assert axes.get_ylabel() == "r_min (m)"


def test_a_sweep_of_two_keys_is_the_map_of_their_means():
    scenario = airflock.load("vasarhelyi_2018/4ms")
    figure = heatmap(
        sweep().sample(frac=1.0, random_state=1), ["model.p_rep", "radio.range"], "r_min", scenario=scenario
    )
    axes = figure.axes[0]
    assert np.allclose(axes.collections[0].get_array(), [[21.0, 22.0, 25.0], [41.0, 42.0, 45.0]])
    assert axes.get_xlabel() == "model.p_rep (1/s)" and axes.get_ylabel() == "radio.range (m)"


def test_a_sweep_with_holes_and_names_is_drawn():
    table = sweep().iloc[:-3].replace({"radio.range": {20: "near", 40: "far"}})
    save_to_nowhere(heatmap(table, ["model.p_rep", "radio.range"], "r_min"))
    save_to_nowhere(heatmap(table, ["radio.range"], "r_min"))
    with pytest.raises(AirflockError, match="no column r_mean"):
        heatmap(table, ["model.p_rep"], "r_mean")


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_a_video_has_the_promised_frames_and_size(tmp_path, ending):
    recording, path, calls = flight(seconds=4.0, document=SQUARE), tmp_path / f"flight.{ending}", []
    choice = {"fps": 10, "speed": 2.0, "start": 1.0, "stop": 3.0}
    assert frame_count(recording, **choice) == 11  # 2 s at 2 times real time: 1 s of film, both ends included
    video(recording, path, height=120, done=lambda: calls.append(1), **choice)
    shown = iio.imread(path, plugin="FFMPEG" if ending == "mp4" else "pillow")
    assert len(calls) == 11
    assert shown.shape[0] == 11 and shown.shape[1] == 120 and shown.shape[2] % 2 == 0
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_darts_are_where_the_agents_are_and_point_where_they_fly():
    stage = VideoFrame(flight(document=SQUARE), None, None, tail=2.0, height=240, speed=1.0)
    stage.render(12.25)  # between two frames
    corners = np.array([path.vertices[:4] for path in stage.darts.get_paths()])
    angle = 12.25 * PACE / RADIUS + np.arange(3) * 2.0 * math.pi / 3.0
    nose, back = corners[:, 0], corners[:, 2]
    centre = nose + (back - nose) * (0.6 / 0.82)
    assert np.allclose(centre, RADIUS * np.column_stack([np.cos(angle), np.sin(angle)]), atol=0.02)
    heading = (nose - back) / np.linalg.norm(nose - back, axis=1)[:, None]
    assert np.allclose(heading, np.column_stack([-np.sin(angle), np.cos(angle)]), atol=1e-3)


def test_pictures_in_space_project_parallel():
    view = flight_view.projection(3)
    assert np.allclose([view.right @ view.up, view.right @ view.right, view.up @ view.up], [0.0, 1.0, 1.0])
    stage = VideoFrame(flight(axes=3, document=BOX), None, None, tail=0.0, height=120, speed=1.0)
    assert stage.render(1.0).shape == (stage.size[1], stage.size[0], 4)
    flat = VideoFrame(flight(document=SQUARE), None, None, tail=2.0, height=120, speed=1.0, space=True)
    flat.render(12.0)
    corners = np.array([path.vertices[:4] for path in flat.darts.get_paths()])
    angle = 12.0 * PACE / RADIUS + np.arange(3) * 2.0 * math.pi / 3.0
    ring = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    centre = corners[:, 0] + (corners[:, 2] - corners[:, 0]) * (0.6 / 0.82)
    assert np.allclose(centre, np.column_stack(view(ring)), atol=0.05)


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_a_figure_is_saved_in_the_format_of_its_ending(tmp_path, ending):
    path = tmp_path / f"functions.{ending}"
    save_figure(transfer(), path)
    start = path.read_bytes()[:5]
    assert start == {"png": b"\x89PNG\r", "pdf": b"%PDF-", "svg": b"<?xml"}[ending]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_the_same_figure_gives_the_same_file_and_settings_stay(tmp_path, ending):
    before = dict(rcParams)
    first, again = (save_figure(transfer(), tmp_path / f"{name}.{ending}").read_bytes() for name in "ab")
    assert first == again
    assert dict(rcParams) == before


def test_a_pdf_embeds_its_fonts_as_truetype(tmp_path):
    # Type 3, which Matplotlib writes if it is told nothing, is refused by IEEE PDF eXpress, ACM and others
    content = save_figure(transfer(), tmp_path / "a.pdf").read_bytes()
    assert b"/FontFile2" in content and b"/Type3" not in content


def test_unknown_endings_and_missing_folders_are_refused_in_one_line(tmp_path):
    for name, reason in (
        ("a.jpg", "ending .jpg: unknown format"),
        ("a", "without an ending"),
        ("none/a.png", "No such file or directory"),
    ):
        with pytest.raises(PictureError, match=reason) as caught:
            save_figure(transfer(), tmp_path / name)
        assert "\n" not in str(caught.value)
    for name, reason in (("a.avi", "give one of .mp4, .gif"), ("none/a.mp4", "No such file or directory")):
        with pytest.raises(PictureError, match=reason):
            video(flight(seconds=1.0), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_the_old_picture_and_nothing_new(tmp_path, monkeypatch):
    figure, path = transfer(), tmp_path / "a.png"
    path.write_bytes(b"old")

    def full(target, _):
        with target.open("wb") as file:
            file.write(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(PictureError, match="No space left on device; nothing was saved"):
        save_figure(figure, path)
    gc.collect()  # an error that held a buffer of the picture ended Python 3.12 here
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_an_interrupted_or_truncated_video_leaves_nothing(tmp_path, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        video(flight(seconds=5.0), tmp_path / "a.mp4", height=64, done=interrupt)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr("imageio_ffmpeg.count_frames_and_secs", lambda _: (1, 0.1))
    with pytest.raises(PictureError, match="kept 1 of"):
        video(flight(seconds=5.0), tmp_path / "a.mp4", height=64)
    assert not list(tmp_path.iterdir())


def test_pictures_leave_the_global_state_of_matplotlib_alone():
    import subprocess
    import sys

    code = (
        "import sys, matplotlib; before = matplotlib.rcParams.copy()\n"
        "from airflock.view.order_parameter_plots import transfer; transfer()._repr_png_()\n"
        "assert matplotlib.rcParams.copy() == before and 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_lines_differ_for_colour_blind_readers_too():
    def luminance(color):
        return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), color[:3], strict=True))

    ramp = [luminance(style.SPEED_COLOURS(v)) for v in np.linspace(0.0, 1.0, 20)]
    assert np.all(np.diff(ramp) > 0.0)  # speed can be read in grey
    assert len({to_hex(c) for c in style.LINE_COLOURS}) == len(style.LINE_COLOURS)


def test_no_line_is_drawn_across_a_periodic_world():
    scenario = airflock.load("vicsek_1995/ordered", {"agents": 20})
    recording = airflock.simulate(scenario, 1)
    path = recording["position"].values[:, :, 0]
    half = 0.5 * scenario.world.side
    assert (np.abs(np.diff(path, axis=0)) > half).any(), "nobody went through a face; the test says nothing"
    axes = trajectories(recording, start=0.0).axes[0]
    drawn = [c.get_segments() for c in axes.collections if hasattr(c, "get_segments")]
    lines = np.concatenate([segments for segments in drawn if len(segments)])
    assert len(lines) and np.abs(lines[:, 1] - lines[:, 0]).max() <= half


def wrapping(seconds=60.0, period=0.5):
    """Three agents that fly east at 4 m/s round a periodic square of 40 m."""
    times = np.arange(0.0, seconds + 1e-9, period)
    x = (times[:, None] * PACE + np.array([0.0, 5.0, 11.0]) + 20.0) % 40.0 - 20.0
    y = np.broadcast_to([-10.0, 0.0, 10.0], x.shape)
    pace, still = np.full_like(x, PACE), np.zeros_like(x)
    world = {
        "agents": 3,
        "model": {"kind": "vicsek_1995"},
        "world": {"side": 40.0, "edges": "periodic", "height": 40.0},
    }
    attributes = {"airflock_scenario": json.dumps(world), "airflock_seed": 7}
    return make_dataset(np.stack([x, y, pace, still, pace, still], axis=1), 2, period, attributes, "velocity")


def test_nothing_is_drawn_through_a_periodic_face():
    recording = wrapping()
    for path in coloured_paths(trajectories(recording)):
        assert np.abs(np.diff(np.array(path.get_segments())[..., 0], axis=1)).max() < 3.0
    stage = VideoFrame(recording, None, None, tail=4.0, height=120, speed=1.0)
    for instant in np.arange(4.0, 20.0, 0.125):
        stage.render(float(instant))
        tails = np.array(stage.tails.get_segments())
        assert np.abs(np.diff(tails[..., 0], axis=1)).max() < 3.0
        expected = (instant * PACE + np.array([0.0, 5.0, 11.0]) + 20.0) % 40.0 - 20.0
        corners = np.array([path.vertices[:4] for path in stage.darts.get_paths()])
        centre = corners[:, 0, 0] + (corners[:, 2, 0] - corners[:, 0, 0]) * (0.6 / 0.82)
        away = np.abs(centre - expected)
        assert np.minimum(away, 40.0 - away).max() <= 0.5 * 0.5 * PACE + 0.02  # half a frame's way, at a face


def test_colours_follow_the_heading_where_all_fly_equally_fast():
    recording = flight(document=SQUARE)
    figure = trajectories(recording, highlight=False)
    for agent, path in enumerate(coloured_paths(figure)):
        first = recording["velocity"].sel(time=40.0).values[:, 0, agent]
        assert path.get_array()[0] == pytest.approx(math.degrees(math.atan2(first[1], first[0])) % 360.0)
    assert figure.axes[1].get_ylabel() == "heading"
    with pytest.raises(AirflockError, match="none of auto, speed, heading, agent"):
        trajectories(recording, colour="mood")


def test_many_paths_in_little_room_are_cut_and_the_title_says_so():
    crowd = flight(agents=120, seconds=100.0)
    figure = trajectories(crowd)
    texts = " ".join(t.get_text() for t in figure.axes[0].texts)
    shown = len(coloured_paths(figure)[0].get_segments()) * 0.5
    assert shown < 60.0 and f"{100.0 - shown:.4g} to 100 s" in texts


@pytest.mark.parametrize("smooth", [0.0, 5.0, None])
def test_smoothed_series_keep_constants_and_say_their_window(smooth):
    recording = flight(agents=12, document={**SQUARE, "agents": 12})
    figure = series(recording, smooth=smooth)
    upper = figure.axes[0]
    title = " ".join(text.get_text() for text in figure.findobj(Text))
    assert ("means over 5 s" in title) == (smooth == 5.0)
    line = next(line for line in upper.lines if line.get_label().startswith("$\\phi^{\\mathrm{vel}}"))
    course = airflock.over_time(recording)["phi_vel"]
    pen = SmoothedLines(airflock.over_time(recording), smooth)
    assert line.get_ydata().mean() == pytest.approx(course.mean() / 4.0, rel=0.02)
    assert len(line.get_ydata()) == len(course)
    assert pen.window_seconds == {0.0: 0.0, 5.0: 5.0, None: 0.5}[smooth]


def test_the_least_of_a_window_is_never_above_the_instant():
    times = np.arange(0.0, 50.0, 0.5)
    values = pd.Series(np.random.default_rng(8).normal(size=len(times)), index=times)
    axes = style.NotebookFigure(3.0, 2.0).add_subplot()
    (line,) = SmoothedLines(pd.DataFrame({"a": values}), 4.0).draw(axes, values, style.BLUE, "a", least=True)
    assert (line.get_ydata() <= values.to_numpy()).all() and line.get_ydata().min() == values.min()
    (line,) = SmoothedLines(pd.DataFrame({"a": values}), 4.0).draw(axes, values * 0.0 + 3.0, style.BLUE, "a")
    assert line.get_ydata() == pytest.approx(3.0)


def test_pictures_of_one_panel_are_drawn_into_axes_that_are_given():
    figure = style.NotebookFigure(6.0, 3.0)
    left, right = figure.subplots(1, 2)
    assert airflock.plot(flight(document=SQUARE), "trajectories", ax=right) is figure
    assert not left.has_data() and right.has_data()


def test_where_ffmpeg_is_not_installed_the_command_says_so_before_it_flies(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr("airflock.view.plot_by_kind.recording_or_flight", lambda *_, **__: pytest.fail("flew"))
    said = CliRunner().invoke(app, ["video", "vasarhelyi_2018/4ms", "--out", str(tmp_path / "a.mp4")])
    assert "videos need imageio-ffmpeg: pip install 'airflock[video]'" in str(said.exception)
    with pytest.raises(PictureError, match="videos need imageio-ffmpeg"):
        video(flight(seconds=1.0), tmp_path / "a.gif")
    assert not list(tmp_path.iterdir())


def test_a_chart_beside_a_video_moves_with_it():
    recording = flight(agents=12, seconds=20.0, document={**SQUARE, "agents": 12})
    stage = VideoFrame(recording, None, None, tail=0.0, height=160, speed=1.0, chart="phi_vel")
    plain = VideoFrame(recording, None, None, tail=0.0, height=160, speed=1.0)
    assert stage.size[0] > plain.size[0] + 50 and stage.size[1] == plain.size[1]
    one, other = (stage.render(t)[:, plain.size[0] :].copy() for t in (2.0, 18.0))
    assert (one != other).any()
    assert stage.chart_cursor.get_xdata() == [18.0, 18.0]
    with pytest.raises(RecordingError, match="this recording has"):
        VideoFrame(recording, None, None, tail=0.0, height=160, speed=1.0, chart="mood")
    assert time_series_names(scenario_of_recording(recording)) == list(airflock.over_time(recording).columns)


@pytest.mark.parametrize(("chart", "said"), [("phi_velo", "did you mean phi_vel?"), ("mood", "phi_vel, ")])
def test_a_chart_of_what_a_flight_does_not_have_is_refused_before_it_is_flown(tmp_path, monkeypatch, chart, said):
    monkeypatch.setattr("airflock.view.plot_by_kind.recording_or_flight", lambda *_, **__: pytest.fail("flew"))
    path = tmp_path / "a.mp4"
    told = CliRunner().invoke(app, ["video", "vasarhelyi_2018/4ms", "--chart", chart, "--out", str(path)])
    assert isinstance(told.exception, RecordingError) and said in str(told.exception) and not path.exists()
    assert str(told.exception).startswith(f"chart = '{chart}' is none that vasarhelyi_2018/4ms has: ")


def test_terms_are_drawn_in_the_words_of_the_law():
    figure = rules(airflock.load("couzin_2002/torus"))
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["A  repulsion", "B  orientation", "C  attraction"]
    p = airflock.load("couzin_2002/torus").parameters
    close, along, towards = ([axes.lines[0].get_xdata(), axes.lines[0].get_ydata()] for axes in figure.axes)
    assert np.allclose(close[1], close[0] < p.r_r)
    assert np.allclose(along[1], (along[0] >= p.r_r) & (along[0] < p.r_r + p.dr_o))
    far = (towards[0] >= p.r_r + p.dr_o) & (towards[0] < p.r_r + p.dr_o + p.dr_a)
    assert np.allclose(towards[1], far) and figure.axes[2].lines[0].get_label() == "towards it"


def test_words_for_vectors_that_are_not_there_are_refused():
    broken = {**vars(vasarhelyi_2018), "TERMS": {"q": ("push", "m/s")}}
    with pytest.raises(airflock.AirflockError, match="Sums has no field qx"):
        airflock.model(broken, "broken")


@pytest.mark.parametrize("kind", ["series", "rules", "transfer", "trajectories"])
def test_every_kind_of_picture_is_drawn_where_the_given_axes_are(kind):
    figure = style.NotebookFigure(8.0, 6.0)
    places = figure.subplots(2, 1)
    what = "vasarhelyi_2018/4ms" if kind in ("rules", "transfer") else flight()
    assert airflock.plot(what, kind, ax=places[1]) is figure
    drawn = [axes for axes in figure.findobj(Axes) if axes not in places.tolist()] or [places[1]]
    figure.draw_without_rendering()
    upper = places[0].get_position().y0
    for axes in drawn:
        low, high = figure.transFigure.inverted().transform(axes.get_window_extent())[:, 1]
        assert low >= -0.01 and high <= upper + 0.02
    assert not places[0].lines and not places[0].images


def test_a_picture_of_panels_needs_axes_of_a_grid():
    figure = style.NotebookFigure(4.0, 4.0)
    with pytest.raises(airflock.AirflockError, match="axes of a grid"):
        airflock.plot("vasarhelyi_2018/4ms", "rules", ax=figure.add_axes((0.1, 0.1, 0.8, 0.8)))


def test_a_misspelled_kind_of_picture_is_guessed():
    with pytest.raises(AirflockError, match="did you mean series"):
        airflock.plot("vasarhelyi_2018/4ms", "seriez")


@pytest.mark.parametrize(
    ("verb", "rest", "said"),
    [
        ("plot", ["--kind", "space"], "tracks have no scene"),
        ("plot", ["--begin", "50"], "window from 50 to 2 s"),
        ("video", ["--begin", "50"], "window from 50 to 2 s"),
    ],
)
def test_a_fault_of_a_recording_names_its_file(tmp_path, monkeypatch, verb, rest, said):
    monkeypatch.chdir(tmp_path)
    tracks = airflock.load_tracks({"t": [0.0, 1.0, 2.0], "id": ["a"] * 3, "x": [0.0, 1.0, 2.0], "y": [0.0, 0.0, 1.0]})
    save(tracks, "my tracks.nc")
    fault = CliRunner().invoke(app, [verb, "my tracks.nc", *rest]).exception
    assert isinstance(fault, RecordingError) and str(fault).startswith("my tracks.nc: ") and said in str(fault)


def test_tracks_of_one_frame_are_drawn_without_a_warning():
    tracks = airflock.load_tracks({"t": [0.0, 0.0], "id": ["a", "b"], "x": [0.0, 1.0], "y": [0.0, 1.0]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert airflock.plot(tracks).axes


@pytest.mark.parametrize(
    ("distances", "below"),
    [
        (lambda u: 10.0 * u, lambda d: d / 10.0),  # evenly spread: a tail that ends at 0 m
        (lambda u: 10.0 + 2.0 * np.log(u), lambda d: np.exp((d - 10.0) / 2.0)),  # falls by e each 2 m
    ],
)
def test_the_tail_of_a_certificate_is_that_of_distributions_that_are_generalised_pareto(distances, below):
    values = distances((np.arange(5000) + 0.5) / 5000)
    at, share = extrapolated_tail(values)
    assert share[at > 0.0] == pytest.approx(below(at[at > 0.0]), rel=0.1, abs=1e-3)
    assert share[-1] == pytest.approx(0.2, rel=1e-3) and extrapolated_tail(values[:99]) is None


def test_a_certificate_draws_numbers_with_a_factor_and_numbers_from_zero():
    """No factor leads away from zero: such a number has no bar, and its label says from where to where."""
    axis = [
        {"key": "radio.delay", "unit": "s", "nominal": 0.5, "safe": 1.0, "factor": 2.0, "interval": [0.4, 0.7]},
        {"key": "radio.range", "unit": "m", "nominal": 80.0, "safe": 40.0, "factor": 0.5, "not_shown": 30.0},
        {"key": "wind.gust", "unit": "m/s", "nominal": 0.0, "safe": 3.0, "not_shown": 4.0},
    ]
    limits = SimpleNamespace(verdicts=(), rows=(), tolerance={"axis": axis}, over={}, shown=True)
    limits.campaign = SimpleNamespace(confidence=0.95, scenario=SimpleNamespace(name="mine"))
    limits.verdicts = (
        SimpleNamespace(
            looks=[take_look(100, 0, 0.05, 0.05)], probability=0.1, high=0.03, limit=SimpleNamespace(event="x")
        ),
    )
    panel = plot_certificate(limits).axes[1]
    texts = {text.get_text(): text.get_ha() for text in panel.texts}
    assert texts["1 s"] == "left" and texts["40 m"] == "right" and texts["0 to 3 m/s"] == "left"
    widths = [bar.get_width() for bar in panel.patches]
    assert sorted(widths) == pytest.approx([-0.5, 0.0, 1.0])
    ends = [line.get_xdata() for line in panel.lines if line.get_color() == "black"]
    assert len(ends) == 1 and ends[0] == pytest.approx([0.8, 1.4])


def test_a_certificate_that_counted_nothing_says_so_and_has_no_logarithm_of_it():
    """A budget of no time looks at no flight: "Data cannot be log-scaled" stood in the report."""
    empty = SimpleNamespace(rows=(), tolerance={}, over={}, shown=False)
    empty.campaign = SimpleNamespace(confidence=0.95, scenario=SimpleNamespace(name="mine"))
    for looks in ([], [take_look(0, 0, 0.05, 0.05)]):
        limit = SimpleNamespace(event="x", score="r_min", value=1.0)
        empty.verdicts = (SimpleNamespace(looks=looks, probability=0.1, high=None, limit=limit),)
        figure = plot_certificate(empty)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            figure.canvas.draw()
        assert [text.get_text() for text in figure.axes[0].texts][:1] == ["no flight was counted"]


def test_an_identified_flight_whose_command_never_stands_still_is_drawn():
    """No four rows in a row have one command: there is no acceleration to show, and no quantile of it."""
    count = 200
    logs = SimpleNamespace(
        time=0.1 * np.arange(count), is_new=np.arange(count) == 0, step=0.1,
        command=np.random.default_rng(1).normal(size=(count, 2)), velocity=np.zeros((count, 2)),
    )  # fmt: skip
    panel = pyplot.figure().add_subplot()
    _draw_saturation(panel, logs, SimpleNamespace(body=SimpleNamespace(value={"tau": 1.0, "a_max": 5.0, "white": 0.1})))
    assert [text.get_text() for text in panel.texts] == ["the command never stands still"]
