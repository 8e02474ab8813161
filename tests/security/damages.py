"""Cases of the fuzz: damaged caches, and disks that are full at some byte."""

import os
import pickle
import random
import resource
import shutil
import sys
from functools import cache

from mutations import GOLDEN, damage

from airflock.support import atomic
from airflock.support.errors import AirflockError

DRIVER = "from numba import njit\n\n\n@njit(cache=True)\ndef fly(x):\n    return x * 0.5 + 1.0\n"


class Planted:
    """A pickle that runs code when it is loaded."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def fly(folder):
    """Load the driver with a cache folder as a new process would, and fly it."""
    from inside import store

    os.environ["AIRFLOCK_CACHE"] = str(folder)
    for name in [name for name in sys.modules if name.startswith("airflock_driver_planted")]:
        del sys.modules[name]
    return store.load_driver(DRIVER, "planted").fly(3.0)


def damaged_cache(seed, number, folder, tell=False):
    """A cache in which one thing is damaged or planted flies the same numbers, now and the next time."""
    rng = random.Random(f"cache {seed} {number}")
    home, mark = folder / "cache", folder / "mark"
    if not (folder / "sound").exists():
        assert fly(folder / "sound") == 2.5
    shutil.rmtree(home, ignore_errors=True)
    shutil.copytree(folder / "sound", home)
    _damage(rng, home, mark, tell)
    for _ in range(2):
        assert fly(home) == 2.5, "other numbers"
        assert not mark.exists(), "planted code ran"
    return True


def _damage(rng, home, mark, tell):
    files = sorted(path for path in home.rglob("*") if path.is_file())
    path, what = rng.choice(files), rng.randrange(9)
    if tell:
        sys.stdout.write(f"{what} {path}\n")
    text = f"import os\nos.path.isdir({str(mark)!r}) or os.mkdir({str(mark)!r})\n"
    if what < 3:
        path.write_bytes(damage(rng, path.read_bytes()))
    elif what == 3:
        path.write_bytes(b"")
    elif what == 4:
        path.unlink()
    elif what == 5:  # a driver of other physics, or of a stranger's code
        source = next(p for p in files if p.suffix == ".py")
        kept = source.stat()
        source.write_text(rng.choice([DRIVER.replace("0.5", "0.2"), text + DRIVER, ""]))
        os.utime(source, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    elif what == 6:
        ending = rng.choice([".nbi", ".nbc"])
        target = next(p for p in files if p.suffix == ending)
        target.write_bytes(pickle.dumps(Planted(mark)) + target.read_bytes())
    elif what == 7:  # the folder of a driver is a file
        driver = next(p for p in files if p.suffix == ".py").parent
        shutil.rmtree(driver)
        driver.write_text("no folder")
    else:
        (path.parent / "__pycache__").mkdir(exist_ok=True)
        for name in ("planted.cpython-311.pyc", "numba.py", "planted.py"):
            (path.parent / "__pycache__" / name).write_text(text)


@cache
def results():
    """What is written: a recording, figures, tables, documents, a page, a flight of a preset."""
    import pandas as pd

    from airflock.recordings.recording_files import load_recording
    from airflock.view.replay_page import replay
    from airflock.view.trajectory_plots import trajectories

    recording = load_recording(GOLDEN / "recording.nc")
    table = pd.DataFrame({"a": range(5000), "b": [0.1] * 5000})
    document = {"model": {f"k{i}": i / 7 for i in range(400)}}
    return recording, trajectories(recording), table.to_csv(), document, replay(recording)


def full_disk(seed, number, folder, tell=False):
    """A disk that is full at some byte: one fault, and the file that was there before is as it was."""
    rng = random.Random(f"disk {seed} {number}")
    what = rng.choice([*WRITERS])
    place = folder / f"disk{number}"
    place.mkdir()
    target = place / f"a{WRITERS[what][0]}"
    folders = what in ("store", "cache", "mission", "evaluations")  # which make several files
    before = b"what was there before" if rng.random() < 0.5 and not folders else None
    if before is not None:
        target.write_bytes(before)
    limit = int(10 ** rng.uniform(0.0, WRITERS[what][1]))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    results()
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # Python keeps a module's bytecode cut off here
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    fault = None
    try:
        WRITERS[what][2](target)
    except AirflockError as refused:
        fault = str(refused)
        assert "\n" not in fault and "a" in fault
    except OSError as refused:  # the command line makes a line of it
        assert refused.filename == str(target) or what == "cache", f"a bare {refused!r} from {what}"
        assert refused.filename, f"no name in {refused!r}"
        fault = str(refused)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = writes
    if tell:
        sys.stdout.write(f"{what} of {limit} bytes: {fault}\n")
    left = sorted(path.name for path in place.iterdir())
    if what == "mission":
        assert left == ([] if fault else ["a.json", "a.key", "a.operator"]), f"left over: {left}"
    elif what == "evaluations":
        assert not any(name.startswith(".") for name in left), f"left over: {left}"
    elif what == "cache":
        assert fault is None or not any(MARK in path.name for path in place.rglob("*")), f"left over: {left}"
    elif what != "store":
        if fault is not None:
            assert left == ([target.name] if before is not None else []), f"left over: {left}"
            assert before is None or target.read_bytes() == before, "half-written"
        else:
            assert left == [target.name] and target.stat().st_size <= limit
    shutil.rmtree(place)
    return fault is None


def _recording(target):
    from airflock.recordings.recording_files import save

    save(results()[0], target)


def _figure(target):
    from airflock.view.style import save_figure

    save_figure(results()[1], target)


def _video(target):
    from airflock.view.video_writer import video

    video(results()[0], target, fps=5, speed=4.0)


def _export(target):
    from airflock.recordings.exports import export

    export(results()[0], target)


def _document(target):
    from airflock.runs.folder import write_toml_file

    write_toml_file(target, results()[3])


def _certificate(target):
    from other_files import certificate

    certificate().save(target)


def _store(target):
    from airflock.runs.executors import Flight, FlightResult
    from airflock.runs.flight_store import CandidateBatch, FlightStore

    target.mkdir()
    with FlightStore(target) as store:
        store.begin({})
        batch = CandidateBatch("search", 0, 0)
        for i in range(200):
            store.ask(batch, [[0.5]] * (i + 1), [{"model.p_rep": 0.1}] * (i + 1))
            store.land(batch, FlightResult(Flight(i, 0, {}, 7), {"fitness": 0.25, "long": [0.1] * 50}))


@cache
def stored():
    """A folder with a study's store."""
    import tempfile
    from pathlib import Path

    folder = Path(tempfile.mkdtemp()) / "study"
    _store(folder)
    return folder


