"""Tracks drawn at random, fifty of each kind: an import is right or refused; sound motion is read to the last row."""

import json
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import airflock
from airflock.recordings import between_frames_note, scenario_of_recording
from airflock.support.errors import RecordingError

FILES = 50


@pytest.fixture(params=range(FILES))
def rng(seed, request):
    return np.random.default_rng([seed, request.param])


def wander(rng, rows, period, speed, noise, start=(0.0, 0.0)):
    """Place of an animal that turns and changes its speed smoothly, (row, 2), m."""
    heading = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.normal(0.0, 0.3 * np.sqrt(period), rows))
    pace = speed * (1.0 + 0.3 * np.sin(np.arange(rows) * period * rng.uniform(0.3, 1.0)))
    steps = (pace * period * np.array([np.cos(heading), np.sin(heading)])).T
    return np.array(start) + np.cumsum(steps, axis=0) + rng.normal(0.0, noise, (rows, 2))


def school(rng, count, apart):
    """A table of animals that stay `apart` (m) from each other, and its period: t, id, x, y."""
    rate, speed = rng.choice([10.0, 25.0, 30.0, 50.0]), apart * rng.uniform(0.02, 0.2)
    rows, noise = int(rng.integers(80, 240)), speed / rate * rng.uniform(0.01, 0.2)
    shared = wander(rng, rows, 1.0 / rate, speed, 0.0, rng.uniform(-5.0, 5.0, 2))
    tables = []
    for number in range(count):
        own = shared + [apart * number, 0.0] + wander(rng, rows, 1.0 / rate, 0.05 * speed, noise)
        tables.append(
            pd.DataFrame({"t": np.arange(rows) / rate, "id": f"fish_{number}", "x": own[:, 0], "y": own[:, 1]})
        )
    return pd.concat(tables).sort_values(["t", "id"], ignore_index=True), 1.0 / rate


def notes(recording):
    return json.loads(recording.attrs["airflock_import"])["notes"]


def places(recording):
    return recording["position"].transpose("individual", "time", "space", "keypoint").values[..., 0]


def truth(table):
    """Place of each individual, (individual, row, 2), m."""
    return np.stack([own[["x", "y"]].to_numpy() for _, own in table.groupby("id", sort=False)])


def least_distance(place):
    apart = [np.linalg.norm(one - other, axis=1) for one, other in combinations(place, 2)]
    return np.nanmin(apart)


def test_exchanged_identities_are_refused_and_split_if_accepted(rng):
    count = int(rng.integers(2, 6))
    apart = rng.uniform(0.05, 5.0)
    table, period = school(rng, count, apart)
    rows = len(table) // count
    at = int(rng.integers(10, rows - 10))
    who = rng.choice(count, size=int(rng.integers(2, min(count, 3) + 1)), replace=False)
    late = table["t"] > (at - 0.5) * period
    names = {f"fish_{a}": f"fish_{b}" for a, b in zip(who, np.roll(who, 1), strict=True)}
    if rng.random() < 0.3:  # with the velocity of each animal itself
        table["vx"], table["vy"] = (table.groupby("id")[axis].transform(np.gradient) / period for axis in "xy")
    swapped = table.assign(id=np.where(late, table["id"].replace(names), table["id"]))
    if rng.random() < 0.3:  # and not seen for some frames
        hidden = swapped["t"].between((at - rng.integers(1, 5) - 0.5) * period, (at - 0.5) * period)
        swapped = swapped[~(hidden & swapped["id"].isin(names))].reset_index(drop=True)
    with pytest.raises(RecordingError) as error:
        airflock.load_tracks(swapped, unit="m")
    lines = str(error.value).splitlines()
    assert len(lines) == len(names) and all("identities exchanged" in line for line in lines)
    assert all(
        f"row {n}" in "\n".join(lines)
        for n in swapped.index[swapped["id"].isin(names) & (swapped["t"] > (at - 0.5) * period)][: len(names)]
    )
    recording = airflock.load_tracks(swapped, unit="m", accept="jumps", precision=64)
    assert least_distance(places(recording)) == pytest.approx(least_distance(truth(table)), rel=0.05)
    speed = np.nanmax(np.linalg.norm(recording["velocity"].values, axis=1))
    assert speed < 3.0 * np.linalg.norm(np.diff(truth(table), axis=1), axis=2).max() / period


