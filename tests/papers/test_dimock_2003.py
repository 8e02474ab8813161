"""What Dimock & Selig 2003 is measured with: units, chromosome, static formations, fitness."""

import math

import numpy as np
import pytest

from airflock.metrics import fitness_dimock
from airflock.papers.dimock_2003 import robust, static
from airflock.papers.dimock_2003.units import BEST, FT_LBF, HORSEPOWER, gains
from airflock.scenarios.files import load


def test_the_published_gains_lie_on_the_chromosome():
    found = gains(np.array([318, 3, 76, 317, 22]) / 1024.0)
    assert found[:3] == pytest.approx(BEST[:3], abs=0.005)
    assert found.r_a == pytest.approx(BEST.r_a, abs=0.005)
    assert abs(found.r_c - BEST.r_c) > 0.03  # on no k of the printed bounds


def test_units():
    assert pytest.approx(0.737562, rel=1e-6) == 1.0 / FT_LBF
    assert pytest.approx(745.69987, rel=1e-6) == HORSEPOWER
    p = load("dimock_2003/published").parameters
    for name, value in BEST.si().items():
        assert getattr(p, name) == pytest.approx(value, rel=1e-6)


def test_static_formations_and_their_bounds():
    air = static.Air(load("dimock_2003/published").wing)
    tips = static.vee(5, 0.0, air.wing.span)
    assert air.powers(np.zeros((1, 3)))[0] / FT_LBF == pytest.approx(33.376, abs=0.01)
    assert air.powers(tips).mean() / FT_LBF == pytest.approx(8.931, abs=0.005)
    assert air.munk(tips) / FT_LBF == pytest.approx(8.483, abs=0.005)
    assert air.munk(tips) < air.powers(tips).mean()
    start = static.vee(3, 5.0 * air.h, 12.0 * air.h)
    places, power = static.descent(air, start, selfish=False, rounds=8)
    assert power == pytest.approx(air.powers(places).mean()) and power < air.powers(start).mean() - 0.01
    assert power > air.munk(places)


def test_one_horseshoe_rewards_a_row_without_bound():
    wing = load("dimock_2003/published").wing
    row = np.array([(-0.8 * i, 0.51 * wing.span * i, 0.0) for i in range(3)])
    nearer = row * (1.0, 0.502 / 0.51, 1.0)
    one = static.Air(wing, 1)
    assert one.powers(nearer).mean() < one.powers(row).mean() < 0.0


def test_fitness_forgets_no_collision_and_grades_closeness():
    calm = {"power": 20.0, "power_solo": 45.0, "n_coll": 0.0, "crowding": 0.0, "unrest": 0.0, "stable": 1.0}
    assert fitness_dimock.fitness(calm)["fitness"] == -20.0
    assert fitness_dimock.fitness(calm | {"n_coll": 1.0})["fitness"] == -1000.0
    assert fitness_dimock.fitness(calm, "sound")["fitness"] == -20.0
    worse = ({"n_coll": 1.0}, {"crowding": 0.1}, {"unrest": 0.3}, {"stable": 0.0}, {"unrest": math.nan})
    assert all(fitness_dimock.fitness(calm | change, "sound")["fitness"] < -25.0 for change in worse)
    closer = [fitness_dimock.fitness(calm | {"crowding": c}, "sound")["fitness"] for c in (0.0, 0.1, 0.2)]
    assert closer == sorted(closer, reverse=True)


def test_a_rate_lies_in_its_interval():
    class Flight:
        def __init__(self, collided):
            self.collided = collided

    rate, low, high = robust.rates([Flight(k < 3) for k in range(60)])
    assert rate == pytest.approx(0.05)
    assert (low, high) == pytest.approx((0.0171, 0.1370), abs=1e-3)  # Wilson
