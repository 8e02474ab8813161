"""Hills of infer: places of several numbers together that no single number leads to, and ridges between them."""

from dataclasses import replace

import numpy as np
import pytest

from airflock.estimate.inference.identifiability import profile_ridges
from airflock.estimate.inference.likelihood_fit import (
    FINE_SLOPES,
    climb_beyond,
    climb_to_maximum,
    distinct_points,
    parameter_groups,
    profile_ranges,
    redraw_group,
    search_modes,
    sort_groups,
)
from line_laws import Line, quietly


def test_a_hill_that_no_single_number_leads_to_is_found_where_both_are_drawn_anew():
    def law(x, a, b, slope):  # two hills of a and b together, the farther one higher; beyond 0.5 slope acts alone
        height = np.exp(-150.0 * ((a - 0.8) ** 2 + (b - 0.2) ** 2)) + 0.5 * np.exp(
            -150.0 * ((a - 0.3) ** 2 + (b - 0.7) ** 2)
        )
        return np.where(x < 0.5, height * x, slope * (x - 0.5))

    truth = (0.8, 0.2, 0.6)
    model = Line(law, ("a", "b", "slope"), truth)
    beside = climb_to_maximum(model, np.array([0.31, 0.69, 0.5]), [0, 1, 2])
    best = climb_to_maximum(model, np.array(truth), [0, 1, 2])
    assert beside.loss > best.loss + 20.0
    assert profile_ranges(model, beside, [0], quietly).loss > best.loss + 20.0
    assert parameter_groups(model, beside, [0]) == [[0, 1]]
    assert search_modes(model, beside, [0], [0], quietly).loss < best.loss + 0.5


def test_a_hill_is_found_from_which_a_group_alone_climbs_back_beside_a_wrong_rest():
    def law(x, a, c):  # a must be near c; of their mean two are likely, the larger one more
        t = 0.5 * (a + c)
        height = np.exp(-60.0 * (t - 0.8) ** 2) + 0.5 * np.exp(-60.0 * (t - 0.3) ** 2)
        return np.where(x < 0.5, 5.0 * x * (a - c), x * height)

    model = Line(law, ("a", "c"), (0.8, 0.8))
    best = climb_to_maximum(model, np.array([0.8, 0.8]), [0, 1])
    beside = climb_to_maximum(model, np.array([0.3, 0.3]), [0, 1])
    assert beside.loss > best.loss + 20.0
    for a in np.linspace(0.0, 1.0, 21):
        alone = climb_to_maximum(model, np.array([a, beside.place[1]]), [0])
        assert climb_to_maximum(model, alone.place, [0, 1]).loss > best.loss + 20.0
    ends = [climb_to_maximum(model, u, [0, 1]) for u in redraw_group(model, beside, [0], [0])]
    assert min(end.loss for end in ends) < best.loss + 0.5


def test_groups_that_say_the_same_come_after_those_that_say_something_new():
    friction, the_same, wall, sharing = [1, 2, 3, 4], [2, 3, 4, 5], [7, 8], [4, 7, 9, 10]
    assert sort_groups([friction, the_same, wall, sharing]) == [friction, wall, sharing, the_same]


def test_a_step_at_an_edge_does_not_part_numbers_that_act_together():
    def law(x, a, b, slope):  # a and b act where x is small, and b at one step far more than at any other
        edge = np.where(np.arange(len(x)) == 7, 20.0 * b, 0.0)
        return np.where(x < 0.5, x * (a + b**2), slope * (x - 0.5)) + edge

    model = Line(law, ("a", "b", "slope"), (0.8, 0.5, 0.6))
    assert parameter_groups(model, climb_to_maximum(model, np.array([0.7, 0.5, 0.5]), [0, 1, 2]), [0]) == [[0, 1]]


def test_a_narrow_ridge_is_gone_along_beyond_the_better_of_two_ends():
    def law(x, a, b):  # a and b make up for each other along a parabola, on which nothing but a slight slope leads on
        return 30.0 * x * (b - (a - 0.1) ** 2) + 0.5 * x**2 * a

    truth = (0.9, 0.64)
    model = Line(law, ("a", "b"), truth)
    best = climb_to_maximum(model, np.array(truth), [0, 1])
    ends = [climb_to_maximum(model, np.array([a, (a - 0.1) ** 2]), [0, 1], steps=0) for a in (0.2, 0.45)]
    assert climb_to_maximum(model, ends[1].place, [0, 1], steps=40).loss > best.loss + 10.0
    assert climb_beyond(model, ends, [0, 1], [0], [0], quietly)[0].loss < best.loss + 5.0


