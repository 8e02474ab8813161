"""Cases of the fuzz: every other file that Airflock reads, each kind sound at first and then damaged."""

import hashlib
import io
import json
import random
import shutil
import struct
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path

import mutations
import numpy as np
from mutations import GOLDEN, damage, mutate, toml

from airflock.support import untrusted
from airflock.support.errors import AirflockError

sys.path.insert(0, str(GOLDEN.parents[1]))  # modules that tests share

TINY = {"agents": 3, "duration": 2.0, "dt": 0.1, "world.side": 30.0, "metrics.period": 0.5}
FOREIGN = ("table", "array", "arrays", "parquet", "ulog", "dataflash", "tracking", "movement", "mesh", "stl")


@cache
def sound():
    """Bytes of a sound file of each kind, by kind, with the ending of its name."""
    found = {
        "card": (".json", sound_card()),
        "certificate": (".toml", _certificate()),
        "faults": (".toml", b'[[fault]]\nkind = "outage"\nwho = [1]\nbegin = 1.0\nend = 2.0\n'),
        "geojson": (".geojson", json.dumps(_field()).encode()),
        "kml": (".kml", _kml()),
        "memory": (".memory", b'{"sent": 7, "heard": {"2": 3}, "order": 1}'),
        "log": (".log", _log()),
        "plan": (".toml", b"seeds = 10\nseconds = 5.0\nrate = 100.0\nidentity = 'x'\n[search]\ngenerations = 3\n"),
        "mesh": (".obj", (GOLDEN.parents[1] / "cube.obj").read_bytes()),
    }
    return found | _tracks()


def sound_card():
    """Bytes of a flight card."""
    from airflock.drones.onboard.card import card_hash
    from airflock.fleets.card_document import make_card_document
    from airflock.scenarios.files import load

    scenario = load("vasarhelyi_2018/real_4ms", {"topology.kind": "nearest", "topology.k": 4})
    made = make_card_document(scenario, site=(47.5, 19.0, 120.0), members=(1, 2, 3), mission=7, expires=2**33)
    return json.dumps({**made, "hash": card_hash(made)}).encode()


@cache
def certificate():
    """A certificate of a few flights."""
    import tempfile

    from airflock.certificates.certification import certify
    from airflock.scenarios.files import load

    with tempfile.TemporaryDirectory() as folder:
        tiny = load("vasarhelyi_2018/real_4ms", TINY)
        limits, where = ["r_min<9 at 99%", "phi_wall>0"], Path(folder)
        return certify(tiny, limits, flights=4, device="python", folder=where / "flights")


def _certificate():
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        return certificate().save(Path(folder) / "certificate.toml").read_bytes()


def _field():
    ring = [[19.0, 47.5], [19.002, 47.5], [19.002, 47.502], [19.0, 47.502], [19.0, 47.5]]
    pond = [[19.0005, 47.5005], [19.001, 47.5005], [19.001, 47.501], [19.0005, 47.5005]]
    of = {"floor": 10.0, "ceiling": 60.0}
    return {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": of, "geometry": {"type": "Polygon", "coordinates": [ring, pond]}}
        ],
    }


def _kml():
    ring = "19.0,47.5,0 19.002,47.5,0 19.002,47.502,0 19.0,47.502,0 19.0,47.5,0"
    boundary = f"<outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates></LinearRing></outerBoundaryIs>"
    place = f"<Placemark><name>field</name><Polygon>{boundary}</Polygon></Placemark>"
    return (
        f'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{place}</Document></kml>'.encode()
    )


KEY = bytes(range(32))


def _log():
    """Twenty ticks of a node that heard a datagram and its autopilot say nothing that makes sense."""
    from airflock.drones.onboard.flight_log import LoggingNode
    from airflock.drones.onboard.node import Node, NodeMemory

    lines = []
    node = Node(_made_card(), 2, KEY, now=0.0, utc=10**15, memory=NodeMemory(), radios=(0.2,))
    logged = LoggingNode(node, lines.append, now=0.0, memory=NodeMemory(), radios=(0.2,))
    for tick in range(20):
        logged.radio(bytes([tick] * 40), 0.05 * tick)
        logged.autopilot(bytes([0xFD, tick] * 20), 0.05 * tick)
        logged.tick(0.05 * tick)
    return "\n".join(lines).encode()


@cache
def _made_card():
    from airflock.drones.onboard.card import parse_card

    return parse_card(json.loads(sound_card()))


def _tracks():
    """Tracks of two that circle, in each format."""
    import pandas as pd
    import trimesh

    import autopilots
    from airflock.recordings.exports import to_movement
    from airflock.recordings.recording_files import load_recording

    time = 12.0 + 0.1 * np.arange(60)
    ned = np.stack([10 * np.sin(time), 10 * np.cos(time), np.full_like(time, -20.0)], axis=1)
    speed = np.stack([10 * np.cos(time), -10 * np.sin(time), 0.0 * time], axis=1)
    table = pd.DataFrame({"t": np.repeat(time, 2), "id": np.tile([1, 2], 60), "x": np.repeat(ned[:, 0], 2),
                          "y": np.repeat(ned[:, 1], 2)})  # fmt: skip
    import tempfile

    found = {"table": (".csv", table.to_csv(index=False).encode())}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.save(folder / "a.npy", np.stack([ned[:, :2], -ned[:, :2]], axis=1))
        np.savez(folder / "a.npz", trajectories=np.stack([ned[:, :2], -ned[:, :2]], axis=1))
        table.to_parquet(folder / "a.parquet")
        autopilots.write_ulog(folder / "a.ulg", time, ned, speed, speed)
        autopilots.write_dataflash(folder / "a.bin", time, ned, speed, speed)
        to_movement(load_recording(GOLDEN / "recording.nc")).to_netcdf(folder / "a.nc", engine="h5netcdf")
        _idtracker(folder / "a.h5", ned)
        trimesh.creation.box((10.0, 10.0, 10.0)).export(folder / "a.stl")
        kinds = {"array": "npy", "arrays": "npz", "parquet": "parquet", "ulog": "ulg", "dataflash": "bin",
                 "movement": "nc", "tracking": "h5", "stl": "stl"}  # fmt: skip
        for kind, ending in kinds.items():
            found[kind] = (f".{ending}", (folder / f"a.{ending}").read_bytes())
    return found


