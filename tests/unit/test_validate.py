"""The verb validate: the faults of all files together, and studies as well as scenarios."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import airflock
from airflock.cli.main import app
from airflock.errors import AirflockError, ScenarioError

STUDY = Path(airflock.__file__).parent / "studies" / "zapotecatl_2016" / "best.toml"


def validate(*names):
    return CliRunner().invoke(app, ["validate", *map(str, names)])


def test_faults_of_all_files_are_told_whatever_they_are(tmp_path):
    for name in ("bad.nc", "bad.toml"):
        (tmp_path / name).write_text("nonsense = 1")
    flown = airflock.simulate(airflock.load("vicsek_1995/transition", {"duration": 1.0}), 0)
    del flown.attrs["airflock_scenario"]
    airflock.save(flown, tmp_path / "log.nc")
    names = [tmp_path / name for name in ("none.toml", "bad.nc", "none.nc", "log.nc", "bad.toml")]
    done = validate(*names, "zapotecatl_2016/best")
    assert isinstance(done.exception, AirflockError)
    lines = str(done.exception).splitlines()
    for name in names:
        assert any(line.startswith(str(name)) for line in lines), (name, lines)
    assert all(line.startswith(str(tmp_path)) for line in lines)
    assert "zapotecatl_2016/best: valid" in done.output


def test_a_study_is_checked_as_one(tmp_path):
    done = validate(STUDY)
    assert done.exit_code == 0, done.exception
    assert "valid study; 9 parameters" in done.output
    wrong = tmp_path / "wrong.toml"
    wrong.write_text(STUDY.read_text().replace("population = 20", "population = 20.5").replace("r_a = {", "r_aa = {"))
    lines = str(validate(wrong).exception).splitlines()
    assert len(lines) == 2 and "r_aa" in lines[0] and "search.population" in lines[1]


def test_a_study_is_not_flown_as_a_scenario():
    with pytest.raises(ScenarioError, match="is a study, not a scenario; check it with airflock validate"):
        airflock.load(STUDY)
