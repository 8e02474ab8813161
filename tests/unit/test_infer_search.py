"""Search of infer: on laws of one line, whose highest hill is known, it is found, and what cannot be told is left."""

from types import SimpleNamespace

import numpy as np
import pytest

from airflock.infer.candidates import Number
from airflock.infer.fit import (
    FINE,
    WIDE,
    Fit,
    by_powers,
    climb,
    closed_end,
    curvature,
    followed,
    loss_at,
    open_ends,
    settle,
    spread,
)
from airflock.infer.likelihood import Model
from airflock.infer.search import drawn, profile, race, usual
from airflock.infer.told import simplify, telling

STEPS, NOISE = 400, 0.05


class Line(Model):
    """A law of one line: what is seen is a function of the numbers' places and of a known input, with noise."""

    def __init__(self, law, names, truth, defaults=None, usual_numbers=()):
        defaults = defaults or dict.fromkeys(names, 0.5)
        self.numbers = [Number(f"model.{name}", -1, "m", 0.0, 1.0, False, defaults[name]) for name in names]
        self.named, self.usual, self.axes, self.spans, self.held = len(names), None, 2, [(0, 0)], frozenset()
        flags = {name: defaults[name] for name in usual_numbers}
        self.law = SimpleNamespace(scenario=SimpleNamespace(model=SimpleNamespace(usual=flags)))
        generator = np.random.default_rng(4)
        self.input = generator.uniform(0.0, 1.0, STEPS)
        self.rule, self.noise = law, generator.normal(0.0, NOISE, (STEPS, 2))
        self.seen = law(self.input, *truth)

    def differences(self, u, spans=None):
        u = [n.default if k in self.held else x for k, (n, x) in enumerate(zip(self.numbers, u, strict=True))]
        e = self.noise.copy()
        e[:, 0] += self.seen - self.rule(self.input, *u)
        return e, np.zeros(STEPS, np.int64)

    def few(self, frames=0):
        return [0]

    def start(self):
        return np.array([n.default for n in self.numbers])


def quietly():
    pass


def test_a_radius_within_which_nobody_is_is_told_and_a_mass_beside_a_force_is_not():
    # a number that acts beyond 0.6 alone has no slope where it is looked at; the second makes up for the first
    def law(x, force, mass, beyond, dead):
        return x * (force - mass) + x**2 * max(beyond - 0.6, 0.0) + 0.0 * dead

    model = Line(law, ("force", "mass", "beyond", "dead"), (0.9, 0.2, 0.9, 0.5))
    looks = np.array([[0.8, 0.3, 0.2, 0.5], [0.3, 0.1, 0.4, 0.2], [0.7, 0.5, 0.1, 0.9]])
    assert telling(model, model.start(), looks, [0]) == [0, 2]


def test_the_highest_hill_is_found_where_a_climb_from_the_defaults_ends_at_once():
    def law(x, radius, weight):  # nobody is within a radius below 0.6; a wrong radius has its own best weight
        near = x < radius - 0.6
        return np.where(near, weight, 0.0)

    truth = (0.85, 0.9)
    model = Line(law, ("radius", "weight"), truth, {"radius": 0.1, "weight": 0.1})
    best = loss_at(model, np.array(truth), [0, 1], None)
    assert climb(model, model.start(), [0, 1]).loss > best + 100.0
    begin = drawn(model, model.start(), [0], seed=1)
    found = race(model, model.start(), begin, [0, 1], [0], quietly)
    found = profile(model, found, [0], quietly)
    assert found.loss < best + 2.0 and found.place[1] == pytest.approx(truth[1], abs=0.05)


def test_a_valley_is_crossed_where_the_others_follow():
    def law(x, place, height):  # two hills at 0.25 and 0.75 of the first number, each with its own height
        return height * np.sin(4.0 * np.pi * place) * x + 0.5 * place * x**2

    truth = (0.62, 0.3)
    model = Line(law, ("place", "height"), truth)
    wrong = climb(model, np.array([0.12, 0.3]), [0, 1])
    best = climb(model, np.array(truth), [0, 1])
    assert wrong.loss > best.loss + 20.0
    assert profile(model, wrong, [0], quietly).loss < best.loss + 1.0


def test_what_is_usual_stays_until_the_rest_is_found():
    model = Line(lambda x, a, view: a * x * (x < view), ("a", "view"), (0.7, 1.0), {"a": 0.2, "view": 1.0}, ("view",))
    assert usual(model) == [1]
    begin = drawn(model, model.start(), [0], seed=0)
    assert (begin[:, 1] == 1.0).all() and np.ptp(begin[:, 0]) > 0.9
    found = race(model, model.start(), begin, [0, 1], [0], quietly)
    assert found.place[0] == pytest.approx(0.7, abs=0.02) and found.place[1] > 0.98


