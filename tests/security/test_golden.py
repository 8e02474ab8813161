"""Files that version 0.1 and commit 66fb6ba3 wrote are read and mean what they meant, or are refused in one line."""

import json
import shutil
import tomllib

import pytest
from mutations import GOLDEN

import airflock
from airflock.certificates.certificate import certificate_checksum, check_certificate
from airflock.drones.mavlink.signing import read_key
from airflock.drones.onboard.card import read_card
from airflock.drones.onboard.flight_log import replay
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.recording_files import replay_recording
from airflock.runs.folder import open_folder
from airflock.search.study import load_study
from airflock.support.errors import CardError, RecordingError, StudyError

LATER = GOLDEN.parent / "66fb6ba3"  # the last commit before modules moved
SCORES = json.loads((GOLDEN / "scores.json").read_text())


@pytest.mark.parametrize("name", SCORES)
def test_a_recording_of_0_1_has_the_scores_that_it_had(name):
    recording = airflock.load_recording(GOLDEN / name)
    assert "airflock_format" not in recording.attrs and recording.attrs["airflock_version"] == "0.1.0"
    found = airflock.score(recording).iloc[0].to_dict()
    assert {key: found[key] for key in SCORES[name]} == pytest.approx(SCORES[name], rel=1e-6)
    assert set(found) - set(SCORES[name]) == {"clearance"}  # which later versions measure as well


def test_a_recording_of_0_1_with_a_law_of_its_own_asks_for_it_before_it_flies_again():
    with pytest.raises(RecordingError, match="was flown with a law of its own, '/home/someone/laws/own_law.py'"):
        replay_recording(airflock.load_recording(GOLDEN / "own_law.nc"))


def test_a_scenario_and_a_study_of_0_1_are_read():
    scenario = airflock.load(GOLDEN / "scenario.toml")
    assert (scenario.agents, scenario.parameters.r0_rep, scenario.radio.range) == (6, 35.0, 90.0)
    assert scenario.published == {"phi_vel": (4.0, 0.1)} and len(scenario.world.obstacles) == 1
    study = load_study(GOLDEN / "study.toml")
    assert study.space.keys == ("model.p_rep", "model.r0_rep") and study.space.fixed == {"model.v_frict": 0.6}
    assert [o.name for o in study.objectives] == ["phi_vel", "r_min"] and study.search.algorithm == "nsga2"
    assert study.scenario.flight.duration == 2.0


def test_a_flight_card_of_0_1_is_read_and_flies_the_scenario_that_it_was_made_of():
    card, scenario = read_card(GOLDEN / "card.json"), airflock.load(GOLDEN / "scenario.toml")
    assert card.members == (1, 2, 3, 4, 5, 6) and card.model.name == "vasarhelyi_2018"
    assert card.parameters == scenario.parameters and card.delay == scenario.radio.delay
    assert tuple(card.site.origin) == (47.5, 19.04, 120.0)
    assert card.place.excursion(0.0, -15.0, 0.0) > 0.0 > card.place.excursion(0.0, 40.0, 0.0)  # in the obstacle; free


def test_a_flight_card_of_an_older_version_is_one_line(tmp_path):
    older = json.loads((GOLDEN / "card.json").read_text()) | {"airflock_card": 1}
    (tmp_path / "older.json").write_text(json.dumps(older))
    with pytest.raises(CardError, match=r"older.json: is not a flight card of version 2$"):
        read_card(tmp_path / "older.json")


def test_a_certificate_of_0_1_is_whole_and_its_bound_is_that_of_the_count(tmp_path):
    """None of 100 flights: the chance of an event is at most 1 - 0.05^(1/100) with 95 % (Clopper and Pearson)."""
    text = (GOLDEN / "certificate.toml").read_text()
    document = tomllib.loads(text)
    assert document["seal"] == certificate_checksum(document)
    assert document["limit"][0]["high"] == pytest.approx(1.0 - 0.05**0.01, rel=1e-12)
    try:
        found = check_certificate(GOLDEN / "certificate.toml")
    except StudyError as fault:  # the law's text has changed since
        assert "its flights were computed by other rules" in str(fault)
    else:
        assert found.flown and not [line for line in found.faults if "bits" not in line]
    (tmp_path / "newer.toml").write_text(text.replace("format = 1", "format = 9", 1))
    with pytest.raises(StudyError, match="is of format 9; this Airflock reads format 1"):
        check_certificate(tmp_path / "newer.toml")


