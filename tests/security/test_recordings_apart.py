"""Recordings are opened by a process of their own: one that hangs is ended, and none reaches outside its file."""

import signal
import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from mutations import GOLDEN

import airflock
from airflock.recordings.reader_process import ReaderProcess
from airflock.recordings.simulation import bare_document
from airflock.support.errors import RecordingError


def test_what_another_process_opens_is_what_xarray_opens():
    for name in ("recording.nc", "own_law.nc"):
        with xr.open_dataset(GOLDEN / name, engine="h5netcdf") as opened:
            assert opened.load().identical(ReaderProcess(GOLDEN / name).answer())


def test_this_process_opens_no_hdf5():
    text = (
        f"import sys, airflock\nairflock.load_recording({str(GOLDEN / 'recording.nc')!r})\nprint('h5py' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=120)
    assert done.stdout == "False\n", done.stderr


def test_tracks_of_others_are_opened_apart_as_well(tmp_path):
    xr.open_dataset(GOLDEN / "recording.nc", engine="h5netcdf").load().to_netcdf(tmp_path / "a.h5", engine="h5netcdf")
    text = "import sys, airflock\nfound = airflock.load_tracks({!r}, unit='m')\nprint('h5py' in sys.modules)"
    for name in (str(GOLDEN / "recording.nc"), str(tmp_path / "a.h5")):
        done = subprocess.run([sys.executable, "-c", text.format(name)], capture_output=True, text=True, timeout=120)
        assert done.stdout == "False\n", done.stderr


def test_a_recording_names_no_file_of_code(tmp_path):
    """Laws, bodies, sensors, metrics and faults of one's own are bare names in it."""
    scenario = airflock.load("vasarhelyi_2018/4ms")
    sections = ("model", "body", "sensors", "metrics")
    document = {name: {**scenario.document.get(name, {}), "kind": "/home/someone/own.py"} for name in sections}
    told = bare_document(replace(scenario, document={**document, "faults": [{"kind": "/home/someone/own.py"}]}))
    assert "someone" not in str(told) and str(told).count("'own'") == len(sections) + 1


def test_a_recording_that_hangs_is_given_up():
    path = GOLDEN.parent / "hanging_recording.nc"  # 350 zeroed bytes in an attribute heap: HDF5 goes round and round
    opening = ReaderProcess(path, limit=3.0)
    with pytest.raises(RecordingError, match="could not be opened within 3 s; it may be damaged"):
        opening.answer()
    assert opening.process.returncode in (-signal.SIGXCPU, -signal.SIGKILL)


def test_arrays_that_lie_outside_the_file_are_refused(tmp_path):
    import h5py

    with h5py.File(tmp_path / "outside.nc", "w") as file:
        file.create_dataset("position", (10,), "u1", external=[("/etc/passwd", 0, 10)])
    with h5py.File(tmp_path / "link.nc", "w") as file:
        file["position"] = h5py.ExternalLink("/etc/passwd", "/x")
    with h5py.File(tmp_path / "virtual.nc", "w") as file:
        layout = h5py.VirtualLayout((10,), "u1")
        layout[:] = h5py.VirtualSource("other.nc", "x", (10,))
        file.create_virtual_dataset("position", layout)
    for name, words in (("outside", "another file"), ("link", "link to another file"), ("virtual", "another file")):
        with pytest.raises(RecordingError, match=words):
            airflock.load_recording(tmp_path / f"{name}.nc")


def test_a_small_file_of_enormous_arrays_is_refused(tmp_path):
    import h5netcdf

    with h5netcdf.File(tmp_path / "bomb.nc", "w") as file:
        file.dimensions = {"time": 10**7, "individual": 10**7}
        chunks = {"chunks": (1000, 1000), "compression": "gzip"}
        file.create_variable("position", ("time", "individual"), "f8", **chunks)
    with pytest.raises(RecordingError, match="its arrays take 8e.05 GB; there is room for"):
        airflock.load_recording(tmp_path / "bomb.nc")


def test_a_recording_that_was_changed_says_so(tmp_path):
    flown = airflock.load_recording(GOLDEN / "recording.nc")
    file = airflock.save(flown, tmp_path / "a.nc")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = airflock.load_recording(file)
    again["position"][dict(time=3, individual=1)] += 1.0
    again.to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.warns(UserWarning, match="b.nc: was changed since Airflock wrote it"):
        airflock.load_recording(tmp_path / "b.nc")
    assert np.array_equal(airflock.load_recording(file).position, flown.position)
