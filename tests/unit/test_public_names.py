"""Public functions: typed, each argument and the result told; commands and functions match."""

import importlib
import inspect
import json
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import typer.main

import airflock
from airflock.cli.command import VERBS
from airflock.cli.main import app
from airflock.cli.options import ALIASES, SHARED, read_declaration
from airflock.support import log

PACKAGES = {"plots", "measures"}
CLASSES = {"AirflockError", "Scenario", "Flight", "Parameters"}
HOMES = {
    "evolve": "airflock.search.evolution", "certify": "airflock.certificates.certification",
    "display": "airflock.displays.shows", "tune": "airflock.search.tuning_run",
    "identify": "airflock.estimate.identification.vehicle_identification",
    "infer": "airflock.estimate.inference.law_inference", "body": "airflock.core.body",
    "fleet": "airflock.fleets.flying",
}  # fmt: skip
UNITS = {"duration": "s", "budget": "s", "timeout": "s", "start": "s", "stop": "s", "body_length": "m"}
# public functions that no command is: they are what a program does between two of them
LIBRARY_FUNCTIONS = {
    "load", "simulate", "recording_of", "save", "load_recording", "over_time", "starting_set", "presets", "model",
    "open_many",
    "body", "fault", "sensor", "radio", "metric", "metric_set", "check_model", "check_body", "check_metric",
    "check_sensor", "check_radio", "check_topology", "check_fault", "print_law", "quantity", "choice",
    "network_weights", "why",
}  # fmt: skip
FUNCTIONS = sorted(set(airflock.__all__) - PACKAGES - {"__version__"} - CLASSES)  # their examples: test_api_page


def the(name):
    """What stands behind a public name or a dotted one: of a package that can be called, its function."""
    if "." in name:
        home, _, last = name.rpartition(".")
        return getattr(import_module(home), last)
    found = getattr(airflock, name)
    if inspect.ismodule(found):
        found = getattr(import_module(HOMES[name]), name)
    return found


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_and_result_has_a_type(name):
    signature = inspect.signature(the(name))
    assert signature.return_annotation is not signature.empty
    untyped = [p.name for p in signature.parameters.values() if p.annotation is p.empty]
    assert not untyped


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_tells_its_arguments_its_result_and_its_errors(name):
    function = the(name)
    text = inspect.getdoc(function) or ""
    assert "Returns\n-------" in text and "Examples\n--------" in text
    assert re.search(r"\bRaises\b", text) or not inspect.signature(function).parameters  # which errors
    told = {word.strip(" *") for line in text.splitlines() for word in line.partition(" :")[0].split(",")}
    missing = set(inspect.signature(function).parameters) - told
    assert not missing


def test_packages_that_can_be_called_show_the_signature_of_their_function():
    for name in HOMES:
        assert inspect.signature(getattr(airflock, name)) == inspect.signature(the(name))


COMMANDS = typer.main.get_command(app).commands


def test_every_public_function_is_a_command_or_of_the_library():
    commands = {verb.function.removeprefix("airflock.") for verb in VERBS.values() if verb.function}
    assert commands | LIBRARY_FUNCTIONS == set(FUNCTIONS)
    assert set(COMMANDS) == {name for name in VERBS if " " not in name} | {"fly"}


def test_no_cell_of_the_tables_of_commands_and_functions_is_empty():
    text = (Path(__file__).parents[2] / "docs/commands.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in text.splitlines() if line[:1] == "|"
    ]
    rows = [row for row in rows if len(row) == 3]
    assert len(rows) > 30 and [row for row in rows if not all(row)] == []
    assert {name for name in COMMANDS if not any(f"airflock {name}" in row[1] for row in rows)} <= {"doctor", "types"}


@pytest.mark.parametrize("name", sorted(VERBS))
def test_options_of_a_verb_are_arguments_of_its_function_shared_options_and_aliases(name):
    verb = VERBS[name]
    own = f"{verb.body.__module__}.{verb.body.__qualname__}"
    origins = {alias.origin for alias in ALIASES if name in alias.verbs.split()} | {verb.function or own}
    for option in verb.options.values():
        assert option.origin.partition(": ")[0] in origins | {"airflock.cli.options"}, option
    declared = read_declaration(verb.function or verb.body).options
    assert set(declared) <= set(verb.options) | set(verb.without)
    assert {option.name for option in verb.params} == set(verb.options)


