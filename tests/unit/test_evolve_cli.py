"""Verbs evolve and harden from the command line, with real but tiny flights."""

import json
import re
import signal
import sqlite3
import subprocess
import sys
import time
import tomllib

from processes import called, hear_interrupts

SHORT = ["--duration", "5", "--agents", "8", "--set", "dt=0.05"]
NAME = "vasarhelyi_2018/4ms"


def command(*arguments):
    return [sys.executable, "-m", "airflock", *map(str, arguments)]


def landed(folder):
    file = folder / "evaluations.sqlite"
    if not file.exists():
        return 0
    try:
        with sqlite3.connect(f"file:{file}?mode=ro", uri=True) as connection:
            return connection.execute("SELECT count(*) FROM flight").fetchone()[0]
    except sqlite3.OperationalError:
        return 0  # not yet made


def planned(lines):
    """Flights of the search and of finals as the plan says before anything flies."""
    found = re.search(r"^plan: ([\d,]+) flights .* then about ([\d,]+) of finalists$", lines, re.M)
    return [int(number.replace(",", "")) for number in found.groups()]


def test_evolve_prints_json_its_best_flies_and_hardens(tmp_path, request):
    asked = ["evolve", NAME, "--population", 4, "--generations", 2, *SHORT, "--json", "--out", tmp_path / "a"]
    done = called(*asked)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["working_ranges"]["candidates"] == 8 and found["fitness"]["seeds"] == 100
    assert tomllib.loads((tmp_path / "a" / "result.toml").read_text())["parameters"] == found["parameters"]
    search, finals = planned(done.stderr)
    with sqlite3.connect(tmp_path / "a" / "evaluations.sqlite") as connection:
        flown = dict(connection.execute("SELECT stage = 'search', count(*) FROM flight GROUP BY 1").fetchall())
    assert flown[1] == search and flown[0] <= finals
    request.getfixturevalue("undrawn")  # one set of pictures is enough
    flown = called("run", tmp_path / "a" / "best.toml", "--json", "--first-seed", 3)
    assert flown.returncode == 0 and "fitness" in json.loads(flown.stdout)["runs"][0]
    again = called(*asked)
    assert again.returncode == 2 and "continue it with --resume" in again.stderr
    resumed = json.loads(called(*asked, "--resume").stdout)
    assert resumed["parameters"] == found["parameters"] and resumed["fitness"] == found["fitness"]
    bare = called("evolve", NAME, "--resume", "--json", "--out", tmp_path / "a")
    note = "search.population = 4 there, 100 now; search.generations = 2 there, 150 now"
    assert note in bare.stderr and "goes on with what" in bare.stderr
    assert json.loads(bare.stdout)["fitness"] == found["fitness"]
    other = called("evolve", NAME, "--resume", "--population", 6, "--out", tmp_path / "a")
    assert other.returncode == 2 and other.stderr.count("\n") == 1, other.stderr
    assert "holds another study: search.population = 4 there, 6 now; give another --out, or ask for" in other.stderr
    out = tmp_path / "flyable.toml"
    hardened = called("harden", tmp_path / "a", "--out", out, "--seeds", 5, "--json")
    steps = json.loads(hardened.stdout)["steps"]
    assert hardened.returncode == (0 if steps[-1]["kept"] else 1), hardened.stderr
    assert (
        steps[0]["name"] == "optimum" and steps[0]["cost"] == [0.0, 0.0, 0.0] and steps[-1]["name"] == "on fresh seeds"
    )
    assert called("validate", out).returncode == 0


def test_ctrl_c_ends_with_one_line_and_keeps_what_has_landed(tmp_path):
    asked = command("evolve", NAME, "--generations", 5000, *SHORT, "--out", tmp_path / "a")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    running = subprocess.Popen(asked, **pipes, text=True, preexec_fn=hear_interrupts)
    try:
        while landed(tmp_path / "a") < 50 and running.poll() is None:
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        _, told = running.communicate(timeout=60)
    finally:
        running.kill()
    plan, *ends = told.splitlines()  # the plan was said when the search began
    assert plan.startswith("plan: 500,000 flights") and running.returncode == 2 and len(ends) == 1, told
    assert "flights are stored in" in told and "continue with --resume" in told
    assert landed(tmp_path / "a") >= 50


def test_a_second_writer_is_refused_in_one_line(tmp_path):
    asked = command("evolve", NAME, "--generations", 5000, *SHORT, "--out", tmp_path / "a")
    running = subprocess.Popen(asked, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while landed(tmp_path / "a") < 1 and running.poll() is None:
            time.sleep(0.05)
        running.send_signal(signal.SIGSTOP)  # it has the folder, and flies nothing meanwhile
        second = subprocess.run([*asked, "--resume"], capture_output=True, text=True, timeout=120)
        assert second.returncode == 2 and second.stderr.count("\n") == 1
        assert f"another process (process {running.pid} on" in second.stderr
    finally:
        running.kill()
        running.wait()