def test_a_step_that_stays_is_refused_and_takes_no_row_away(rng):
    rate, rows = rng.choice([25.0, 50.0]), 160
    speed = rng.uniform(0.02, 1.0)
    place = wander(rng, rows, 1.0 / rate, speed, 0.02 * speed / rate)
    at = int(rng.integers(5, rows - 5))
    angle, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.0, 10.0)
    place[at:] += size * np.array([np.cos(angle), np.sin(angle)])
    table = pd.DataFrame({"t": np.arange(rows) / rate, "x": place[:, 0], "y": place[:, 1]})
    if rng.random() < 0.3:  # in a gap, which would be bridged
        table = table.drop(index=range(at, min(at + 3, rows - 1))).reset_index(drop=True)
    with pytest.raises(RecordingError, match=f"row {at}: individual jumps .* than the steps beside it explain"):
        airflock.load_tracks(table, unit="m")
    recording = airflock.load_tracks(table, unit="m", accept="jumps", precision=64)
    there = recording["confidence"].values[:, 0, 0] == 1.0
    assert (
        np.array_equal(places(recording)[0][there], table[["x", "y"]]) and np.isnan(places(recording)[0][~there]).all()
    )
    assert np.nanmax(np.linalg.norm(recording["velocity"].values, axis=1)) < 2.0 * speed


def test_outliers_are_left_out_and_no_sound_row_with_them(rng):
    table, period = school(rng, 1, rng.uniform(0.5, 5.0))
    rows, step = len(table), np.linalg.norm(np.diff(table[["x", "y"]].to_numpy(), axis=0), axis=1).max()
    bad = np.unique(rng.integers(3, rows - 3, 3))
    bad = bad[np.append(True, np.diff(bad) > 1)]  # also every second row
    spoilt = table.copy()
    for row in bad:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        spoilt.loc[row, ["x", "y"]] += rng.uniform(30.0, 300.0) * step * np.array([np.cos(angle), np.sin(angle)])
    recording = airflock.load_tracks(spoilt, unit="m", precision=64)
    line = f"DataFrame: column x, y: fish_0: {len(bad)} outliers left out, first row {bad[0]}"
    assert line in notes(recording)
    sound = np.setdiff1d(np.arange(rows), bad)
    assert np.array_equal(places(recording)[0][sound], truth(table)[0][sound])
    assert np.linalg.norm(places(recording)[0] - truth(table)[0], axis=1).max() < 3.0 * step


def test_identities_exchanged_at_a_few_centimetres_are_told_by_the_noise_alone(rng):
    """Neighbours in a school move farther in a frame or two than they are apart: their own motion hides no exchange."""
    rate, rows, noise = rng.choice([25.0, 50.0]), int(rng.integers(80, 240)), rng.uniform(0.0, 0.001)
    apart, speed = rng.uniform(0.03, 0.06), rng.uniform(0.05, 0.6)
    shared = wander(rng, rows, 1.0 / rate, speed, 0.0)
    pair = np.stack([shared, shared + [apart, 0.0]]) + rng.normal(0.0, noise, (2, rows, 2))
    at = int(rng.integers(10, rows - 10))
    exchanged = np.concatenate([pair[:, :at], pair[::-1, at:]], axis=1)
    table = pd.DataFrame({
        "t": np.tile(np.arange(rows) / rate, 2), "id": np.repeat(["a", "b"], rows),
        "x": exchanged[..., 0].ravel(), "y": exchanged[..., 1].ravel(),
    })  # fmt: skip
    sound = table.assign(x=pair[..., 0].ravel(), y=pair[..., 1].ravel())
    assert np.array_equal(places(airflock.load_tracks(sound, unit="m", precision=64)), pair)
    with pytest.raises(RecordingError) as error:
        airflock.load_tracks(table, unit="m")
    lines = str(error.value).splitlines()
    assert len(lines) == 2 and all("identities exchanged" in line for line in lines)
    recording = airflock.load_tracks(table, unit="m", accept="jumps", precision=64)
    speeds = np.linalg.norm(recording["velocity"].values, axis=1)
    most = np.linalg.norm(np.diff(pair, axis=1), axis=2).max() * rate
    assert np.nanmax(speeds) <= 1.001 * most


