"""What is asked for is judged before anything flies: no flight is lost to a wrong name or a wrong ending."""

import json

import pytest
from typer.testing import CliRunner

from airflock.cli.main import app
from airflock.support.errors import AirflockError
from inside import cpu, simulate

BEST = "zapotecatl_2016/best"
OVER = ["--over", "model.r_s=0.1,0.2", "--duration", "1", "--seeds", "1"]


@pytest.fixture
def grounded(monkeypatch):
    """Nothing may fly."""

    def flown(*_, **__):
        raise AssertionError("something was flown")

    for name in ("driver_of", "fly_on_cpu", "fly_steps"):
        monkeypatch.setattr(cpu, name, flown)
    monkeypatch.setattr(simulate, "run_in_threads", flown)


def refused(*arguments):
    """Lines of the refusal."""
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert isinstance(done.exception, AirflockError), (done.exception, done.output)
    return str(done.exception).splitlines()


def test_a_wrong_name_to_show_is_refused_with_the_nearest(grounded):
    assert refused("sweep", BEST, *OVER, "--show", "qualitty") == [
        "--show qualitty: unknown order parameter; did you mean quality?"
    ]
    (line,) = refused("sweep", BEST, *OVER, "--show", "fitness")
    assert "unknown order parameter" in line and "polarisation" in line


def test_all_faults_of_a_sweep_are_told_together(grounded):
    lines = refused("sweep", BEST, *OVER, "--show", "xxx", "--over", "model.w_c", "--table", "/nowhere/lost.csv")
    assert [line.split(":")[0] for line in lines] == ["/nowhere/lost.csv", "--over model.w_c", "--show xxx"]


def test_a_key_swept_twice_is_refused(grounded):
    assert refused("sweep", BEST, *OVER, "--over", " model.r_s=0.3") == [
        "--over model.r_s: given 2 times; give all its values in one --over"
    ]


@pytest.mark.parametrize("key", ["seed", "fitness"])
def test_a_key_that_the_table_has_as_another_column_is_asked_for_whole(grounded, key):
    """The flights of `--over seed=1,2`, which is scene.seed, were told by their own seeds, as if those were swept."""
    (line,) = refused("sweep", "kidger/final_2d", "--over", f"{key}=1,2" if key == "seed" else f"{key}=paper,sound")
    section = {"seed": "scene", "fitness": "metrics"}[key]
    assert line == f"kidger/final_2d: {key}: is a column of the table already; write {section}.{key}"


def test_a_picture_of_three_keys_is_refused(grounded, tmp_path):
    more = ["--over", "agents=10,11", "--over", "model.w_c=1,2", "--plot", tmp_path / "map.png"]
    (line,) = refused("sweep", BEST, *OVER, *more)
    assert "map.png" in line and "1 or 2 keys, not 3" in line


@pytest.mark.parametrize(
    ("name", "shown"),
    [(BEST, "quality"), ("vicsek_1995/transition", "polarisation"), ("vasarhelyi_2018/4ms", "fitness")],
)
def test_what_is_shown_by_default_is_reported(name, shown):
    key = {"vicsek_1995/transition": "model.eta"}.get(name, "agents")
    values = "10,11" if key == "agents" else "0.1,0.2"
    asked = ["sweep", name, "--over", f"{key}={values}", "--duration", "1", "--seeds", "1"]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, (done.exception, done.output)
    assert f"{shown} (mean" in done.output


def test_a_default_sweep_without_fitness_keeps_its_table(tmp_path):
    file = tmp_path / "kept.csv"
    done = CliRunner().invoke(app, ["sweep", BEST, *OVER, "--table", str(file), "--json"])
    assert done.exit_code == 0, (done.exception, done.output)
    assert len(file.read_text().splitlines()) == 3
    text = done.stdout[done.stdout.index("{") :]
    assert len(json.loads(text)["runs"]) == 2


@pytest.mark.parametrize(
    "asked",
    [
        ["run", BEST, "--plot", "lost.xyz"],
        ["run", BEST, "--plot", "lost.nc"],
        ["run", BEST, "--save", "lost.csv"],
        ["run", BEST, "--save", "lost"],
        ["sweep", BEST, *OVER, "--table", "lost.png"],
        ["sweep", BEST, *OVER, "--plot", "lost.csv"],
        ["plot", BEST, "--out", "lost.mp4"],
        ["video", BEST, "--out", "lost.png"],
        ["score", "none.nc", "--series", "lost.nc"],
        ["harden", BEST, "--out", "lost.nc"],
        ["display", "A", "--save", "lost.toml"],
        ["display", "A", "--plot", "lost.jpg"],
    ],
)
def test_an_ending_that_is_not_written_is_refused(grounded, asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (line,) = refused(*asked)
    assert line.startswith("lost") and ("the only format" in line or "give one of" in line)
    assert not list(tmp_path.iterdir())


def test_all_endings_are_judged_together_with_the_scenario(grounded):
    lines = refused("run", BEST, "--save", "a.csv", "--plot", "b.nc", "--set", "model.r_s=-1")
    assert [line.split(":")[0] for line in lines] == ["a.csv", "b.nc", BEST]


def test_a_recording_ends_in_nc(tmp_path):
    import airflock

    flown = airflock.simulate(airflock.load(BEST, {"duration": 1.0}), 0)
    with pytest.raises(AirflockError, match=r"x.csv: ending .csv is not .nc"):
        airflock.save(flown, tmp_path / "x.csv")


def test_all_faults_of_a_display_are_told_together(grounded):
    asked = ["display", "heart.pgn", "none.stl", "--failing", "0.95", "--failure", "fly", "--save", "x.csv"]
    lines = refused(*asked, "--drones", "5", "--set", "wind.gustt=1")
    starts = ("x.csv", "--failing", "--failure", "display", "heart.pgn", "none.stl")
    assert len(lines) == 6 and all(any(s in line for line in lines) for s in starts), lines


def test_the_table_of_a_display_fits_80_columns(monkeypatch, capsys):
    from airflock.cli import flight_verbs
    from airflock.displays.show_control import ShapeReport

    monkeypatch.setenv("COLUMNS", "80")
    formed = ShapeReport(123.456, 0.0283456, 0.123456, 2000, 1234, 12, 123, 10, 3)
    row = {"shape": "pictures/of/a/heart.png", **vars(formed)}  # as the command makes it
    flight_verbs._print_display([row] * 2)
    told = capsys.readouterr().out
    assert "…" not in told and max(map(len, told.splitlines())) <= 80
    for number in ("123.5", "0.02835", "0.1235", "2000", "1234", "123", "12", "10"):
        assert number in told
    assert "".join(line[:11].strip() for line in told.splitlines()).count(row["shape"]) == 2
