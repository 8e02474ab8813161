"""The page of the Python API: every public name stands on it, typed, and its docstring says what it must.

That is: each argument, shapes of arrays, units of numbers, errors, where it comes from if it was published, and an
example that runs.
"""

import doctest
import inspect
import re
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules, resolve_name

import pytest
from raising import raised

import airflock
from airflock.displays import show_control as master
from airflock.parts import KINDS
from airflock.support import errors

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
    return resolve_name(name)


OPENED = ["airflock.AirflockError", "airflock.Scenario", "airflock.Flight", "airflock.Parameters"]
FUNCTIONS = [name for name in LISTED if inspect.isfunction(the(name))]
PROPERTIES = [name for name in MEMBERS if isinstance(the(name), property)]
RECORDS = [name for name in CLASSES if is_dataclass(resolve_name(name))]


def code(name):
    """The function behind a name: of a property what reads it, and what a decorator wraps."""
    found = the(name)
    return inspect.unwrap(found.fget if isinstance(found, property) else found)


def meaning(text, name):
    """What a docstring says of an argument, in either form; "" if nothing."""
    said = re.search(rf"(?:^|; )(?:\*?\w+, )*{name}(?:, \w+)* *: ?((?:.|\n(?= )|\n\n(?= ))*)", text, re.M)
    return re.split(r"; \w+ ?: ", said[1])[0] if said else ""


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
def test_every_example_runs(name, tmp_path, monkeypatch, scored_plainly):
    monkeypatch.chdir(tmp_path)
    if name.startswith("airflock.plots."):  # a picture is that of any flight: its law need not be compiled
        monkeypatch.setattr(airflock, "simulate", partial(airflock.simulate, device="python"))
        monkeypatch.setattr(master, "Flight", partial(master.Flight, device="python"))
    if name == "airflock.Flight.fault":  # which no other example has in its driver
        monkeypatch.setattr(airflock, "open", partial(airflock.open, device="python"))
    finder = doctest.DocTestFinder(recurse=False)
    (test,) = [found for found in finder.find(the(name), name, globs={}) if found.examples]
    told = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL, verbose=False)
    assert runner.run(test, out=told.append).failed == 0, "".join(told)


def test_no_two_docstrings_are_equal():
    texts = [inspect.getdoc(the(name)) for name in LISTED]
    assert len(set(texts)) == len(texts)


QUIET = {  # raise none of ours: neither their source nor their docstring shows one
    "airflock.presets", "airflock.plots.convergence", "airflock.Scenario.with_drawn_scene",
    "airflock.Scenario.separation",
    "airflock.Flight.scores", "airflock.Flight.snapshot", "airflock.Flight.compile",
    "airflock.search.study_result.EvolveResult.document", "airflock.certificates.causes.WhyResult.document",
    "airflock.certificates.causes.WhyResult.text", "airflock.certificates.causes.WhyResult.table",
    "airflock.certificates.causes.WhyResult.causes", "airflock.certificates.causes.WhyResult.avoidable_until",
    "airflock.certificates.causes.HitCauses.document", "airflock.certificates.disturbances.AttackResult.document",
}  # fmt: skip


@pytest.mark.parametrize("name", [*FUNCTIONS, *PROPERTIES])
def test_every_error_that_the_source_shows_is_told(name):
    home = name.rpartition(".")[0]
    found = raised(code(name), resolve_name(home) if home in CLASSES else None)
    told = re.findall(r"\b\w+Error\b", inspect.getdoc(the(name)).partition("Raises")[2])
    known = tuple(what for what in (the_error(word) for word in told) if what)
    assert {what.__name__ for what in found if not issubclass(what, known)} == set()
    if name in FUNCTIONS:
        assert bool(known) != (name in QUIET)


def the_error(name):
    """An error of ours by its name, also one of another module than `airflock.support.errors`."""
    below = [errors.AirflockError]
    for what in below:
        below += what.__subclasses__()
    return next((what for what in below if what.__name__ == name), None)


