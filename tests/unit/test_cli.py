"""The command line: what it prints, and that bad input ends with one line and status 2."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from typer.main import get_command

import airflock
from airflock.cli.main import app
from processes import called, hear_interrupts

SHORT = ["--duration", "2", "--agents", "10"]


def test_run_prints_one_json_object_with_the_published_keys():
    command = [sys.executable, "-m", "airflock", "run", "vasarhelyi_2018/4ms", "--seeds", "2", "--json", *SHORT]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    keys = [
        "phi_vel",
        "phi_corr",
        "r_min_mean",
        "r_min",
        "phi_coll",
        "n_coll",
        "phi_wall",
        "n_disc",
        "n_min",
        "phi_lap",
        "f_speed",
        "f_coll",
        "f_disc",
        "f_cluster",
        "f_wall",
        "f_corr",
        "fitness",
    ]
    assert found["seeds"] == 2 and [run["seed"] for run in found["runs"]] == [0, 1]
    for part in (*found["runs"], found["mean"], found["std"], found["median"]):
        assert set(keys) <= set(part)
    first, second = (run["phi_vel"] for run in found["runs"])
    assert first != second
    assert found["mean"]["phi_vel"] == pytest.approx((first + second) / 2)
    assert found["median"]["phi_vel"] == pytest.approx((first + second) / 2)


def test_first_seed_flies_the_same_flight_as_the_same_seed_among_many():
    many = json.loads(called("run", "vasarhelyi_2018/4ms", "--seeds", 3, "--json", *SHORT).stdout)["runs"]
    one = json.loads(called("run", "vasarhelyi_2018/4ms", "--first-seed", 2, "--json", *SHORT).stdout)["runs"]
    assert one == many[2:]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "vasarhelyi_2018/4m"], ["no such file or preset", "did you mean vasarhelyi_2018/4ms?"]),
        (["run", "nope.toml"], ["nope.toml: no such file or preset; airflock presets lists the presets"]),
        (["fleet", "vasarhelyi_2018/real_4ms", "--mode", "proceses"], ["--mode proceses", "did you mean processes?"]),
        (["run", "vasarhelyi_2018/4ms", "--set", "model.p_repp=1"], ["model.p_repp", "did you mean model.p_rep?"]),
        (["run", "vasarhelyi_2018/4ms", "--set", "model.r0_rep=-4"], ["model.r0_rep = -4 m", "[0, 1000] m"]),
        (["run", "vasarhelyi_2018/4ms", "--set", "model.limit=capp"], ["model.limit", "did you mean cap?"]),
        (["run", "vasarhelyi_2018/4ms", "--set", "p_rep"], ["--set p_rep", "KEY=VALUE"]),
        (["run", "vasarhelyi_2018/4ms", "--agents", "3000"], ["agents = 3000 do not fit", "start.separation = 8 m"]),
        (["run", "vasarhelyi_2018/4ms", "--save", "/nowhere/x.nc"], ["/nowhere/x.nc", "does not exist"]),
        (["sweep", "vasarhelyi_2018/4ms", "--over", "radio.delay=0:x:3"], ["--over", "low:high:count"]),
        (["score", "nothing.nc"], ["nothing.nc", "no such file"]),
        (["paper", "vasarheli_2018"], ["unknown paper", "did you mean vasarhelyi_2018?"]),
    ],
)
def test_bad_input_ends_with_one_line_that_names_it_and_status_2(arguments, words):
    done = called(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("airflock: ")
    for word in words:
        assert word in lines[0]


def test_all_faults_of_a_file_are_reported_together(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text(
        'agents = "many"\nduratoin = 3\n[model]\nkind = "vasarhelyi"\n[sensors]\nperiod = -1\n'
        '[world]\narena = "polygon"\ncorners = [[0, 0], [10, 0], [0, 10], [10, 10]]\n'
        '[radio]\nrange = { value = 80, unit = "kg" }\n'
    )
    done = called("validate", file)
    assert done.returncode == 2
    crossed = "crosses or touches itself"
    for word in ("agents", "duratoin", "model.kind", "sensors.period = -1 s", crossed, "the unit is m"):
        assert word in done.stderr
    assert len(done.stderr.strip().splitlines()) == 6


def test_a_recording_scores_like_its_flight_and_flies_again_to_the_same_bits(tmp_path):
    file = tmp_path / "flight.nc"
    same = ["--set", "metrics.collision_period=0.2", "--precision", "64", *SHORT]
    flown = json.loads(called("run", "vasarhelyi_2018/4ms", "--json", "--save", file, *same).stdout)["runs"][0]
    scored = json.loads(called("score", file, "--json").stdout)["runs"][0]
    for key in flown.keys() & scored.keys() - {"seed"}:
        assert scored[key] == pytest.approx(flown[key], abs=1e-9), key
    again = called("validate", file)
    assert again.returncode == 0 and "same bits" in again.stdout
    assert list(tmp_path.iterdir()) == [file]


def test_a_recording_says_what_its_flight_looked_for_between_frames(tmp_path):
    """A flight looks for collisions at every step; its recording has frames 0.2 s apart and told others, in silence."""
    file = tmp_path / "flight.nc"
    for more, told in (([], 1), (["--set", "metrics.collision_period=0.2"], 0)):
        assert called("run", "vasarhelyi_2018/4ms", "--save", file, *more, *SHORT).returncode == 0
        done = called("score", file)
        assert done.stderr.count("phi_coll, n_coll and what follows from them: by frames 0.2 s apart") == told
        assert done.stderr.count("looked every 0.01 s") == told


def test_a_preset_is_shown_as_json_too():
    """`--json` was taken, and TOML was printed."""
    for words in (["vicsek_1995/ordered"], ["--for-speed", "6"]):
        plain, found = called("presets", *words).stdout, called("presets", *words, "--json").stdout
        assert json.loads(found) == tomllib.loads(plain)


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path):
    folder = tmp_path / "folder.nc"
    folder.mkdir()
    done = called("run", "vasarhelyi_2018/4ms", "--save", folder, *SHORT)
    assert done.returncode == 2 and "folder.nc" in done.stderr
    assert list(tmp_path.iterdir()) == [folder] and list(folder.iterdir()) == []


def test_a_disk_that_fills_up_takes_no_score_away(tmp_path, monkeypatch, capsys):
    from airflock import recordings
    from airflock.cli.main import app
    from airflock.recordings import recording_files as files
    from airflock.support.errors import RecordingError

    def full(recording, path):
        raise RecordingError(f"{path}: No space left on device; nothing was saved")

    for home in (files, recordings):  # where it is, and the door through which the command reaches it
        monkeypatch.setattr(home, "save", full)
    few = ["--device", "python", "--agents", "2", "--duration", "1", "--json", "--save", str(tmp_path / "a.nc")]
    with pytest.raises(RecordingError, match="No space left"):
        app(["run", "vicsek_1995/ordered", *few], standalone_mode=False)
    assert 0.0 <= json.loads(capsys.readouterr().out)["runs"][0]["polarisation"] <= 1.0


def test_a_cut_off_recording_is_refused(tmp_path):
    file = tmp_path / "flight.nc"
    assert called("run", "vasarhelyi_2018/4ms", "--save", file, *SHORT).returncode == 0
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    done = called("score", file)
    assert done.returncode == 2 and "is not a netCDF recording" in done.stderr


def test_starting_set_is_a_valid_scenario_and_table_s1_at_its_own_speeds(tmp_path):
    from airflock.scenarios.files import load

    for speed in ("4", "16"):
        file = tmp_path / f"{speed}.toml"
        file.write_text(called("presets", "--for-speed", speed).stdout)
        ours, published = load(file).parameters, load(f"vasarhelyi_2018/{speed}ms").parameters
        for name in ("r0_rep", "p_rep", "r0_frict", "c_frict", "v_frict", "v_shill", "a_shill"):
            assert getattr(ours, name) == pytest.approx(getattr(published, name), rel=1e-3)
    file.write_text(called("presets", "--for-speed", "12").stdout)
    between = load(file).parameters
    assert between.v_shill >= 2.0 * 12.0
    assert (
        load("vasarhelyi_2018/8ms").parameters.r0_rep < between.r0_rep < load("vasarhelyi_2018/16ms").parameters.r0_rep
    )


def test_every_verb_has_help_with_an_example():
    verbs = list(get_command(app).commands)
    listing = called("--help").stdout
    assert {"run", "evolve", "harden", "display"} < set(verbs)
    for verb in verbs:
        assert verb in listing
        help_text = called(verb, "--help").stdout
        assert f"airflock {verb}" in " ".join(help_text.split()) and "Example" in help_text


def test_interrupt_ends_with_one_line_and_status_2():
    import signal
    import time

    ready = "import airflock.cli as cli; print('ready', flush=True); cli.main()"  # from there on it hears
    command = [sys.executable, "-c", ready, "run", "vasarhelyi_2018/4ms", "--seeds", "2000"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes, cwd=Path.home(), preexec_fn=hear_interrupts) as running:
        try:
            assert running.stdout.readline() == "ready\n"
            time.sleep(2.0)
            running.send_signal(signal.SIGINT)
            _, stderr = running.communicate(timeout=120)
        finally:
            running.kill()
    assert running.returncode == 2
    *notes, last = stderr.strip().splitlines()
    assert last.startswith("airflock: interrupted") and all(line.startswith("note: ") for line in notes)


def test_a_time_flown_may_carry_its_unit():
    from airflock.cli.options import parse_settings

    assert parse_settings(None, None, "600") == {"duration": 600.0}
    assert airflock.load("vasarhelyi_2018/4ms", parse_settings(None, 4, "2min")).flight.duration == 120.0
    assert "--duration 2m: write a time" in called("run", "vasarhelyi_2018/4ms", "--duration", "2m").stderr


@pytest.mark.parametrize(("name", "words"), [("mine.py", "--law"), ("flight.nc", "airflock score")])
def test_what_is_no_scenario_says_what_takes_it(tmp_path, name, words):
    path = tmp_path / name
    path.write_text("x = 1\n")
    for verb in (["run"], ["evolve", "--out", str(tmp_path / "study")]):
        told = called(verb[0], str(path), *verb[1:]).stderr
        assert words in told and told.count("\n") == 1, told


def test_a_scenario_that_is_not_there_is_named_once(tmp_path):
    told = called("evolve", "vasarhelyi_2018/4m", "--out", str(tmp_path / "study")).stderr
    assert told.startswith("airflock: vasarhelyi_2018/4m: no such file")


@pytest.mark.parametrize("time", ["9" * 400 + "s", "0", "-3", "2mins", "nan", ""])
def test_a_time_that_is_none_is_one_line(time):
    """The first has more digits than a float: an infinite budget ended in an OverflowError."""
    for command in (["certify", "vasarhelyi_2018/4ms", "--limit", "r_min<1 at 1/h", f"--budget={time}"],
                    ["run", "vasarhelyi_2018/4ms", f"--duration={time}"]):  # fmt: skip
        done = called(*command)
        assert done.returncode == 2 and done.stderr.count("\n") == 1 and "write a time above 0" in done.stderr


def test_the_command_ends_without_a_last_look_for_garbage():
    text = """
