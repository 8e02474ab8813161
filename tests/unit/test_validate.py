"""The verb validate: the faults of all files together, and studies as well as scenarios."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

import airflock
from airflock.cli.main import app
from airflock.support.errors import AirflockError, ScenarioError

STUDY = Path(airflock.__file__).parent / "parts/laws/reynolds_1987/studies/zapotecatl_2016/best.toml"


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


def test_verdicts_notes_and_faults_are_told_as_json(tmp_path):
    wrong = tmp_path / "wrong.toml"
    wrong.write_text('extends = "vasarhelyi_2018/4ms"\nagnets = 3\n[radio]\ndelay = -1')
    done = validate("vasarhelyi_2018/4ms", wrong, "--json")
    assert done.exit_code == 2 and done.stderr == ""
    right, bad = json.loads(done.stdout)["files"]
    assert right == {
        "file": "vasarhelyi_2018/4ms", "verdict": "valid; vasarhelyi_2018, 100 agents, 600 s",
        "notes": [], "faults": [],
    }  # fmt: skip
    assert bad["file"] == str(wrong) and bad["verdict"] is None
    assert bad["faults"] == [
        f"{wrong}: agnets: unknown key; did you mean agents?",
        f"{wrong}: radio.delay = -1 s lies outside [0, 30] s",
    ]
    noted = validate("vasarhelyi_2018/4ms", "--set", "radio.delay=600 ms", "--json")
    (entry,) = json.loads(noted.stdout)["files"]
    assert noted.exit_code == 0 and entry["notes"] == ["radio.delay = 600 ms is 0.6 s"] and entry["faults"] == []


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