@pytest.mark.parametrize("name", sorted({verb.function for verb in VERBS.values() if verb.function}))
def test_what_is_read_of_a_function_is_its_signature(name):
    read, signature = read_declaration(name), inspect.signature(the(name.removeprefix("airflock.")))
    assert list(read.arguments) == [p for p, each in signature.parameters.items() if each.kind is not each.VAR_KEYWORD]
    for option in read.options.values():
        default = signature.parameters[option.name].default
        default = default.stop if isinstance(default, range) else default
        assert default == (inspect.Parameter.empty if option.default is ... else option.default), option.name


def test_no_text_of_an_option_stands_twice():
    """A text is in a docstring, or in the table of shared options; the modules of verbs have none."""
    shared = [option.help for members in SHARED.values() for option in members]
    assert len(set(shared)) == len(shared) and len(SHARED) <= 6 and len(ALIASES) <= 30
    assert not any("help" in alias.changes for alias in ALIASES)
    of_functions = {o.help for verb in VERBS.values() for o in verb.options.values() if "cli.options" not in o.origin}
    assert not of_functions & set(shared)
    for path in (Path(airflock.__file__).parent / "cli").glob("*_verbs.py"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"typer\.(Option|Argument)|metavar=", text), path


def test_a_function_in_one_new_module_is_a_verb_with_help_json_and_example(tmp_path, monkeypatch):
    from typer.testing import CliRunner

    (tmp_path / "counting_verb.py").write_text(
        """from airflock.cli.command import verb

@verb("Look something up")
def count(word: str, *, times: int = 2, loud: bool = False) -> dict:
    \'\'\'Count letters.

    Example: airflock count flock --times 3

    Parameters
    ----------
    word : str (WORD)
        A word to count.
    times : int in [1, 9]
        How often it is counted.
    loud : bool
        With `times`: shout.
    \'\'\'
    return {"letters": len(word) * times, "loud": loud}
"""
    )
    monkeypatch.syspath_prepend(tmp_path)
    importlib.import_module("counting_verb")
    try:
        run = CliRunner().invoke
        assert json.loads(run(app, ["count", "flock", "--times", "3", "--json"]).stdout) == {
            "letters": 15,
            "loud": False,
        }
        assert "15" in run(app, ["count", "flock", "--times", "3"]).stdout
        told = " ".join(run(app, ["count", "--help"], env={"COLUMNS": "200"}).stdout.split())
        for words in (
            "Example: airflock count flock",
            "A word to count.",
            "[default: 2]",
            "1<=x<=9",
            "With --times: shout",
        ):
            assert words in told, told
        refused = run(app, ["count", "flock", "--times", "10"])
        assert "--times 10 lies outside [1, 9]" in str(refused.exception)
        assert "count" in run(app, ["--help"]).stdout
    finally:
        del VERBS["count"]


COMPLETED = {
    "airflock evo": "evolve",
    "airflock fly pre": "prepare",
    "airflock run x --preci": "--precision",
    "airflock run vasarhelyi_2018/real_4": "vasarhelyi_2018/real_4ms",
    "airflock sweep x --over radio.del": "radio.delay=",
    "airflock certify x --tolerance-of radio.del": "radio.delay",
    "airflock run x --law vicsek": "vicsek_1995",
    "airflock plot x --kind traj": "trajectories",
    "airflock fleet x --mode task": "tasks",
    "airflock run x --set world.arena=sq": "world.arena=square",
}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_completes_verbs_options_presets_keys_and_choices(shell, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        app(["--show-completion", shell])
    assert f"_AIRFLOCK_COMPLETE=complete_{shell}" in capsys.readouterr().out  # what the script calls
    for line, word in COMPLETED.items():
        monkeypatch.setenv("_AIRFLOCK_COMPLETE", f"complete_{shell}")
        monkeypatch.setenv("_TYPER_COMPLETE_ARGS", line)
        monkeypatch.setenv("_TYPER_COMPLETE_FISH_ACTION", "get-args")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split()) - 1))
        with pytest.raises(SystemExit):
            app([])
        found = re.split(r'[\n\t"]+|:', capsys.readouterr().out)
        assert word in [each.strip("() ") for each in found], (line, found)


