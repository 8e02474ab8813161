"""A path may begin with ~, the home folder: in every function that takes one, and where no shell has put it in."""

import matplotlib as mpl
import pytest
from typer.testing import CliRunner

import airflock
from airflock.cli.command import expand_home
from airflock.support.untrusted import expand_path
from airflock.view.style import save_figure

mpl.use("agg")
SCENARIO = 'extends = "vasarhelyi_2018/4ms"\nagents = 3\nduration = 1.0\n'


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home folder with a scenario and a log, and another folder to work in, which must stay empty."""
    (tmp_path / "home").mkdir()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "home" / "mine.toml").write_text(SCENARIO)
    (tmp_path / "home" / "log.csv").write_text("t,x,y\n" + "".join(f"{0.1 * n},{n},0\n" for n in range(40)))
    yield tmp_path / "home"
    assert not list((tmp_path / "elsewhere").iterdir())


def test_the_home_folder_is_put_in_for_its_sign_alone(home):
    assert expand_path("~/a/b.nc") == home / "a" / "b.nc"
    for name in ("a~/b.nc", "./~/b.nc", "~nobody-of-this-name/b.nc", "a/b.nc"):
        assert str(expand_path(name)) == name.removeprefix("./")
    assert expand_home("--save=~/b.nc") == f"--save={home}/b.nc" and expand_home("~/b.nc") == f"{home}/b.nc"
    assert expand_home("--map=t:=time*1e-6") == "--map=t:=time*1e-6" and expand_home("--plot") == "--plot"


def test_functions_read_and_write_in_the_home_folder(home):
    scenario = airflock.load("~/mine.toml")
    assert scenario.agents == 3 and airflock.validate("~/mine.toml")
    flight = airflock.simulate(scenario, device="python")
    assert airflock.save(flight, "~/flight.nc") == home / "flight.nc"
    assert airflock.load_recording("~/flight.nc").sizes == flight.sizes
    assert airflock.export(flight, "~/flight.csv") == home / "flight.csv"
    assert airflock.replay(flight).save("~/flight.html") == home / "flight.html"
    assert save_figure(airflock.plot(flight), "~/flight.png") == home / "flight.png"
    assert airflock.load_tracks("~/log.csv").sizes["time"] == 40
    assert airflock.load_tracks(["~/log.csv"]).sizes["time"] == 40
    written = {"flight.nc", "flight.csv", "flight.html", "flight.png"}
    assert {path.name for path in home.iterdir()} >= written


def test_what_a_scenario_extends_may_lie_there(home):
    (home / "field.toml").write_text(SCENARIO.replace("vasarhelyi_2018/4ms", "~/mine.toml"))
    assert airflock.load("~/field.toml").agents == 3


def test_the_command_line_puts_it_in_where_a_shell_does_not(home):
    from airflock.cli.main import app

    ran = CliRunner().invoke(app, ["import", "~/log.csv", "--save=~/tracks.nc"])
    assert ran.exit_code == 0 and (home / "tracks.nc").is_file()
