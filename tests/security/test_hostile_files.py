"""A stranger's files: whatever names code is refused in one line, and nothing of it runs.

Every way in is a row of WAYS; whoever adds a door adds its rows.
"""

import json
import os
import pickle
import re
import traceback
from pathlib import Path

import mutations
import numpy as np
import other_files
import pytest
from damages import Planted

import airflock
from airflock.drones.onboard.card import card_hash, read_card
from airflock.runs.folder import REQUEST_FILE, write_toml_file
from airflock.search.study import load_study
from airflock.support.errors import AirflockError, ScenarioError

LAW = "from pathlib import Path\nPath(__file__).with_name('mark').touch()\n"
SCENARIO = 'duration = 1.0\nagents = 3\n[model]\nkind = "evil.py"\n'
STUDY = 'scenario = "{0}"\n[objective]\nown = "{1}"\n[space.metrics]\nr_coll = {{ low = 1.0, high = 2.0 }}\n'


def packed(tmp_path):
    """A folder as a stranger packs it, without recordings."""
    (tmp_path / "evil.py").write_text(LAW)
    for name in ("h5py.py", "numpy.py", "sitecustomize.py"):  # beside the recording, for whoever imports from there
        (tmp_path / name).write_text(LAW)
    (tmp_path / "evil.toml").write_text(SCENARIO)
    (tmp_path / "own.toml").write_text(STUDY.format("vasarhelyi_2018/4ms", "evil.py"))
    (tmp_path / "study.toml").write_text(STUDY.format("evil.toml", "none.py"))
    (tmp_path / "set.toml").write_text(
        'scenario = "vasarhelyi_2018/4ms"\n[set]\n"model.kind" = "EVIL"\n'.replace("EVIL", str(tmp_path / "evil.py"))
    )
    evil = str(tmp_path / "evil.py")
    for name, entry in {
        "several": '"evil.toml"',
        "several_set": '{ scenario = "vasarhelyi_2018/4ms", set = { "model.kind" = "EVIL" } }'.replace("EVIL", evil),
    }.items():
        (tmp_path / f"{name}.toml").write_text(f'scenarios = ["vasarhelyi_2018/4ms", {entry}]\n')
    for section in ("body", "sensors", "radio", "metrics"):
        text = SCENARIO.replace("evil.py", "vasarhelyi_2018") + f'[{section}]\nkind = "evil.py"\n'
        (tmp_path / f"{section}.toml").write_text(text)
    text = 'extends = "vasarhelyi_2018/4ms"\n[[faults]]\nkind = "evil.py"\nat = 0.1\n'
    (tmp_path / "faults.toml").write_text(text)
    text = 'extends = "vasarhelyi_2018/4ms"\n[[groups]]\nagents = 2\nmodel = { kind = "evil.py" }\n'
    (tmp_path / "groups.toml").write_text(text)
    (tmp_path / "extended.toml").write_text('extends = "evil.toml"\nagents = 4\n')
    version = f'[flown]\nairflock = "{airflock.__version__}"\nprecision = 32\ndevice = "cpu"\nrules = "0"\n'
    text = 'seal = ""\nformat = 1\nconfidence = 0.95\nlimit = []\n[flights]\ncount = 1\nlooks = ""\nuncertain = false\n'
    law = '[scenario]\nname = "a"\nduration = 1.0\nagents = 3\n[scenario.model]\nkind = "evil.py"\n'
    (tmp_path / "certificate.toml").write_text(text + version + law)
    text = SCENARIO.replace("evil.py", "vasarhelyi_2018") + '[topology]\nkind = "evil.py"\n'
    (tmp_path / "topology.toml").write_text(text)
    rows = "".join(f"{0.1 * k},{who},{k + who},{who},1,0,1,0\n" for k in range(50) for who in (1, 2))
    (tmp_path / "log.csv").write_text("t,id,x,y,vx,vy,cx,cy\n" + rows)
    for name in ("pickled.npy", "pickled.pkl"):
        (tmp_path / name).write_bytes(pickle.dumps(Planted(tmp_path / "mark")))
    np.save(tmp_path / "objects.npy", np.array([Planted(tmp_path / "mark")], dtype=object))
    np.savez(tmp_path / "objects.npz", trajectories=np.array([Planted(tmp_path / "mark")], dtype=object))
    card = json.loads(other_files.sound_card())
    card = {**{key: value for key, value in card.items() if key != "hash"}, "law": {"kind": "evil"}}
    (tmp_path / "card.json").write_text(json.dumps({**card, "hash": card_hash(card)}))
    for kind in ("study", "campaign", "tuning", "sweep"):
        (tmp_path / kind).mkdir()
        law = str(tmp_path / "evil.py")
        held = {"run": kind, "name": "evil.toml", "seeds": [0], "scenario": {"model": {"kind": law}}}
        write_toml_file(tmp_path / kind / REQUEST_FILE, held)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "best.toml").write_text(SCENARIO.replace("evil.py", str(tmp_path / "evil.py")))
    return tmp_path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The same with recordings; one names the law by its whole path, as version 0.1 wrote them."""
    mutations.warm("commands")
    tmp_path = packed(tmp_path_factory.mktemp("stranger"))
    recording = airflock.load_recording(mutations.GOLDEN / "recording.nc")
    document = json.loads(recording.attrs["airflock_scenario"])
    kinds = {"evil": {"kind": "evil.py"}, "path": {"kind": str(tmp_path / "evil.py")}}
    for name, model in kinds.items():
        changed = recording.assign_attrs(airflock_scenario=json.dumps({**document, "model": model}))
        changed.to_netcdf(tmp_path / f"{name}.nc", engine="h5netcdf")
    mesh = {**document, "scene": {"kind": "mesh", "file": "/etc/passwd"}}
    recording.assign_attrs(airflock_scenario=json.dumps(mesh)).to_netcdf(tmp_path / "mesh.nc", engine="h5netcdf")
    return tmp_path


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """A folder of one's own for a test that changes it, as the working folder."""
    monkeypatch.chdir(tmp_path)
    return packed(tmp_path)


