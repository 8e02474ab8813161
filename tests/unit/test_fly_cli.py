"""The verbs fly and fleet: cards and keys are written whole or not at all, and mistakes are told all at once."""

import json
import math
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter

import pytest

from airflock.cli.main import main
from airflock.drones.mavlink.signing import read_key
from airflock.drones.onboard.card import read_card
from airflock.drones.onboard.flight_log import LoggingNode, code_version
from airflock.drones.onboard.node import Node, NodeMemory
from airflock.support.coordinates import FlightSite

HERE = ["--site", "47.5,19.04,120", "--members", "1-3", "--set", "world.side=120"]
REAL = "vasarhelyi_2018/real_4ms"


@pytest.fixture
def airflock(monkeypatch, capsys, tmp_path):
    """The command, run in an empty folder: status, output, lines of errors."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airflock", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        told = capsys.readouterr()
        return end.value.code or 0, told.out, told.err.splitlines()

    return run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            [],
            "the following arguments are required: --autopilot, --radio; "
            "python -m airflock.drones.onboard --help lists",
        ),
        (["--autopilot", "udp:a:1", "--radio", "udp:a:2", "--memeber", "3"], "unrecognized arguments: --memeber 3"),
        (["--autopilot", "udp:a:1", "--radio", "udp:a:2", "--member", "x"], "argument --member: invalid int value"),
        (["--autopilot", "udp:a:1", "--radio", "udp:a:2", "--i-am"], "unrecognized arguments: --i-am; "),
    ],
)
def test_a_wrong_command_line_of_a_node_is_one_line(airflock, words, said):
    code, out, lines = airflock("fly", "mission.json", "--member", "3", *words)
    assert code == 2 and not out and len(lines) == 1 and lines[0].startswith(f"airflock: {said}")


def test_a_mission_is_prepared_checked_and_never_overwritten(airflock, tmp_path):
    code, out, _ = airflock("fly", "prepare", REAL, *HERE, "--json")
    made = json.loads(out)
    assert code == 0 and made["members"] == [1, 2, 3] and 0.0 < made["airtime"]["slow"] < 0.1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mission.json", "mission.key", "mission.operator"]
    assert {p.stat().st_mode & 0o777 for p in tmp_path.glob("mission.[ko]*")} == {0o600}
    port = ["--autopilot", "udp:127.0.0.1:39431", "--radio", "udp:127.0.0.1:39432"]
    code, out, lines = airflock("fly", "mission.json", "--member", 2, *port, "--check")
    assert code == 2 and not out and len(lines) == 1, "it could answer only whoever sends something to it"
    assert lines[0].endswith("nobody would hear this drone; write udp:127.0.0.1:39432>HOST:PORT")
    port[-1] += ">127.0.0.1:39433"
    assert airflock("fly", "mission.json", "--member", 2, *port, "--check")[::2] == (0, [])
    code, _, lines = airflock("fly", "prepare", REAL, *HERE)
    assert code == 2 and len(lines) == 3 and all("never overwritten" in line for line in lines)


def test_a_computer_whose_clock_was_not_set_is_noted(airflock, tmp_path, monkeypatch):
    """It starts in 1970, or where it was stopped: the card would be valid for longer than cards are."""
    assert airflock("fly", "prepare", REAL, *HERE)[0] == 0
    words = ["--member", 2, "--autopilot", "udp:127.0.0.1:39431", "--radio", "udp:127.0.0.1:39432>127.0.0.1:39433"]
    for early in (0.0, 3600.0, 8 * 86400.0, 400 * 86400.0):
        with monkeypatch.context() as patched:
            now = time.time()
            patched.setattr("airflock.drones.onboard.node_program.time.time", lambda now=now, early=early: now - early)
            code, _, lines = airflock("fly", "mission.json", *words, "--check")
        assert code == 0 and ("was the clock set after it had started?" in "\n".join(lines)) is (early > 7 * 86400.0)


def test_mistakes_of_a_preparation_are_told_together_and_nothing_is_written(airflock, tmp_path):
    code, _, lines = airflock(
        "fly", "prepare", REAL, "--site", "47.5;19", "--members", "a-3", "--out", "absent/m.txt", "--set", "agents"
    )
    assert code == 2 and all(line.startswith("airflock: ") for line in lines)
    for part in ("--site 47.5;19: is not LAT,LON,ALT", "write 1-10", "absent", "KEY=VALUE"):
        assert any(part in line for line in lines), part
    for text in ("3-", "-3", "3-1", "1,,2", ""):
        code, _, lines = airflock("fly", "prepare", REAL, *HERE[:2], "--members", text)
        assert code == 2 and any(f"--members {text}: write 1-10" in line for line in lines), (text, lines)
    for more, part in (
        (["--limit", "breake=2"], "--limit breake: is not a limit; did you mean brake?"),
        (["--limit", "brake=900"], "outside [0.1, 20] m/s^2"),
        (["--limit", "status_period=0.02", "--fast-bits", "30000"], "fast radio: 3 drones would take"),
        (["--autopilot", "naza"], "none of px4, ardupilot"), (["--limit", "base=1"], "SafetyLimits.base = 1 m"),
    ):  # fmt: skip
        code, _, lines = airflock("fly", "prepare", REAL, *HERE, *more)
        assert code == 2 and any(part in line for line in lines), (more, lines)
    code, _, lines = airflock(
        "fly", "prepare", REAL, "--site", "47,190,0", "--members", "1-3,2", "--limit", "breake=2", "--autopilot", "naza"
    )
    for part in ("did you mean brake?", "longitude", "occurs twice", "none of px4, ardupilot"):
        assert any(part in line for line in lines), (part, lines)
    code, _, (line,) = airflock("fleet", "vicsek_1995/ordered", "--duration", "1")  # of 300 agents, all of whom it told
    assert code == 2 and "members: 251 is none of the system ids from 1 to 250" in line
    code, _, lines = airflock("fly", "prepare", "dimock_2003/published", "--site", "47,19,0", "--members", "1-3")
    assert code == 2 and lines
    assert not list(tmp_path.iterdir())


def test_a_field_is_flown_only_where_its_map_lies(airflock, tmp_path, seed):
    """Drawn sites, on the field, near it and far from it; and maps whose latitude comes first."""
    rng, counted = random.Random(seed), Counter()
    for _ in range(50):
        site = FlightSite(rng.uniform(20.0, 50.0), rng.uniform(70.0, 84.0), 0.0)  # either could be a latitude
        offset = rng.choice([0.0, rng.uniform(2.0, 99.0), rng.uniform(101.0, 900.0), rng.uniform(1e4, 1e6)])
        bearing, swapped = rng.uniform(0.0, 6.28), rng.random() < 0.3
        ring = [site.to_geodetic(x, y, 0.0) for x, y in ((-90, -90), (90, -90), (90, 90), (-90, 90), (-90, -90))]
        points = [(p.latitude, p.longitude)[:: 1 if swapped else -1] for p in ring]
        (tmp_path / "a.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [points]}))
        place = site.to_geodetic(offset * math.cos(bearing), offset * math.sin(bearing), 0.0)
        words = ["--set", "world.file=a.geojson", "--site", f"{place.latitude:.8f},{place.longitude:.8f},0"]
        words += ["--set", "agents=3", "--members", "1-3", "--set", "world.arena=polygon"]
        for file in tmp_path.glob("mission.*"):
            file.unlink()
        code, _, lines = airflock("fly", "prepare", REAL, *words)
        text = "\n".join(lines)
        counted[code, offset > 0.0, swapped] += 1
        assert code == (2 if swapped or offset > 100.0 else 0), text
        assert ("latitude and longitude seem to be exchanged" in text) is (swapped and offset < 2e4), text
        assert ("its outline is flown at the site" in text) is (0.0 < offset < 100.0 and not swapped), text
        if code:
            assert not list(tmp_path.glob("mission.*")) and "--move-field" in text
            assert airflock("fly", "prepare", REAL, *words, "--move-field")[0] == 0
    assert len(counted) >= 5


def test_what_a_card_leaves_off_is_said_in_a_line(airflock, tmp_path):
    (tmp_path / "mine.toml").write_text(
        f'extends = "{REAL}"\n[[faults]]\nkind = "motor"\nat = 5\nagents = [1]\n'
        '[[faults]]\nkind = "clock"\nper_hour = 2\n'
        '[[faults]]\nkind = "motor"\nat = 9\nagents = [2]\n'
        '[[groups]]\nname = "all"\nmodel = { p_rep = { value = 0.13, spread = 0.01 } }\n'
    )
    code, _, lines = airflock("fly", "prepare", "mine.toml", *HERE)
    assert code == 0 and [line for line in lines if "leaves off" in line] == [
        "note: the card leaves off the scenario's faults: motor, clock",
        "note: the card leaves off the scenario's tolerances of groups: p_rep",
    ]
    code, _, lines = airflock("fly", "prepare", REAL, *HERE, "--out", "other.json")
    assert code == 0 and not [line for line in lines if "leaves off" in line]


def test_orders_are_checked_before_they_are_sent(airflock):
    airflock("fly", "prepare", REAL, *HERE)
    code, _, lines = airflock("fly", "order", "mission.json", "strat", "--radio", "udp:127.0.0.1:1", "--target", 9)
    assert code == 2 and len(lines) == 2 and "strat: is not an order" in lines[0] and "members are 1, 2, 3" in lines[1]
    code, _, lines = airflock("fly", "order", "mission.json", "goto", "--radio", "udp:127.0.0.1:39433")
    assert code == 2 and "goto needs it" in lines[0]
    code, _, lines = airflock("fly", "order", "mission.json", "hold", "--radio", "udp:127.0.0.1:39433")
    assert code == 2 and "cannot send" in lines[0]
    code, _, _ = airflock("fly", "order", "mission.json", "hold", "--radio", "udp:127.0.0.1:39433>127.0.0.1:39434")
    assert code == 0


def test_a_preparation_says_what_the_scenario_did_not_fly(airflock):
    """A card for another number of drones, or for drones quicker than the body: tau 1 s and a_max 6 m/s^2 here."""
    agents, given = ["--set", "agents=3"], "what the scenario gives a card"
    code, _, lines = airflock("fly", "prepare", REAL, *HERE, *agents, "--limit", "response=1", "--limit", "brake=6")
    assert code == 0 and not [line for line in lines if "scenario" in line]
    limits = ["--limit", "response=0.01", "--limit", "brake=20", "--limit", "accel=7", "--out", "other.json"]
    code, _, lines = airflock("fly", "prepare", REAL, *HERE, *limits)
    told = [line for line in lines if line.startswith("note: ")]
    assert code == 0 and told[0].startswith("note: the card is for 3 drones, the scenario flies ")
    assert told[1].startswith(f"note: response = 0.01 s is shorter than {given}, 1 s: ")
    assert told[2].startswith(f"note: accel = 7 m/s^2 is more than {given}, 6 m/s^2: ")
    assert told[3].startswith(f"note: brake = 20 m/s^2 is more than {given}, 6 m/s^2: ")


@pytest.mark.parametrize(
    ("point", "said"),
    [
        ("47.5,19.04,20", "lies -100 m above the site; the fence reaches from 2 to 30 m (ALT is above sea level"),
        ("47.501,19.04,140", "m outside of the fence"), ("1,2,140", "m outside of the fence"),
        ("nan,19.04,140", "is not LAT,LON,ALT"),
    ],
)  # fmt: skip
def test_nobody_is_sent_to_a_point_that_every_drone_would_refuse(airflock, point, said):
    airflock("fly", "prepare", REAL, *HERE)
    radio = ["--radio", "udp:127.0.0.1:39433>127.0.0.1:39434"]
    code, out, lines = airflock("fly", "order", "mission.json", "goto", "--point", point, *radio)
    assert code == 2 and not out and len(lines) == 1 and lines[0].startswith(f"airflock: --point {point}: ")
    assert said in lines[0]


@pytest.mark.parametrize(
    ("autopilot", "guard", "silent"), [("px4", "COM_OF_LOSS_T", 1.0), ("ardupilot", "GUID_TIMEOUT", 3.0)]
)
@pytest.mark.parametrize("preset", ["vasarhelyi_2018/32ms", REAL])
def test_how_far_a_drone_flies_on_without_setpoints_is_told_for_its_own_limits(
    airflock, preset, autopilot, guard, silent
):
    """It keeps its speed until the time-out, and e-folds in `response` from then on: v (T + response) in all."""
    _, _, lines = airflock("fly", "prepare", preset, *HERE[:4], "--autopilot", autopilot, "--limit", "response=0.5")
    (line,) = [line for line in lines if guard in line]
    fast = 1.5 * float(preset.rpartition("/")[2].strip("real_ms"))
    assert line.endswith(f": {fast * (silent + 0.5):.3g} m at the limit of {fast:g} m/s with {silent:g} s")


def test_a_point_within_the_fence_is_sent_and_a_kill_tells_its_second_step(airflock):
    airflock("fly", "prepare", REAL, *HERE)
    radio = ["--radio", "udp:127.0.0.1:39433>127.0.0.1:39434"]
    code, _, lines = airflock("fly", "order", "mission.json", "goto", "--point", "47.5001,19.04,140", *radio)
    assert code == 0 and lines == ["sent GOTO to all"]
    _, _, lines = airflock("fly", "order", "mission.json", "kill", *radio)
    assert lines == ["sent KILL to all; the motors stop when kill --confirm follows within 5 s"]
    _, _, lines = airflock("fly", "order", "mission.json", "kill", "--confirm", *radio)
    assert lines == ["sent CONFIRM_KILL to all"]


def test_a_node_that_a_service_stops_keeps_its_log_and_its_memory(airflock, tmp_path):
    airflock("fly", "prepare", REAL, *HERE)
    ports = ["--autopilot", "udp:127.0.0.1:39435", "--radio", "udp:127.0.0.1:39436>127.0.0.1:39437"]
    command = [
        sys.executable,
        "-m",
        "airflock.drones.onboard",
        "mission.json",
        "--member",
        "2",
        "--i-am-the-pilot",
        *ports,
    ]
    node = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 30.0
    while not (tmp_path / "mission-2.memory").exists() and time.monotonic() < until:  # saved at the first tick
        time.sleep(0.01)
    time.sleep(0.2)  # less than the second after which it saves again
    node.terminate()
    _, told = node.communicate(timeout=30.0)
    assert node.returncode == 2 and told.startswith("airflock: stopped; ")
    (log,) = tmp_path.glob("mission-2-*.log")
    code, out, lines = airflock("fly", "replay", "mission.json", log, "--json")
    assert code == 0 and json.loads(out)["ticks"] >= 2 and not lines, "what it did since it last saved"


@pytest.mark.parametrize("hears", ["nobody", "a full disk"])
def test_a_node_flies_on_when_the_terminal_that_it_was_started_from_has_gone(airflock, tmp_path, hears):
    airflock("fly", "prepare", REAL, *HERE)
    ports = ["--autopilot", "udp:127.0.0.1:39438", "--radio", "udp:127.0.0.1:39439>127.0.0.1:39440"]
    command = [
        sys.executable,
        "-m",
        "airflock.drones.onboard",
        "mission.json",
        "--member",
        "2",
        "--i-am-the-pilot",
        *ports,
    ]
    if hears == "nobody":
        reads, writes = os.pipe()
        os.close(reads)
    else:
        writes = os.open("/dev/full", os.O_WRONLY)
    with os.fdopen(writes, "w") as out:
        node = subprocess.Popen(command, stdout=out, stderr=subprocess.PIPE, text=True)
    memory, until = tmp_path / "mission-2.memory", time.monotonic() + 60.0
    while not memory.exists() and time.monotonic() < until:
        time.sleep(0.01)
    node.send_signal(signal.SIGHUP)
    time.sleep(6.0)  # after 3 s it says that no autopilot is heard
    assert node.poll() is None, node.communicate()
    node.terminate()
    _, told = node.communicate(timeout=60.0)
    assert "airflock: stopped; " in told and "No space" not in told and "pipe" not in told.lower().replace("stdout", "")
    (log,) = tmp_path.glob("mission-2-*.log")
    assert '"notes":["missing: no heartbeat' in log.read_text()


@pytest.mark.parametrize("host", ["nobody.invalid", "a..b", "x" * 70])
@pytest.mark.parametrize("port", ["udp:{}:39432", "udp:127.0.0.1:39432>{}:39433"])
def test_a_check_on_the_ground_finds_a_radio_whose_name_leads_nowhere(airflock, host, port):
    airflock("fly", "prepare", REAL, *HERE)
    radio = port.format(host)
    autopilot = ["--autopilot", "udp:127.0.0.1:39431"]
    code, out, lines = airflock("fly", "mission.json", "--member", 2, *autopilot, "--radio", radio, "--check")
    assert code == 2 and not out and len(lines) == 1 and lines[0].startswith(f"airflock: {radio}: ")


def test_log_of_another_version_is_reported_with_the_ticks_that_differ(airflock, tmp_path):
    airflock("fly", "prepare", REAL, *HERE)
    found, key = read_card(tmp_path / "mission.json"), read_key(tmp_path / "mission.key")
    lines, usual = [], {"memory": NodeMemory(), "radios": (0.1,)}
    node = LoggingNode(Node(found, 2, key, now=0.0, utc=10**15, **usual), lines.append, now=0.0, **usual)
    for k in range(100):
        node.tick(0.05 * k)
    log = tmp_path / "x.log"
    log.write_text("\n".join(lines) + "\n")
    code, _, told = airflock("fly", "replay", "mission.json", "x.log")
    assert code == 0 and told[-1] == "100 ticks, 0 with another output than was logged"
    head = json.loads(lines[0])
    assert head.pop("version") == code_version()
    lines[0] = json.dumps(head)
    for k, phase in ((40, "BOOT"), (41, "READY"), (95, "BOOT")):
        lines[k] = json.dumps(json.loads(lines[k]) | {"out": "0" * 16, "phase": phase})
    log.write_text("\n".join(lines) + "\n")
    code, _, told = airflock("fly", "replay", "mission.json", "x.log")
    assert code == 2 and "flown by another version (an earlier one; this is " in told[-1] and "3 of 100" in told[-1]
    said = "\n".join(told)
    assert "1.95 to 2.00 s  2 ticks with another output" in said and "4.70 to 4.70 s  1 ticks" in said
    assert "2.00 s  the log says READY, this version BOOT" in said
    _, out, _ = airflock("fly", "replay", "mission.json", "x.log", "--json")
    assert (
        json.loads(out)["different"] == pytest.approx([1.95, 2.0, 4.7])
        and "earlier" in json.loads(out)["another_version"]
    )


def test_a_file_that_is_no_log_is_one_line(airflock, tmp_path):
    airflock("fly", "prepare", REAL, *HERE)
    for content in (b"{}\n", b"\xff\xfe", b""):
        (tmp_path / "x.log").write_bytes(content)
        code, _, lines = airflock("fly", "replay", "mission.json", "x.log")
        assert code == 2 and len(lines) == 1


def test_a_fleet_is_flown_and_told(airflock):
    code, out, _ = airflock("fleet", REAL, "--agents", 3, "--duration", 2, "--json")
    (run,) = json.loads(out)["runs"]
    assert code == 0 and run["phases"] == ["FLOCK"] * 3 and run["phi_vel"] > 0.5 and len(run["sha256"]) == 64
    code, _, lines = airflock(
        "fleet", REAL, "--vehicle", "naza", "--against", "nature", "--save", "x.txt", "--set", "worl.side=1"
    )
    assert code == 2 and len(lines) >= 4


def test_how_a_fleet_flies_is_checked_at_once(airflock, tmp_path):
    (tmp_path / "wrong.toml").write_text('[[fault]]\nkind = "los"\n')
    wrong = ["--mode", "procs", "--body", "quad", "--vehicle", "px5", "--faults", "wrong.toml"]
    code, _, lines = airflock("fleet", REAL, *wrong, "--agents", 2)
    assert code == 2 and len(lines) == 4
    told = ("px4, ardupilot", "multirotor, quadrotor", "lockstep, tasks, processes", "kind = 'los' is none of")
    for line, part in zip(lines, told, strict=True):
        assert part in line
    (tmp_path / "wakes.toml").write_text('[[fault]]\nkind = "node"\nend = 5\n')
    code, _, lines = airflock("fleet", REAL, "--agents", 2, "--mode", "tasks", "--faults", "wakes.toml")
    assert code == 2 and lines == ["airflock: fault node: on the real clock a node that died stays dead; leave out end"]


def test_a_fleet_on_the_real_clock_tells_what_it_cost(airflock):
    short = ["--agents", 2, "--duration", 1, "--set", "radio.delay=0.1", "--set", "world.side=120"]
    code, out, _ = airflock("fleet", REAL, *short, "--mode", "tasks", "--body", "quadrotor", "--json")
    (run,) = json.loads(out)["runs"]
    assert code == 0 and run["load"]["ticks"] > 0 and run["load"]["cores"] > 0.0 and len(run["phases"]) == 2


@pytest.mark.parametrize(
    "words",
    [
        ["fly", "prepare", REAL, *HERE],
        ["fleet", REAL, "--agents", "2", "--duration", "1", "--set", "world.side=120"],
        ["plot", REAL, "--kind", "rules", "--out", "rules.png"],
    ],
    ids=["fly prepare", "fleet", "plot"],
)
def test_how_a_value_was_read_is_told(airflock, words):
    code, _, lines = airflock(*words, "--set", "delay=400ms")
    assert code == 0 and "note: radio.delay = 400 ms is 0.4 s" in lines