ARRAY = re.compile(r"ndarray|DataArray|Dataset")
SHAPE = re.compile(
    r"\((?:\w+,\s*)*(?:time|frame|individual|agent|component|axis|goal|leader|left|receiver)\b[\w,\s]*\)"
    r"|[Aa]s `airflock.simulate` returns"
)
TABLE = re.compile(r"\b[Rr]ows?\b|\bcolumns?\b|\bby (?:time|distance)\b|[Bb]y time:")
UNIT = re.compile(
    r"(?<![\w'/.])(?:m|s|m/s|m/s²|m²|rad/s|1/s|degrees|pixels|px|GB|h)(?![\w'²/])"
    r"|[Pp]er (?:second|m|inch|pixel)\b|%|-?\b[01] to 1\b|\(0, 1\)|[Ss]hare|[Tt]imes real|unit of|in `unit`|In `unit`"
)


def shaped(kind, text):
    """Whether a text says the form of what has this type."""
    if ARRAY.search(kind):
        return bool(SHAPE.search(text))
    return bool(TABLE.search(text)) if re.search(r"DataFrame|Series", kind) else True


@pytest.mark.parametrize("name", [*FUNCTIONS, *PROPERTIES])
def test_every_array_and_table_says_its_form(name):
    signature, text = inspect.signature(code(name)), inspect.getdoc(the(name))
    assert shaped(str(signature.return_annotation), text)
    for argument in signature.parameters.values():
        said = meaning(text, argument.name)
        kind = "ndarray" if said.startswith("array") else str(argument.annotation)
        assert shaped(kind, said), (argument.name, said)


@pytest.mark.parametrize("name", [*FUNCTIONS, *PROPERTIES])
def test_every_number_says_its_unit(name):
    signature, text = inspect.signature(code(name)), inspect.getdoc(the(name))
    for argument in signature.parameters.values():
        if re.search(r"\bfloat\b", str(argument.annotation)) and "Mapping" not in str(argument.annotation):
            said = meaning(text, argument.name)
            assert UNIT.search(said), (argument.name, said)
    if re.search(r"\bfloat\b|DataArray|Series|ndarray(?!.*bool)", str(signature.return_annotation)):
        assert UNIT.search(text.partition("Examples")[0])


@pytest.mark.parametrize("name", RECORDS)
def test_every_number_of_a_record_says_its_unit(name):
    record = resolve_name(name)
    for field in fields(record):
        if re.fullmatch(r"(builtins\.)?float|<class 'float'>", str(field.type)):
            said = meaning(inspect.getdoc(record), field.name)
            assert UNIT.search(said), (field.name, said)


SOURCE = re.compile(r"\b(?:19|20)\d\d\b|Kidger|\b[Oo]urs?\b|of no publication")
PUBLISHED = tuple(kind.folder.rpartition(".")[2] for kind in KINDS)
HELPERS = {"parameters", "ranking", "metric_sets"}  # hold no rule of their own


@pytest.mark.parametrize("package", PUBLISHED)
def test_every_rule_names_its_source_or_says_that_it_is_ours(package):
    home = import_module(f"airflock.parts.{package}")
    silent: list[str] = []
    if SOURCE.search(home.__doc__):
        return  # of all kinds at once
    for name in sorted({found.name for found in iter_modules(home.__path__)} - HELPERS):
        module = import_module(f"{home.__name__}.{name}")
        numbers = getattr(getattr(module, "Parameters", None), "__dataclass_fields__", {}).values()
        if not SOURCE.search(" ".join([module.__doc__, *(number.metadata["airflock"].source for number in numbers)])):
            silent.append(name)
    assert silent == []


@pytest.mark.parametrize("name", FUNCTIONS)
def test_measures_and_functions_of_a_module_with_a_source_name_it(name):
    home = resolve_name(code(name).__module__)
    if SOURCE.search(home.__doc__ or "") or "airflock.recordings.measures" in home.__name__:
        assert SOURCE.search(inspect.getdoc(the(name)).partition("Examples")[0])
