"""How processes end and what they leave: SIGTERM, SIGKILL, other users, full streams, no network."""

import os
import signal
import subprocess
import sys
import time
from importlib import import_module

import pytest

from airflock.support import atomic, cache


def child(action):
    """Process that does something, and its pid."""
    pid = os.fork()
    if pid == 0:
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            action()
        finally:
            os._exit(99)
    return pid


def writing(path, begun):
    """Begin to write a file and never end."""
    with atomic.atomic_path(path) as temporary:
        temporary.write_text("half")
        begun.touch()
        time.sleep(60.0)


def wait_for(path):
    begin = time.monotonic()
    while not path.exists():
        assert time.monotonic() - begin < 30.0
        time.sleep(0.01)


def test_sigterm_ends_like_ctrl_c_and_leaves_nothing(tmp_path, monkeypatch):
    main = import_module("airflock.cli.main")
    target, begun = tmp_path / "out" / "video.mp4", tmp_path / "begun"
    target.parent.mkdir()
    monkeypatch.setattr(main, "app", lambda **_: writing(target, begun))

    def act():
        try:
            main.main()
        except SystemExit as end:
            os._exit(end.code)

    pid = child(act)
    wait_for(begun)
    os.kill(pid, signal.SIGTERM)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 2
    assert list(target.parent.iterdir()) == []


class Finalised:
    """Something whose finaliser takes as long as a signal needs to come, as those of a compiler's objects may."""

    def __init__(self, number):
        self.number = number

    def __del__(self):
        signal.raise_signal(self.number)
        for _ in range(1000):  # the interpreter hears of it in here
            pass


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interruption_that_falls_into_a_finaliser_is_not_lost(monkeypatch, number):
    """Python can only tell of what is raised there: a flight of days went on after SIGTERM, and heard no other."""
    main = import_module("airflock.cli.main")

    def flying(**_):
        Finalised(number)
        time.sleep(10.0)

    def act():
        signal.signal(signal.SIGINT, signal.default_int_handler)
        monkeypatch.setattr(main, "app", flying)
        try:
            main.main()
        except SystemExit as end:
            os._exit(end.code)

    assert os.waitstatus_to_exitcode(os.waitpid(child(act), 0)[1]) == 2  # 99: it slept to its end


def test_what_a_killed_process_left_is_swept_and_what_a_living_one_writes_is_not(tmp_path):
    pids = []
    for name in ("dead", "alive"):
        pids.append(child(lambda name=name: writing(tmp_path / f"{name}.mp4", tmp_path / f"{name} begun")))
        wait_for(tmp_path / f"{name} begun")
    os.kill(pids[0], signal.SIGKILL)
    os.waitpid(pids[0], 0)
    old = time.time() - 2.0 * atomic.FRESH
    left = {path.name.split(".")[1]: path for path in tmp_path.glob(".*")}
    assert set(left) == {"dead", "alive"}
    for path in left.values():
        os.utime(path, (old, old))
    atomic.remove_leftovers.cache_clear()
    atomic.write_file(tmp_path / "other.csv", "x")
    assert not left["dead"].exists() and left["alive"].exists()
    os.kill(pids[1], signal.SIGKILL)
    os.waitpid(pids[1], 0)