def test_a_number_that_others_make_up_for_goes_back_to_its_default():
    def law(x, force, unit, free):
        return (force + unit) * x + free * x**2

    model = Line(law, ("force", "unit", "free"), (0.8, 0.1, 0.6), {"force": 0.5, "unit": 0.1, "free": 0.5})
    ridge = climb(model, np.array([0.3, 0.6, 0.6]), [0, 1, 2])
    assert ridge.place[1] > 0.3  # the prior alone does not bring it back
    gone, place = simplify(model, ridge, quietly)
    assert gone == [1] and place[[0, 2]] == pytest.approx([0.8, 0.6], abs=0.05)


def test_the_part_of_one_radius_is_taken_by_another_of_its_unit():
    def law(x, radius, floor, weight):  # who is within either acts
        return weight * (x < max(radius, floor))

    model = Line(law, ("radius", "floor", "weight"), (0.62, 0.0, 0.7), {"radius": 0.2, "floor": 0.0, "weight": 0.7})
    swapped = np.array([0.2, 0.62, 0.7])
    gone, place = simplify(model, Fit(swapped, [0, 1, 2], model.score(swapped), 0.0), quietly)
    assert gone == [1] and place[0] == pytest.approx(0.62, abs=0.01)


def test_standard_errors_are_those_of_least_squares():
    model = Line(lambda x, a, b: a * x + b, ("a", "b"), (0.5, 0.5))
    fit = climb(model, model.start(), [0, 1])
    design = np.stack([model.input, np.ones(STEPS)], axis=1)
    variance = fit.score.variances()[0]
    expected = np.sqrt(np.diag(np.linalg.inv(design.T @ design / variance + 4.0 * np.eye(2))))
    assert spread(model, fit, [0]) == pytest.approx(expected, rel=1e-6)
    ridge = Line(lambda x, a, b: (a + b) * x, ("a", "b"), (0.5, 0.5))
    fit = climb(ridge, ridge.start(), [0, 1])
    moved = followed(fit, curvature(ridge, fit, [0]), 0, 0.8)
    assert moved[0] == 0.8 and moved[1] == pytest.approx(fit.place[1] + fit.place[0] - 0.8, abs=1e-3)


def test_steps_of_a_likelihood_are_walked_down_which_have_no_slope():
    def law(x, radius, weight):  # who is within a radius acts; distances are on a grid of 1/40
        return weight * (np.round(40.0 * x) / 40.0 < radius)

    truth = (0.71, 0.8)
    model = Line(law, ("radius", "weight"), truth)
    beside = climb(model, np.array([0.83, 0.7]), [0, 1])
    best = climb(model, np.array(truth), [0, 1])
    found = settle(model, beside, None)
    assert beside.loss > best.loss + 10.0 and found.loss < best.loss + 1.0
    assert 0.7 < found.place[0] <= 0.725


def test_a_force_over_a_mass_is_one_number_however_far_it_is_moved():
    def law(x, force, mass, length):
        return 10.0 ** (force - mass) * x + length * x**2

    model = Line(law, ("force", "mass", "length"), (0.8, 0.7, 0.4))
    model.numbers = [Number(f"model.{k}", -1, "1", 1.0, 10.0, k != "length", 1.0) for k in ("force", "mass", "length")]
    fit = climb(model, np.array([0.8, 0.7, 0.4]), [0, 1, 2])
    moved = by_powers(model, fit, followed(fit, curvature(model, fit, None), 1, 0.1), 1)
    assert moved == pytest.approx([fit.place[0] - fit.place[1] + 0.1, 0.1, fit.place[2]], abs=1e-9)
    assert model.score(moved).loss() == pytest.approx(model.score(fit.place).loss(), abs=1e-6)


def test_a_bent_ridge_is_followed_by_fine_slopes():
    """Wide slopes cut the corners of a ridge that bends, and a climb by them stops at once."""

    def law(x, along, across):  # across is a wave of along, which is told ten times less
        return 30.0 * (across - 0.5 - 0.2 * np.sin(20.0 * along)) * x + 3.0 * along * x**2

    def ridge(along):
        return np.array([along, 0.5 + 0.2 * np.sin(20.0 * along)])

    model = Line(law, ("along", "across"), ridge(0.7))
    best = climb(model, ridge(0.7), [0, 1], steps=40).loss
    wide, fine = (climb(model, ridge(0.6), [0, 1], steps=40, slopes=ways) for ways in ((WIDE,), (WIDE, FINE)))
    assert wide.loss > best + 50.0 and fine.loss < best + 10.0


def test_a_limit_that_nobody_reaches_has_no_upper_end():
    model = Line(lambda x, most, weight: np.minimum(weight * x, most), ("most", "weight"), (0.9, 0.5))
    fit = climb(model, np.array([0.8, 0.5]), [0, 1])
    below, above = open_ends(model, fit, [0])
    assert below.tolist() == [False, False] and above.tolist() == [True, False]
    edge = fit.place[0] - closed_end(model, fit, [0], 0, 0.0)
    assert 0.4 < edge < 0.5  # the largest that the tracks ask for is 0.5
