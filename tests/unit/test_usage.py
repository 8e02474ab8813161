"""A wrong command line ends with one line in the words of every other fault, and with status 2."""

import math
import re
from bdb import BdbQuit
from pathlib import Path

import pytest
from typer.main import get_command

import airflock
from airflock.cli.command import VERBS
from airflock.cli.flight_verbs import merge_similar_notes
from airflock.cli.main import app, main
from airflock.recordings.sweeps import metric_to_show
from airflock.scenarios.files import load
from airflock.support.errors import AirflockError
from airflock.view.plot_by_kind import KINDS


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("rum x", "rum: unknown command; did you mean run?"),
        ("xyzzy", "xyzzy: unknown command; airflock --help lists them"),
        ("--hlep", "--hlep: unknown option; did you mean --help?"),
        ("run x --sed 3", "run: --sed: unknown option; did you mean --seeds?"),
        ("import x.csv --out y.nc", "import: --out: unknown option; did you mean --save?"),
        ("evolve x --output y", "evolve: --output: unknown option; did you mean --out?"),
        (
            "harden x --margin faults",
            "harden: --margin was removed; give the distance itself: --limit 'r_min<3 at 0.01/h'",
        ),
        ("run x --zzz", "run: --zzz: unknown option; airflock run --help lists them"),
        ("run vasarhelyi_2018/real_4ms --seeds 0", "run: --seeds 0 lies outside [1, 1000000]"),
        ("run vasarhelyi_2018/real_4ms --seeds=-3", "run: --seeds -3 lies outside [1, 1000000]"),
        ("run vasarhelyi_2018/real_4ms --seeds abc", "run: --seeds abc is not a number; give [1, 1000000]"),
        ("run vasarhelyi_2018/real_4ms --seeds 1.5", "run: --seeds 1.5 is not a whole number; give [1, 1000000]"),
        ("run vasarhelyi_2018/real_4ms --first-seed -1", "run: --first-seed -1 lies outside [0, inf]"),
        (
            "run vasarhelyi_2018/real_4ms --duration soon",
            "--duration soon: write a time above 0 such as 90s, 10min or 2h",
        ),
        ("run vasarhelyi_2018/real_4ms --seeds 0 --seeds 5 --threads 0", "run: --threads 0 lies outside [1, inf]"),
        ("run x --seeds", "--seeds needs a value"),
        ("presets --for-speed nan", "presets: --for-speed nan is not a finite number; give [0.1, 100]"),
        (
            "harden vasarhelyi_2018/real_4ms --out y.toml --cost nan",
            "harden: --cost nan is not a finite number; give [0, inf]",
        ),
        ("display AIR --spacing=nan", "display: --spacing nan is not a finite number; give [2.5, 100]"),
        ("replay x --rate NaN", "replay: --rate nan is not a finite number; give [0.1, 100]"),
        (
            "fly prepare vasarhelyi_2018/real_4ms --site 0,0,0 --members 1 --margin 1e999",
            "fly prepare: --margin inf is not a finite number",
        ),
        (
            "fly prepare vasarhelyi_2018/real_4ms --site 0,0,0 --members 1 --fast-bits nan",
            "fly prepare: --fast-bits nan is not a finite",
        ),
        ("fly order m.json start --radio udp:1 --in nan", "fly order: --in nan is not a finite number; give [0, 60]"),
        ("run", "run: PRESET|FILE is missing; for instance: airflock run vasarhelyi_2018/4ms --seeds 20"),
        ("run a b c", "run: unexpected b c; it takes PRESET|FILE and options; for instance: airflock run"),
        ("doctor a", "doctor: unexpected a; it takes options alone; for instance: airflock doctor"),
        (
            "presets show vicsek_1995/ordered",
            "presets: unexpected vicsek_1995/ordered; it takes PRESET and options; for instance: airflock presets v",
        ),
        ("run x --seed 3", "run: --seed: unknown option; did you mean --first-seed (of one flight), or --seeds"),
        ("run vasarhelyi_2018/real_4ms --agents -3", "--agents -3 lies outside [1, 1e+07]"),
        ("watch x --agents 0", "--agents 0 lies outside [1, 1e+07]"),
        ("run x --trust=yes", "--trust takes no value; write it alone"),
        ("evolve x --budget 10s", "evolve: --budget: unknown option; airflock evolve --help lists them"),
        ("watch x --duration 1h", "watch: --duration: unknown option; airflock watch --help lists them"),
        ("run x --timesteps 3", "run: --timesteps: unknown option; airflock run --help lists them"),
        ("run x --agent 3", "run: --agent: unknown option; did you mean --agents?"),
        ("sweep x --plots a.png", "sweep: --plots: unknown option; did you mean --plot?"),
        ("plot a --kind serie", "plot: --kind serie is none of trajectories, series, rules, transfer, scene"),
        ("fly prepar", "fly: prepar: unknown command; did you mean prepare?"),
        ("fly prepare a --member 3", "fly prepare: --member: unknown option; did you mean --members?"),
    ],
)
def test_what_typer_refuses_is_told_in_one_line(words, line, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["/anywhere/airflock", *words.split()])
    with pytest.raises(SystemExit) as ended:
        main()
    told = capsys.readouterr()
    assert ended.value.code == 2 and told.out == ""
    assert told.err.startswith(f"airflock: {line}")
    assert len(told.err.splitlines()) == 1


def test_a_search_without_a_folder_asks_for_one_and_names_what_else_is_wrong(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["/anywhere/airflock", "evolve", "a"])
    with pytest.raises(SystemExit) as ended:
        main()
    lines = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2 and len(lines) == 2
    assert lines[0] == "airflock: out is missing; give the folder of the run: --out DIR"
    assert lines[1].startswith("airflock: a: no such file or preset")