import atexit, gc, sys
atexit.register(lambda: print(gc.get_freeze_count()))  # what is registered first is called last
sys.argv = ["airflock", "presets"]
from airflock.cli import main
main()
"""
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.splitlines()[-1]) > 1000


def test_presets_shows_scenarios_that_load_and_nothing_else_of_this_computer(tmp_path):
    """A name may be a link to any file, and a scenario may hold letters that turn a terminal's text round."""
    (tmp_path / "link.toml").symlink_to("/etc/passwd")
    (tmp_path / "secrets.toml").write_text('[keys]\ntoken = "x0x0x0"\n')
    (tmp_path / "odd.toml").write_text('extends = "vasarhelyi_2018/4ms"\ntitle = "a\u202eb\té"  # \u2066\n')
    for name in ("/etc/passwd", tmp_path / "link.toml", tmp_path / "secrets.toml", "/dev/null", tmp_path):
        done = called("presets", name)
        assert (done.returncode, done.stdout) == (2, "") and "x0x0" not in done.stderr, done.stderr
        assert done.stderr.startswith("airflock: ") and "root:" not in done.stderr
    done = called("presets", tmp_path / "odd.toml")
    assert done.stdout == 'extends = "vasarhelyi_2018/4ms"\ntitle = "a\\u202eb\té"  # \\u2066\n'
