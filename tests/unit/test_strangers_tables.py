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
    line = refused(tmp_path, "t,x,y\nMay 4th 2026,1,2\n")
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


def test_heights_beside_degrees_times_1e7_are_millimetres_as_the_error_says_to_write(tmp_path):
    degrees = [[t, round(475e6 + 100 * t), 190400000, round(120e3 + 500 * t)] for t in TIMES]
    text = "time_boot_s,lat,lon,alt\n" + rows(degrees)
    assert '--map "lon:=lon*1e-7" --map "alt:=alt*1e-3"' in refused(tmp_path, text)
    ways = {"lat": "lat*1e-7", "lon": "lon*1e-7", "alt": "alt*1e-3"}
    height = tracks(tmp_path, text, map=ways)["position"].sel(space="z")
    assert float(np.ptp(height.values)) == pytest.approx(0.5 * TIMES[-1], abs=1e-3)


def test_advice_on_degrees_goes_by_their_size(tmp_path):
    exchanged = "t,lat,lon\n" + rows([[t, 151.2, -33.9 + 1e-5 * t] for t in TIMES])
    assert refused(tmp_path, exchanged).endswith('write --map "lat:=lon" --map "lon:=lat"')
    found = tracks(tmp_path, exchanged, map={"lat": "lon", "lon": "lat"})
    assert float(np.ptp(found["position"].sel(space="y").values)) == pytest.approx(1.109 * TIMES[-1], rel=1e-2)
    minutes = "t,lat,lon\n" + rows([[t, 4730.1 + 1e-3 * t, 1902.5] for t in TIMES])
    assert "degrees and minutes" in refused(tmp_path, minutes)
    assert "1e-7" not in refused(tmp_path, minutes)


@pytest.mark.parametrize(("unit", "seconds", "step"), [("days", 86400, 4), ("days", 86400, 1), ("hours", 3600, 4)])
def test_times_that_make_birds_faster_than_aircraft_are_no_seconds(tmp_path, unit, seconds, step):
    moments = TIMES * step
    text = "time,lat,lon\n" + rows([[f"{45444 + t / seconds:.10f}", 47 + 1e-4 * t, 19] for t in moments])
    line = refused(tmp_path, text)
    assert "column time" in line and "row 2" in line and unit in line and "time*86400" in line
    found = tracks(tmp_path, text, map={"t": f"time*{seconds}"})
    assert float(found["velocity"].sel(space="y").median()) == pytest.approx(11.1, rel=0.02)


@pytest.mark.parametrize(
    "header",
    ["datetime,particle,x,y", "Date Time,particle,easting,northing", "t,id,Easting [m],Northing [m]"],
)
def test_common_names_of_columns_are_known(tmp_path, header):
    found = tracks(tmp_path, header + "\n" + long())
    np.testing.assert_allclose(found["position"].values[:, :, 0, 1], np.stack(place(TIMES, 2), axis=1))


def test_latitudes_of_satellites_are_known_by_their_name(tmp_path):
    text = "time,GPS Lat,GPS Lon,GPS Alt\n" + rows([[t, 47 + 1e-5 * t, 19, 100] for t in TIMES])
    north = tracks(tmp_path, text)["position"].sel(space="y").values
    assert float(np.ptp(north)) == pytest.approx(1.112 * TIMES[-1], rel=1e-2)


def test_one_place_on_a_body_with_a_score_is_that_of_the_individual(tmp_path):
    text = "t,thorax.x,thorax.y,thorax.score\n" + rows([[t, *place(t, 1), 0.9] for t in TIMES])
    found = tracks(tmp_path, text, unit="m")
    np.testing.assert_allclose(found["position"].values[:, :, 0, 0], np.stack(place(TIMES, 1), axis=1))
    off = [[t, *(place(t, 1) if t != 5.0 else (90.0, 90.0)), 0.9 if t != 5.0 else 0.1] for t in TIMES]
    notes = []
    tracks(tmp_path, "t,nose_x,nose_y,nose_likelihood\n" + rows(off), unit="m", say=notes.append)
    assert any("1 rows less likely than 0.6" in note for note in notes)


