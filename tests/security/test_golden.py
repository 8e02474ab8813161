"""Files that version 0.1 wrote are read, and mean what they meant."""

import json

import pytest
from mutations import GOLDEN

import airflock
from airflock.errors import RecordingError
from airflock.evolve.study import load_study
from airflock.recordings.files import fly_again

SCORES = json.loads((GOLDEN / "scores.json").read_text())


@pytest.mark.parametrize("name", SCORES)
def test_a_recording_of_0_1_has_the_scores_that_it_had(name):
    recording = airflock.load_recording(GOLDEN / name)
    assert "airflock_format" not in recording.attrs and recording.attrs["airflock_version"] == "0.1.0"
    found = airflock.score(recording).iloc[0].to_dict()
    assert found == pytest.approx(SCORES[name], rel=1e-6)


def test_a_recording_of_0_1_with_a_law_of_its_own_asks_for_it_before_it_flies_again():
    with pytest.raises(RecordingError, match="was flown with a law of its own, '/home/someone/laws/own_law.py'"):
        fly_again(airflock.load_recording(GOLDEN / "own_law.nc"))


def test_a_scenario_and_a_study_of_0_1_are_read():
    scenario = airflock.load(GOLDEN / "scenario.toml")
    assert (scenario.agents, scenario.parameters.r0_rep, scenario.radio.range) == (6, 35.0, 90.0)
    assert scenario.published == {"phi_vel": (4.0, 0.1)} and len(scenario.world.obstacles) == 1
    study = load_study(GOLDEN / "study.toml")
    assert study.space.keys == ("model.p_rep", "model.r0_rep") and study.space.fixed == {"model.v_frict": 0.6}
    assert [o.name for o in study.objectives] == ["phi_vel", "r_min"] and study.search.algorithm == "nsga2"
    assert study.scenario.flight.duration == 2.0


def test_what_is_saved_today_carries_its_format(tmp_path):
    recording = airflock.load_recording(GOLDEN / "recording.nc")
    again = airflock.load_recording(airflock.save(recording, tmp_path / "a.nc"))
    assert again.attrs["airflock_format"] == 2
    airflock.save(again.assign_attrs(airflock_format=2), tmp_path / "b.nc")
    newer = again.assign_attrs(airflock_format=3)
    newer.to_netcdf(tmp_path / "c.nc", engine="h5netcdf")
    with pytest.raises(RecordingError, match="is of format 3; this Airflock reads formats 1 to 2"):
        airflock.load_recording(tmp_path / "c.nc")
