"""Public functions: typed, each argument and the result told; commands and functions match."""

import inspect
import re
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import pytest
import typer.main

import airflock
from airflock.cli.counterparts import COUNTERPARTS, LIBRARY_FUNCTIONS
from airflock.cli.main import app

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


def test_every_command_has_a_function_and_every_function_a_command():
    assert set(COUNTERPARTS) == set(COMMANDS)
    assert {found.function for found in COUNTERPARTS.values() if "." not in found.function} | set(
        LIBRARY_FUNCTIONS
    ) == set(FUNCTIONS)


def test_no_cell_of_the_tables_of_commands_and_functions_is_empty():
    text = (Path(__file__).parents[2] / "docs/commands.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in text.splitlines() if line[:1] == "|"
    ]
    rows = [row for row in rows if len(row) == 3]
    assert len(rows) > 30 and [row for row in rows if not all(row)] == []
    assert {name for name in COMMANDS if not any(f"airflock {name}" in row[1] for row in rows)} <= {"doctor", "types"}


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_option_has_its_argument(name):
    found = COUNTERPARTS[name]
    assert set(found.options) == {option.name for option in COMMANDS[name].params}
    arguments = inspect.signature(the(found.function)).parameters
    for option, argument in found.options.items():
        if argument.isidentifier():
            assert argument in arguments, f"{name} {option}: airflock.{found.function} has no {argument}"
        elif argument.startswith("airflock."):
            home, _, last = argument.partition("(")[0].rpartition(".")
            assert callable(getattr(airflock if home == "airflock" else resolve_name(home), last)), argument


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
    plain = airflock.sweep(short, over, seeds=[3, 5])
    kept = airflock.sweep(short, over, seeds=[3, 5], out=tmp_path / "a")
    assert kept.equals(plain) and kept.attrs == plain.attrs
    with pytest.raises(airflock.AirflockError, match="already holds a sweep; continue it with --resume"):
        airflock.sweep(short, over, seeds=[3, 5], out=tmp_path / "a")
    with pytest.raises(airflock.AirflockError, match="holds another sweep: seeds = "):
        airflock.sweep(short, over, seeds=[3, 6], out=tmp_path / "a", resume=True)
    with pytest.raises(airflock.AirflockError, match="^over: .* holds this itself"):
        airflock.sweep(over=over, out=tmp_path / "a", resume=True)
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
