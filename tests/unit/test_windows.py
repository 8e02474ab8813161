"""What POSIX alone has is missing, as on Windows: flights, studies, locks, the cache and recordings do without it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from airflock.support import locks

# The modules of others are imported first: they, too, ask for msvcrt to know Windows.
AS_ON_WINDOWS = """
import asyncio, multiprocessing, os, signal, subprocess, sys, tempfile, types
import numba, pandas, typer, xarray, h5netcdf, scipy.io

HELD = {}  # (file, place) -> handle; a handle that was closed holds nothing

def locking(handle, mode, count):
    def file(number):
        try:
            found = os.fstat(number)
        except OSError:
            return None
        return found.st_dev, found.st_ino
    key = (*file(handle), os.lseek(handle, 0, os.SEEK_CUR))
    other = HELD.get(key)
    if other is not None and other != handle and file(other) == key[:2]:
        raise OSError(13, "Permission denied")
    HELD[key] = handle

sys.modules["msvcrt"] = types.SimpleNamespace(LK_NBLCK=2, locking=locking)
for name in ("fcntl", "termios", "resource", "pwd", "grp"):
    sys.modules[name] = None
for name in ("geteuid", "getuid", "uname", "fork", "getloadavg", "sysconf", "sysconf_names", "readv",
             "sched_getaffinity", "O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_NOCTTY"):
    if hasattr(os, name):
        delattr(os, name)
if hasattr(os, "process_cpu_count"):  # what Python 3.13 makes it where nobody tells the own processors
    os.process_cpu_count = os.cpu_count
del signal.SIGXCPU
"""


def run_as_on_windows(code, folder):
    """What a program prints where POSIX alone is missing."""
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": ":".join(sys.path), "HOME": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", AS_ON_WINDOWS + code], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout.split()


def test_a_scenario_flies_and_its_recording_is_written_and_read(tmp_path):
    code = """
import airflock
short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
flown = airflock.simulate(short, seed=1, device="python")
airflock.save(flown, "flight.nc")
print(bool((airflock.load_recording("flight.nc").position == flown.position).all()))
print(*sorted(set(os.listdir(".")) - {".cache"}))
"""
    assert run_as_on_windows(code, tmp_path) == ["True", "flight.nc"]


def test_one_writer_at_a_time_opens_a_store(tmp_path):
    code = """
import os
from airflock.support.errors import StudyError
from airflock.runs import flight_store as store
from pathlib import Path
handle = store._lock(Path("."))
try:
    store._lock(Path("."))
except StudyError as fault:
    print("process" in str(fault))
os.close(handle)
os.close(store._lock(Path(".")))
from airflock.engine.numba_private.sealed_cache import folder_lock
with folder_lock(Path(".")) as held, folder_lock(Path("."), timeout=0.0) as twice:
    print(held, twice)
"""
    assert run_as_on_windows(code, tmp_path) == ["True", "True", "False"]


def test_a_study_opens_and_the_cache_is_made(tmp_path):
    code = """
import airflock
from airflock.support import cache
from pathlib import Path
print(cache.cache_folder_error(Path("kept")) == "" and Path("kept/drivers").is_dir())
from airflock.runs.flight_store import FlightStore
Path("study").mkdir()
with FlightStore(Path("study"), write=True) as kept:
    print(Path("study/evaluations.sqlite").exists())
"""
    assert run_as_on_windows(code, tmp_path) == ["True", "True"]


def test_what_was_left_of_a_file_is_removed_and_a_serial_line_is_refused_in_one_line(tmp_path):
    code = """
import os
from airflock.support import atomic
from airflock.support.errors import LinkError
from airflock.drones.onboard.node_program import open_port
left = ".a.airflock-12345678.txt"
open(left, "w").close()
os.utime(left, (0, 0))
atomic.write_file("a.txt", "whole")
print(os.path.exists(left), open("a.txt").read())
try:
    open_port("serial:/dev/ttyUSB0:57600")
except LinkError as fault:
    print(str(fault).count("POSIX"), str(fault).count("\\n"))
"""
    assert run_as_on_windows(code, tmp_path) == ["False", "whole", "1", "0"]


HOLDS = """
import os, sys, time
from airflock.support import locks
locks.lock(os.open(sys.argv[1], os.O_RDWR | os.O_CREAT))
print("held", flush=True)
time.sleep(60.0)
"""


def test_a_lock_ends_with_the_process_that_is_killed(tmp_path):
    path = tmp_path / "lock"
    with subprocess.Popen([sys.executable, "-c", HOLDS, str(path)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        handle = os.open(path, os.O_RDWR)
        with pytest.raises(BlockingIOError):
            locks.lock(handle)
        other.kill()
        other.wait()
        locks.lock(handle)
        os.close(handle)


def test_only_the_module_of_locks_asks_for_what_posix_alone_has():
    source = Path(locks.__file__).parents[1]
    asking = {
        path.name
        for path in source.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.strip() in ("import fcntl", "import termios", "import resource", "import pwd")
    }
    assert asking == {"locks.py", "node_program.py", "reader_process.py"}