@pytest.mark.parametrize("after", [0, 30], ids=["in the probe", "in the flight"])
def test_a_debugger_that_is_left_ends_the_command(after, tmp_path, monkeypatch, capsys):
    stops = []

    def leave():
        stops.append(None)
        if len(stops) > after:
            raise BdbQuit

    text = (
        (Path(__file__).parents[2] / "examples" / "own_rule.py")
        .read_text()
        .replace("    away =", "    breakpoint()\n    away =")
    )
    (tmp_path / "mine.py").write_text(text)
    monkeypatch.setattr("sys.breakpointhook", leave)
    flight = ["--device", "python", "--agents", "12", "--duration", "4"]
    monkeypatch.setattr(
        "sys.argv", ["airflock", "run", "vasarhelyi_2018/4ms", "--law", str(tmp_path / "mine.py"), *flight]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2 and capsys.readouterr().err.splitlines()[-1] == "airflock: interrupted"


def test_a_sweep_shows_what_flights_are_judged_by_and_else_their_order():
    named = {"vasarhelyi_2018/4ms": "fitness", "zapotecatl_2016/best": "quality", "vicsek_1995/ordered": "polarisation"}
    assert {name: metric_to_show(None, [load(name)]) for name in named} == named
    assert metric_to_show(None, [load("vasarhelyi_2018/4ms", {"metrics.kind": "order"})]) == "polarisation"


def test_the_nearest_choice_is_told():
    with pytest.raises(AirflockError, match=rf" is none of {', '.join(KINDS)}; did you mean series\?$"):
        app(["plot", "a", "--kind", "serie"])


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["run", "--help"], ["fly", "--help"]])
def test_what_is_right_ends_well(words, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["airflock", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0 and capsys.readouterr().out


def test_notes_of_a_sweep_that_differ_in_numbers_alone_are_one_line():
    notes = ["delay = 0.1 s is odd", "no walls", "delay = 0.25 s is odd", "delay = 1e-05 s is odd", "delay = x is odd"]
    assert list(merge_similar_notes(notes)) == ["delay = 0.1 s is odd (2 more like it)", "no walls", "delay = x is odd"]


def texts(command, path=()):
    """Every help text of a command and of what is below it, with where it stands."""
    yield (*path, "help"), command.help or ""
    for parameter in command.params:
        yield (*path, parameter.name), getattr(parameter, "help", None) or ""
    for name, below in getattr(command, "commands", {}).items():
        yield from texts(below, (*path, name))


def test_no_square_bracket_of_a_help_is_taken_for_markup():
    found = {where: re.findall(r"(?<!\\)\[(?!/?bold\])[^\]]*\]", text) for where, text in texts(get_command(app))}
    assert {where: brackets for where, brackets in found.items() if brackets} == {}


@pytest.mark.parametrize(
    ("words", "file"),
    [
        ("certify mine.toml --limit r_min<1 --out mine.toml", "mine.toml"),
        ("certify mine.toml --limit r_min<1 --out ../here/mine.toml", "mine.toml"),
        ("harden mine.toml --out mine.toml", "mine.toml"),
        ("identify fish.nc --like mine.toml --out mine.toml", "mine.toml"),
        ("infer fish.nc --models vicsek_1995,mine.toml --out mine.toml", "mine.toml"),
        ("import fish.nc --save fish.nc", "fish.nc"),
        ("export fish.nc --out fish.nc", "fish.nc"),
        ("display heart.png --plot heart.png", "heart.png"),
    ],
)
def test_no_command_writes_over_the_file_that_it_reads(words, file, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for name in ("mine.toml", "fish.nc", "heart.png"):
        Path(name).write_text("duration = 5.0\n")
    monkeypatch.setattr("sys.argv", ["airflock", *words.split()])
    with pytest.raises(SystemExit) as ended:
        main()
    assert (
        ended.value.code == 2
        and f"{file}: is an input and would be overwritten; give another" in capsys.readouterr().err
    )
    assert Path(file).read_text() == "duration = 5.0\n"


@pytest.mark.parametrize("ours", [math.nan, math.inf, -1.0])
def test_what_is_no_number_is_refused_in_python_too(ours, tmp_path):
    """nan passed the comparisons with the ends of ranges: a set of nans was written, and hardening kept whatever."""
    small = {"agents": 4, "duration": 1.0}
    for call in (
        lambda: airflock.starting_set(ours),
        lambda: airflock.harden(load("vasarhelyi_2018/4ms", small), range(2), cost=ours),
        lambda: airflock.display(["I"], 4, spacing=ours),
        lambda: airflock.replay(airflock.simulate(load("vasarhelyi_2018/4ms", small)), rate=ours),
        lambda: airflock.tune("vasarhelyi_2018/4ms", tmp_path / "tuned", budget=ours),
    ):
        with pytest.raises(AirflockError, match=f"{ours:g}"):
            call()


def test_to_resume_nothing_is_refused_by_every_command_that_can_resume(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    resuming = [name for name, verb in VERBS.items() if "resume" in verb.options]
    assert {"sweep", "evolve", "certify", "tune"} <= {*resuming}
    for name in resuming:
        monkeypatch.setattr("sys.argv", ["airflock", name, "--resume"])
        with pytest.raises(SystemExit) as ended:
            main()
        lines = capsys.readouterr().err
        assert ended.value.code == 2 and lines.startswith("airflock: ") and "unexpected" not in lines, (name, lines)
    assert not list(tmp_path.iterdir())
