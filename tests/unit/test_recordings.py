"""Recordings: layout, scores of flights and logs, and what is refused."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock.engine import driver_text, plan_of
from airflock.recordings.attributes import recording_name
from airflock.recordings.dataset import make_dataset, recording_frames
from airflock.recordings.scores import measure_recording, over_time
from airflock.support.errors import AirflockError, RecordingError
from inside import drivers, measuring, passes_driver, tables

pytestmark = pytest.mark.usefixtures("scored_plainly")


def log(position, velocity=None, period=0.1):
    """A flight log (time, individual, 2) without anything that only a simulation knows."""
    dims = ("time", "space", "keypoint", "individual")
    times = np.arange(len(position)) * period
    names = [f"drone_{i}" for i in range(position.shape[1])]
    pack = {"position": (dims, np.transpose(position, (0, 2, 1))[:, :, None, :])}
    if velocity is not None:
        pack["velocity"] = (dims, np.transpose(velocity, (0, 2, 1))[:, :, None, :])
    coordinates = {"time": times, "space": ["x", "y"], "keypoint": ["centre"], "individual": names}
    return xr.Dataset(pack, coordinates)


@pytest.fixture(scope="module")
def circling():
    """Four drones at 5 m/s, 90 degrees apart on a circle of 20 m, counter-clockwise."""
    t = np.arange(0.0, 10.0, 0.1)[:, None]
    angle = t * 5.0 / 20.0 + np.arange(4) * np.pi / 2
    return log(20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def test_layout_is_that_of_movement():
    found = make_dataset(np.zeros((5, 6, 3)), 2, 0.2, {}, "velocity")
    assert found.position.dims == ("time", "space", "keypoint", "individual")
    assert found.attrs["ds_type"] == "poses" and found.attrs["fps"] == 5.0 and found.attrs["time_unit"] == "seconds"
    assert found.confidence.dims == ("time", "keypoint", "individual")
    assert found.position.attrs["units"] == "m" and found.command.attrs["units"] == "m/s"


def test_a_log_is_scored_without_velocity_model_or_arena(circling):
    values, course = measure_recording(circling, {"metrics.r_cluster": 80.0})
    assert values["phi_vel"] == pytest.approx(5.0, rel=1e-3)
    assert values["r_min_mean"] == pytest.approx(20.0 * np.sqrt(2.0), rel=1e-6)
    assert values["phi_corr"] == pytest.approx(-1.0 / 3.0, abs=1e-3)  # unit vectors of a cross sum to zero
    assert "phi_wall" not in values and "n_coll" not in values  # nobody said out of what, or how near
    assert len(course) == circling.sizes["time"]


def test_settings_change_what_counts_as_a_collision(circling):
    assert airflock.score(circling, settings={"metrics.r_coll": 29.0})["n_coll"][0] > 0
    assert airflock.score(circling, settings={"metrics.r_coll": 28.0})["n_coll"][0] == 0


def test_settings_change_a_scenario_by_its_name_and_what_only_recordings_have_is_refused():
    small = {"agents": 3, "duration": 2.0}
    by_name = airflock.score("vasarhelyi_2018/4ms", settings=small)
    assert by_name.equals(airflock.score(airflock.load("vasarhelyi_2018/4ms", small)))
    with pytest.raises(RecordingError, match="groups, body_length: needs a recording"):
        airflock.score("vasarhelyi_2018/4ms", groups=True, body_length=0.1)


def test_a_missing_position_takes_its_drone_out_of_that_instant_alone(circling):
    broken = circling.copy(deep=True)
    broken["position"][dict(time=30, individual=2)] = np.nan
    whole, holed = over_time(circling), over_time(broken)
    assert np.isfinite(holed.drop(columns="clearance").to_numpy()).all()  # nothing stands there
    others = over_time(circling.drop_isel(individual=2))
    assert holed["phi_vel"].iloc[30] == pytest.approx(others["phi_vel"].iloc[30])
    away = [k for k in range(len(whole)) if abs(k - 30) > 1]  # beside the gap velocities are one-sided differences
    assert np.allclose(whole.iloc[away], holed.iloc[away], equal_nan=True)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda d: d.drop_vars("position"), "no variable position"),
        (lambda d: d.isel(individual=0), "lacks the dimension individual"),
        (lambda d: d.isel(individual=slice(0)), "is empty"),
        (lambda d: d.isel(space=[0]), "1 components"),
        (lambda d: d.isel(time=slice(None, None, -1)), "time is not an increasing"),
        (lambda d: d.isel(time=[0, 1, 5, 6]), "resample"),
        (lambda d: d.isel(time=[0]), "one frame without velocity"),
    ],
)
def test_what_is_no_recording_is_refused_with_the_reason(circling, damage, words):
    with pytest.raises(RecordingError, match=words):
        recording_frames(damage(circling))


def test_flight_with_a_law_given_directly_can_still_be_scored(tmp_path):
    import importlib.util

    path = Path(__file__).parents[2] / "examples" / "own_rule.py"
    spec = importlib.util.spec_from_file_location("own_rule", path)
    law = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(law)
    settings = {"duration": 5.0, "agents": 10, "metrics.collision_period": 0.2}
    scenario = airflock.load("vasarhelyi_2018/4ms", settings, law=law)
    direct = airflock.score(scenario, [4], device="python").iloc[0]
    file = airflock.save(airflock.simulate(scenario, 4, device="python"), tmp_path / "own.nc")
    scored = airflock.score(airflock.load_recording(file)).iloc[0]
    assert scored[direct.index].to_numpy() == pytest.approx(direct.to_numpy(), abs=1e-9)


def test_a_recording_of_a_law_of_ones_own_is_scored_anywhere_without_it_and_flown_again_with_it(tmp_path, monkeypatch):
    from airflock.parts.laws.viragh_2014 import law as viragh_2014
    from airflock.recordings.recording_files import replay_recording

    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "mine.py").write_text(Path(viragh_2014.__file__).read_text())
    (tmp_path / "sub" / "own.toml").write_text('duration = 2.0\nagents = 5\n[model]\nkind = "mine.py"\n')
    monkeypatch.chdir(tmp_path)
    scenario = airflock.load("sub/own.toml", trust=True)
    file = airflock.save(airflock.simulate(scenario, 1, device="python"), tmp_path / "sub.nc")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine.py").write_text("raise ValueError('another law')\n")
    monkeypatch.chdir(tmp_path / "elsewhere")
    again = airflock.load_recording(file)
    assert airflock.score(again)["phi_vel"][0] > 0.0
    assert str(tmp_path) not in again.attrs["airflock_scenario"]
    with pytest.raises(RecordingError, match="--law FILE.py"):
        replay_recording(again)
    assert replay_recording(again, law=tmp_path / "sub" / "mine.py") == (True, [])
    assert scenario.document["model"]["kind"] == "mine.py"


@pytest.mark.parametrize(
    "damage",
    [{"faults": 5}, {"groups": 7}, {"groups": [3, "four"]}, {"groups": [{"model": 1}]}],
    ids=str,
)
def test_a_damaged_scenario_in_a_recording_is_refused_in_lines_of_its_own(damage):
    """Fuzzed recording 9338 of seed 2 had a number in place of its list of faults, and ended in a TypeError."""
    short = airflock.load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 1.0})
    flight = airflock.simulate(short, 1, device="python")
    told = json.loads(flight.attrs["airflock_scenario"])
    broken = flight.assign_attrs(airflock_scenario=json.dumps(told | damage))
    with pytest.raises(AirflockError) as refused:
        airflock.score(broken)
    assert refused.value.__cause__ is None


def test_one_agent_has_no_nearest_neighbour():
    alone = airflock.load("vasarhelyi_2018/4ms", {"duration": 2.0, "agents": 1, "metrics.collision_period": 0.2})
    flight = airflock.simulate(alone, precision=64)
    flown = [airflock.score(alone, precision=64), airflock.score(flight), over_time(flight)]
    for found in [*flown, airflock.score(alone, device="python")]:
        assert found[["r_min", "r_min_mean"]].isna().all(axis=None) and found["phi_vel"].notna().all()
        assert not (found > 1e12).any(axis=None)


def test_same_sampling_gives_the_same_numbers_from_the_kernel_and_from_the_recording():
    settings = {"duration": 20.0, "metrics.collision_period": 0.2}
    for name in ("vasarhelyi_2018/4ms", "vasarhelyi_2018/obstacles"):
        scenario = airflock.load(name, settings)
        direct = airflock.score(scenario, [1], precision=64).iloc[0]
        scored = airflock.score(airflock.simulate(scenario, 1, precision=64)).iloc[0]
        assert scored[direct.index].to_numpy() == pytest.approx(direct.to_numpy(), abs=1e-9)


@pytest.mark.parametrize(
    "attributes, name",
    [
        ({"airflock_name": "vasarhelyi_2018/4ms", "source_file": "a.csv"}, "vasarhelyi_2018/4ms"),
        ({"source_file": "tank/fish.csv"}, "fish"),
        ({"source_file": "log_1.ulg, log_2.ulg, log_3.ulg"}, "log_1 and 2 more"),
        ({"source_file": ".csv"}, ".csv"),
        ({}, "recording"),
    ],
)
def test_pictures_of_tracks_are_called_like_their_file(circling, attributes, name):
    assert recording_name(circling.assign_attrs(attributes)) == name


def test_where_nothing_stands_no_instant_has_a_clearance(circling):
    assert over_time(circling)["clearance"].isna().all()
    walled = over_time(circling, {"world.arena": "circle", "world.radius": 100.0})
    assert walled["clearance"].tolist() == pytest.approx([80.0] * len(walled))


def test_the_text_by_which_recordings_were_flown_is_written_once(monkeypatch):
    """It takes a tenth of a second, and most recordings of a study or a test are of one plan."""
    found, written = airflock.load("vicsek_1995/ordered", {"agents": 3, "duration": 0.5}), []
    write = drivers.flight_driver_text
    monkeypatch.setattr(drivers, "flight_driver_text", lambda plan: written.append(plan) or write(plan))
    drivers._text.cache_clear()
    flown = [airflock.simulate(found, seed=seed, device="python") for seed in range(3)]
    text = driver_text(found, precision=flown[0].attrs["airflock_precision"])
    assert {each.attrs["airflock_sources"] for each in flown} == {hashlib.sha256(text.encode()).hexdigest()}
    assert len(written) == 1


def test_one_driver_measures_flights_of_several_laws():
    """To compile it takes seconds, and of a law it would tell only where the numbers of the arena stand in a row."""
    texts, keys = set(), {"agents": 5, "metrics.kind": "vasarhelyi", "world.dimensions": "2", "world.arena": "square"}
    for law in ("vasarhelyi_2018/4ms", "viragh_2014/4ms", "couzin_2002/torus"):
        found = airflock.load(law, keys | {"world.side": 100.0})
        plan = plan_of(found, precision=64)
        texts.add(passes_driver.replay(measuring.shared_plan(plan, tables(found, plan, 0))[0]))
    assert len(texts) == 1
