"""Replays: positions packed and unpacked, and a page that holds everything that it needs."""

import base64
import hashlib
import html
import json
import re
from importlib import resources

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

import airflock
from airflock.cli import main as run_main
from airflock.support.errors import RecordingError
from airflock.view.agent_colours import cluster_labels
from airflock.view.replay_page import PackedPositions, check_colour, pack_positions, unpack_positions

MOTOR = {"kind": "motor", "agents": [7]}
FRAMES = st.tuples(st.integers(1, 9), st.integers(2, 3), st.integers(1, 4))


@given(FRAMES.flatmap(lambda shape: arrays(float, shape, elements=st.floats(-1e4, 1e4, width=32))))
def test_unpacked_positions_lie_within_half_a_quantum(position):
    packed = pack_positions(position)
    away = np.abs(unpack_positions(packed)[0] - position).max(axis=(0, 2))
    assert (away <= 0.5 * np.array(packed.step) + 1e-9 * np.abs(position).max()).all()
    assert (np.array(packed.step) <= np.maximum(np.ptp(position, axis=(0, 2)) / 65535, 1e-12)).all()


@given(st.integers(1, 9), st.integers(1, 4), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_rows_of_bytes_are_kept_exactly(frames, agents, count, seed):
    rng = np.random.default_rng(seed)
    rows = list(rng.integers(0, 256, (count, frames, agents)).astype(np.uint8))
    found = unpack_positions(pack_positions(rng.normal(size=(frames, 2, agents)), rows))[1]
    assert len(found) == count and all((a == b).all() for a, b in zip(found, rows, strict=True))


@pytest.fixture(scope="module")
def recording():
    scenario = airflock.load("vasarhelyi_2018/4ms", {"agents": 12, "duration": 20.0})
    return airflock.simulate(scenario, 1, events=[{"step": 500, "kind": "change", "data": {"model.p_rep": 0.3}}])


def about(page):
    return json.loads(re.search(r'id="about">(.*?)</script>', page.text, re.S)[1])


def test_a_page_names_its_flight_its_events_and_loads_nothing(recording):
    page = airflock.replay(recording)
    told = about(page)
    assert told["events"] == [[5.0, "change model.p_rep = 0.3"]]
    assert told["shape"][1:] == [2, 12] and told["seed"] == 1
    assert not re.search(r'(src|href)="?(https?:|//)', page.text.replace(three(), ""))
    assert html.escape(page.text, quote=True) in page._repr_html_()


def test_a_minute_of_a_thousand_drones_takes_less_than_five_megabytes():
    rng = np.random.default_rng(3)
    speed = 4.0 * np.exp(1j * np.cumsum(rng.normal(0.0, 0.1, (600, 1000)), axis=0))
    path = np.cumsum(0.1 * speed + rng.normal(0.0, 0.01, (600, 1000)), axis=0)
    size = len(pack_positions(np.stack([path.real, path.imag], axis=1)).data) * 4 / 3 + len(three())
    assert size < 5e6


def test_frames_are_thinned_to_the_rate(recording):
    assert about(airflock.replay(recording, rate=2.0))["period"] == pytest.approx(0.6)  # frames are 0.2 s apart


def test_close_pairs_become_collisions_once(recording):
    near = recording.copy(deep=True)
    near["position"][50:60, :, 0, 1] = near["position"].values[50:60, :, 0, 0] + 0.1
    period = float(recording["time"][1] - recording["time"][0])
    collisions = [entry for entry in about(airflock.replay(near))["collisions"] if entry[1:] == [0, 1]]
    assert len(collisions) == 1 and collisions[0][0] == pytest.approx(50 * period)


@pytest.mark.parametrize("axes", ["xy", "xyz"])
def test_tracks_far_from_their_origin_are_drawn_like_near_ones(axes):
    """In a grid of maps a flock lies 5,000 km north: on a graphics card its darts had no length any more."""
    time = np.arange(10.0)
    columns = {"t": np.tile(time, 2), "id": np.repeat(["a", "b"], 10)}
    columns |= {axis: np.r_[time, 3.0 * time] + 7.0 * number for number, axis in enumerate(axes)}
    near = about(airflock.replay(airflock.load_tracks(columns)))
    far = about(
        airflock.replay(airflock.load_tracks({**columns, "x": columns["x"] + 2**19, "y": columns["y"] + 2**22}))
    )
    assert far["low"] == near["low"] and far["stage"] == near["stage"] and far["quantum"] == near["quantum"]
    assert near["height"][0] == pytest.approx(7.0 * (len(axes) - 1)) and np.abs(near["low"][:2]).max() < 30.0
    assert near["stage"]["centre"][2] == pytest.approx(14.0 + 13.5 if axes == "xyz" else 0.0)


def test_names_cannot_break_out_of_the_page(recording):
    odd = recording.assign_attrs(airflock_name="</script><b>@DATA@ & co")
    page = airflock.replay(odd)
    assert about(page)["name"] == "</script><b>@DATA@ & co" and "</script><b>" not in page.text


def shown(page):
    """Rows of bytes of a page, by the names of its layers; at last, of a recording with gaps, who is there."""
    told = about(page)
    data = base64.b64decode(re.search(r'id="data">(.*?)</script>', page.text, re.S)[1])
    rows = unpack_positions(PackedPositions(told["low"], told["quantum"], tuple(told["shape"]), data))[1]
    return dict(zip([*(layer["name"] for layer in told["layers"]), "there"], rows, strict=False))


def test_whoever_is_absent_is_not_shown_and_stays_where_it_was(recording):
    holes = recording.copy(deep=True)
    holes["position"][3:8, 0, 0, 0] = np.nan
    holes["position"][:4, 1, 0, 2] = np.nan
    page = airflock.replay(holes)
    absent = shown(page)["there"] == 0
    assert absent[3:8, 0].all() and absent[:4, 2].all() and absent.sum() == 9
    assert not about(airflock.replay(recording))["layers"] or "there" not in shown(airflock.replay(recording))
    assert None not in about(page)["charts"][0][1]


def test_a_lone_agent_has_no_chart_of_the_nearest_pair():
    alone = airflock.load("vasarhelyi_2018/4ms", {"agents": 1, "duration": 1.0})
    told = about(airflock.replay(airflock.simulate(alone, device="python")))
    assert [title for title, _ in told["charts"]] == ["mean speed (m/s)"]


def test_layers_hold_clusters_faults_groups_and_what_the_recording_knows_of_each():
    given = {"agents": 12, "duration": 6.0, "groups": [{"agents": [4, 5], "name": "slow"}, {"name": "rest"}]}
    scenario = airflock.load("vasarhelyi_2018/4ms", given)
    recording = airflock.simulate(scenario, 1, events=[{"step": 200, "kind": "fault", "data": MOTOR}], device="python")
    speed = np.sqrt((recording["velocity"] ** 2).sum("space")).isel(keypoint=0, drop=True)
    page = airflock.replay(recording.assign(pace=speed), colour="pace")
    told, rows = {layer["name"]: layer for layer in about(page)["layers"]}, shown(page)
    assert rows["group"][0].tolist() == [1, 1, 1, 1, 0, 0, *[1] * 6] and told["group"]["names"] == ["slow", "rest"]
    times = recording["time"].values
    assert ((rows["fault"] == 0) == ((times >= 2.0)[:, None] & (np.arange(12) == 7))).all()
    assert np.abs(rows["pace"] / 254 * np.ptp(speed.values) + speed.values.min() - speed.values).max() < 0.02
    reach = scenario.resolved_metrics().r_cluster
    last = cluster_labels(recording["position"].values[-1, :, 0].T, reach)
    assert ((rows["cluster"][-1] == 255) == (last < 0)).all()
    assert len(set(rows["cluster"][-1].tolist()) - {255}) == len(set(last.tolist()) - {-1})


def test_unknown_colours_and_wrong_endings_are_one_line(recording, tmp_path):
    with pytest.raises(RecordingError, match="colour = 'mood' is none that this recording knows: speed, heading"):
        airflock.replay(recording, colour="mood")
    with pytest.raises(RecordingError, match=r"; did you mean speed\?$"):
        airflock.replay(recording, colour="spede")
    with pytest.raises(RecordingError, match="the only format written here"):
        airflock.replay(recording).save(tmp_path / "show.pdf")


@pytest.mark.parametrize("name", ["vasarhelyi_2018/faulty", "kidger/city", "vicsek_1995/ordered", "couzin_2002/torus"])
def test_colours_of_a_flight_are_known_before_it_is_flown(name):
    few = {"agents": 30, "duration": 2.0} if name.endswith("faulty") else {"agents": 3, "duration": 2.0}
    scenario = airflock.load(name, few)
    flown = airflock.replay(airflock.simulate(scenario, 1, device="python")).text
    ways = json.loads(re.search(r'<script type="application/json" id="about">(.*?)</script>', flown)[1])["ways"]
    for way in ways:
        check_colour(scenario, way)
    with pytest.raises(RecordingError, match=f"knows: {', '.join(ways)}$"):
        check_colour(scenario, "mood")


def test_a_wrong_colour_is_refused_before_the_flight(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("airflock.view.plot_by_kind.simulate", lambda *_, **__: pytest.fail("it was flown"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["airflock", "replay", "vasarhelyi_2018/4ms", "--colour", "spede"])
    with pytest.raises(SystemExit) as ended:
        run_main()
    told = capsys.readouterr().err
    assert ended.value.code == 2 and told.count("\n") == 1 and "did you mean speed?" in told
    assert not list(tmp_path.iterdir())


def three():
    return (resources.files("airflock.view") / "replays" / "three.min.js").read_text(encoding="utf-8")


def test_the_library_is_the_one_that_is_named():
    root = resources.files("airflock.view") / "replays"
    stored = (root / "three.min.js").read_bytes()
    assert len(stored) < 1_000_000
    assert hashlib.sha256(stored).hexdigest() in (root / "three.md").read_text(encoding="utf-8")
