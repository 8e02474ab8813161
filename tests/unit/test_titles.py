"""Titles and labels of pictures: any name of a file, units of what is drawn, whole generations, no empty panel."""

import io

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from typer.testing import CliRunner

import airflock
from airflock.cli.main import app
from airflock.support.errors import RecordingError
from airflock.view.order_parameter_plots import series
from airflock.view.search_plots import convergence
from airflock.view.trajectory_plots import trajectories

pytestmark = pytest.mark.usefixtures("scored_plainly")


def fish(name="fish.csv"):
    """Four individuals that circle at one speed."""
    angle = 0.1 * np.arange(60)[:, None] + np.arange(4)
    found = airflock.load_tracks(np.stack([np.cos(angle), np.sin(angle)], axis=2), fps=10.0, unit="m")
    return found.assign_attrs(source_file=name)


def words(figure):
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


@pytest.mark.parametrize("name", ["a^b.csv", "tank {2.csv", "50%.csv", "$x$y$.csv", "a_b-c #2.csv", "Fischköder.csv"])
@pytest.mark.parametrize("draw", [series, trajectories])
def test_any_name_of_a_file_is_a_title_as_it_stands(draw, name):
    figure = draw(fish(name))
    figure.savefig(io.BytesIO(), format="png", dpi=20)
    assert name.rpartition(".")[0] in words(figure)


def test_panels_of_tracks_have_units_and_none_is_empty():
    figure = series(fish())
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert "phi_vel\n(m/s)" in labels and "polarisation\n(1)" in labels
    assert not [label for label in labels if label.startswith(("out", "clearance"))]
    assert all(np.isfinite(line.get_ydata()).any() for axes in figure.axes for line in axes.lines)


def test_a_picture_says_which_path_is_thick_and_what_dots_are():
    said = next(text for text in words(trajectories(fish(), agent=2)) if "dots" in text)
    assert "dots: at the end" in said and said.endswith("thick: individual 3")
    assert "thick" not in " ".join(words(trajectories(fish(), highlight=False)))


def test_a_heading_of_tracks_in_a_tank_is_not_north():
    (bar,) = [axes for axes in trajectories(fish()).axes if axes.get_ylabel() == "heading"]
    assert [tick.get_text() for tick in bar.get_yticklabels()] == ["+x", "+y", "−x", "−y", "+x"]


def test_half_a_generation_is_none():
    table = pd.DataFrame({"run": 0, "generation": range(20), "fitness": 0.5})
    figure = convergence(table, "fitness")
    ticks = figure.axes[0].get_xticks()
    assert (ticks == np.round(ticks)).all()


@pytest.mark.parametrize("kind", ["rules", "transfer"])
def test_tracks_have_no_law_to_draw(tmp_path, kind):
    with pytest.raises(RecordingError, match="tracks were flown by no scenario"):
        airflock.plot(fish(), kind)
    airflock.save(fish(), tmp_path / "fish.nc")
    result = CliRunner().invoke(
        app, ["plot", str(tmp_path / "fish.nc"), "--kind", kind, "--out", str(tmp_path / "a.png")]
    )
    assert str(result.exception).startswith(f"{tmp_path}/fish.nc: tracks")
    assert not (tmp_path / "a.png").exists()