def _idtracker(path, ned):
    import h5py

    with h5py.File(path, "w") as file:
        file["trajectories"] = np.stack([ned[:, :2], -ned[:, :2]], axis=1)
        file["frames_per_second"] = 10.0


def other_file(seed, number, folder, tell=False):
    """Read a damaged file of a random kind, as the command does that takes it."""
    rng = random.Random(f"file {seed} {number}")
    kind = rng.choice(sorted(sound()))
    ending, content = sound()[kind]
    path = folder / f"damaged{ending}"
    path.write_bytes(_damaged(rng, kind, content))
    if tell:
        sys.stdout.write(f"{kind}\n")
        shutil.copy(path, f"last{ending}")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        said = _refusal(kind, path)
    if tell:
        sys.stdout.write(f"{said}\n")
    return said is None


def _refusal(kind, path):
    """What is said when a file is refused, which is checked; None if it is taken."""
    try:
        READ[kind](path)
        return None
    except mutations.Flown:
        return None
    except AirflockError as fault:
        text = str(fault)
        if kind in FOREIGN and mutations.LAST_RESORT in text:  # a library's own reader may fail in any way
            assert path.name in text and "\n" not in text and len(text) <= mutations.LONGEST, text[:300]
        else:
            mutations.check(fault)
        return text


def _damaged(rng, kind, content):
    if kind == "card" and rng.random() < 0.8:  # sealed again, as somebody would who means harm
        from airflock.drones.onboard.card import card_hash

        document = mutate(rng, {k: v for k, v in json.loads(content).items() if k != "hash"})
        document = _without_dates(document)
        return json.dumps({**document, "hash": card_hash(document)}).encode()
    if kind == "certificate" and rng.random() < 0.8:
        document = _without_dates(mutate(rng, untrusted.parse_toml(content.decode())))
        document["seal"] = hashlib.sha256(repr(document).encode()).hexdigest()
        return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in document.items()).encode()
    if kind in ("geojson", "memory") and rng.random() < 0.6:
        return json.dumps(_without_dates(mutate(rng, json.loads(content)))).encode()
    if kind in ("faults", "plan") and rng.random() < 0.6:
        document = mutate(rng, untrusted.parse_toml(content.decode()))
        return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in document.items()).encode()
    if kind == "log" and rng.random() < 0.6:
        lines = content.decode().splitlines()
        chosen = rng.randrange(len(lines))
        lines[chosen] = json.dumps(_without_dates(mutate(rng, json.loads(lines[chosen]))))
        return "\n".join(lines).encode()
    if kind in ("array", "ulog") and rng.random() < 0.2:  # numbers of bytes or rows that are not there
        at = rng.randrange(min(len(content) - 8, 200))
        return content[:at] + struct.pack("<Q", rng.choice([2**63, 2**40, 0])) + content[at + 8 :]
    return damage(rng, content)


def _without_dates(value):
    return json.loads(json.dumps(value, default=str))


def _tracks_of(path):
    from airflock.recordings.imports.load_tracks import load_tracks

    load_tracks(path, unit="m", fps=10.0)


def _mesh(path):
    from airflock.world.scenery import Parameters
    from airflock.world.scenes.meshes import load_mesh

    load_mesh(Parameters(kind="mesh", file=str(path)), 3)


def _check_certificate(path):
    from importlib import import_module

    def flown(*_, **__):
        raise mutations.Flown

    check = import_module("airflock.certificates.certificate")
    check._flown_again = flown
    check.check_certificate(path)


def _ground(path):
    from airflock.world.scenes.field_outlines import load_field

    load_field(path, simplify=1.0, space=True)


def _faults(path):
    from airflock.fleets.drone_faults import read_injected_faults

    read_injected_faults(path, (1, 2, 3))


def _read_card(path):
    from airflock.drones.onboard.card import read_card

    read_card(path)


def _replay_log(path):
    from airflock.drones.onboard.flight_log import replay_log_file

    for _ in replay_log_file(path, _made_card(), KEY):
        pass


def _memory(path):
    from airflock.drones.onboard.flight_log import read_node_memory

    read_node_memory(path)


def _plan(path):
    from airflock.runs.folder import read_toml_file
    from airflock.search.tuning_run import read_plan

    read_plan(read_toml_file(path), path)


READ = {
    "card": _read_card, "certificate": _check_certificate, "faults": _faults, "geojson": _ground, "kml": _ground,
    "memory": _memory, "log": _replay_log, "plan": _plan, "mesh": _mesh, "stl": _mesh,
    **dict.fromkeys(
        ("table", "array", "arrays", "parquet", "ulog", "dataflash", "movement", "tracking"), _tracks_of
    ),
}  # fmt: skip
CASES = {"files": other_file}
