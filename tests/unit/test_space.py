"""Search spaces: a point becomes parameters and back, bounds and orders hold everywhere, faults are told."""

import numpy as np
import pytest

from airflock.runs.search_space import full_space, with_parameters
from airflock.scenarios.files import load
from airflock.search import study
from airflock.support.errors import ErrorCollector, ParameterError

SCENARIO = load("zapotecatl_2016/best")
FLOCK = load("vasarhelyi_2018/6ms")
TABLE = {
    "model": {
        "r_s": {"low": 0.1, "high": 0.4},
        "r_a": {"low": 0.05, "high": 0.5, "above": "model.r_s"},
        "r_c": {"low": 0.2, "high": 3.0, "above": "model.r_a", "scale": "log"},
        "w_c": {"low": 1.0, "high": 6.0, "integer": True},
        "w_s": {"fixed": 20.0},
        "w_a": {"tied": "model.w_c", "factor": 2.0, "offset": 1.0},
    }
}


def read_space(table, scenario):
    errors = ErrorCollector()
    return study.read_space(table, scenario, errors), errors.errors


def space(table=TABLE, scenario=SCENARIO):
    found, faults = read_space(table, scenario)
    assert not faults
    return found


def test_corners_of_the_cube_are_the_ends_of_the_ranges():
    low, high = (space().parameters([x] * 4) for x in (0.0, 1.0))
    assert (low["model.r_s"], high["model.r_s"]) == (0.1, 0.4)
    assert (low["model.r_c"], high["model.r_c"]) == (0.2, 3.0)
    assert (low["model.w_c"], high["model.w_c"]) == (1.0, 6.0)
    assert (low["model.w_s"], low["model.w_a"], high["model.w_a"]) == (20.0, 3.0, 13.0)


def test_middle_of_a_logarithmic_range_is_the_geometric_mean():
    found = space({"model": {"p_rep": {"low": 0.01, "high": 1.0, "scale": "log"}}}, FLOCK)
    assert found.parameters([0.5])["model.p_rep"] == pytest.approx(0.1)


def test_orders_whole_numbers_and_ties_hold_at_every_point_and_points_come_back(seed):
    rng = np.random.default_rng(seed)
    found = space()
    for point in rng.random((200, 4)):
        p = found.parameters(point)
        assert p["model.r_s"] <= p["model.r_a"] <= p["model.r_c"]
        assert p["model.w_c"] == int(p["model.w_c"]) and p["model.w_a"] == 2.0 * p["model.w_c"] + 1.0
        assert found.parameters(found.point(p)) == pytest.approx(p, rel=1e-9)
        assert with_parameters(SCENARIO, p).parameters.r_s == p["model.r_s"]


def test_each_whole_number_takes_an_equal_share_of_the_range():
    found = space()
    values = [found.parameters([0.5, 0.5, 0.5, (i + 0.5) / 600])["model.w_c"] for i in range(600)]
    assert [values.count(float(n)) for n in range(1, 7)] == [100] * 6


def test_without_a_table_everything_varies_but_the_speed_that_is_asked_for():
    keys = full_space(FLOCK).keys
    assert "model.v_flock" not in keys and {"model.r0_rep", "model.a_shill"} <= set(keys)


def test_numbers_outside_their_declaration_are_refused():
    with pytest.raises(ParameterError, match="p_rep = 11 1/s lies outside"):
        with_parameters(FLOCK, {"model.p_rep": 11.0})


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"low": 1.0, "high": 1.0}, "range [1, 1] 1/s is empty"),
        ({"low": 2.0, "high": 1.0}, "range [2, 1] 1/s is inverted"),
        ({"low": 1.0, "high": 99.0}, "space.model.p_rep.high = 99 1/s lies outside the declared [0, 10] 1/s"),
        ({"low": 0.0, "high": 1.0, "scale": "log"}, "must be above 0 on a logarithmic scale"),
        ({"low": 0.0, "high": 1.0, "scale": "cubic"}, "none of linear, log"),
        ({"low": "0", "high": 1.0}, "space.model.p_rep.low = '0' is not a number; give [0, 10] 1/s"),
        ({"low": 0.0, "hihg": 1.0}, "space.model.p_rep.hihg: unknown key; did you mean high?"),
        ({"low": 0.0, "high": 1.0, "unit": "m"}, "the unit is 1/s"),
        ({"low": 0.1, "high": 0.9, "integer": True}, "holds no whole number"),
        ({"low": 0.1, "high": 0.9, "above": "model.c_frict"}, ""),
        ({"low": 0.1, "high": 0.9, "above": "model.p_rep"}, "above runs in a circle"),
        ({"tied": "model.v_shill"}, "'model.v_shill' neither varies nor is fixed"),
        ({"fixed": -1.0}, "space.model.p_rep.fixed = -1 1/s lies outside"),
    ],
)
def test_each_fault_is_one_line_with_key_value_unit_and_range(entry, words):
    found, faults = read_space({"model": {"p_rep": entry, "r0_rep": {"low": 1.0, "high": 2.0}}}, FLOCK)
    if words:
        assert found is None and len(faults) == 1 and words in faults[0] and "\n" not in faults[0]
    else:
        assert not faults and found.fixed == {"model.c_frict": FLOCK.parameters.c_frict}


def test_unknown_keys_and_empty_spaces_are_told_together():
    _, faults = read_space({"model": {"p_repp": {}, "limit": {"low": 0.0}}, "radio": 3}, FLOCK)
    assert len(faults) == 3
    assert any("did you mean space.model.p_rep?" in fault for fault in faults)
    assert read_space({}, FLOCK)[1] == ["space: nothing varies; give at least one key low and high"]


def test_drag_descent_varies_only_where_it_is_flown():
    table = {"aero": {"k_d": {"low": 0.01, "high": 1.0}}}
    _, faults = read_space(table, FLOCK)
    assert faults[0] == (
        "space.aero.k_d is not a number of vasarhelyi_2018/6ms, which has no section [aero]; "
        "--set aero.k_d=VALUE adds drag descent to it"
    )
    assert space(table, load("vasarhelyi_2018/6ms", {"aero.k_d": 0.1})).keys == ("aero.k_d",)