def told(action):
    """What an action says when it is refused, in a process of its own; empty if it is not."""
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            said = ""
            try:
                action()
            except AirflockError as fault:
                said = f"refused: {fault}"
            except BaseException:  # the test must hear of it
                said = traceback.format_exc()
            os.write(writing, said.encode()[:60_000])
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    os.waitpid(pid, 0)
    return said


def command(*words):
    """A command of the command line; what would fly counts as done."""
    return lambda: mutations.commanded(list(words), Path())


def python(text):
    """A line of Python of somebody who has unpacked the folder."""
    return lambda: eval(text, NAMES)


NAMES = {
    "airflock": airflock, "load_study": load_study, "Path": Path, "read_card": read_card,
}  # fmt: skip
CONSENT = "would run the code in "
WAYS = {
    "load": (python('airflock.load("evil.toml")'), CONSENT),
    "settings": (
        python('airflock.load("vasarhelyi_2018/4ms", {"model.kind": str(Path("evil.py").absolute())})'),
        CONSENT,
    ),
    "body of a scenario": (python('airflock.load("body.toml")'), CONSENT),
    "sensor of a scenario": (python('airflock.load("sensors.toml")'), CONSENT),
    "radio of a scenario": (python('airflock.load("radio.toml")'), CONSENT),
    "topology of a scenario": (python('airflock.load("topology.toml")'), CONSENT),
    "law of a group": (python('airflock.load("groups.toml")'), CONSENT),
    "metrics of a scenario": (python('airflock.load("metrics.toml")'), CONSENT),
    "faults of a scenario": (python('airflock.load("faults.toml")'), CONSENT),
    "fault of an event": (
        python(
            'airflock.open("vasarhelyi_2018/4ms", events=[{"step": 0, "kind": "fault", '
            '"data": {"kind": str(Path("evil.py").absolute())}}]).advance(0.1)'
        ),
        CONSENT,
    ),
    "scenario that extends another": (python('airflock.load("extended.toml")'), CONSENT),
    "open": (python('airflock.open("evil.toml")'), CONSENT),
    "event of a flight": (
        python(
            'airflock.open("vasarhelyi_2018/4ms", events=[{"step": 0, "kind": "change", '
            '"data": {"model.kind": str(Path("evil.py").absolute())}}]).advance(0.1)'
        ),
        CONSENT,
    ),
    "watch": (command("watch", "evil.toml", "--port", "0"), ""),
    "watch against": (command("watch", "vasarhelyi_2018/4ms", "--against", "evil.toml", "--port", "0"), ""),
    "tune": (command("tune", "evil.toml", "--out", "tuned"), ""),
    "tune logs": (command("tune", "log.csv", "--like", "evil.toml", "--out", "tuned"), ""),
    "folder of a study": (python('airflock.evolve(None, "study", resume=True)'), CONSENT),
    "folder of a campaign": (python('airflock.certify(folder="campaign", resume=True)'), CONSENT),
    "folder of a tuning": (python('airflock.tune(None, "tuning", resume=True)'), CONSENT),
    "folder of a sweep": (python('airflock.sweep(out="sweep", resume=True)'), CONSENT),
    "identify": (command("identify", "log.csv", "--like", "evil.toml"), ""),
    "infer": (command("infer", "log.csv", "--models", "evil.toml"), ""),
    "card of a scenario": (command("fly", "prepare", "evil.toml", "--site", "47,19,0", "--members", "1-3"), ""),
    "flight card": (python('read_card(Path("card.json"))'), "is not a law of this version"),
    "scenario with faults of its own": (command("run", "faults.toml"), ""),
    "tracks of a pickle": (python('airflock.load_tracks("pickled.pkl")'), "could run code"),
    "array of a pickle": (python('airflock.load_tracks("pickled.npy", fps=1.0, unit="m")'), "could run code"),
    "array of objects": (python('airflock.load_tracks("objects.npy", fps=1.0, unit="m")'), "could run code"),
    "arrays of objects": (python('airflock.load_tracks("objects.npz", fps=1.0, unit="m")'), "could run code"),
    "replay": (command("replay", "evil.toml", "--html", "a.html"), ""),
    "fleet": (command("fleet", "evil.toml"), ""),
    "simulate": (python('airflock.simulate("evil.toml")'), CONSENT),
    "study of own fitness": (python('load_study("own.toml")'), CONSENT),
    "study of a scenario with a law": (python('load_study("study.toml")'), CONSENT),
    "study of several with a law": (python('load_study("several.toml")'), CONSENT),
    "study of several that sets a law": (python('load_study("several_set.toml")'), CONSENT),
    "study that sets a law": (python('load_study("set.toml")'), CONSENT),
    "score of a recording": (python('airflock.score(airflock.load_recording("evil.nc"))'), ""),
    "validate": (command("validate", "evil.toml"), ""),
    "run": (command("run", "evil.toml"), ""),
    "presets": (command("presets", "evil.toml"), ""),
    "sweep": (command("sweep", "evil.toml", "--over", "radio.delay=0,1"), ""),
    "plot rules": (command("plot", "evil.toml", "--kind", "rules"), ""),
    "evolve": (command("evolve", "own.toml", "--out", "out"), ""),
    "validate study": (command("validate", "study.toml"), ""),
    "certify": (command("certify", "evil.toml", "--limit", "r_min<1 at 1%", "--flights", "2"), ""),
    "certificate": (command("certify", "certificate.toml", "--check"), ""),
    "harden": (command("harden", "folder", "--out", "out.toml"), ""),
    "score": (command("score", "evil.nc"), ""),
    "score path": (command("score", "path.nc"), ""),
    "validate recording": (command("validate", "path.nc"), ""),
    "plot recording": (command("plot", "path.nc", "--out", "a.png"), ""),
    "plot series": (command("plot", "path.nc", "--kind", "series", "--out", "a.png"), ""),
    "mesh of a recording": (python('airflock.score(airflock.load_recording("mesh.nc"))'), "none of glb"),
}


