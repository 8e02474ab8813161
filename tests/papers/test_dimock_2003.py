"""What Dimock & Selig 2003 is measured with: units, chromosome, static formations, fitness."""

import math

import numpy as np
import pytest

from airflock.engine import fly_world
from airflock.parts.metric_sets import dimock as fitness_dimock
from airflock.scenarios.files import load
from airflock_papers.dimock_2003 import flights, ga, ga_claims, robust, robust_claims, static
from airflock_papers.dimock_2003.flights import Flight, Start, Task, in_row
from airflock_papers.dimock_2003.units import BEST, FT_LBF, HORSEPOWER, gains


def test_the_published_gains_lie_on_the_chromosome():
    found = gains(np.array([318, 3, 76, 317, 22]) / 1024.0)
    assert found[:3] == pytest.approx(BEST[:3], abs=0.005)
    assert found.r_a == pytest.approx(BEST.r_a, abs=0.005)
    assert abs(found.r_c - BEST.r_c) > 0.03  # on no k of the printed bounds


def test_a_change_of_nothing_leaves_each_flight_its_own_gains_and_start():
    tasks = [Task(BEST._replace(k_d=k_d), start) for k_d in (0.0, 3.0) for start in (Start(sx=5.0, sy=5.0), Start())]
    plain, changed = (flights.Birds(1, changes=c).fly("", tasks, 1.0) for c in ({}, {"metrics.r_coll": 0.1524}))
    for before, after in zip(plain, changed, strict=True):
        np.testing.assert_array_equal(after.frames, before.frames)
    assert len({flight.power for flight in plain}) == len(tasks)


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
    assert fitness_dimock.of_paper(calm) == -20.0
    assert fitness_dimock.of_paper(calm | {"n_coll": 1.0}) == -1000.0
    assert fitness_dimock.sound(calm) == -20.0
    worse = ({"n_coll": 1.0}, {"crowding": 0.1}, {"unrest": 0.3}, {"stable": 0.0}, {"unrest": math.nan})
    assert all(fitness_dimock.sound(calm | change) < -25.0 for change in worse)
    closer = [fitness_dimock.sound(calm | {"crowding": c}) for c in (0.0, 0.1, 0.2)]
    assert closer == sorted(closer, reverse=True)


def test_a_rate_lies_in_its_interval():
    class Flight:
        def __init__(self, collided):
            self.collided = collided

    rate, low, high = robust.rates([Flight(k < 3) for k in range(60)])
    assert rate == pytest.approx(0.05)
    assert (low, high) == pytest.approx((0.0171, 0.1370), abs=1e-3)  # Wilson


class Birds:
    """Flights that cost nothing: power is the sum of the gains, and bold birds collide."""

    progress = None

    def __init__(self):
        self.tasks = []

    def fly(self, title, tasks, duration=20.0, noise=0.0, **readings):
        self.tasks += tasks
        return [
            Flight({"power": sum(t.gains), "n_coll": float(t.gains.k_a > 80.0)}, np.zeros((1, 3, 5))) for t in tasks
        ]


def test_a_generation_flies_no_controller_twice_and_loses_those_that_collide_or_cannot_cohere():
    birds = Birds()
    run = ga.Run(ga.READINGS["mean"], 1)
    losses = ga.losses_of(birds, run)
    points = np.array([[0.1, 0.1, 0.1, 0.5, 0.1]] * 2 + [[0.1, 0.9, 0.1, 0.5, 0.1], [0.1, 0.1, 0.1, 0.0, 0.9]])
    assert losses(points) == pytest.approx([sum(gains(points[0])), sum(gains(points[0])), ga.LOST, ga.LOST])
    losses(points)
    assert run.flown == len(birds.tasks) == 2
    assert run.best == [run.best[0]] * 2 and run.champions[-1] == gains(points[0])
    assert run.timid == [0.0, 0.0]
    assert run.lost == [0.25, 0.25]  # one of four collides; who cannot cohere was not flown


def test_of_the_controllers_with_a_small_gain_those_that_collide_are_counted():
    run = ga.Run(ga.READINGS["mean"], 1)
    points = np.array([[0.1, k_a, 0.1, r_c, 0.1] for k_a, r_c in ((0.01, 0.5), (0.01, 0.5), (0.01, 0.0), (0.5, 0.5))])
    run.note(points, np.array([20.0, ga.LOST, ga.LOST, ga.LOST]))
    assert run.careless == [(3, 1)] and run.lost == [0.5] and run.timid == [0.75]


@pytest.mark.parametrize(("aside", "behind", "row"), [(0.5, 1.0, True), (1.0, 0.5, False), (1.6, 5.0, False)])
def test_a_row_is_longer_than_wide_and_a_span_wide_at_most(aside, behind, row):
    rank = np.arange(5.0)
    places = np.array([-behind * rank, aside * (rank % 3), 0.0 * rank]) * 0.3048 * 2.0
    assert in_row(Flight({}, places[None])) == row


def test_one_horseshoe_is_solved_as_the_dense_system_is():
    keys = {"wing.segments": "1", "wing.positions": "free", "model.gradient": "none", "duration": 0.1}
    scenario = load("dimock_2003/published", {**keys, "model.k_c": 0.0, "model.k_a": 0.0})
    found = fly_world(scenario, record=True, device="python")
    places = found.frames[0, :3].T.astype(float)
    assert found.values["power"] == pytest.approx(static.Air(scenario.wing, 1).powers(places).mean(), rel=1e-3)


def test_cmaes_takes_no_more_flights_than_it_is_given():
    birds = Birds()
    run = ga.with_cmaes(birds, ga.READINGS["mean"], 3, 200)
    assert run.flown <= 200 and run.best[-1] < run.best[0]
    assert len(birds.tasks) == run.flown + 4  # of the winner's: early, midway, final, and with the full gradient


def test_nobody_on_the_front_is_beaten_and_everybody_else_is():
    rng = np.random.default_rng(5)
    tried = [robust.Candidate(None, *pair) for pair in rng.random((50, 2))]
    kept = robust.nondominated(tried)
    for c in tried:
        beaten = any(k.power <= c.power and k.crowding <= c.crowding and k is not c for k in kept)
        assert beaten != (c in kept)


def test_held_out_flights_are_of_all_kinds_and_no_search_has_seen_their_seeds():
    tasks = robust.held_out(BEST, 60)
    assert [task.start for task in tasks[:6]] == list(robust.STARTS.values())
    assert len({task.seed for task in tasks}) == 60 and min(task.seed for task in tasks) > 30 * 12 * 6


def test_few_collisions_of_many_are_fewer_by_the_exact_test():
    flights = [Flight({"n_coll": float(k < 8)}, None) for k in range(100)]
    safe = [Flight({"n_coll": 0.0}, None) for _ in range(100)]
    assert robust_claims.less(safe, flights) == pytest.approx(math.comb(192, 100) / math.comb(200, 100), rel=0.1)
    assert robust_claims.less(flights, flights) > 0.5


@pytest.mark.parametrize("collisions", [(0.0, 1.0), (1.0, 1.0)])
def test_winners_that_all_collide_with_the_full_gradient_are_not_measured(collisions):
    runs = [ga.Run(ga.READINGS["mean"], seed, best=[10.0]) for seed in (1, 2)]
    for run, met in zip(runs, collisions, strict=True):
        run.flights["full gradient"] = Flight({"power": 11.0, "n_coll": met}, np.zeros((1, 3, 5)))
    found = ga_claims._full(runs)
    assert [each.value.runs for each in found] == ([1] if 0.0 in collisions else [])