def test_a_link_is_followed_and_a_named_pipe_refused(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to(tmp_path / "far" / "real.csv")
    atomic.write_file(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink() and (tmp_path / "far" / "real.csv").read_text() == "new"
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(OSError, match="not a regular file"):
        atomic.write_file(tmp_path / "pipe.csv", "new")


@pytest.mark.parametrize("mode", [0o777, 0o775])
def test_a_cache_that_others_may_write_is_not_used(tmp_path, monkeypatch, mode):
    base = tmp_path / "shared"
    (base / cache.DRIVERS).mkdir(parents=True)
    base.chmod(mode)
    monkeypatch.setenv("AIRFLOCK_CACHE", str(base))
    assert "may be written by other users" in cache.cache_folder_error(base)
    spare = cache.cache_folder()
    assert spare != base and spare.stat().st_mode & 0o077 == 0 and spare.name != f"airflock-{os.getuid()}"


def test_a_cache_of_another_user_is_not_used(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("only root can give a folder to another user")
    (tmp_path / cache.DRIVERS).mkdir()
    os.chown(tmp_path / cache.DRIVERS, 65534, 65534)
    assert "is not a folder of this user's" in cache.cache_folder_error(tmp_path)
    os.chown(tmp_path, 65534, 65534)
    assert "belongs to another user" in cache.cache_folder_error(tmp_path)


def test_drivers_that_others_could_have_written_are_thrown_away(tmp_path):
    inner = tmp_path / cache.DRIVERS
    (inner / ("0" * 20)).mkdir(parents=True)
    inner.chmod(0o777)
    assert cache.cache_folder_error(tmp_path) == ""
    assert list(inner.iterdir()) == [] and inner.stat().st_mode & 0o777 == 0o700


def test_the_drivers_that_were_not_used_for_longest_go_first(tmp_path, monkeypatch):
    monkeypatch.setenv("AIRFLOCK_CACHE", str(tmp_path))
    now = time.time()
    for i in range(5):
        folder = tmp_path / cache.DRIVERS / f"{i:020x}"
        folder.mkdir(parents=True)
        (folder / "a.py").write_bytes(bytes(1000))
        used = now - (10_000.0 * (5 - i) if i < 4 else 0.0)
        os.utime(folder, (used, used))
    (tmp_path / "studies").mkdir()
    assert cache.shrink(tmp_path, max_bytes=2500) == 3
    assert sorted(path.name[-1] for path in (tmp_path / cache.DRIVERS).iterdir()) == ["3", "4"]
    assert cache.shrink(tmp_path, max_bytes=0) == 1  # the one in use stays
    assert cache.clear_cache() == (1, 1000) and (tmp_path / "studies").is_dir()


def test_one_new_driver_in_64_looks_through_the_cache(tmp_path, monkeypatch):
    from inside import store

    looked = []
    (tmp_path / cache.DRIVERS).mkdir()
    monkeypatch.setattr(store, "shrink", looked.append)
    for begin in range(256):
        store._written(tmp_path / cache.DRIVERS / f"{begin:02x}{'0' * 18}", "a", "text")
    assert looked == [tmp_path] * 4
    store._written(tmp_path / cache.DRIVERS / ("0" * 20), "a", "text")  # not a new one
    assert len(looked) == 4


COMMAND = [sys.executable, "-m", "airflock"]


def test_a_full_disk_behind_the_output_is_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run([*COMMAND, "presets"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=120)
    assert done.returncode == 2 and done.stderr == "airflock: output: No space left on device\n"


def test_what_nobody_foresaw_is_one_line_and_a_traceback_for_who_asks():
    text = (
        "import importlib\nm = importlib.import_module('airflock.cli.main')\n"
        "def app(**_): raise ZeroDivisionError('by \\x1b zero')\nm.app = app\nm.main()\n"
    )
    said = "airflock: unexpected ZeroDivisionError: by \\x1b zero; please report it; AIRFLOCK_DEBUG=1 shows where\n"
    for debug in ("", "1"):
        environment = {**os.environ, "AIRFLOCK_DEBUG": debug}
        done = subprocess.run(
            [sys.executable, "-c", text], capture_output=True, text=True, timeout=120, env=environment
        )
        assert done.returncode == 2 and done.stderr.endswith(said) and (done.stderr == said) == (not debug)


def test_a_home_that_cannot_be_written_costs_a_compilation_and_doctor_says_why(tmp_path):
    nowhere = {key: value for key, value in os.environ.items() if key not in ("AIRFLOCK_CACHE", "XDG_CACHE_HOME")}
    nowhere |= {"HOME": "/dev/null"}  # no folder can be made in it, whoever one is
    words = ["run", "vasarhelyi_2018/4ms", "--agents", "3", "--duration", "1", "--device", "python", "--save", "a.nc"]
    for command, said in ((["doctor"], "/dev/null/.cache/airflock cannot be written"), (words, "saved a.nc")):
        done = subprocess.run(
            [*COMMAND, *command], cwd=tmp_path, env=nowhere, capture_output=True, text=True, timeout=300
        )
        told = " ".join((done.stdout + done.stderr).split())
        assert done.returncode == 0 and said in told and "Traceback" not in told, told


OFFLINE = """
import sys
def refuse(event, _):
    if event in ("socket.connect", "socket.getaddrinfo", "socket.gethostbyname", "socket.bind", "socket.sendto"):
        raise RuntimeError(f"network: {event}")
sys.addaudithook(refuse)
from airflock.cli.main import main
import socket
for words in (["run", "vasarhelyi_2018/4ms", "--agents", "5", "--duration", "1", "--save", "a.nc", "--plot", "a.png"],
              ["score", "a.nc"], ["presets"]):
    sys.argv = ["airflock", *words]
    try:
        main()
    except SystemExit as end:
        assert not end.code, words
try:
    socket.create_connection(("localhost", 9))
except RuntimeError:
    print("offline")
"""


def test_nothing_asks_for_the_network(tmp_path):
    done = subprocess.run([sys.executable, "-c", OFFLINE], cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and done.stdout.endswith("offline\n"), done.stderr