def test_a_hill_that_is_as_likely_lies_inside_the_interval():
    def law(x, a, slope):  # a and 1 - a are the same law: which of both flew, the tracks do not say
        return x * (a - 0.5) ** 2 * 4.0 + slope * x**2

    model = Line(law, ("a", "slope"), (0.8, 0.6))
    fit = climb_to_maximum(model, np.array([0.25, 0.5]), [0, 1])
    assert fit.place[0] == pytest.approx(0.2, abs=0.05)
    drop = 2.0
    other = fit.place.copy()
    other[0] = 1.0 - other[0]
    without = profile_ridges(model, fit, [0], drop)[1].ends(fit.place, drop)
    found = profile_ridges(model, replace(fit, others=(other, np.array([0.5, 0.5]))), [0], drop)[1].ends(
        fit.place, drop
    )
    assert without[1][0] < 0.5
    assert found[1][0] == pytest.approx(0.8, abs=0.05) and found[0][0] == pytest.approx(without[0][0], abs=0.02)
    assert found[1][1] == pytest.approx(without[1][1], abs=0.02)  # the far place is less likely, and not told


def test_all_places_of_a_surface_that_are_as_likely_lie_inside_the_intervals():
    def law(x, a, p, v):  # where x is small, only a + 0.03 / (0.1 + p)² - (v - 0.2)² shows; beyond, v alone, faintly
        return np.where(x < 0.6, 10.0 * x * (a + 0.03 / (0.1 + p) ** 2 - (v - 0.2) ** 2), 0.5 * (x - 0.6) * v)

    model, drop = Line(law, ("a", "p", "v"), (0.3, 0.9, 0.6)), 4.0
    start = np.array([0.33 - 0.03 / 0.45**2, 0.35, 0.6])  # on the surface, where p is small
    fit, found = profile_ridges(
        model, climb_to_maximum(model, start, [0, 1, 2], steps=3, slopes=(FINE_SLOPES,)), [0], drop
    )
    low, high = found.ends(fit.place, drop)
    p, v = (each.ravel() for each in np.meshgrid(np.linspace(0.1, 1.0, 31), np.linspace(0.3, 0.9, 31)))
    places = np.stack([0.17 + (v - 0.2) ** 2 - 0.03 / (0.1 + p) ** 2, p, v], axis=1)
    likely = [u for u in places if u[0] >= 0.0 and model.score(u).loss() < fit.score.loss() + drop]
    assert len(likely) > 50 and np.ptp(likely, axis=0)[1] > 0.7
    assert (np.array(likely) > low - 0.02).all() and (np.array(likely) < high + 0.02).all()


def test_a_number_that_is_told_sharply_is_walked_by_steps_shorter_than_its_interval():
    def law(x, a, p, v):  # the same surface, seen through a v that moves forty times as fast
        w = 0.6 + 40.0 * (v - 0.5)
        return np.where(x < 0.6, 10.0 * x * (a + 0.03 / (0.1 + p) ** 2 - (w - 0.2) ** 2), 0.5 * (x - 0.6) * w)

    model, drop = Line(law, ("a", "p", "v"), (0.3, 0.9, 0.5)), 4.0
    start = climb_to_maximum(
        model, np.array([0.33 - 0.03 / 0.45**2, 0.35, 0.5]), [0, 1, 2], steps=3, slopes=(FINE_SLOPES,)
    )
    fit, found = profile_ridges(model, start, [0], drop)
    low, high = found.ends(fit.place, drop)
    assert high[2] - low[2] < 0.01
    assert all(way[1][1] < drop for way in found.paths)


def test_each_hill_is_climbed_once():
    places = [np.array(u) for u in ((0.5, 0.5, 0.0), (0.52, 0.5, 0.9), (0.7, 0.5, 0.0), (0.71, 0.45, 0.0))]
    assert [u.tolist() for u in distinct_points(places, (0, 1))] == [[0.5, 0.5, 0.0], [0.7, 0.5, 0.0]]
