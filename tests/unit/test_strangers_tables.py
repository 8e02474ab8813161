"""Tables as strangers have them: remarks above, blanks between columns, clocks of hours; one motion in all of them."""

import numpy as np
import pytest
import xarray as xr

import airflock
from airflock.support.errors import RecordingError
from airflock.view.trajectory_plots import trajectories

TIMES = np.arange(40) * 0.5


def place(t, number):
    return 3.0 * number + t, 0.25 * t * t


def rows(cells, separator=","):
    return "\n".join(separator.join(map(str, row)) for row in cells) + "\n"


def long(separator=",", write=repr):
    cells = [[write(t), n, *map(write, place(t, n))] for t in map(float, TIMES) for n in (1, 2)]
    return rows(cells, separator)


def clock(t):
    return f"{int(t) // 3600:02d}:{int(t) // 60 % 60:02d}:{t % 60:06.3f}"


def comma(number):
    return repr(number).replace(".", ",")


PAIRS = rows([[t, *place(t, 1), *place(t, 2)] for t in TIMES])
WRITTEN = {
    "plain": ("t,id,x,y\n" + long(), {}),
    "remarks above": ("# a tracker, version 3\n# tank 2\nt,id,x,y\n" + long(), {}),
    "names in a remark": ("# a tracker\n# t,id,x,y\n" + long(), {}),
    "of NumPy": ("# t id x y\n" + long(" "), {}),
    "blanks": ("t  id  x  y\n" + long("   "), {}),
    "of a spreadsheet": ("sep=;\nt;id;x;y\n" + long(";", comma), {"decimal": ","}),
    "clock": ("t,id,x,y\n" + rows([[clock(t), n, *place(t, n)] for t in map(float, TIMES) for n in (1, 2)]), {}),
    "dates": (
        "Zeit,id,x,y\n" + rows([[f"2026-05-04T10:{clock(t)[3:]}", n, *place(t, n)] for t in TIMES for n in (1, 2)]),
        {"map": {"t": "Zeit"}},
    ),
    "wide, number last": ("t,x1,y1,x2,y2\n" + PAIRS, {}),
    "wide, name first": ("t,fish1_x,fish1_y,fish2_x,fish2_y\n" + PAIRS, {}),
}  # fmt: skip


def tracks(tmp_path, text, **options):
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    return airflock.load_tracks(path, precision=64, **options)


def refused(tmp_path, text, **options):
    with pytest.raises(RecordingError) as fault:
        tracks(tmp_path, text, **options)
    (line,) = str(fault.value).splitlines()
    return line


@pytest.mark.parametrize("written", WRITTEN)
def test_however_a_table_is_written_it_tells_the_same_motion(tmp_path, written):
    text, options = WRITTEN[written]
    found = tracks(tmp_path, text, **options)["position"].transpose("individual", "time", "space", "keypoint")
    expected = [np.stack(place(TIMES, n), axis=1) for n in (1, 2)]
    np.testing.assert_allclose(found.values[..., 0], expected, rtol=0.0, atol=1e-9)


def test_rows_are_counted_as_an_editor_does_also_below_remarks(tmp_path):
    assert "column x, row 5: 'fast'" in refused(tmp_path, "# one\n# two\nt,x,y\n0,1,2\n1,fast,2\n")
    assert "row 3: 1,5 has a decimal comma" in refused(tmp_path, "sep=;\nt;x;y\n0;1,5;2\n")


def test_a_row_of_units_and_a_time_that_is_none_say_what_to_write(tmp_path):
    found = tracks(tmp_path, "t,x,y\n,mm,mm\n" + rows([[t, 1e3 * t, 2e3] for t in TIMES]))
    np.testing.assert_allclose(found["position"].values[:, 0, 0, 0], TIMES)
    assert "row 2 holds the units of the columns" in found.attrs["airflock_import"]
    assert "'mm' is a unit; write it into the header" in refused(tmp_path, "t,x,y\n0,1,2\n,mm,mm\n")
    line = refused(tmp_path, "t,x,y\n04.05.2026 10:00,1,2\n")
    assert "is no time; write seconds, hours:minutes:seconds, or dates" in line


def test_degrees_times_1e7_are_read_as_the_fault_says_to_write(tmp_path):
    lat, lon = 47.5 + 1e-5 * TIMES, 19.04 + 1e-5 * TIMES
    cells = [[t, n, round(a * 1e7), round(b * 1e7)] for t, a, b in zip(TIMES, lat, lon, strict=True) for n in (1, 2)]
    text = "t,id,lat,lon\n" + rows(cells)
    line = refused(tmp_path, text)  # once for the file, not once for each individual
    assert line.endswith('write --map "lat:=lat*1e-7" --map "lon:=lon*1e-7"')
    assert refused(tmp_path, text, map={"lat": "lat*1e-7"}).endswith('degrees, write --map "lon:=lon*1e-7"')
    found = tracks(tmp_path, text, map={"lat": "lat*1e-7", "lon": "lon*1e-7"})
    assert float(abs(found["position"]).max()) < 100.0


def test_nothing_is_said_of_satellite_time_where_there_is_none(tmp_path):
    notes = []
    tracks(tmp_path, WRITTEN["wide, number last"][0], say=notes.append)
    assert not [note for note in notes if "GNSS" in note]


def test_places_on_one_body_are_no_individuals(tmp_path):
    text = "t,head_x,head_y,tail_x,tail_y\n" + PAIRS
    assert "has 2 keypoints (head, tail); choose one: --keypoint head" in refused(tmp_path, text)
    found = tracks(tmp_path, text, keypoint="tail")
    assert found.sizes["individual"] == 1
    np.testing.assert_allclose(found["position"].values[:, :, 0, 0], np.stack(place(TIMES, 2), axis=1))
    assert "no position among" in refused(tmp_path, "t,goal_x,goal_y\n" + rows([[t, t, t] for t in TIMES]))


@pytest.mark.parametrize(
    ("header", "options", "labels"),
    [
        ("t,id,x,y", {}, ("x (m)", "y (m)")),
        ("t,id,pos_e,pos_n", {}, ("east (m)", "north (m)")),
        ("t,id,x,y", {"axes": "enu"}, ("east (m)", "north (m)")),
    ],
)
def test_pictures_say_east_only_where_it_is_known(tmp_path, header, options, labels):
    found = tracks(tmp_path, header + "\n" + long(), **options)
    axes = trajectories(found).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == labels


def test_what_is_known_of_axes_is_kept_in_the_file(tmp_path):
    airflock.save(tracks(tmp_path, "t,id,pos_e,pos_n\n" + long()), tmp_path / "tracks.nc")
    found = airflock.load_recording(tmp_path / "tracks.nc")
    assert isinstance(found, xr.Dataset) and trajectories(found).axes[0].get_xlabel() == "east (m)"
