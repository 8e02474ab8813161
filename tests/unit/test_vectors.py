"""A parameter of several numbers: one declaration, components for all that looks at numbers, a tuple for rules."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import airflock
import several_terms
from airflock.core.parameters import declarations, number_names
from airflock.engine import driver_text, fly_world
from airflock.engine.text.generate import DriverSource
from airflock.runs.search_space import full_space
from airflock.scenarios.part_kinds import CallerParts
from airflock.scenarios.scenario_builder import build_scenario
from airflock.studio.flight_pane import scenario_controls
from airflock.support.errors import ParameterError, RuleError, ScenarioError
from flocks import interpreted
from reference.flight import fly_plainly

CLOSE = {"agents": 5, "duration": 2.0, "start.kind": "ball", "start.radius": 9.0, "start.separation": 2.0}
LAW = airflock.model(vars(several_terms))


def terms(**settings):
    """A scenario of the law with several terms."""
    return build_scenario({}, "terms", CLOSE | {"world.arena": "none"} | settings, caller_parts=CallerParts(law=LAW))


def weights(found):
    return found.parameters.w


def declared(**options):
    """A class with one vector."""

    @dataclass(frozen=True, kw_only=True)
    class Own(airflock.Parameters):
        v: tuple[float, ...] = airflock.quantity(meaning="a vector", unit="m", low=0.0, high=2.0, **options)
        one: float = airflock.quantity(1.0, "m", low=0.0, high=2.0, meaning="a number")

    return Own


def test_a_record_has_the_vector_and_its_components():
    own = declared(default=0.5, size=3)
    assert number_names(own) == ("v_0", "v_1", "v_2", "one")
    assert own().v == (0.5, 0.5, 0.5) and own(v=[0, 1, 2]).v == (0.0, 1.0, 2.0)
    assert replace(own(v=(0.1, 0.2, 0.3)), v_1=1.5).v == (0.1, 1.5, 0.3) == replace(own(), v=(0.1, 1.5, 0.3)).v
    meanings = {name: how.meaning for name, how, _ in declarations(own)}
    assert meanings["v_2"] == "a vector, 3 of 3"


def test_faults_of_a_declaration_and_of_values_are_one_line_each():
    with pytest.raises(ParameterError, match=r"size = 2: give 1 to 64 components and a default for each \(a vector\)"):
        declared(default=(0.5, 0.3, 0.1), size=2)
    with pytest.raises(ParameterError, match="several numbers needs their size"):
        declared(default=(0.5, 0.3))
    with pytest.raises(ParameterError, match="Own.v has 1 number; give 3"):
        declared(default=0.5, size=3)(v=[1.0])
    with pytest.raises(ParameterError, match=r"Own.v_1 = 9 m lies outside \[0, 2\] m"):
        declared(default=0.5, size=3)(v=(1.0, 9.0, 1.0))


def test_a_scenario_gives_a_vector_whole_or_by_component_and_tells_all_that_is_wrong():
    assert weights(terms()) == (0.5, 0.3, 0.1)
    assert weights(terms(**{"model.w": [0.4, "0.2 m/s", 0.0]})) == (0.4, 0.2, 0.0) == weights(terms(w=[0.4, 0.2, 0.0]))
    base = build_scenario(
        {"model": {"w": {"value": [0.4, 0.2, 0.0], "unit": "m/s"}}},
        "t",
        {"model.w_2": 1.0},
        caller_parts=CallerParts(law=LAW),
    )
    assert weights(base) == (0.4, 0.2, 1.0)
    assert weights(build_scenario(base.document, "t", {"model.w": [1, 2, 3]}, caller_parts=CallerParts(law=LAW))) == (
        1.0,
        2.0,
        3.0,
    )
    with pytest.raises(ScenarioError) as told:
        terms(**{"model.w": [9.0, "x", 0.1], "model.reach": -1.0})
    assert str(told.value).splitlines() == [
        "terms: model.w_0 = 9 m/s lies outside [0, 5] m/s", "terms: model.w_1 = 'x' is not a number; give [0, 5] m/s",
        "terms: model.reach = -1 m lies outside [1, 100] m",
    ]  # fmt: skip
    for given, said in (([1.0], "has 1 number; give 3"), (0.3, "= 0.3 is not a list; give 3 numbers")):
        with pytest.raises(ScenarioError, match=f"terms: model.w {said}"):
            terms(**{"model.w": given})


def test_a_file_may_extend_another_and_give_the_vector_anew(tmp_path):
    law = Path(several_terms.__file__).read_text()
    (tmp_path / "law.py").write_text(law)
    (tmp_path / "base.toml").write_text('[model]\nkind = "law.py"\nw_0 = 1.0\nw_1 = 2.0\n')
    (tmp_path / "more.toml").write_text('extends = "base.toml"\n[model]\nw = [0.3, 0.2, 0.1]\n')
    (tmp_path / "less.toml").write_text('extends = "base.toml"\n[model]\nw_1 = 0.2\n')
    assert weights(airflock.load(tmp_path / "more.toml", trust=True)) == (0.3, 0.2, 0.1)
    assert weights(airflock.load(tmp_path / "less.toml", trust=True)) == (1.0, 0.2, 0.1)


def test_a_search_and_a_page_see_components():
    scenario = terms()
    assert {"model.w_0", "model.w_1", "model.w_2"} <= {axis.key for axis in full_space(scenario).axes}
    assert {"model.w_0", "model.w_2"} <= {
        control.key for group in scenario_controls(scenario).values() for control in group
    }


def test_a_law_with_a_vector_keeps_the_standing_list():
    airflock.check_model(LAW)


def test_all_loops_over_a_vector_are_unrolled():
    text = driver_text(terms())
    rule = text.partition("def several_terms_neighbour")[2].partition("def ")[0]
    assert "for " not in rule and all(f"p.w_{k} * power" in rule for k in range(3))
    decide = text.partition("def several_terms_decide")[2].partition("def ")[0]
    assert "for " not in decide and "p.w_2 / " in decide


def test_a_flight_is_that_of_the_reference_and_every_component_counts():
    flown, known = interpreted(terms(), 3), fly_plainly(terms(), 3)
    assert np.abs(flown.frames - known.frames).max() < 1e-9
    for k in range(3):
        other = interpreted(terms(**{f"model.w_{k}": 2.0}), 3)
        assert np.abs(other.frames - flown.frames).max() > 1e-3


def test_compiled_is_interpreted_and_a_flight_may_change_a_component():
    scenario = terms(**{"metrics.kind": "order"})
    compiled = fly_world(scenario, 3, precision=64, record=True)
    assert np.abs(compiled.frames - interpreted(scenario, 3).frames).max() < 1e-9
    flight = airflock.open(scenario, 3, device="python").advance(1.0).change({"model.w_2": 1.5})
    assert weights(flight.scenario) == (0.5, 0.3, 1.5)
    assert weights(flight.advance(0.2).change({"model.w": [1.0, 0.0, 0.0]}).scenario) == (1.0, 0.0, 0.0)
    assert json.dumps(dict(flight.scenario.document["model"]))


def beyond(p):
    return p.w[3]


def left_early(p):
    total = 0.0
    for k in range(3):
        if p.w[k] > 0.4:
            break
        total += p.w[k]
    return total


def as_a_whole(p):
    a, b, c = p.w
    return a + b * len(p.w) + c


def text_of(rule):
    source = DriverSource("", {}, {"p": {"w": 3}})
    name = source.name(rule)
    space = {"real": float, "p": several_terms.Parameters()}
    exec("\n".join(source.blocks), space)
    return source.blocks[-1], space[name]


def test_what_cannot_be_unrolled_stays_a_loop_over_a_tuple_and_a_wrong_index_is_told():
    for rule in (left_early, as_a_whole):
        text, made = text_of(rule)
        assert "(p.w_0, p.w_1, p.w_2)" in text
        for w in ((0.5, 0.3, 0.1), (0.1, 0.2, 0.3), (0.1, 0.9, 0.2)):
            p = several_terms.Parameters(w=w)
            assert made(p) == rule(p)
    with pytest.raises(RuleError, match=r"test_vectors.py:\d+: rule beyond: p.w\[3\] asks for component 3 of 3"):
        text_of(beyond)
