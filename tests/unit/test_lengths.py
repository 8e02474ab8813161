"""Tracks do not say what is near: what depends on such a length is told where somebody gives it."""

import numpy as np
import pandas as pd
import pytest

import airflock
from airflock.parts import SETS
from airflock.recordings.flown_scenario import scenario_of_recording
from airflock.recordings.scores import (
    IN_BODIES,
    body_length_settings,
    measure_recording,
    nearness_note,
    undefined_metrics_of,
)
from airflock.support.errors import RecordingError
from processes import called

GIVEN = {
    "r_coll": 1.0, "r_cluster": 3.0, "r_comm": 2.0, "r_b": 0.8, "r_flock": 5.0, "max_e": 20.0, "v_flock": 3.0,
    "v_tol": 1.0, "r_body": 0.5, "r_tol": 2.0, "r_safe": 1.0, "centre_x": 26.0, "centre_y": 26.0,
}  # fmt: skip


@pytest.fixture(autouse=True)
def plainly(request):
    """Wings alone take longer by plain Python than their driver takes to compile."""
    if "[dimock]" not in request.node.name:
        request.getfixturevalue("scored_plainly")


def tracks(seed, agents=12, frames=40):
    """A dozen individuals that wander in a cube of 12 m."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(20.0, 32.0, (1, 3, agents)) + np.cumsum(rng.normal(0.0, 0.3, (frames, 3, agents)), axis=0)
    rows = [(0.1 * t, i, *x[t, :, i]) for t in range(frames) for i in range(agents)]
    return airflock.load_tracks(pd.DataFrame(rows, columns=["time", "id", "x", "y", "z"]), unit="m")


@pytest.mark.parametrize("kind", SETS)
def test_what_depends_on_a_length_says_so(kind, seed):
    """Brute force: each length is changed, and whatever then differs is not told without it."""
    recording = tracks(seed)
    settings = {"metrics.kind": kind, "world.arena": "square", "world.side": 200.0}
    settings |= {f"metrics.{key}": value for key, value in GIVEN.items()}
    assert undefined_metrics_of(recording, scenario_of_recording(recording, settings), settings) == {}
    here = measure_recording(recording, settings)[0]
    for key, value in GIVEN.items():
        fewer = {name: given for name, given in settings.items() if name != f"metrics.{key}"}
        if key == "max_e" and "quality" in here:  # without it an error says what to give
            continue
        refused = undefined_metrics_of(recording, scenario_of_recording(recording, fewer), fewer)
        for factor in (0.3, 3.0):
            there = measure_recording(recording, {**settings, f"metrics.{key}": factor * value})[0]
            changed = {name for name in here if str(here[name]) != str(there[name])} - {"phi_lap", "phi_lap_abs"}
            assert changed <= set(refused) or key == "v_tol", (key, changed)
        assert not set(measure_recording(recording, fewer)[0]) & set(refused)


def test_a_body_is_a_length(seed):
    recording = tracks(seed)
    bare, scored = airflock.score(recording), airflock.score(recording, body_length=2.0)
    assert {"phi_vel", "polarisation", "r_min_mean"} <= set(bare) and "n_coll" not in bare and "fitness" not in bare
    assert bare.attrs["not_told"]["phi_corr"] == ("r_cluster",)
    by_hand = airflock.score(recording, settings={"metrics.r_coll": 1.0, "metrics.r_cluster": 10.0})
    assert scored["n_coll"][0] == by_hand["n_coll"][0] and scored["phi_corr"][0] == by_hand["phi_corr"][0]
    assert (scored[list(bare)].iloc[0].dropna() == bare.iloc[0].dropna()).all()  # the others are what they were
    assert body_length_settings(2.0)["metrics.r_coll"] == 1.0 and IN_BODIES["r_coll"] == 0.5
    own = airflock.score(recording, settings={"metrics.r_cluster": 4.0}, body_length=2.0)  # who knows better is heard
    assert own["n_min"][0] == airflock.score(recording, settings={"metrics.r_cluster": 4.0})["n_min"][0]


@pytest.mark.parametrize("length", [0.5, 2.0])
def test_line_on_what_is_near_has_the_radius_of_each_order_parameter_that_depends_on_one(seed, length):
    recording, settings = tracks(seed), body_length_settings(length) | {"metrics.r_comm": 7.0}
    values = measure_recording(recording, settings)[0]
    note = nearness_note(recording, scenario_of_recording(recording, settings), values)
    needs = scenario_of_recording(recording, settings).metrics.rule.needs
    assert needs
    for name in values:
        for key in set(needs.get(name, ())) & IN_BODIES.keys():
            part = note.split(f"metrics.{key} = {settings[f'metrics.{key}']:g} m (")[1].split(")")[0]
            assert name in part.split(", ")
    assert "metrics.r_cluster" in note and "metrics.r_comm = 7 m" in note
    assert nearness_note(recording, scenario_of_recording(recording), measure_recording(recording)[0]) == ""


def test_a_simulated_flight_brings_its_lengths():
    flight = airflock.simulate(airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0}))
    assert undefined_metrics_of(flight, scenario_of_recording(flight)) == {} and {
        "n_coll",
        "phi_corr",
        "fitness",
    } <= set(measure_recording(flight)[0])


def test_the_command_says_what_to_give(tmp_path, seed):
    file = airflock.save(tracks(seed), tmp_path / "tracks.nc")
    found = called("score", file)
    assert found.returncode == 0 and "n_coll" not in found.stdout
    assert "n_coll" in found.stderr and "--body-length" in found.stderr and "metrics.r_coll" in found.stderr
    assert "n_coll" in called("score", file, "--body-length", "0.5").stdout
    wrong = called("score", file, "--body-length", "-1")
    assert wrong.returncode == 2 and wrong.stderr.count("\n") == 1 and "body_length = -1 m" in wrong.stderr


def test_a_rotation_is_told_where_its_centre_is(tmp_path, seed):
    """Tracks moved elsewhere are the same motion: nothing told of them may change."""
    recording = tracks(seed)
    moved = recording.assign(position=recording["position"] + 500.0)
    here, there = airflock.score(recording), airflock.score(moved)
    assert list(here) == list(there) and here.attrs["not_told"]["phi_lap"] == ("centre_x", "centre_y")
    for name in here:
        assert here[name][0] == pytest.approx(there[name][0], rel=1e-3, nan_ok=True), name
    about = [{"metrics.centre_x": place, "metrics.centre_y": place} for place in (26.0, 526.0)]
    laps = [airflock.score(one, settings=at)["phi_lap"][0] for one, at in zip((recording, moved), about, strict=True)]
    assert laps[0] == pytest.approx(laps[1], abs=1e-3)
    with pytest.raises(RecordingError, match="mine: has no phi_lap, because tracks do not say"):
        airflock.plots.rotations({"mine": recording})