def test_clocks_since_switching_on_are_named_where_nobody_is_there_for_long(tmp_path):
    cells = [[f"{t + 500 * n}", n, *place(t, n), 1.7e9 + t] for t in TIMES for n in (1, 2, 3)]
    text = "t,id,x,y,server\n" + rows(cells)
    assert "--map utc:=COLUMN" in refused(tmp_path, text, unit="m")
    assert tracks(tmp_path, text, unit="m", map={"utc": "server"}).sizes["time"] == len(TIMES)


def test_places_that_are_there_but_not_read_are_named(tmp_path):
    notes = []
    deep = "t,x,y,depth [m]\n" + rows([[t, *place(t, 1), 3 + 0.1 * t] for t in TIMES])
    tracks(tmp_path, deep, unit="m", say=notes.append)
    assert """column depth [m] is left out; for a height, write --map "z:=-'depth [m]'\"""" in " ".join(notes)
    found = tracks(tmp_path, deep, unit="m", map={"z": "-'depth [m]'"}, accept="down")
    assert float(found["velocity"].sel(space="z").mean()) == pytest.approx(-0.1, rel=1e-3)
    twice = "t,lat,lon,x,y\n" + rows([[t, 47 + 1e-5 * t, 19, 50 * t, 0] for t in TIMES])
    tracks(tmp_path, twice, unit="m", say=notes.append)
    assert '--map "lat:=lat" --map "lon:=lon"' in notes[-1] + " ".join(notes)
    found = tracks(tmp_path, twice, map={"lat": "lat", "lon": "lon"})
    assert float(found["velocity"].sel(space="y").mean()) == pytest.approx(1.112, rel=1e-2)


def test_hours_between_dates_of_two_files_ask_for_their_zones(tmp_path):
    for name, hour in (("a", "08"), ("b", "10")):
        text = "timestamp,x,y\n" + rows([[f"2024-06-01T{hour}:{clock(t)[3:]}", *place(t, 1)] for t in TIMES])
        (tmp_path / f"{name}.csv").write_text(text)
    with pytest.raises(RecordingError) as error:
        airflock.load_tracks([tmp_path / "a.csv", tmp_path / "b.csv"], unit="m")
    assert "are of different zones" in str(error.value)


@pytest.mark.parametrize(
    ("column", "first", "later", "left_out"),
    [("status", "invalid", "valid", 6), ("fix", "nofix", "3d", 6), ("fix", range(6), range(6, 40), 0)],
)
def test_a_column_of_fixes_is_read_by_its_words_and_not_if_it_counts_them(tmp_path, column, first, later, left_out):
    words = [*([first] * 6 if isinstance(first, str) else first), *([later] * 34 if isinstance(later, str) else later)]
    text = f"t,lat,lon,{column}\n" + rows([[t, 47 + 1e-5 * t, 19, word] for t, word in zip(TIMES, words, strict=True)])
    notes = []
    assert tracks(tmp_path, text, say=notes.append).sizes["time"] == len(TIMES) - left_out
    assert any(f"column {column}" in note for note in notes)


@pytest.mark.parametrize("apart", [5.0, 20.0, 35.0])
def test_identities_exchanged_in_even_motion_are_a_jump(tmp_path, apart):
    """Positions of simulations have no noise; a step of 2 m a row is none either."""
    cells = [[t, n, 4.0 * t, apart * (n if t < 9.0 else 1 - n)] for t in TIMES for n in (0, 1)]
    with pytest.raises(RecordingError, match="identities exchanged"):
        tracks(tmp_path, "t,id,x,y\n" + rows(cells), unit="m")
    found = tracks(tmp_path, "t,id,x,y\n" + rows(cells), unit="m", accept="jumps")
    assert float(abs(found["velocity"]).max()) == pytest.approx(4.0)


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
