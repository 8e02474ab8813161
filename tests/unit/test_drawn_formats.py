"""Tracks as programs of the field write them, drawn at random: the motion that was written, or one line that asks."""

import json
import re
import struct
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr
from typer.testing import CliRunner

import airflock
from airflock.cli.main import app
from airflock.core import installed
from airflock.recordings import imports
from airflock.recordings.imports import common_frame
from airflock.support.errors import RecordingError

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "_ext"))
import kinds  # noqa: E402
import writing  # noqa: E402

DRAWN = 50
OF_HDF5 = 6  # each starts a process


class Truth:
    """A few individuals on circles: times (row,), s; places and velocities (row, individual, 2), m and m/s."""

    def __init__(self, rng, *, rate=None, count=None, size=1.0):
        self.rate = rate or float(rng.choice([2.0, 4.0, 5.0, 10.0, 20.0, 25.0]))
        self.t = np.arange(int(rng.integers(40, 80))) / self.rate
        count = count or int(rng.integers(2, 5))
        radius, speed = size * rng.uniform(3.0, 30.0, count), size * rng.uniform(1.0, 8.0, count)
        turn = rng.choice([-1.0, 1.0], count) * speed / radius
        angle = rng.uniform(0.0, 6.3, count) + turn * self.t[:, None]
        centre = size * rng.uniform(-20.0, 20.0, (count, 2))
        self.place = centre + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        self.velocity = (turn * radius)[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        self.names = [f"bird_{k}" for k in range(count)]

    def long(self, t="t", x="x", y="y", name="id", times=None, scale=1.0):
        times = self.t if times is None else times
        return pd.DataFrame({
            t: np.repeat(times, len(self.names)), name: np.tile(self.names, len(self.t)),
            x: scale * self.place[..., 0].ravel(), y: scale * self.place[..., 1].ravel(),
        })  # fmt: skip

    def check(self, found, atol=1e-3, names=None):
        """Require that a recording holds exactly this motion."""
        place = found["position"].transpose("time", "individual", "space", "keypoint").values[..., 0]
        assert place.shape[:2] == self.place.shape[:2]
        np.testing.assert_allclose(found["time"].values, self.t, atol=1e-5)
        if names is not None:
            assert list(found["individual"].values) == names
        np.testing.assert_allclose(place[..., :2], self.place, atol=atol)


def write(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def csv(tmp_path, table, name="tracks.csv", **options):
    table.to_csv(tmp_path / name, index=False, **options)
    return tmp_path / name


def rows(cells, separator=","):
    return "\n".join(separator.join(map(str, row)) for row in cells) + "\n"


def notes_of(found):
    return json.loads(found.attrs["airflock_import"])["notes"]


def refusal(source, **options):
    with pytest.raises(RecordingError) as error:
        airflock.load_tracks(source, **options)
    return str(error.value)


# Each kind writes a truth in a file, and returns it with the options that its user would write.
KINDS = {}


def kind(make):
    KINDS[make.__name__] = make
    return make


@kind
def ticks_since_1970(rng, tmp_path):
    truth = Truth(rng)
    unit = rng.choice([1.0, 1e3, 1e6, 1e9])
    begin = int(rng.integers(800_000_000, 2_000_000_000))
    ticks = [int(begin * unit) + round(t * unit) if unit > 1.0 else begin + t for t in truth.t]
    header = rng.choice(["timestamp", "time", "t", "utc"])
    return truth, csv(tmp_path, truth.long(t=header, x="x_m", y="y_m", times=np.array(ticks))), {}


@kind
def date_beside_time(rng, tmp_path):
    truth = Truth(rng, rate=1.0, size=1.0)
    begin = pd.Timestamp("2026-01-01") + pd.Timedelta(seconds=int(rng.integers(0, 86400 * 300)))
    form = str(rng.choice(["%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%Y%m%d"]))
    step = int(rng.choice([1, 60, 1200, 3600, 86400 // 4]))
    when = begin + pd.to_timedelta(np.repeat(truth.t * step, len(truth.names)).round(), unit="s")
    truth.t = truth.t * step
    table = truth.long(x="x_m", y="y_m").drop(columns="t")
    table.insert(0, rng.choice(["Date", "UTC_Date", "gps-date"]), when.strftime(form))
    table.insert(
        int(rng.integers(0, 2)),
        rng.choice(["Time", "time"]),
        when.strftime("%H:%M:%S" if step < 60 or rng.random() < 0.5 else "%H:%M"),
    )
    return truth, csv(tmp_path, table), {}


@kind
def clock_over_midnight(rng, tmp_path):
    truth = Truth(rng, rate=1.0)
    begin = 86400 - int(rng.integers(1, len(truth.t)))
    clock = [f"{s // 3600 % 24:02d}:{s // 60 % 60:02d}:{s % 60:02d}" for s in (begin + truth.t).astype(int)]
    return truth, csv(tmp_path, truth.long(t="Time", x="x_m", y="y_m", times=np.array(clock))), {}


@kind
def one_corrupt_stamp(rng, tmp_path):
    truth = Truth(rng, count=1)
    since = float(rng.choice([0.0, 1.7e9]))
    times, row = truth.t + since, int(rng.integers(1, len(truth.t) - 1))
    times[row] = (
        rng.choice([0.0, 1e9, times[-1] + 5e4, -1e5]) if since == 0.0 else rng.choice([0.0, 1e10, times[-1] + 5e4])
    )
    if times[row] == since == 0.0 and row < 21:
        times[row] = 1e9
    truth.corrupt = row
    return truth, csv(tmp_path, truth.long(x="x_m", y="y_m", times=times)), {}


@kind
def a_row_that_came_late(rng, tmp_path):
    truth = Truth(rng, count=1)
    table = truth.long(x="x_m", y="y_m")
    row, place = int(rng.integers(1, 15)), int(rng.integers(37, len(table)))
    late = table.iloc[[row]]
    rest = table.drop(index=row)
    return truth, csv(tmp_path, pd.concat([rest.iloc[:place], late, rest.iloc[place:]])), {}


@kind
def array_of_npz(rng, tmp_path):
    truth = Truth(rng)
    name = str(rng.choice(["positions", "pos", "xy", "tracks", "position", "trajectories"]))
    others = {"names": np.array(["a", None], object)} if rng.random() < 0.3 else {}
    others |= {"velocities": truth.velocity, "a": truth.place * 2.0, "headings": truth.place[..., 0], "n": np.array(3)}
    members = [*others.items(), (name, truth.place)]
    order = rng.permutation(len(members))
    np.savez(tmp_path / "sim.npz", **{members[k][0]: members[k][1] for k in order})
    return truth, tmp_path / "sim.npz", {"fps": truth.rate, "unit": "m"}


@kind
def npz_of_one_individual(rng, tmp_path):
    truth = Truth(rng, count=1)
    x, y = 100.0 * truth.place[:, 0].T
    members = {"frame": np.arange(len(truth.t)), "time": truth.t, "X#wcentroid (cm)": x, "Y#wcentroid (cm)": y}
    members |= {"SPEED (cm/s)": truth.t, "frame_segments": np.zeros((3, 2))}
    np.savez(tmp_path / "fish0.npz", **members)
    return truth, tmp_path / "fish0.npz", {}


@kind
def matlab(rng, tmp_path):
    truth = Truth(rng)
    if rng.random() < 0.5:
        scipy.io.savemat(tmp_path / "sim.mat", {"v": truth.velocity, "pos": truth.place, "dt": 1.0 / truth.rate})
    else:
        scipy.io.savemat(tmp_path / "sim.mat", {"X": truth.place[..., 0], "Y": truth.place[..., 1], "dt": 0.1})
    return truth, tmp_path / "sim.mat", {"fps": truth.rate, "unit": "m"}


@kind
def matlab_since_7_3(rng, tmp_path):
    import h5py

    truth = Truth(rng)
    with h5py.File(tmp_path / "sim.mat", "w", userblock_size=512) as file:
        file["positions"], file["speeds"] = truth.place.T, truth.place[..., 0].T
    with open(tmp_path / "sim.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    return truth, tmp_path / "sim.mat", {"fps": truth.rate, "unit": "m"}


@kind
def sleap_analysis(rng, tmp_path):
    import h5py

    truth = Truth(rng)
    nodes = np.stack([truth.place / 0.01 + 5.0, truth.place / 0.01], axis=2)  # frame, individual, node, axis
    with h5py.File(tmp_path / "a.analysis.h5", "w") as file:
        file["tracks"], file["node_names"] = nodes.transpose(1, 3, 2, 0), np.array([b"nose", b"thorax"])
        file["track_names"], file["track_occupancy"] = np.array([n.encode() for n in truth.names]), np.ones((3, 2))
        file["edge_inds"], file["provenance"] = np.zeros((1, 2), int), "{}"
    return truth, tmp_path / "a.analysis.h5", {"fps": truth.rate, "unit": "px", "scale": 0.01, "keypoint": "thorax"}


@kind
def sleap_csv(rng, tmp_path):
    truth = Truth(rng)
    frames, count = len(truth.t), len(truth.names)
    x, y = truth.place.reshape(-1, 2).T / 0.01
    table = pd.DataFrame({
        "track": np.tile(truth.names, frames), "frame_idx": np.repeat(np.arange(frames), count), "instance.score": 0.9,
        "leg1.x": x + 7.0, "leg1.y": y, "leg1.score": 0.4, "thorax.x": x, "thorax.y": y, "thorax.score": 0.4,
    })  # fmt: skip
    options = {"fps": truth.rate, "unit": "px", "scale": 0.01, "keypoint": "thorax"}
    return truth, csv(tmp_path, table, "labels.csv"), options


@kind
def deeplabcut(rng, tmp_path):
    several = bool(rng.random() < 0.5)
    truth = Truth(rng, count=None if several else 1)
    heads = [["scorer"], ["individuals"], ["bodyparts"], ["coords"]]
    columns = []
    for k, name in enumerate(truth.names):
        for part, shift in (("head", 0.0), ("tail", 9.0)):
            own = truth.place[:, k] / 0.002 + shift
            for coord, values in (("x", own[:, 0]), ("y", own[:, 1]), ("likelihood", np.full(len(own), 0.99))):
                for head, cell in zip(heads, ("DLC_r50", name, part, coord), strict=True):
                    head.append(cell)
                columns.append(values)
    heads = heads if several else [heads[0], *heads[2:]]
    path = write(tmp_path / "videoDLC.csv", rows([*heads, *np.column_stack([np.arange(len(truth.t)), *columns])]))
    return truth, path, {"fps": truth.rate, "unit": "px", "scale": 0.002, "keypoint": "head"}


@kind
def ethovision(rng, tmp_path):
    truth = Truth(rng, count=1)
    separator, unit = str(rng.choice([";", "\t"])), str(rng.choice(["cm", "mm", "m"]))
    factor, point = {"cm": 100.0, "mm": 1000.0, "m": 1.0}[unit], str(rng.choice([".", ","]))
    above = [
        ['"Experiment"', '"Fish"'],
        ['"Trial name"', '"Trial 1"'],
        *[[f'"Variable {k}"', '"a"'] for k in range(rng.integers(0, 30))],
        [],
    ]
    head = ['"Trial time"', '"Recording time"', '"X center"', '"Y center"', '"Area"', '"Velocity"', ""]
    units = ['"s"', '"s"', f'"{unit}"', f'"{unit}"', '"cm²"', '"cm/s"', ""]
    text = [['"Number of header lines:"', f'"{len(above) + 3}"'], *above, head, units]
    for k, t in enumerate(truth.t):
        place = [f"{factor * value:.6f}" for value in truth.place[k, 0]]
        cells = [f"{t:.3f}", f"{t:.3f}", *place, "1.2", "-" if k == 0 else "1.6", ""]
        text.append([cell.replace(".", point) for cell in cells])
    encoding = str(rng.choice(["utf-8-sig", "utf-16", "utf-8"]))
    path = write(tmp_path / "ethovision.txt", rows(text, separator), encoding)
    return truth, path, {"decimal": ","} if point == "," else {}


@kind
def netlogo(rng, tmp_path):
    truth = Truth(rng)
    above = ['"BehaviorSpace results (NetLogo 6.4.0)"', '"Flocking.nlogo"', '"experiment"', '"05/04/2026 10:00:00:000"',
             '"min-pxcor","max-pxcor","min-pycor","max-pycor"', '"-35","35","-35","35"']  # fmt: skip
    head = '"[run number]","population","[step]","who","xcor","ycor"'
    body = [
        [1, 3, k, name, *map(repr, map(float, truth.place[k, i]))]
        for k in range(len(truth.t))
        for i, name in enumerate(truth.names)
    ]
    path = write(tmp_path / "flocking.csv", "\n".join([*above, head]) + "\n" + rows(body))
    return truth, path, {"fps": truth.rate, "unit": "m"}


@kind
def trackmate(rng, tmp_path):
    truth = Truth(rng)
    table = truth.long(t="POSITION_T", x="POSITION_X", y="POSITION_Y", name="TRACK_ID", scale=1e6)
    table.insert(0, "LABEL", [f"ID{k}" for k in range(len(table))])
    table["TRACK_ID"], table["FRAME"] = table["TRACK_ID"].str.removeprefix("bird_"), 1
    heads = [["Label", "T", "Track ID", "X", "Y", "Frame"], ["Label", "T", "Track ID", "X", "Y", "Frame"],
             ["", "(sec)", "", "(micron)", "(micron)", ""]]  # fmt: skip
    order = [
        list(table.columns).index(c) for c in ("LABEL", "POSITION_T", "TRACK_ID", "POSITION_X", "POSITION_Y", "FRAME")
    ]
    table = table.iloc[:, order]
    path = write(tmp_path / "spots.csv", rows([table.columns, *heads, *table.to_numpy()]))
    return truth, path, {}


@kind
def trex_csv(rng, tmp_path):
    truth = Truth(rng, count=1)
    place = 100.0 * truth.place[:, 0]
    table = pd.DataFrame({"frame": np.arange(len(truth.t)), "time": truth.t, "X#wcentroid (cm)": place[:, 0],
                          "Y#wcentroid (cm)": place[:, 1], "SPEED#wcentroid (cm/s)": 1.0})  # fmt: skip
    return truth, csv(tmp_path, table, "fish0.csv"), {}


@kind
def crazyflie_client(rng, tmp_path):
    truth = Truth(rng, count=1)
    table = pd.DataFrame({"Timestamp": (rng.integers(1000, 90000) + 1e3 * truth.t).round().astype(int)})
    for c, axis in enumerate("xy"):
        table[f"stateEstimate.{axis}"] = truth.place[:, 0, c]
        table[f"stateEstimate.v{axis}"] = truth.velocity[:, 0, c]
    return truth, csv(tmp_path, table, "Position-20260504.csv"), {}


WORDS = {
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e3, "msec": 1e3, "millisecond": 1e3, "milliseconds": 1e3,
             "usec": 1e6, "microseconds": 1e6, "centisec": 1e2, "min": 1 / 60, "minutes": 1 / 60, "hours": 1 / 3600},
    "length": {"m": 1.0, "meters": 1.0, "metres": 1.0, "meter": 1.0, "cm": 100.0, "centimeters": 100.0, "mm": 1e3,
               "millimetres": 1e3, "feet": 1 / 0.3048, "ft": 1 / 0.3048, "foot": 1 / 0.3048, "inches": 1 / 0.0254,
               "km": 1e-3, "micron": 1e6, "µm": 1e6},
    "speed": {"m/s": 1.0, "m/sec": 1.0, "mph": 1 / 0.44704, "kts": 3600 / 1852, "knots": 3600 / 1852, "km/h": 3.6,
              "kph": 3.6, "cm/s": 100.0, "ft/s": 1 / 0.3048},
}  # fmt: skip


@kind
def words_of_units(rng, tmp_path):
    truth = Truth(rng)
    time, length, speed = (str(rng.choice(list(words))) for words in WORDS.values())
    form = str(rng.choice(["{} [{}]", "{} ({})", "{}({})"]))
    if rng.random() < 0.3 and "/" not in speed:
        form = "{}_{}"
    table = truth.long(form.format("Time", time), form.format("x", length), form.format("y", length),
                       times=truth.t * WORDS["time"][time], scale=WORDS["length"][length])  # fmt: skip
    if form != "{}_{}" or rng.random() < 0.5:
        for c, axis in enumerate("xy"):
            table[form.format(f"v{axis}", speed)] = WORDS["speed"][speed] * truth.velocity[..., c].ravel()
    return truth, csv(tmp_path, table), {}


@kind
def names_that_need_quotes(rng, tmp_path):
    truth = Truth(rng)
    joint = str(rng.choice(["-", ".", " "]))
    east, north, who = (
        joint.join(words) for words in (["pos", "east"], ["pos", "east", "n"], ["individual", "local", "name"])
    )
    table = truth.long(x=east, y=north, name=who, scale=100.0).assign(pos=1.0, east=2.0 if joint == "." else 0.0)
    if joint == "-":
        table = table.drop(columns="pos")
    quote = rng.random() < 0.5
    x, y = (f"'{name}'" if quote else name for name in (east, north))
    return truth, csv(tmp_path, table), {"map": {"id": who, "x": f"{x}*0.01", "y": f"0.01*({y})", "t": "t"}}


@kind
def rows_that_end_with_a_delimiter(rng, tmp_path):
    truth = Truth(rng)
    lines = truth.long(x="x_m", y="y_m").to_csv(index=False).splitlines()
    end = "," * int(rng.integers(1, 3))
    return truth, write(tmp_path / "a.csv", "\n".join([lines[0], *(line + end for line in lines[1:])]) + "\n"), {}


@kind
def names_without_one_for_the_row(rng, tmp_path):  # as write.table of R writes
    truth = Truth(rng)
    table = truth.long(x="x_m", y="y_m")
    lines = [
        ",".join(table.columns),
        *(f'"{k}",{line}' for k, line in enumerate(table.to_csv(index=False).splitlines()[1:], 1)),
    ]
    return truth, write(tmp_path / "a.csv", "\n".join(lines) + "\n"), {}


@kind
def frames_by_map(rng, tmp_path):
    truth = Truth(rng)
    header = str(rng.choice(["frame", "Frame", "frame_idx"]))
    table = truth.long(t=header, x="x_mm", y="y_mm", name="fish", times=np.arange(len(truth.t)), scale=1000.0)
    unit = {"unit": "mm"} if rng.random() < 0.5 else {}
    if rng.random() < 0.3:
        table, unit = (
            table.rename(columns={"x_mm": "x", "y_mm": "y", header: "k"}),
            {"unit": "mm", "time_unit": "frames"},
        )
    time = "k" if "k" in table else header
    return truth, csv(tmp_path, table), {"map": {"t": time, "id": "fish"}, "fps": truth.rate, **unit}


@kind
def dataflash_of_a_plane(rng, tmp_path):
    """Messages of the filters EKF3 or EKF2, of two cores, or POS; source of the layout: AP_Logger/LogStructure.h."""
    pytest.importorskip("pymavlink")
    truth = Truth(rng, count=1)
    kind = str(rng.choice(["XKF1", "NKF1"]))
    columns = "TimeUS,C,VN,VE,VD,PN,PE,PD" if kind == "XKF1" else "TimeUS,VN,VE,VD,PN,PE,PD"
    form = "QBffffff" if kind == "XKF1" else "Qffffff"
    head = struct.pack(
        "<BB4s16s64s", 130, 3 + struct.calcsize("<" + form), kind.encode(), form.encode(), columns.encode()
    )
    fmt = struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    log = [b"\xa3\x95\x80" + fmt, b"\xa3\x95\x80" + head]
    for k, t in enumerate(truth.t):
        (east, north), (ve, vn) = truth.place[k, 0], truth.velocity[k, 0]
        for core in (0, 1) if kind == "XKF1" else (0,):
            number = [core] if kind == "XKF1" else []
            place = (vn, ve, 0.0, north + 3.0 * core, east, -30.0)
            log.append(b"\xa3\x95\x82" + struct.pack("<" + form, round(8e7 + 1e6 * t), *number, *place))
    (tmp_path / "plane.bin").write_bytes(b"".join(log))
    return truth, tmp_path / "plane.bin", {}


SLOW = {"dataflash_of_a_plane", "matlab", "matlab_since_7_3", "sleap_analysis"}


@pytest.mark.parametrize("name", KINDS)
def test_a_drawn_file_is_read_as_the_motion_that_it_holds(tmp_path, name):
    for seed in range(OF_HDF5 if name in SLOW else DRAWN):
        print(name, "seed", seed)  # noqa: T201
        truth, path, options = KINDS[name](np.random.default_rng(seed), tmp_path)
        found = airflock.load_tracks(path, precision=64, **options)
        if name == "one_corrupt_stamp":
            told = [note for note in notes_of(found) if "corrupt time" in note]
            assert (
                len(told) == 1
                and f"column t: 1 rows of bird_0 with a corrupt time left out, first row {truth.corrupt + 2} "
                in told[0]
            )
            assert found["confidence"].values[truth.corrupt, 0, 0] < 1.0
            truth.check(found, atol=5.0)
            continue
        truth.check(found)


@pytest.mark.parametrize(("row", "stamp"), [(0, 5e4), (0, 1e10), (-1, 0.05), (-1, -1e5)])
def test_a_corrupt_time_of_the_first_or_last_row_is_left_out(row, stamp):
    table = Truth(np.random.default_rng(4), rate=10.0, count=1).long(x="x_m", y="y_m")
    plain = airflock.load_tracks(table.drop(index=table.index[row]))
    table.loc[table.index[row], "t"] = stamp
    found = airflock.load_tracks(table)
    assert np.array_equal(found["position"], plain["position"])
    assert any("1 rows of bird_0 with a corrupt time left out" in note for note in notes_of(found))


# Questions: nothing in the file decides, so that nothing may be assumed.
QUESTIONS = {}


def question(make):
    QUESTIONS[make.__name__] = make
    return make


@question
def degrees_in_x_and_y(rng, tmp_path):
    t = np.arange(60) * float(rng.choice([1.0, 60.0, 600.0]))
    speed, heading = rng.uniform(0.2, 20.0), rng.uniform(0.0, 6.3)
    lat, lon = rng.uniform(-60.0, 60.0), rng.uniform(-179.0, 179.0)
    move = speed * t / 111e3
    x, y = (lon + move * np.cos(heading) / np.cos(np.radians(lat))).round(7), (lat + move * np.sin(heading)).round(7)
    table = pd.DataFrame({"id": 1, "t": t, "X": x, "Y": y})
    return csv(tmp_path, table), {}, 'degrees? Write --map "lon:=' if abs(lon) <= 90.0 else "degrees? Write"


@question
def array_of_individuals_first(rng, tmp_path):
    truth = Truth(rng, count=int(rng.choice([1, 2, 5, 200])))
    np.save(tmp_path / "a.npy", truth.place.swapaxes(0, 1))
    return tmp_path / "a.npy", {"fps": 10.0, "unit": "m"}, "individuals first? Exchange the axes"


@question
def array_of_individuals_on_a_grid_first(rng, tmp_path):
    grid = rng.uniform(2.0, 9.0) * np.array([[col, row] for row in range(2) for col in range(4)])
    path = 0.1 * rng.uniform(0.5, 3.0) * np.arange(200)[:, None, None] * np.array([1.0, rng.uniform(0.1, 1.0)])
    np.save(tmp_path / "a.npy", (grid + path).swapaxes(0, 1))
    return tmp_path / "a.npy", {"fps": 10.0, "unit": "m"}, "individuals first? Exchange the axes"


@kind
def array_of_more_individuals_than_frames(rng, tmp_path):
    truth = Truth(rng, count=int(rng.integers(100, 200)))
    np.save(tmp_path / "a.npy", truth.place)
    return truth, tmp_path / "a.npy", {"fps": truth.rate, "unit": "m"}


@question
def arrays_without_a_known_name(rng, tmp_path):
    truth = Truth(rng)
    names = rng.permutation(["a", "data", "run1"])[: rng.integers(2, 4)] if rng.random() < 0.7 else ["velocities"]
    np.savez(tmp_path / "a.npz", **{name: truth.place * k for k, name in enumerate(names, 1)})
    return tmp_path / "a.npz", {"fps": 10.0, "unit": "m"}, "write --map position:=NAME"


@question
def days_or_months_first(rng, tmp_path):
    truth = Truth(rng, rate=1.0, count=1)
    day, month = rng.permutation(np.arange(1, 13))[:2]
    table = truth.long(t="Time", x="x_m", y="y_m", times=np.array([f"10:00:{k % 60:02d}" for k in range(len(truth.t))]))
    return (
        csv(tmp_path, table[:60].assign(Date=f"{day:02d}/{month:02d}/2026")),
        {},
        "may have the day or the month first; write --time-unit dmy, or --time-unit mdy",
    )


@question
def dates_beside_numbers(rng, tmp_path):
    truth = Truth(rng, count=1)
    dates = np.where(truth.t < truth.t[5], "2026-05-04", "2026-05-05")
    return (
        csv(tmp_path, truth.long(t="Time", x="x_m", y="y_m").assign(Date=dates)),
        {},
        "holds several dates beside column Time, whose",
    )


@question
def ticks_of_an_unknown_clock(rng, tmp_path):
    truth = Truth(rng)
    ticks = (6.5e11 + truth.t * 1e9).astype(int)  # nanoseconds since a boot
    return csv(tmp_path, truth.long(x="x_m", y="y_m", times=ticks)), {}, "has no unit; as ms since 1970"


@question
def centimetres_without_a_unit(rng, tmp_path):
    truth = Truth(rng, size=2.0)
    table = truth.long(scale=100.0)
    if rng.random() < 0.5:
        for c, axis in enumerate("xy"):
            table[f"v{axis}"] = 100.0 * truth.velocity[..., c].ravel()
    return csv(tmp_path, table), {}, "cm or mm? Write --unit cm"


@question
def rate_of_frames_beside_seconds(rng, tmp_path):
    return csv(tmp_path, Truth(rng).long(x="x_m", y="y_m")), {"fps": 25.0}, "--fps 25.0: of no use"


@question
def frames_without_a_rate(rng, tmp_path):
    truth = Truth(rng)
    table = truth.long(t="frame", x="x_m", y="y_m", times=np.arange(len(truth.t)))
    return (
        csv(tmp_path, table),
        {"map": {"t": "frame"}} if rng.random() < 0.5 else {},
        "counts frames; say how many a second",
    )


@question
def headings_in_the_place_of_heights(rng, tmp_path):
    truth = Truth(rng, rate=10.0)
    (x, y), (later_x, later_y) = truth.velocity[0].T[:2], truth.velocity[1].T[:2]
    turn = np.sign(x * later_y - y * later_x)
    course = np.arctan2(truth.velocity[..., 1], truth.velocity[..., 0])
    course += rng.normal(0.0, rng.uniform(0.0, 0.2), course.shape)
    assert turn.any()
    angle = rng.choice([1.0, -1.0]) * course + rng.choice([0.0, np.pi / 2.0])
    angle = angle % (2.0 * np.pi) if rng.random() < 0.5 else (angle + np.pi) % (2.0 * np.pi) - np.pi
    angle = np.degrees(angle) if rng.random() < 0.5 else angle
    np.save(tmp_path / "a.npy", np.concatenate([truth.place, angle[..., None]], axis=-1))
    return tmp_path / "a.npy", {"fps": 10.0, "unit": "m"}, "goes as headings do"


@kind
def array_in_space(rng, tmp_path):
    """Heights that rise, fall and turn with the motion are no headings."""
    truth = Truth(rng)
    phase = rng.uniform(0.2, 2.0) * truth.t[:, None] + rng.uniform(0.0, 6.3, len(truth.names))
    height = rng.uniform(0.5, 200.0) + rng.uniform(0.1, 5.0) * np.sin(phase) + rng.uniform(-1.0, 1.0) * truth.t[:, None]
    height += rng.normal(0.0, 0.01, height.shape)
    np.save(tmp_path / "a.npy", np.concatenate([truth.place, height[..., None]], axis=-1))
    return truth, tmp_path / "a.npy", {"fps": truth.rate, "unit": "m"}


@question
def minutes_without_a_unit(rng, tmp_path):
    truth = Truth(rng, rate=float(rng.choice([10.0, 20.0, 25.0])))
    table = truth.long(t=rng.choice(["t", "time"]), x="x_m", y="y_m", times=truth.t / 60.0)
    return (
        csv(tmp_path, table),
        {},
        "flies or films: Write --time-unit min; or if times are days",
    )


@question
def thousandths_without_a_unit(rng, tmp_path):
    truth = Truth(rng, rate=float(rng.choice([2.0, 5.0, 10.0, 20.0])))
    unit, factor = [("ms", 1e3), ("us", 1e6)][rng.integers(2)]
    x, y, options = [("x_m", "y_m", {}), ("x", "y", {"unit": "m"})][rng.integers(2)]  # without any, they may be degrees
    table = truth.long(t=rng.choice(["timestamp", "time"]), x=x, y=y, times=(factor * truth.t).astype(int))
    return csv(tmp_path, table), options, f"{unit}? Write --time-unit {unit}; if they are seconds"


def received(rng):
    """Two receivers of one drone, some metres and milliseconds apart."""
    truth = Truth(rng, count=1)
    table = truth.long(x="x_m", y="y_m").drop(columns="id")
    shift = rng.uniform(-2.0, 2.0, 2)
    late = float(rng.choice([0.0, 0.4])) / truth.rate
    other = table.assign(t=table["t"] + late, x_m=table["x_m"] + shift[0], y_m=table["y_m"] + shift[1])
    header, names = str(rng.choice(["device_id", "device", "receiver_name"])), [("a", "b"), (7, 4)][rng.integers(2)]
    both = [table.assign(**{header: names[0]}), other.assign(**{header: names[1]})]
    return truth, pd.concat(both).sort_values("t", kind="stable"), header, sorted(names, key=str) == list(names)


@question
def receivers_by_an_unknown_name(rng, tmp_path):
    _, table, header, _ = received(rng)
    return csv(tmp_path, table), {}, f"at the same times: write --map receiver:={header} if they are receivers"


@kind
def receivers_by_map(rng, tmp_path):
    first = False
    while not first:  # numbers are read in their order, names in that of the rows
        truth, table, header, first = received(rng)
    return truth, csv(tmp_path, table), {"map": {"receiver": header}}


LETTERS = (["A", "B", "C"], ["C", "V", "U"], ["leader", "follower", "Stray"])


def pairs_of_columns(rng, truth):
    names = LETTERS[rng.integers(len(LETTERS))]
    table = {"t_s": truth.t}
    for k, name in enumerate(names):
        table |= {f"{name}_{axis}_m": truth.place[:, k, c] for c, axis in enumerate("xy")}
    return names, pd.DataFrame(table)


@question
def pairs_of_columns_by_letters(rng, tmp_path):
    names, table = pairs_of_columns(rng, Truth(rng, count=3))
    words = f"has 3 keypoints ({', '.join(names)}); choose one: --keypoint {names[0]}; or if each is an individual"
    return csv(tmp_path, table), {}, words


@question
def pairs_of_columns_in_several_units(rng, tmp_path):
    names, table = pairs_of_columns(rng, Truth(rng, count=3))
    table = table.rename(columns={f"{names[2]}_x_m": f"{names[2]}_x_cm"})
    return csv(tmp_path, table), {"map": {"id": "columns"}}, f"column {names[2]}_x_cm: its unit is not that of others"


@kind
def pairs_of_columns_by_map(rng, tmp_path):
    truth = Truth(rng, count=3)
    truth.names, table = pairs_of_columns(rng, truth)
    return truth, csv(tmp_path, table), {"map": {"id": "columns"}}


@kind
def times_named_by_their_unit(rng, tmp_path):
    truth = Truth(rng)
    unit = str(rng.choice(["seconds", "minutes", "hours", "milliseconds", "msecs"]))
    words = WORDS["time"] | {"msecs": 1e3}
    return truth, csv(tmp_path, truth.long(t=unit, x="x_m", y="y_m", times=truth.t * words[unit])), {}


@kind
def dates_in_an_order_that_is_given(rng, tmp_path):
    truth = Truth(rng, rate=1.0)
    day, month, order = int(rng.integers(1, 13)), int(rng.integers(1, 13)), str(rng.choice(["dmy", "mdy"]))
    when = pd.Timestamp(2026, month, day, 10) + pd.to_timedelta(truth.t, unit="s")
    form = str(rng.choice(["%d/%m/%Y", "%d-%m-%Y"]))
    form = form if order == "dmy" else form[3:5] + form[2] + form[:2] + form[5:]
    if rng.random() < 0.5:
        table = truth.long(t="time", x="x_m", y="y_m", times=when.strftime(f"{form} %H:%M:%S").to_numpy())
    else:
        table = truth.long(t="Time", x="x_m", y="y_m", times=when.strftime("%H:%M:%S").to_numpy())
        table["Date"] = np.repeat(when.strftime(form).to_numpy(), len(truth.names))
    return truth, csv(tmp_path, table), {} if day == month and form[0] == "%" else {"time_unit": order}


@kind
def hour_that_comes_twice(rng, tmp_path):
    """Local times without a zone, in the night in which summer time ends."""
    zone, night = [("Europe/Budapest", "2026-10-25 00:30"), ("America/New_York", "2026-11-01 05:30"),
                   ("Australia/Sydney", "2026-04-04 15:30")][rng.integers(3)]  # fmt: skip
    truth = Truth(rng, rate=1.0)
    step = int(rng.choice([1, 60, 300, 1800, 3600]))
    begin = pd.Timestamp(night, tz="UTC") - pd.Timedelta(seconds=step * int(rng.integers(1, 30)))
    truth.t = truth.t * step
    local = (begin + pd.to_timedelta(truth.t, unit="s")).tz_convert(zone).tz_localize(None)
    if rng.random() < 0.5:
        table = truth.long(t="timestamp", x="x_m", y="y_m", times=local.strftime("%Y-%m-%d %H:%M:%S").to_numpy())
    else:
        table = truth.long(t="Time", x="x_m", y="y_m", times=local.strftime("%H:%M:%S").to_numpy())
        table["Date"] = np.repeat(local.strftime("%Y-%m-%d").to_numpy(), len(truth.names))
    return truth, csv(tmp_path, table), {}


@question
def keypoints_of_one_body(rng, tmp_path):
    truth = Truth(rng, count=1)
    x, y = truth.place[:, 0].T
    table = pd.DataFrame({"t": truth.t, "head.x": x, "head.y": y, "tail.x": x, "tail.y": y})
    return csv(tmp_path, table), {"unit": "m"}, "has 2 keypoints (head, tail); choose one: --keypoint head"


@pytest.mark.parametrize("name", QUESTIONS)
def test_what_a_drawn_file_does_not_decide_is_asked_in_one_line(tmp_path, name):
    for seed in range(DRAWN):
        print(name, "seed", seed)  # noqa: T201
        path, options, words = QUESTIONS[name](np.random.default_rng(seed), tmp_path)
        line = refusal(path, **options)
        assert words in line and len(line.splitlines()) == 1 and ("of no use" in line or line.startswith(str(path)))


def meridian(lat):
    """Distance from the equator along a meridian of WGS84, m, by quadrature of its radius of curvature."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = np.radians(lat)[..., None] / 2.0
    phi = half * (nodes + 1.0)
    radius = 6378137.0 * (1.0 - 0.00669437999014) / (1.0 - 0.00669437999014 * np.sin(phi) ** 2) ** 1.5
    return (radius * weights * half).sum(axis=-1)


@pytest.mark.parametrize("logged", [False, True])
def test_speeds_and_distances_of_a_migration_are_those_on_the_ellipsoid(tmp_path, logged):
    for seed in range(DRAWN):
        print("seed", seed)  # noqa: T201
        rng = np.random.default_rng(seed)
        step, speed = float(rng.choice([600.0, 3600.0])), rng.uniform(5.0, 20.0)
        t = step * np.arange(int(rng.integers(40, 120)))
        grid = np.linspace(-89.0, 89.0, 4001)
        begin = rng.uniform(-40.0, 40.0)
        sign = -np.sign(begin)
        lat = np.interp(meridian(np.array(begin)) + sign * speed * t, meridian(grid), grid)
        lat -= (
            np.vectorize(lambda x: meridian(np.array(x)))(lat) - meridian(np.array(begin)) - sign * speed * t
        ) / 111e3
        lon = rng.uniform(-180.0, 180.0)
        ahead = lat + 0.05
        table = pd.concat(
            [pd.DataFrame({"id": name, "t": t, "lat": own, "lon": lon}) for name, own in (("a", lat), ("b", ahead))]
        )
        if logged:
            table = table.assign(vx=0.0, vy=sign * speed)
        found = airflock.load_tracks(table, precision=64)
        moved = np.linalg.norm(found["velocity"].values, axis=1)
        np.testing.assert_allclose(moved, speed, rtol=1e-3)
        place = found["position"].values[:, :, 0]
        apart = np.linalg.norm(place[:, :, 1] - place[:, :, 0], axis=1)
        truth = np.array([meridian(np.array(b)) - meridian(np.array(a)) for a, b in zip(lat, ahead, strict=True)])
        np.testing.assert_allclose(apart, truth, rtol=1e-6)
        assert any("z drops with the curvature of the earth" in note for note in notes_of(found))


def test_axes_at_many_places_are_those_at_each():
    rng = np.random.default_rng(3)
    lat, lon = rng.uniform(-89.0, 89.0, 20), rng.uniform(-180.0, 180.0, 20)
    every = common_frame.enu_axes(lat, lon)
    for k in range(20):
        assert np.array_equal(every[..., k], common_frame.enu_axes(lat[k], lon[k]))
        np.testing.assert_allclose(every[..., k] @ every[..., k].T, np.eye(3), atol=1e-15)


# Advice: what a message says to write is written, until the file is taken; then it must hold the truth.
FAULTS = {}


def faulty(make):
    FAULTS[make.__name__] = make
    return make


def flown(rng, **columns):
    """One drone in three dimensions; header → column of the truth times a factor, and the table of it."""
    truth = Truth(rng, rate=20.0, count=1)
    climb = 0.6 * np.sin(0.5 * truth.t)
    x, y = truth.place[:, 0].T
    vx, vy = truth.velocity[:, 0].T
    truth.height = 30.0 + 1.2 * (1.0 - np.cos(0.5 * truth.t))
    return truth, {"t": truth.t, "x": x, "y": y, "z": truth.height, "vx": vx, "vy": vy, "vz": climb}


@faulty
def speeds_down_by_an_expression(rng):
    truth, own = flown(rng)
    table = {**{k: own[k] for k in ("t", "x", "y", "z", "vx", "vy")}, "VD_cm": 100.0 * own["vz"]}
    return truth, table, {"map": {"vz": "-VD_cm/100"}}


@faulty
def heights_down(rng):
    truth, own = flown(rng)
    return truth, own | {"z": -own["z"]}, {}


@faulty
def heights_down_of_a_log_that_stands(rng):
    truth, own = flown(rng)
    stand = np.arange(3 * len(truth.t)) * 0.05
    table = {
        name: np.concatenate([np.full(len(stand), values[0] if name in "xy" else 0.0), values])
        for name, values in own.items()
    }
    table["t"] = np.concatenate([stand, stand[-1] + 0.05 + truth.t])
    low = np.minimum(own["z"] - 15.0, own["t"] * 4.0)
    table["z"] = -np.concatenate([0.0 * stand, low])
    for name in ("vx", "vy", "vz"):
        del table[name]
    truth.t, truth.height = table["t"], -table["z"]
    truth.place = np.stack([table["x"], table["y"]], axis=-1)[:, None]
    return truth, table, {"accept": ["jumps"]}


@faulty
def heights_and_speeds_down(rng):
    truth, own = flown(rng)
    return truth, own | {"z": -own["z"], "vz": -own["vz"]}, {}


@faulty
def north_east_down(rng):
    truth, own = flown(rng)
    table = {
        "t": own["t"],
        "x": own["y"],
        "y": own["x"],
        "z": -own["z"],
        "vx": own["vy"],
        "vy": own["vx"],
        "vz": -own["vz"],
    }
    truth.x_is_north = True
    return truth, table, {}


@faulty
def positions_in_a_small_unit(rng):
    truth, own = flown(rng)
    factor = float(rng.choice([100.0, 1000.0]))
    return truth, own | {name: factor * own[name] for name in "xyz"}, {}


@faulty
def speeds_in_a_small_unit(rng):
    truth, own = flown(rng)
    factor = float(rng.choice([100.0, 3.6]))
    return truth, own | {name: factor * own[name] for name in ("vx", "vy", "vz")}, {}


@faulty
def times_without_a_unit(rng):
    truth, own = flown(rng)
    table = {name: own[name] for name in ("t", "x", "y", "z")}
    return truth, table | {"t": own["t"] * float(rng.choice([1e3, 1 / 60]))}, {"unit": "m"}


@faulty
def times_in_a_small_unit(rng):
    truth, own = flown(rng)
    return truth, own | {"t": own["t"] * float(rng.choice([1e3, 1e6]))}, {}


@faulty
def everything_in_centimetres(rng):
    truth, own = flown(rng)
    scale = max(1.0, 2.0 / float(np.abs(truth.velocity).max()))
    truth.place, truth.height = truth.place * scale, truth.height * scale
    return truth, {name: values if name == "t" else 100.0 * scale * values for name, values in own.items()}, {}


@faulty
def degrees_times_1e7(rng):
    truth, own = flown(rng)
    origin = (rng.uniform(-60, 60), rng.uniform(-170, 170), 0.0)
    ecef = common_frame.to_ecef(*origin) + np.stack(
        [own["x"], own["y"], 0.0 * own["x"]], axis=1
    ) @ common_frame.enu_axes(*origin[:2])
    lon = np.degrees(np.arctan2(ecef[:, 1], ecef[:, 0]))
    lat = np.degrees(np.arctan2(ecef[:, 2], (1.0 - common_frame.ECCENTRICITY2) * np.hypot(ecef[:, 0], ecef[:, 1])))
    truth.height = None
    return truth, {"t": own["t"], "lat": np.round(lat * 1e7), "lon": np.round(lon * 1e7)}, {"origin": origin}


def followed(line, options):
    """Return the options with what the first way that a message names says to write."""
    told = re.search(r"(?:write|Write)(?!.*(?:write|Write).*no unit) (.+)", line)[1]
    told = re.split(r"; |, or | or \*|\. | \(", told)[0]
    options = {**options, "map": dict(options.get("map", {}))}
    for name, text in re.findall(r"--([a-z-]+) (\"[^\"]*\"|\S+)", told):
        text = text.strip('"')
        if name == "map":
            target, expression = text.split(":=")
            options["map"][target] = expression
        else:
            options[name.replace("-", "_")] = {"fps": float}.get(name, str)(text)
    return options


@pytest.mark.parametrize("name", FAULTS)
def test_advice_that_is_followed_ends_right(tmp_path, name):
    for seed in range(DRAWN):
        truth, table, options = FAULTS[name](np.random.default_rng(seed))
        path = csv(tmp_path, pd.DataFrame(table), "log.csv")
        print(name, "seed", seed)  # noqa: T201
        for _ in range(6):
            try:
                found = airflock.load_tracks(path, precision=64, **options)
                break
            except RecordingError as error:
                found = None
                line = str(error).splitlines()[0]
                print(line)  # noqa: T201
                knows = "--axes ned if x is north" in line and hasattr(truth, "x_is_north")
                options = {"axes": "ned"} if knows else followed(line, options)
        assert found is not None
        truth.check(found, atol=0.02 if name == "degrees_times_1e7" else 1e-3)
        if truth.height is not None:
            np.testing.assert_allclose(found["position"].values[:, 2, 0, 0], truth.height, atol=1e-3)
        if "vz" in table:
            np.testing.assert_allclose(
                found["velocity"].values[3:-3, 2, 0, 0], np.gradient(truth.height, truth.t)[3:-3], atol=0.05
            )


# Options: each one with each kind of source is of use, or refused in a line that names it.
def sources(tmp_path):
    """Return kind of source → source, options that it needs; each has a gap, and two individuals where it can."""
    import h5py

    truth = Truth(np.random.default_rng(7), rate=10.0, count=2)
    gap = np.r_[0:20, 25 : len(truth.t)]
    keep = np.isin(np.repeat(np.arange(len(truth.t)), 2), gap)
    metres = truth.long(x="x_m", y="y_m")[keep]
    place = truth.place.copy()
    place[20:25] = np.nan
    geo = truth.long(x="lon", y="lat", scale=1e-5)[keep]
    since = truth.long(x="x_m", y="y_m", times=truth.t + 1.7e9)[keep]
    frames = truth.long(t="frame", x="x_px", y="y_px", times=np.arange(len(truth.t)), scale=100.0)[keep]
    pose = np.stack([place, place + 1.0], axis=2).transpose(0, 3, 2, 1)  # time, space, keypoint, individual
    coords = {"time": truth.t, "space": ["x", "y"], "keypoint": ["head", "tail"], "individual": truth.names}
    dataset = {"position": (tuple(coords), pose, {"units": "m"})}
    np.save(tmp_path / "a.npy", place)
    np.savez(tmp_path / "a.npz", positions=place, velocities=2.0 * place)
    scipy.io.savemat(tmp_path / "a.mat", {"positions": place})
    with h5py.File(tmp_path / "t.h5", "w") as file:
        file["trajectories"] = place
    metres.to_parquet(tmp_path / "a.parquet")
    log = KINDS["dataflash_of_a_plane"](np.random.default_rng(2), tmp_path)[1]
    return {
        "bin": (log, {}),
        "csv": (csv(tmp_path, metres), {}),
        "csv of bare numbers": (csv(tmp_path, metres.rename(columns={"x_m": "x", "y_m": "y"}), "bare.csv"), {}),
        "csv of frames": (csv(tmp_path, frames, "frames.csv"), {"fps": 10.0, "scale": 0.01}),
        "csv of fixes": (csv(tmp_path, geo, "geo.csv"), {}),
        "csv of dates": (csv(tmp_path, since, "since.csv"), {}),
        "parquet": (tmp_path / "a.parquet", {}),
        "DataFrame": (metres, {}),
        "array": (place, {"fps": 10.0, "unit": "m"}),
        "npy": (tmp_path / "a.npy", {"fps": 10.0, "unit": "m"}),
        "npz": (tmp_path / "a.npz", {"fps": 10.0, "unit": "m"}),
        "mat": (tmp_path / "a.mat", {"fps": 10.0, "unit": "m"}),
        "idtracker": (tmp_path / "t.h5", {"fps": 10.0, "unit": "m"}),
        "Dataset": (xr.Dataset(dataset, coords, {"time_unit": "seconds"}), {"keypoint": "head"}),
    }


VALUES = {
    "map": [{"x": "2*x_m"}, {"frame": "id"}, {"position": "velocities"}], "unit": ["cm", "px"], "scale": [0.5],
    "time_unit": ["ms", "frames"], "fps": [20.0], "keypoint": ["tail"], "axes": ["ned", "enu"],
    "origin": [(10.0, 20.0, 0.0), (0.0, 0.0, 5.0)], "rate": [7.0],
    "bridge": [0.0], "begin": [1.0], "end": [2.0], "decimal": [","], "delimiter": [";", "tab"], "precision": [64],
}  # fmt: skip


# Options that say what the file says as well.
AGREES = {
    ("csv of frames", "unit", "px"),
    ("csv of fixes", "axes", "enu"),
    ("bin", "axes", "enu"),
    ("bin", "bridge", 0.0),
} | {(name, "time_unit", "frames") for name in ("csv of frames", "array", "npy", "npz", "mat", "idtracker")}


@pytest.fixture(scope="module")
def plainly_read(tmp_path_factory):
    """Each source with the options that it needs, and what is read of it without any other."""
    known = sources(tmp_path_factory.mktemp("sources"))
    return {name: (source, needs, airflock.load_tracks(source, **needs)) for name, (source, needs) in known.items()}


@pytest.mark.parametrize("option", VALUES)
def test_an_option_is_of_use_or_refused_whatever_the_source(plainly_read, option):
    for name, (source, needs, plain) in plainly_read.items():
        for value in VALUES[option]:
            print(name, option, value)  # noqa: T201
            try:
                found = airflock.load_tracks(source, **{**needs, option: value})
            except RecordingError as error:
                lines = str(error).splitlines()
                words = (f"--{option.replace('_', '-')}", option, "column", "decimal", "pixels", "counts frames")
                assert any(word in line for line in lines for word in words), lines
                continue
            frame = {key: value for key, value in found.attrs.items() if key != "airflock_import"}
            before = {key: value for key, value in plain.attrs.items() if key != "airflock_import"}
            same = found.equals(plain) and frame == before and found["position"].dtype == plain["position"].dtype
            assert not same or (name, option, value) in AGREES, (
                f"{name}: {option} = {value} changes nothing, and nothing is said"
            )


def test_a_window_of_files_with_dates_counts_from_the_first_row():
    table = Truth(np.random.default_rng(1), rate=1.0).long(x="x_m", y="y_m")
    plain = airflock.load_tracks(table, begin=10.0, end=20.0)
    dates = airflock.load_tracks(table.assign(t=table["t"] + 1.7e9), begin=10.0, end=20.0)
    assert np.array_equal(plain["position"], dates["position"]) and dates.sizes["time"] == 11
    assert any("--begin and --end count from the first row" in note for note in notes_of(dates))


@pytest.mark.parametrize("text", ["=1+1", "@SUM(1)", "+cmd", "-2+3", "\t=1", " =1", "-2+3"])
def test_no_exported_name_is_a_formula(tmp_path, text):
    found = airflock.load_tracks(Truth(np.random.default_rng(1), count=2).long(x="x_m", y="y_m"))
    found = found.assign_coords(individual=[text, "ok"])
    airflock.export(found, tmp_path / "a.csv")
    names = [line.split(",")[0].strip('"') for line in (tmp_path / "a.csv").read_text().splitlines()]
    assert f"'{text}" in names and "ok" in names and not any(name[:1] in "=+-@\t " for name in names)


@pytest.mark.parametrize("rate", [1e5, 1e7, 1e8])
def test_a_rate_that_nobody_means_is_refused_in_one_line(rate):
    table = Truth(np.random.default_rng(1), rate=20.0).long(x="x_m", y="y_m")
    line = refusal(table, rate=rate)
    assert line.startswith(f"--rate {rate:g}: ") and line.endswith("write --rate 2e+04 or less")


# Formats: a reader in one file is in the import, the help, the docs and the errors.
READER = """
from pathlib import Path
import numpy as np
from airflock.recordings.imports import reader
from airflock.recordings.imports.track import ImportedTrack

@reader("diary of a bird", suffixes=(".bird",), sniff=lambda start: start.startswith(b"BIRD"), needs="patience")
def read_diary(path, options, findings):
    \"""Time and place, a row each.\"""
    t, x, y = np.loadtxt(path, skiprows=1).T
    return [ImportedTrack("robin", str(path), t, {"x": x, "y": y}, np.arange(len(t)))]
"""


def forget_formats():
    imports.formats.cache_clear()
    installed.cache_clear()


@pytest.fixture(params=["beside", "package"])
def diary(request, tmp_path, monkeypatch):
    """A file of a format that one file reads, which lies beside the others or in an installed package."""
    folder = tmp_path / "site"
    if request.param == "beside":
        folder.mkdir()
        monkeypatch.setattr(imports, "__path__", [*imports.__path__, str(folder)])
        monkeypatch.setattr(imports.__spec__, "submodule_search_locations", imports.__path__)
        file, module = folder / "diary.py", "airflock.recordings.imports.diary"
    else:
        (folder / "aviary" / "readers").mkdir(parents=True)
        for package in ("aviary", "aviary/readers"):
            (folder / package / "__init__.py").touch()
        (folder / "aviary-1.0.dist-info").mkdir()
        (folder / "aviary-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: aviary\nVersion: 1.0\n")
        (folder / "aviary-1.0.dist-info" / "entry_points.txt").write_text("[airflock.parts]\naviary = aviary\n")
        monkeypatch.syspath_prepend(folder)
        file, module = folder / "aviary" / "readers" / "diary.py", "aviary.readers.diary"
    file.write_text(READER)
    forget_formats()
    yield file
    forget_formats()
    for name in (module, "aviary", "aviary.readers"):
        sys.modules.pop(name, None)


def test_a_reader_in_one_file_works_at_once(diary, tmp_path, monkeypatch):
    truth = Truth(np.random.default_rng(3), count=1)
    rows = np.column_stack([truth.t, truth.place[:, 0]])
    for name in ("a.bird", "a.dat"):  # the second by its first bytes
        np.savetxt(tmp_path / name, rows, header="BIRD", comments="")
        found = airflock.load_tracks(tmp_path / name, precision=64)
        truth.check(found, names=["robin"])
    assert ".bird (diary of a bird)" in refusal(write(tmp_path / "a.xlsx", "no table"))
    assert "is no diary of a bird" in refusal(write(tmp_path / "b.bird", "t x y"))
    with pytest.raises(RecordingError, match="holds tracks, not a recording"):
        airflock.load_recording(tmp_path / "a.bird")
    help = CliRunner().invoke(app, ["import", "--help"], env={"COLUMNS": "400"}).output
    assert ".bird (diary of a bird)" in help and ".ulg (PX4 ULog)" in help
    monkeypatch.setattr(writing, "OUT", tmp_path)
    kinds.formats()
    row = "| `.bird` | diary of a bird | Time and place, a row each. | patience |"
    assert row in (tmp_path / "formats.md").read_text()


def test_a_reader_that_cannot_be_read_is_left_out_with_its_name(diary, tmp_path):
    if diary.parent.name == "readers":
        diary.write_text("\n@reader(\n")
        forget_formats()
        with pytest.warns(UserWarning, match=r"aviary: aviary\.readers: .*diary\.py.* its readers are left out"):
            known = imports.formats()
        assert "PX4 ULog" in {one.name for one in known}


def test_every_format_says_what_is_read_and_no_two_share_an_ending_without_a_sniffer():
    endings = [ending for one in imports.formats() for ending in one.suffixes if one.load().sniff is None]
    assert len(endings) == len(set(endings)) and {".csv", ".ulg", ".nc", ".npy"} <= set(endings)
    assert all(one.about.endswith((".", "which")) for one in imports.formats())