@pytest.mark.parametrize("way", WAYS)
def test_nothing_of_a_strangers_runs_without_consent(whole, monkeypatch, way):
    monkeypatch.chdir(whole)
    action, words = WAYS[way]
    said = told(action)
    assert not (whole / "mark").exists()
    assert "Traceback" not in said and words in said
    assert not words or (said.startswith("refused: ") and "\n" not in said)


def test_consent_runs_it_and_names_the_file_without_it(stranger):
    with pytest.raises(ScenarioError, match=rf"would run the code in {stranger}/evil.py; if you trust it, add --trust"):
        airflock.load("evil.toml")
    for consent in ({"trust": True}, {"law": "evil.py"}):
        with pytest.raises(AirflockError, match="evil"):  # it is no law, but it ran
            airflock.load("evil.toml", **consent)
        assert (stranger / "mark").exists()
        (stranger / "mark").unlink()


@pytest.mark.parametrize("text", ["import sys\nsys.exit(0)\n", "raise KeyboardInterrupt\n", "1 / 0\n"])
def test_a_law_or_fitness_that_ends_the_process_is_one_line(stranger, text):
    (stranger / "evil.py").write_text(text)
    for name, door in (("evil.toml", airflock.load), ("own.toml", load_study)):
        with pytest.raises(AirflockError) as fault:
            door(name, trust=True)
        assert re.search(r"evil\.py:\d+: ", str(fault.value)) and "\n" not in str(fault.value)
