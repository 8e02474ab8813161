"""Parameters: declared once, with unit, range, meaning and source; numbers out of range never get in."""

from dataclasses import dataclass
from importlib import import_module

import pytest
from hypothesis import given, strategies as st

from airflock.core.parameters import (
    Choice,
    Parameters,
    Quantity,
    choice,
    choices,
    declarations,
    number_names,
    quantity,
    quantity_error,
)
from airflock.core.silence import Parameters as Silence, with_defaults
from airflock.parts import BODIES
from airflock.scenarios.files import load
from airflock.scenarios.named_code import MODELS
from airflock.scenarios.scenario_builder import build_scenario
from airflock.scenarios.schema import read_section
from airflock.scenarios.sections import SECTIONS
from airflock.support.errors import ErrorCollector, ParameterError, ScenarioError

RECORDS = {
    **{f"model {name}": import_module(f"airflock.parts.laws.{name}").Parameters for name in MODELS},
    **SECTIONS,
    **{f"body {name}": body.Parameters for name, body in BODIES.items()},
}


@dataclass(frozen=True, kw_only=True)
class Example(Parameters):
    """A record with one of each."""

    gain: float = quantity(0.5, "1/s", low=0.0, high=2.0, meaning="a gain", source="here")
    range: float | None = quantity(None, "m", low=1.0, high=9.0, meaning="a distance")
    form: str = choice("program", ("program", "printed"), meaning="a reading")


@pytest.mark.parametrize("name", sorted(RECORDS))
def test_every_parameter_of_the_package_says_what_it_means_and_its_default_lies_in_its_range(name):
    for key, declared, default in declarations(RECORDS[name]):
        assert declared.meaning, key
        if isinstance(declared, Quantity):
            assert declared.unit and declared.low < declared.high, key
            assert declared.optional if default is None else declared.low <= default <= declared.high, key
        if isinstance(declared, Choice):
            assert default in declared.options and len(set(declared.options)) == len(declared.options), key


def test_all_faults_come_together_with_unit_and_range():
    with pytest.raises(ParameterError) as caught:
        Example(gain=3.0, range=0.5, form="guess")
    assert str(caught.value).splitlines() == [
        "Example.gain = 3 1/s lies outside [0, 2] 1/s",
        "Example.range = 0.5 m lies outside [1, 9] m",
        "Example.form = 'guess' is none of program, printed",
    ]


@given(st.one_of(st.floats(), st.integers(), st.text(max_size=3), st.booleans(), st.none()))
def test_only_numbers_in_range_get_in(value):
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if number and 0.0 <= value <= 2.0:
        made = Example(gain=value)
        assert made.gain == value and isinstance(made.gain, float)
        assert number_names(made) == ("gain", "range") and choices(made) == {"form": "program"}
    else:
        with pytest.raises(ParameterError, match=r"Example\.gain"):
            Example(gain=value)


def test_a_plain_number_is_told_without_its_unit():
    share = Quantity("1", 0.0, 1.0, "a share", "", False)
    assert quantity_error(2.0, share) == "= 2 lies outside [0, 1]"
    assert quantity_error("2", share) == "= '2' is not a number; give [0, 1]"
    length = share._replace(unit="m")
    assert quantity_error(2.0, length) == "= 2 m lies outside [0, 1] m"
    with pytest.raises(ScenarioError, match=r"agents = 0 lies outside \[1, 1e\+07\]$"):
        load("vasarhelyi_2018/4ms", {"agents": 0})


WRONG = (True, None, "much", "", [], [1.0], float("nan"), float("inf"), 1e300, -(10**400), object)


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_and_a_file_say_the_same_of_a_wrong_value(name):
    """There is one check: each value that a record refuses is refused by a file in the same words."""
    record = RECORDS[name]
    for key, declared, _ in declarations(record):
        for value in WRONG:
            if isinstance(declared, Choice) and type(value) is int:
                continue  # a file may write a choice that is a digit as a number
            errors = ErrorCollector()
            made, _ = read_section("there", {key: value}, record, errors)
            try:
                assert made in (record(**{key: value}), None)
            except ParameterError as error:
                assert errors.errors == [str(error).replace(f"{record.__name__}.", "there.")]
            # What ends nowhere may be so in Python, but not in a file; neither may an open number be written.
            assert made is not None or errors.errors, (key, declared)


@pytest.mark.parametrize("unit", [False, [], 0, 5, {}, "furlong", ["m"]])
def test_a_key_with_a_wrong_unit_is_one_error_whatever_its_value(unit):
    """A unit that is no text was taken for none where it was false, empty or 0; others were reported twice."""
    for value in (30.0, True, [1.0, 2.0], -5.0):
        for key, known in (("model.p_rep", "1/s"), ("world.edges", "none"), ("world.corners", "m"), ("dt", "s")):
            with pytest.raises(ScenarioError) as caught:
                load("vasarhelyi_2018/4ms", {key: {"value": value, "unit": unit}})
            ours = [line for line in caught.value.errors if f" {key} " in line]
            assert len(ours) == 1, caught.value.errors
            assert f"the unit is {known}" in ours[0] or f"{value!r}" in ours[0] or "is not a list" in ours[0]


SPREAD = {"spread": 0.1}


@pytest.mark.parametrize("entry", [{"x": 1}, {"value": 1.0, "x": 1}, SPREAD, {"value": 1.0, **SPREAD}, 1.0])
def test_an_unknown_key_is_one_error_wherever_it_stands_and_whatever_it_holds(entry):
    law, wrong = {"kind": "vasarhelyi_2018"}, {"p_repp": entry}
    places = [{section: wrong} for section in ("body", "radio", "world")] + [{"model": law | wrong}]
    places += [{"groups": [{section: wrong}]} for section in ("model", "body", "sensors")]
    places += [{"faults": [{"kind": "motor", "at": 1.0, **wrong}]}]
    for document in places:
        with pytest.raises(ScenarioError, match=r"\.p_repp: unknown key") as caught:
            build_scenario({"model": law} | document)
        assert len(caught.value.errors) == 1


def test_a_hundred_thousand_errors_are_collected_in_linear_time():
    errors = ErrorCollector()
    for number in range(100_000):
        errors.add(f"x{number}: unknown key", "once")
    assert len(errors.errors) == 100_001


def test_declared_parameters_of_a_class_that_is_no_dataclass_are_not_lost():
    class Bare(Parameters):
        speed: float = quantity(4.0, "m/s", low=0.0, high=10.0, meaning="speed")

    with pytest.raises(ParameterError, match=r"^Bare declares speed, but is not a dataclass; write @dataclass"):
        list(declarations(Bare))


@pytest.mark.parametrize("speed", [0.0, 1000.0, 1e4])
def test_the_reach_of_a_lost_neighbour_grows_at_twice_the_speed_of_the_fastest_laws_too(speed):
    assert with_defaults(Silence(), speed).closing == 2.0 * (speed or 4.0)