def test_what_is_saved_today_carries_its_format(tmp_path):
    recording = airflock.load_recording(GOLDEN / "recording.nc")
    again = airflock.load_recording(airflock.save(recording, tmp_path / "a.nc"))
    assert again.attrs["airflock_format"] == 2
    airflock.save(again.assign_attrs(airflock_format=2), tmp_path / "b.nc")
    newer = again.assign_attrs(airflock_format=3)
    newer.to_netcdf(tmp_path / "c.nc", engine="h5netcdf")
    with pytest.raises(RecordingError, match="is of format 3; this Airflock reads formats 1 to 2"):
        airflock.load_recording(tmp_path / "c.nc")


def test_scenario_study_and_optimum_of_66fb6ba3_mean_what_they_meant():
    scenario = airflock.load(LATER / "mine.toml")
    assert (scenario.agents, scenario.flight.duration, scenario.radio.numbers.delay) == (4, 8.0, 0.4)
    assert [(entry.fault.name, entry.at) for entry in scenario.faults] == [("motor", 4.0)]
    study = load_study(LATER / "study.toml")
    assert study.space.keys == ("model.p_rep", "model.r0_rep") and study.scenario.document == scenario.document
    best = airflock.load(LATER / "study_folder" / "best.toml")
    found = tomllib.loads((LATER / "study_folder" / "result.toml").read_text())
    assert {key: getattr(best.parameters, key.partition(".")[2]) for key in found["parameters"]} == found["parameters"]


def test_a_study_of_66fb6ba3_is_not_mixed_with_flights_of_today(tmp_path, monkeypatch):
    monkeypatch.chdir(LATER)  # a study holds the name of its scenario
    folder = shutil.copytree(LATER / "study_folder", tmp_path / "study")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    line = r"^\S*: holds another study: rules = \w+ there, \w+ now; .*, or continue it with the version that began it$"
    with pytest.raises(StudyError, match=line):
        open_folder(folder, load_study("study.toml"), resume=True)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_certificate_of_66fb6ba3_says_with_which_version_it_can_be_checked():
    document = tomllib.loads((LATER / "certificate.toml").read_text())
    assert document["seal"] == certificate_checksum(document)
    with pytest.raises(StudyError, match=r"other rules .*; check it with the version that wrote it, or certify again$"):
        check_certificate(LATER / "certificate.toml")


def test_a_recording_of_66fb6ba3_has_its_scenario_and_its_scores():
    recording = airflock.load_recording(LATER / "flight.nc")
    assert scenario_of_recording(recording).document == airflock.load(LATER / "mine.toml").document
    [found] = airflock.score(recording).to_dict("records")
    assert found["phi_vel"] == pytest.approx(5.228351219074343, rel=1e-6)
    assert found["fitness"] == pytest.approx(0.028467499505426302, rel=1e-6)


def test_card_and_logs_of_nodes_of_66fb6ba3_are_read(tmp_path):
    key = shutil.copyfile(LATER / "card.key", tmp_path / "card.key")
    key.chmod(0o600)  # a key that others can read is refused
    card, lines = read_card(LATER / "card.json"), (LATER / "node.log").read_text().splitlines()
    ticks = list(replay(lines, card, read_key(key)))
    assert len(ticks) == len(lines) - 1 and sum(tick.same for tick in ticks) > 0.9 * len(ticks)
    tracks = airflock.load_tracks(LATER / "flown.log")
    assert tracks.sizes["time"] == 60 and bool((tracks["position"].sel(space="z") == 50.0).all())