def _evaluations(target):
    """Tables of all flights of a study."""
    from airflock.runs.flight_store import FlightStore
    from airflock.search.study_result import export

    with FlightStore(stored(), write=False) as store:
        export(store, target.parent)


def _card(target):
    """Card and keys of a mission, by the command."""
    from airflock.cli.main import app

    words = ["fly", "prepare", "vasarhelyi_2018/real_4ms", "--site", "47.5,19.0,120", "--members", "1-10", "--json"]
    app([*words, "--out", str(target)], standalone_mode=False)


def _cache(target):
    """A driver is compiled and flown in any case, unless nothing at all can be written."""
    assert fly(target) == 2.5


MARK = atomic.MARK
WRITERS = {  # ending, decimal logarithm of the most bytes, and what writes
    "recording": (".nc", 5.5, _recording),
    "figure": (".png", 5.5, _figure),
    "figure as pdf": (".pdf", 5.0, _figure),
    "figure as svg": (".svg", 5.5, _figure),
    "video": (".mp4", 5.0, _video),
    "replay": (".html", 6.3, lambda target: results()[4].save(target)),
    "table": (".csv", 5.5, lambda target: atomic.write_file(target, results()[2])),
    "export as csv": (".csv", 5.0, _export),
    "export as parquet": (".parquet", 5.0, _export),
    "export as movement": (".nc", 5.0, _export),
    "document": (".toml", 4.5, _document),
    "certificate": (".toml", 4.5, _certificate),
    "mission": (".json", 4.5, _card),
    "evaluations": ("", 5.0, _evaluations),
    "store": ("", 5.5, _store),
    "cache": ("", 4.0, _cache),
}


CASES = {"caches": damaged_cache, "disks": full_disk}
