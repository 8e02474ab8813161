"""The page of the Python API: every public name stands on it, typed, with a docstring and an example that runs."""

import doctest
import inspect
import re
from pathlib import Path
from pkgutil import resolve_name

import pytest

import airflock

PAGE = (Path(__file__).parents[2] / "docs" / "api.md").read_text(encoding="utf-8")
CALLED = re.findall(r"^\.\. autofunction:: (\S+)$", PAGE, re.M)
CLASSES = {
    name: members.split(", ") if members else []
    for name, members in re.findall(r"^\.\. autoclass:: (\S+)$(?:\n   :members: (.+))?", PAGE, re.M)
}
MEMBERS = [f"{name}.{member}" for name, members in CLASSES.items() for member in members]
LISTED = [*CALLED, *CLASSES, *MEMBERS]


def the(name):
    """What a name of the page stands for: of a class what its body says, so that a property is not asked."""
    home, _, last = name.rpartition(".")
    if home in CLASSES:
        return inspect.getattr_static(resolve_name(home), last, None)
    return resolve_name(f"{home}:{last}")


OPENED = ["airflock.AirflockError", "airflock.Scenario", "airflock.Flight", "airflock.Parameters"]
FUNCTIONS = [name for name in LISTED if inspect.isfunction(the(name))]


def test_every_public_name_stands_on_the_page():
    missing = set(airflock.__all__) - {name.rpartition(".")[2] for name in LISTED}
    assert missing == {"AirflockError", "__version__", "plots", "measures"}  # of the last two, what they hold:
    assert {f"airflock.plots.{name}" for name in airflock.plots.__all__} - set(LISTED) == {
        "airflock.plots.KINDS", "airflock.plots.plot"
    }  # fmt: skip
    for module in (getattr(airflock.measures, name) for name in airflock.measures.__all__):
        home = module.__name__
        held = {name for name, what in vars(module).items() if getattr(what, "__module__", "") == home}
        assert {f"{home}.{name}" for name in held if name.islower() and name[0] != "_"} <= set(LISTED)


@pytest.mark.parametrize("name", [*CLASSES, *MEMBERS])
def test_every_class_and_member_says_what_it_is(name):
    if name != "airflock.Scenario.vehicle":  # a field, told by its class
        assert inspect.getdoc(the(name))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_and_result_has_a_type_and_each_argument_its_meaning(name):
    function = the(name)
    signature, text = inspect.signature(function), inspect.getdoc(function)
    mine = [argument for argument in signature.parameters.values() if argument.name != "self"]
    assert signature.return_annotation is not signature.empty
    assert [argument.name for argument in mine if argument.annotation is argument.empty] == []
    assert [argument.name for argument in mine if not re.search(rf"\b{argument.name}\b", text)] == []


@pytest.mark.parametrize("name", [*FUNCTIONS, *OPENED])
def test_every_example_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    finder = doctest.DocTestFinder(recurse=False)
    (test,) = [found for found in finder.find(the(name), name, globs={}) if found.examples]
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL, verbose=False)
    assert runner.run(test, out=told.append).failed == 0, "".join(told)


def test_no_two_docstrings_are_equal():
    texts = [inspect.getdoc(the(name)) for name in LISTED if name != "airflock.Scenario.vehicle"]
    assert len(set(texts)) == len(texts)
