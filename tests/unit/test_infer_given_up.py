"""Numbers of a law that were given up: the intervals of the others know of those that the tracks could have told."""

from types import SimpleNamespace

import numpy as np
import pytest

from airflock.estimate.inference.identifiability import Ridges, restore_parameters, ridges_from_point
from airflock.estimate.inference.law_inference import _Comparison
from airflock.estimate.inference.likelihood_fit import FINE_SLOPES, climb_to_maximum
from line_laws import Line, quietly

DROP = 4.0


def fitted(law, names, truth, number, default):
    """A model, and its fit by all numbers but one that stays at its default."""
    model = Line(law, names, truth, dict.fromkeys(names, 0.5) | {names[number]: default})
    rest = [k for k in range(len(names)) if k != number]
    without = model.with_parameters([model.numbers[k] for k in rest])
    return model, climb_to_maximum(
        without, np.array([truth[k] for k in rest]), [0, 1], steps=200, slopes=(FINE_SLOPES,)
    )


def test_the_others_lie_within_intervals_that_know_of_a_number_that_was_given_up():
    def law(x, gain, slope, bend):  # bend and gain make up for each other along a parabola, but for a faint trace
        return 30.0 * x * (gain - (bend - 0.1) ** 2) + 0.02 * x**2 * bend + np.where(x > 0.9, slope, 0.0)

    truth = (0.64, 0.7, 0.9)
    model, fit = fitted(law, ("gain", "slope", "bend"), truth, 2, 0.3)
    assert fit.place[0] == pytest.approx(0.04, abs=0.01)  # gain as it must be where bend is what it is not
    ways = ridges_from_point(model, fit, 2, 0.3, [0], DROP)
    low, high = Ridges(tuple(ways)).ends(np.append(fit.place, 0.3), DROP)
    bends = np.linspace(0.0, 1.0, 101)
    likely = [
        u for u in (np.array([(b - 0.1) ** 2, fit.place[1], b]) for b in bends)
        if model.score(u).loss() < fit.score.loss() + DROP
    ]  # fmt: skip
    assert np.ptp(likely, axis=0)[2] > 0.6
    assert (np.array(likely)[:, 0] > low[0] - 0.02).all() and (np.array(likely)[:, 0] < high[0] + 0.02).all()
    assert low[0] < truth[0] < high[0] and high[1] - low[1] < 0.1


def test_what_others_make_up_for_exactly_is_a_name_and_widens_nothing():
    def law(x, force, free, unit):
        return (force + unit) * x + free * x**2

    model, fit = fitted(law, ("force", "free", "unit"), (0.5, 0.6, 0.4), 2, 0.3)
    assert fit.place[0] == pytest.approx(0.6, abs=0.05)
    assert ridges_from_point(model, fit, 2, 0.3, [0], DROP) == []


def test_what_changes_nothing_widens_nothing():
    model, fit = fitted(lambda x, a, b, idle: a * x + b + 0.0 * idle, ("a", "b", "idle"), (0.5, 0.6, 0.4), 2, 0.3)
    assert ridges_from_point(model, fit, 2, 0.3, [0], DROP) == []


def test_a_number_is_taken_back_where_a_walk_leads_higher_than_any_climb():
    def law(x, b, a):  # a and b make up for each other along a parabola, on which nothing but a slight slope leads on
        return 30.0 * x * (b - (a - 0.1) ** 2) + 0.2 * x**2 * a

    truth = (0.64, 0.9)
    model = Line(law, ("b", "a"), truth, {"b": 0.5, "a": 0.45})
    without = model.with_parameters(model.numbers[:1])
    fit = climb_to_maximum(without, np.array([0.1225]), [0], steps=200, slopes=(FINE_SLOPES,))
    best, beside = (climb_to_maximum(model, np.array(u), [0, 1], steps=40) for u in (truth, (fit.place[0], 0.45)))
    assert beside.loss > best.loss + 8.0

    found, higher = restore_parameters(model.law, without, fit, [0], quietly)
    assert found.law.numbers == model.law.numbers and higher.place == pytest.approx(truth, abs=0.05)
    without.seen = law(model.input, 0.1225, 0.45)  # nothing but the default flew
    fit = climb_to_maximum(without, np.array([0.1225]), [0], steps=200, slopes=(FINE_SLOPES,))
    assert restore_parameters(model.law, without, fit, [0], quietly)[0] is without


def law_that(name, gain, surprise, every):
    """What a comparison asks of a law; surprises differ from span to span, by another rhythm for each law."""
    return SimpleNamespace(name=name, gain=gain, negative_log_likelihoods=surprise + np.sin(np.arange(100.0) / every))


def test_a_law_that_cannot_be_told_from_the_best_is_searched_as_deeply(monkeypatch):
    """The true law ended on a wrong hill at first; the far one has no chance, and its search is saved."""
    shallow = [law_that("wrong", 30.0, 0.0, 2.0), law_that("true", 28.0, 0.05, 3.0), law_that("far", 3.0, 5.0, 5.0)]
    deep = {"wrong": law_that("wrong", 31.0, -0.01, 2.0), "true": law_that("true", 90.0, -6.0, 3.0)}
    comparison, searched = object.__new__(_Comparison), []

    def deeper(name):
        searched.append(name)
        return deep[name]

    monkeypatch.setattr(comparison, "deeper", deeper, raising=False)
    comparison.contest(shallow)
    assert searched == ["wrong", "true"] and [law.name for law in shallow] == ["true", "wrong", "far"]