def test_help_and_options_of_every_verb_are_read_without_numpy():
    code = """
import sys
from airflock.cli.command import VERBS
from airflock.cli.main import app
assert all(verb.params or name == "doctor" for name, verb in VERBS.items())
print(sorted({"numpy", "numba", "pandas", "xarray", "scipy"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout == "[]\n", done.stdout + done.stderr


def test_scores_carry_units_and_meanings_and_a_scenario_shows_itself():
    short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0, "delay": "400 ms"})
    table = airflock.score(short)
    assert set(table.attrs["units"]) == set(table.attrs["meanings"]) == set(table.columns)
    page = short._repr_html_()
    assert "0.4 s" in page and "age of neighbours" in page and "delay is read as radio.delay" in page
    assert "range" not in page  # has its default


def test_a_sweep_of_one_point_is_a_score():
    short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    swept = airflock.sweep(short, {"radio.delay": [0.4]}, seeds=2)
    scored = airflock.score(airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0, "delay": 0.4}), 2)
    assert swept["phi_vel"].tolist() == scored["phi_vel"].tolist()


def test_a_sweep_in_a_folder_is_the_sweep_and_goes_on_from_the_folder_alone(tmp_path, monkeypatch):
    short = airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})
    over = {"radio.kind": ["constant", "links"], "model.p_rep": [0.1, 0.2]}
    plainly = {"device": "python"}  # two radios take longer to compile than these flights in plain Python
    plain = airflock.sweep(short, over, seeds=[3, 5], **plainly)
    kept = airflock.sweep(short, over, seeds=[3, 5], out=tmp_path / "a", **plainly)
    assert kept.equals(plain) and kept.attrs == plain.attrs
    with pytest.raises(airflock.AirflockError, match="already holds a sweep; continue it with --resume"):
        airflock.sweep(short, over, seeds=[3, 5], out=tmp_path / "a", **plainly)
    with pytest.raises(airflock.AirflockError, match="holds another sweep: seeds = "):
        airflock.sweep(short, over, seeds=[3, 6], out=tmp_path / "a", resume=True, **plainly)
    with pytest.raises(airflock.AirflockError, match="^over: .* holds this itself"):
        airflock.sweep(over=over, out=tmp_path / "a", resume=True)
    with pytest.raises(airflock.AirflockError, match="give keys with lists of values"):
        airflock.sweep(short)
    with pytest.raises(airflock.AirflockError, match="a folder keeps seeds below 2.63"):
        airflock.sweep(short, over, seeds=[1 << 63], out=tmp_path / "b")
    monkeypatch.setattr("airflock.runs.executors.ScenarioTask.score", lambda *_: pytest.fail("flown"))
    assert airflock.sweep(out=tmp_path / "a", resume=True).equals(plain)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_help_of_every_command_shows_a_call_of_it(name):
    assert f"Example: airflock {name}" in COMMANDS[name].help


def test_keys_are_printed_for_people_and_for_machines():
    from json import loads

    from typer.testing import CliRunner

    run = CliRunner().invoke
    found = loads(run(app, ["keys", "delay", "--json"]).stdout)
    assert {key["name"] for key in found} == {"radio.delay", "body.delay"}  # that of the radio, and of every body
    (key,) = loads(run(app, ["keys", "radio.delay", "--json"]).stdout)
    assert key["name"] == "radio.delay" and key["unit"] == "s" and (key["low"], key["high"]) == (0.0, 30.0)
    text = run(app, ["keys", "radio"]).stdout
    assert "radio.delay" in text and "age of neighbours' data on arrival" in text and "[0 … 30 s]" in text
    assert "radio" in run(app, ["keys"]).stdout
    schema = loads(run(app, ["keys", "--schema"]).stdout)
    assert schema["properties"]["radio"]["properties"]["delay"]["default"] == 1.0
    assert run(app, ["keys", "radio", "--schema"]).exit_code != 0  # it is of a whole file


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arguments_with_a_unit_say_it(name):
    text = inspect.getdoc(the(name)) or ""
    for argument, unit in UNITS.items():
        if argument in inspect.signature(the(name)).parameters:
            (told,) = re.findall(rf"^[\w, ]*\b{argument}\b[\w, ]* : ?.*(?:\n .*)*", text, re.M)[:1]
            assert re.search(rf"\b{unit}\b|second", told), (argument, told)


def test_functions_report_to_the_logger_that_is_silent_until_somebody_listens(caplog):
    saying = {name for name in FUNCTIONS if "say" in inspect.signature(the(name)).parameters}
    assert saying >= {"score", "simulate", "sweep", "load_tracks", "fleet"}
    for name in saying - {"watch", "why"}:  # nobody would find the page of one; the other is silent by default
        assert inspect.signature(the(name)).parameters["say"].default is log, name
    code = (
        "from airflock.support import log; import logging; log('chosen'); logging.basicConfig(level=20); log('heard')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "" and done.stderr == "INFO:airflock:heard\n"
