"""Units that people write: compound units agree with their parts, scenarios with and without them are the same."""

import math
import re

import pytest
from hypothesis import given, strategies as st

from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.scenarios.schema import SPELLINGS, UNITS, conversion_factor
from airflock.support.errors import ScenarioError

NAME = "vasarhelyi_2018/4ms"
BASE = {
    "m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3, "in": 0.0254, "ft": 12 * 0.0254, "yd": 36 * 0.0254,
    "mi": 5280 * 12 * 0.0254, "nmi": 1852.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0, "kg": 1.0,
    "rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi, "mrad": 1e-3, "1": 1.0, "N": 1.0, "%": 0.01,
    "J": 1.0, "kJ": 1e3, "MJ": 1e6, "W": 1.0, "mW": 1e-3, "kW": 1e3, "Wh": 60.0 * 60.0, "kWh": 60.0 * 6e4,
}  # fmt: skip
NAMED = {
    "mph": "mi/h", "kn": "nmi/h", "Hz": "1/s", "rpm": "turn/min", "kHz": "1/ms",
}  # fmt: skip


def measure(unit: str) -> float:
    """Size of a unit in SI, from the definitions of its parts."""
    over, _, under = NAMED.get(unit, unit).partition("/")
    size = 1.0
    for part, sign in ((over, 1.0), (under or "1", -1.0)):
        word, _, power = part.partition("^")
        size *= BASE[word] ** (sign * float(power or 1))
    return size


COMPOUND = [(u, d) for d, known in UNITS.items() for u in known if d not in ("N", "kg", "kg/m^3") and u != "g"]


@pytest.mark.parametrize(("unit", "declared"), COMPOUND)
def test_a_compound_unit_is_made_of_its_parts(unit, declared):
    assert conversion_factor(unit, declared) == pytest.approx(measure(unit) / measure(declared), rel=1e-12)


def test_units_without_such_parts_are_those_of_their_definitions():
    assert conversion_factor("lb", "kg") * conversion_factor("g", "m/s^2") == pytest.approx(
        conversion_factor("lbf", "N"), rel=1e-12
    )
    assert conversion_factor("g/cm^3", "kg/m^3") == pytest.approx(
        conversion_factor("g", "kg") / conversion_factor("cm", "m") ** 3
    )
    assert sum(len(known) for known in UNITS.values()) >= 30


def test_every_spelling_stands_for_a_known_unit():
    every = {*UNITS, *(unit for known in UNITS.values() for unit in known)}
    assert set(SPELLINGS.values()) <= every


@given(st.floats(1e-3, 20.0), st.sampled_from(["us", "ms", "min", "h", "s"]))
def test_a_value_with_a_unit_is_the_value_in_seconds(seconds, unit):
    text = f"{seconds / conversion_factor(unit, 's'):.15g} {unit}"
    scenario = load(NAME, {"radio.delay": text, "sensors.period": 0.0})
    assert scenario.radio.delay == pytest.approx(seconds, rel=1e-11)
    told = [note for note in scenario.notes if note.startswith("radio.delay = ") and " is " in note and unit in note]
    assert unit == "s" or told


def test_units_in_files_are_converted_and_what_is_flown_is_in_si(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        'duration = "10 min"\n[model]\nkind = "vasarhelyi_2018"\nv_flock = "20 km/h"\n[radio]\n'
        'delay = { value = 400, unit = "ms", source = "measured" }\nrange = "300ft"\n[world]\n'
        'obstacles = { value = [[[0, 0], [10, 0], [0, 10]]], unit = "yd" }\n'
    )
    scenario = load(path)
    assert scenario.flight.duration == 600.0 and scenario.radio.delay == 0.4
    assert scenario.radio.range == pytest.approx(91.44) and scenario.parameters.v_flock == pytest.approx(20 / 3.6)
    assert scenario.world.obstacles == (((0.0, 0.0), (9.144, 0.0), (0.0, 9.144)),)
    assert scenario.document["radio"]["delay"] == {"value": 0.4, "unit": "s", "source": "measured"}
    assert {"duration = 10 min is 600 s", "radio.range = 300 ft is 91.44 m"} <= set(scenario.notes)
    assert "world.obstacles was converted from yd to m" in scenario.notes


def test_a_converted_value_is_checked_against_the_declared_range():
    with pytest.raises(ScenarioError, match=re.escape("radio.delay = 3600 s lies outside [0, 30] s")):
        load(NAME, {"radio.delay": "1 h"})