def test_a_bad_row_at_an_end_of_a_track_is_no_reset(rng):
    table, period = school(rng, 1, rng.uniform(0.5, 5.0))
    rows, row = len(table), rng.choice([0, len(table) - 1])
    step = np.linalg.norm(np.diff(table[["x", "y"]].to_numpy(), axis=0), axis=1).max()
    spoilt, angle = table.copy(), rng.uniform(0.0, 2.0 * np.pi)
    # farther than an animal starts in a frame, which would be motion
    size = max(rng.uniform(50.0, 300.0) * step, 300.0 * (3.0 * period) ** 2)
    spoilt.loc[row, ["x", "y"]] += size * np.array([np.cos(angle), np.sin(angle)])
    gone = [row]
    if rng.random() < 0.3:  # and a gap beside it
        gap = [1, 2] if row == 0 else [rows - 3, rows - 2]
        gone, spoilt = [*gone, *gap], spoilt.drop(index=gap)
    recording = airflock.load_tracks(spoilt, unit="m", precision=64)
    assert any("1 outliers left out" in note for note in notes(recording))
    np.testing.assert_array_equal(places(recording)[0], np.delete(truth(table)[0], gone, axis=0))


def test_an_absent_animal_that_is_parked_is_absent(rng):
    table, period = school(rng, 2, rng.uniform(0.5, 5.0))
    table[["x", "y"]] += rng.choice([-1, 1], 2) * rng.uniform(10.0, 20.0, 2)
    rows = len(table) // 2
    begin = rng.choice([0, int(rng.integers(10, rows // 2))])
    end = rows if begin and rng.random() < 0.4 else begin + int(rng.integers(3, rows // 3))
    parked = table["id"].eq("fish_0") & table["t"].between((begin - 0.5) * period, (end - 0.5) * period)
    spot = (0.0, 0.0) if begin == 0 or end == rows or rng.random() < 0.5 else (-1.0, -1.0)
    spoilt = table.assign(x=table["x"].mask(parked, spot[0]), y=table["y"].mask(parked, spot[1]))
    recording = airflock.load_tracks(spoilt, unit="m", bridge=0.0, accept="absent", precision=64)
    assert any("taken as absent" in note and f"row {spoilt.index[parked][0]}" in note for note in notes(recording))
    seen = places(recording)
    assert np.isnan(seen[0][begin:end]).all() and np.array_equal(seen[1], truth(table)[1])
    there = np.setdiff1d(np.arange(rows), np.arange(begin, end))
    assert np.array_equal(seen[0][there], truth(table)[0][there])


def geodetic(rng, rows, rate=5.0):
    lat, lon = rng.uniform(-60.0, 60.0), rng.uniform(-179.0, 179.0)
    place = wander(rng, rows, 1.0 / rate, rng.uniform(2.0, 15.0), 0.0)
    return pd.DataFrame({
        "TimeUS": (1e8 + np.arange(rows) * 1e6 / rate).astype(int),
        "Lat": (lat + place[:, 1] / 111320.0).round(7),
        "Lng": (lon + place[:, 0] / (111320.0 * np.cos(np.radians(lat)))).round(7),
        "Alt": 120.0,
    })  # fmt: skip


def test_latitude_and_longitude_zero_are_no_fix(rng, tmp_path):
    table = geodetic(rng, int(rng.integers(10, 60)))
    first = int(rng.integers(1, 5))
    out = (np.arange(len(table)) < first) | (rng.random(len(table)) < rng.choice([0.0, 0.2]))
    table.assign(Lat=table["Lat"].mask(out, 0.0), Lng=table["Lng"].mask(out, 0.0)).to_csv(tmp_path / "own.csv")
    table[~out].to_csv(tmp_path / "sound.csv", index=False)
    recording, expected = (airflock.load_tracks(tmp_path / name, precision=64) for name in ("own.csv", "sound.csv"))
    assert np.array_equal(places(recording), places(expected), equal_nan=True)
    assert any(
        f"column Lat, Lng: {out.sum()} rows at 0, 0" in note and "first row 2" in note for note in notes(recording)
    )


FLAGS = {  # column → what it holds where a row counts, and where it does not
    "Status": ([3, 4, 6], [0, 1]),
    "fix_type": ([2, 3], [0, 1]),
    "gps:fix-type": (["3D", "2D"], ["none"]),
    "fix": ([1], [0]),
    "fix_quality": ([1, 2, 4], [0]),
    "visible": (["true"], ["false"]),
    "import-marked-outlier": ([None, "false"], ["true"]),
    "likelihood": ([0.61, 0.99, 1.0], [0.0, 0.3, 0.59]),
    "confidence": ([0.9], [0.1]),
    "confidence [%]": ([61, 90, 100], [0, 20, 59]),
    "score": ([70.0, 95.5], [3.0, 41.0]),
    "status": (["A"], ["V"]),
}


def test_rows_that_a_column_rejects_are_left_out(rng, tmp_path):
    table = geodetic(rng, int(rng.integers(40, 120)))
    column = str(rng.choice(list(FLAGS)))
    good, bad = FLAGS[column]
    out = rng.random(len(table)) < 0.2
    out[0] |= rng.random() < 0.5
    if not out.any():
        out[5] = True
    wrong = pd.DataFrame({"Lat": 0.0, "Lng": 0.0}, table.index)
    if rng.random() < 0.5:
        wrong = table[["Lat", "Lng"]] + rng.normal(0.0, 0.05, (len(table), 2))
    own = table.assign(**{name: table[name].mask(out, wrong[name]) for name in wrong})
    own[column] = [(bad if no else good)[rng.integers(len(bad if no else good))] for no in out]
    own.to_csv(tmp_path / "own.csv", index=False)
    table[~out].to_csv(tmp_path / "sound.csv", index=False)
    recording = airflock.load_tracks(tmp_path / "own.csv", precision=64)
    expected = airflock.load_tracks(tmp_path / "sound.csv", precision=64)
    line = f"column {column}: {out.sum()} rows"
    assert any(line in note and f"first row {2 + np.flatnonzero(out)[0]}" in note for note in notes(recording))
    assert np.array_equal(places(recording), places(expected), equal_nan=True)


def test_two_receivers_are_one_drone(rng, tmp_path):
    rows = int(rng.integers(40, 100))
    table = geodetic(rng, rows)
    column = str(rng.choice(["I", "receiver", "gps_id", "instance"]))
    other = table.assign(
        TimeUS=table["TimeUS"] + int(rng.integers(0, 100_000)),
        Lat=table["Lat"] + rng.uniform(1e-5, 5e-5), Lng=table["Lng"] - rng.uniform(1e-5, 5e-5),
    )  # fmt: skip
    primary = 0
    pair = [table.assign(**{column: 0}), other.assign(**{column: 1})]
    if rng.random() < 0.4:  # the second is the one in use
        primary = 1
        pair = [one.assign(U=number) for number, one in enumerate(pair)]
    pd.concat(pair).sort_values("TimeUS", kind="stable").to_csv(tmp_path / "own.csv", index=False)
    pair[primary].drop(columns=[column, "U"], errors="ignore").to_csv(tmp_path / "sound.csv", index=False)
    recording = airflock.load_tracks(tmp_path / "own.csv", precision=64)
    expected = airflock.load_tracks(tmp_path / "sound.csv", precision=64)
    assert recording.sizes["individual"] == 1
    assert np.array_equal(places(recording), places(expected))
    assert any(f"column {column}" in note and f"{primary} is read" in note for note in notes(recording))


def test_names_are_those_of_individuals_not_of_rows_or_tags(rng, tmp_path):
    table, _ = school(rng, int(rng.integers(2, 5)), 1.0)
    extra = {
        "id": np.arange(1000, 1000 + len(table)) if rng.random() < 0.5 else [f"e{k}" for k in range(len(table))],
        "tag-local-identifier": rng.choice(["t1", "t2"], len(table)),
        "name": "school",
    }
    extra = {name: values for name, values in extra.items() if rng.random() < 0.7} or {"id": extra["id"]}
    real = str(rng.choice(["individual-local-identifier", "vehicle_id", "animal", "fish"]))
    own = table.drop(columns="id").assign(**{real: table["id"]}, **extra)
    own = own[rng.permutation(own.columns)]
    own.to_csv(tmp_path / "own.csv", index=False)
    recording = airflock.load_tracks(tmp_path / "own.csv", unit="m", precision=64)
    assert set(recording["individual"].values) == set(table["id"])
    (note,) = (note for note in notes(recording) if f"id from {real}; also there: " in note)
    assert all(name in note for name in extra) and ("id" in extra) == ("id (row number)" in note)


def test_rows_that_are_numbered_are_of_one_individual_or_refused(rng, tmp_path):
    table, _ = school(rng, int(rng.integers(1, 3)), 1.0)
    count = table["id"].nunique()
    numbered = table.assign(id=np.arange(len(table)) + int(rng.integers(0, 1000)))
    path = tmp_path / "own.csv"
    numbered.to_csv(path, index=False)
    if count == 1:
        recording = airflock.load_tracks(path, unit="m", precision=64)
        assert recording.sizes["individual"] == 1 and np.array_equal(places(recording), truth(table))
    else:
        with pytest.raises(RecordingError, match="column id has as many names as rows .* write --map id:=COLUMN"):
            airflock.load_tracks(path, unit="m")


# Sound motion that looks odd.
def burst(rng, rows, period):
    """A fish that darts now and then: speed decays after each start, within several frames or two."""
    speed, decay = np.full(rows, rng.uniform(0.0, 0.05)), np.exp(-period / rng.uniform(0.05, 0.4))
    for start in rng.integers(5, rows - 5, int(rng.integers(1, 8))):
        speed[start:] += rng.uniform(0.3, 2.0) * decay ** np.arange(rows - start)
    heading = np.cumsum(rng.normal(0.0, 0.05, rows))
    return np.cumsum(speed * period * np.array([np.cos(heading), np.sin(heading)]), axis=1).T


def bounce(rng, rows, period):
    """One who turns at walls within a frame."""
    far = rng.uniform(0.3, 1.0, 2) * np.arange(rows)[:, None] * period * rng.uniform(0.5, 3.0) + rng.uniform(
        0.0, 1.0, 2
    )
    return np.abs((far + 1.0) % 4.0 - 2.0)


def hop(rng, rows, period):
    """One who rests and hops, each time within one frame or two."""
    x = np.zeros((rows, 2))
    for start in rng.integers(5, rows - 5, int(rng.integers(2, 20))):
        x[start:] += rng.uniform(-1.0, 1.0, 2) * 0.02 * (25.0 * period) ** 2
    return x


def rest(rng, rows, period):
    """A bird that rests, flies and rests; fixes are minutes or hours apart."""
    x = np.zeros((rows, 2))
    for start in rng.choice(np.arange(5, rows - 5, 5), int(rng.integers(3, 6)), replace=False):
        for late in range(int(rng.integers(1, 4))):
            angle = rng.uniform(0.0, 2.0 * np.pi)
            x[start + late :] += rng.uniform(8.0, 14.0) * period * np.array([np.cos(angle), np.sin(angle)])
    return x


SOUND = {burst: (0.01, 0.02, 0.04), bounce: (0.02, 0.04, 0.1), hop: (0.02, 0.04), rest: (26.0, 60.0, 600.0, 3600.0)}


@pytest.mark.parametrize("motion", SOUND)
def test_sound_motion_is_read_to_the_last_row_and_keeps_its_peaks(rng, motion):
    rows, period = int(rng.integers(60, 400)), rng.choice(SOUND[motion])
    place = motion(rng, rows, period)
    noise = rng.uniform(1.0, 5.0) if motion is rest else rng.choice([0.0, 1e-4, 3e-4])
    place = place + rng.normal(0.0, noise, place.shape) + rng.uniform(-3.0, 3.0, 2)
    table = pd.DataFrame({"t": np.arange(rows) * period, "x": place[:, 0], "y": place[:, 1]})
    speeds = np.gradient(place, period, axis=0)
    table = table.rename(columns={"t": "t [s]", "x": "x [m]", "y": "y [m]"})
    for accept in ((), "jumps"):
        recording = airflock.load_tracks(table, accept=accept, precision=64)
        assert np.array_equal(places(recording)[0], place) and (recording["confidence"] == 1.0).all()
        seen = recording["velocity"].transpose("individual", "time", "space", "keypoint").values[0, ..., 0]
        np.testing.assert_allclose(seen, speeds, rtol=1e-6, atol=1e-6 * np.abs(speeds).max())


def test_drones_that_hop_with_a_lagging_estimate_are_read(rng):
    """Velocities lag by a filter, heights and climbs differ, and the log is slow; the units of PX4 are fixed."""
    rows, period, lag = int(rng.integers(100, 400)), rng.choice([0.05, 0.1, 0.2]), rng.uniform(0.0, 0.15)
    fine = np.arange(0.0, rows * period, 0.01)
    wish = np.zeros((len(fine), 3))
    for start in rng.integers(50, len(fine) - 100, int(rng.integers(1, 5))):
        wish[start : start + int(rng.integers(50, 300))] += rng.uniform(-6.0, 6.0, 3) * [1.0, 1.0, 0.3]
    speed = np.zeros_like(wish)
    seen = np.zeros_like(wish)
    for k in range(1, len(fine)):
        speed[k] = speed[k - 1] + np.clip((wish[k] - speed[k - 1]) / 0.3, -8.0, 8.0) * 0.01
        seen[k] = seen[k - 1] + (speed[k] - seen[k - 1]) * (0.01 / (0.01 + lag))
    place = np.cumsum(speed, axis=0) * 0.01 + [0.0, 0.0, -20.0]
    rows_at = (np.arange(rows) * period / 0.01).round().astype(int)
    noise = rng.uniform(0.001, 0.01)
    x, v = place[rows_at] + rng.normal(0.0, noise, (rows, 3)), seen[rows_at] + rng.normal(0.0, noise, (rows, 3))
    v[:, 2] *= rng.uniform(0.8, 1.25)
    columns = dict(zip(("x", "y", "z", "vx", "vy", "vz"), np.hstack([x, v]).T, strict=True))
    table = pd.DataFrame({"timestamp": (1e7 + np.arange(rows) * period * 1e6).astype(int), "xy_valid": 1, **columns})
    recording = airflock.load_tracks(table, precision=64)
    np.testing.assert_array_equal(places(recording)[0], x[:, [1, 0, 2]] * [1.0, 1.0, -1.0])
    assert (recording["confidence"] == 1.0).all()


@pytest.mark.usefixtures("scored_plainly")
@pytest.mark.parametrize("period", [26.0, 60.0, 3600.0, 86400.0])
def test_fixes_minutes_or_hours_apart_are_scored_as_they_stand(tmp_path, seed, period):
    rng = np.random.default_rng(seed)
    place = 1000.0 * np.arange(3)[:, None, None] * [1.0, 0.0] + np.cumsum(rng.normal(0.0, 30.0, (3, 50, 2)), axis=1)
    table = pd.DataFrame({
        "time [s]": np.repeat(np.arange(50) * period, 3), "id": ["a", "b", "c"] * 50,
        "x [m]": place[:, :, 0].T.ravel(), "y [m]": place[:, :, 1].T.ravel(),
    })  # fmt: skip
    recording = airflock.load_tracks(table, precision=64)
    scores = airflock.score(recording).iloc[0]
    velocity = np.gradient(place, period, axis=1)
    assert scores["phi_vel"] == pytest.approx(np.linalg.norm(velocity, axis=2).mean(), rel=1e-4)
    assert scores["r_min"] == pytest.approx(least_distance(place), rel=1e-6)
    heading = velocity / np.linalg.norm(velocity, axis=2, keepdims=True)
    assert scores["polarisation"] == pytest.approx(np.linalg.norm(heading.mean(axis=0), axis=1).mean(), rel=1e-4)
    line = between_frames_note(recording, scenario_of_recording(recording))
    assert f"frames are {period:g} s apart" in line and "straight lines" in line
    assert len(airflock.over_time(recording)) == 50


def test_presence_is_that_of_the_file_and_with_bridged_gaps(scored_plainly):
    t = np.arange(100) * 0.1
    table = pd.DataFrame({"t": t, "x": t, "y": 0.0})
    table = pd.concat([table.assign(id="a"), table.assign(id="b", y=1.0).drop(index=range(40, 45))])
    scores = airflock.score(airflock.load_tracks(table)).iloc[0]
    assert "present" not in scores and scores["present_measured"] == pytest.approx(1.0 - 5 / 200)
    scores = airflock.score(airflock.load_tracks(table, bridge=0.0)).iloc[0]
    assert scores["present"] == pytest.approx(1.0 - 5 / 200) and "present_measured" not in scores


def test_as_many_names_as_rows_end_in_one_line(tmp_path):
    rows = 100_000
    table = pd.DataFrame({"t": np.arange(rows) * 0.1, "id": [f"a{k}" for k in range(rows)], "x": 0.0, "y": 0.0})
    table.to_csv(tmp_path / "many.csv", index=False)
    with pytest.raises(RecordingError) as error:
        airflock.load_tracks(tmp_path / "many.csv")
    assert str(error.value).count("\n") == 0 and "column id has as many names as rows" in str(error.value)


def test_rows_that_are_rejected_can_be_kept(tmp_path):
    table = pd.DataFrame({"t": np.arange(40) * 0.1, "x": np.arange(40) * 0.1, "y": 0.0, "likelihood": 0.5})
    with pytest.raises(RecordingError, match="column likelihood: no row counts; to read them all, write --accept rows"):
        airflock.load_tracks(table, unit="m")
    recording = airflock.load_tracks(table, unit="m", accept="rows")
    assert recording.sizes["time"] == 40 and any(
        "40 rows less likely than 0.6 kept" in line for line in notes(recording)
    )


def test_rows_alone_between_gaps_are_counted():
    t = np.r_[np.arange(30) * 10.0, 300.0 + 37.3 * np.arange(1, 6), 530.0 + np.arange(30) * 10.0]
    table = pd.DataFrame({"t [s]": t, "x [m]": t, "y [m]": 0.0})
    alone = int(((np.diff(t[:-1]) > 15.0) & (np.diff(t[1:]) > 15.0)).sum())
    assert alone == 5 and any(
        "row 30: individual has rows alone" in note and "(5 in all)" in note and "--bridge 38" in note
        for note in notes(airflock.load_tracks(table))
    )
    recording = airflock.load_tracks(table, bridge=38.0)  # as the note says
    assert not any("rows alone" in note for note in notes(recording))
    there = recording["confidence"].values[:, 0, 0] > 0.0
    np.testing.assert_allclose(places(recording)[0][there, 0], recording["time"][there], atol=1e-3)


def test_confidence_of_poses_rejects_rows_and_that_of_airflock_does_not():
    dims, t = ("time", "space", "individual"), np.arange(50) * 0.1
    sure = np.where(np.arange(50) % 10 == 5, 0.2, 0.9)[:, None]
    place = np.stack([t, 0.0 * t], axis=1)[:, :, None]
    place[sure[:, 0] < 0.5] += 7.0
    coordinates = {"time": t, "space": ["x", "y"], "individual": ["mouse"]}
    variables = {"position": (dims, place, {"units": "m"}), "confidence": (("time", "individual"), sure)}
    poses = xr.Dataset(variables, coordinates, {"time_unit": "seconds", "source_software": "DeepLabCut"})
    recording = airflock.load_tracks(poses, precision=64)
    assert any(
        "column confidence: 5 rows less likely than 0.6 left out, first row 5" in note for note in notes(recording)
    )
    np.testing.assert_allclose(places(recording)[0][:, 0], t, atol=1e-9)
    again = airflock.load_tracks(recording, precision=64)  # the frames that were bridged have a confidence of 0.5
    assert np.array_equal(places(again), places(recording))


def test_the_first_of_several_filters_is_read(tmp_path):
    t = np.arange(100) * 0.1
    own = pd.DataFrame({"TimeUS": (t * 1e6).astype(int), "C": 0, "PN": 3.0 * t, "PE": 0.5 * t, "PD": -10.0})
    pd.concat([own, own.assign(C=1, PN=own["PN"] + 4.0)]).sort_values("TimeUS").to_csv(
        tmp_path / "xkf1.csv", index=False
    )
    recording = airflock.load_tracks(tmp_path / "xkf1.csv", precision=64)
    np.testing.assert_allclose(places(recording)[0], np.stack([0.5 * t, 3.0 * t, 0.0 * t + 10.0], axis=1), atol=1e-9)
    assert any("column C" in note and "0 is read, the first" in note for note in notes(recording))