@pytest.mark.parametrize(
    ("settings", "fault"),
    [
        ({"radio.delay": "4 parsec"}, "radio.delay = 4 parsec: the unit is s, or one of us, ms, min, h"),
        ({"radio.delay": "4 m"}, "radio.delay = 4 m: the unit is s"),
        ({"radio.delay": "soon"}, "radio.delay = 'soon' is not a number; give [0, 30] s"),
        ({"model.c_frict": "5 m"}, "model.c_frict = 5 m: has no unit; give a number, or %"),
    ],
)
def test_a_unit_of_something_else_is_refused_once(settings, fault):
    with pytest.raises(ScenarioError) as caught:
        load(NAME, settings)
    assert len(caught.value.errors) == 1 and fault in caught.value.errors[0]


@pytest.mark.parametrize(
    ("key", "remedy"),
    [
        ("model.c_frict", "is text; give NUMBER without quotes"),  # 0.1 was read as 0. in the unit 1: as nothing
        ("radio.range", "has no unit; give NUMBER without quotes, or 'NUMBER m' (or mm, cm, km,"),
        ("faults.share", "is text; give NUMBER without quotes"),
    ],
)
@given(number=st.decimals(0, 1000, places=2).map(str) | st.integers(0, 1000).map(str))
def test_a_number_in_quotes_without_a_unit_is_refused_whatever_its_digits(key, remedy, number):
    entry = {"faults": [{"kind": "motor", "at": 1.0, "share": number}]} if key == "faults.share" else {key: number}
    with pytest.raises(ScenarioError) as caught:
        load(NAME, entry)
    assert f"= '{number}' {remedy.replace('NUMBER', number)}" in str(caught.value)


@pytest.mark.parametrize(("text", "rate"), [("1 1/min", 1 / 60), ("0.5 1/s", 0.5), ("6e1 1/min", 1.0), ("0.5Hz", 0.5)])
def test_a_unit_may_begin_with_a_digit_after_a_blank(text, rate):
    assert load(NAME, {"model.p_rep": text}).parameters.p_rep == pytest.approx(rate)


@pytest.mark.parametrize("delay", [{"value": "0.4 s"}, {"value": "400 ms"}, {"value": 400, "unit": "ms"}, "0.4 s", 0.4])
def test_a_value_means_the_same_as_text_and_in_a_table_with_its_source(delay):
    """`{ value = "0.4 s" }`, in the unit that is declared, was no number, while `{ value = "400 ms" }` was one."""
    given = {**delay, "source": "measured"} if isinstance(delay, dict) else delay
    assert load(NAME, {"radio.delay": given}).radio.delay == 0.4
    groups = [{"name": "slow", "agents": 3, "body": {"tau": {"value": "1.2 s", "spread": "100 ms"}}}]
    (found,) = load(NAME, {"groups": groups}).groups
    assert found.numbers["b", "tau"] == 1.2 and found.spread["b", "tau"] == 0.1


def test_a_conversion_is_told_with_its_key_in_the_order_of_the_file():
    keys = {"loss": "5 %", "range": "0.1 km", "delay": "400 ms"}
    groups = [{"agents": 3, "body": {"tau": {"value": 1.2, "spread": "100 ms"}}}]
    faults = [{"kind": "motor", "share": "30 %", "at": "0.5 min"}]
    notes = build_scenario(
        {"model": {"kind": "vasarhelyi_2018"}, "radio": keys, "groups": groups, "faults": faults}
    ).notes
    told = [note.partition(" = ")[0] for note in notes if " is " in note]
    assert told[:3] == ["radio.loss", "radio.range", "radio.delay"]
    assert told[3:6] == ["groups[0].body.tau.spread", "faults[0].at", "faults[0].share"]


@pytest.mark.parametrize("written", ["v_flock = 6 m/s", "v_flock = 20 km/h  # slow", "v_flock=6m/s"])
def test_a_number_with_its_unit_outside_quotes_says_what_to_write(tmp_path, written):
    path = tmp_path / "mine.toml"
    path.write_text(f'extends = "{NAME}"\n[model]\n{written}\n')
    with pytest.raises(ScenarioError) as fault:
        load(path)
    said = str(fault.value).partition("stands in quotes: ")[2]
    path.write_text(f'extends = "{NAME}"\n[model]\n{said}\n')
    assert said and load(path).document["model"]["v_flock"] == pytest.approx(5.6, abs=0.5)


def test_a_decimal_comma_says_which_number_was_meant():
    with pytest.raises(ScenarioError, match=r"radio\.delay = 0,4: has a decimal comma; write 0\.4$"):
        load(NAME, {"radio.delay": "0,4"})
