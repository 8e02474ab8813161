"""Order parameters of Vásárhelyi et al. 2018 on made-up flocks whose values are known by hand."""

import math

import numpy as np
import pytest

from airflock.core.maths import bell, peak, rising
from flocks import IDEAL, ISLANDS, measured, scenario

SIDE = 100.0


def flock(**settings):
    keys = {key.replace(".", "__"): value for key, value in IDEAL.items()}
    keys |= {"world__side": SIDE, "radio__range": 30.0, "agents": 5, "metrics__period": 0.0}
    keys |= {"metrics__r_coll": 3.0, "metrics__r_cluster": 20.0}
    return scenario(**keys | settings)


def instant(*agents):
    """One frame (1, component, agent) from (x, y, vx, vy) of each agent."""
    return np.array(agents, float).T[None]


def film(*frames):
    return np.concatenate([instant(*frame) for frame in frames])


def test_parallel_flock_is_correlated_and_opposed_one_is_not():
    together = measured(flock(), instant((0, 0, 4, 0), (10, 0, 4, 0), (0, 10, 4, 0)))
    assert together["phi_corr"] == pytest.approx(1.0)
    assert together["polarisation"] == pytest.approx(1.0)
    assert together["phi_vel"] == pytest.approx(4.0)
    opposed = measured(flock(), instant((0, 0, 4, 0), (10, 0, -4, 0)))
    assert opposed["phi_corr"] == pytest.approx(-1.0)
    assert opposed["polarisation"] == pytest.approx(0.0, abs=2e-6)


def test_correlation_is_the_mean_over_other_members_of_the_own_cluster():
    # a chain of three, linked neighbour to neighbour, at 0, 60 and 120 degrees; and a lone agent, which contributes 0
    angles = (0.0, 60.0, 120.0)
    agents = [(15.0 * i, 0.0, math.cos(math.radians(a)), math.sin(math.radians(a))) for i, a in enumerate(angles)]
    found = measured(flock(), instant(*agents, (-45.0, -45.0, 1.0, 0.0)))
    pairs = (0.5 + -0.5, 0.5 + 0.5, -0.5 + 0.5)  # cosines with the other two
    assert found["phi_corr"] == pytest.approx(sum(p / 2.0 for p in pairs) / 4.0)
    assert found["n_min"] == 1.0
    whole = measured(flock(), instant(*agents))
    assert whole["n_min"] == 3.0


def test_nearest_neighbours_and_disconnected_agents():
    found = measured(flock(), instant((0, 0, 1, 0), (6, 8, 1, 0), (6, 20, 1, 0), (-49, -49, 1, 0)))
    far = math.hypot(49.0, 49.0)
    assert found["r_min_mean"] == pytest.approx((10.0 + 10.0 + 12.0 + far) / 4.0)
    assert found["r_min"] == pytest.approx(10.0)
    assert found["n_disc"] == 1.0


def test_a_contact_is_one_collision_until_they_part():
    def gap(d):
        return [(0, 0, 1, 0), (d, 0, 1, 0), (0, 40, 1, 0)]

    found = measured(flock(), film(*(gap(d) for d in (9, 2, 1, 2, 9, 2.9, 3.1))))
    assert found["n_coll"] == 2.0
    assert found["phi_coll"] == pytest.approx(4.0 / 7.0 * 2.0 / 6.0)  # one of three pairs in four of seven instants
    assert measured(flock(), film(gap(9), gap(8)))["n_coll"] == 0.0


def test_a_third_agent_that_comes_near_a_pair_is_one_more_collision():
    pair = [(0, 0, 1, 0), (2, 0, 1, 0)]
    found = measured(flock(), film([*pair, (20, 0, 1, 0)], [*pair, (3.5, 0, 1, 0)]))
    assert found["n_coll"] == 2.0


def test_excursion_is_the_mean_over_those_outside():
    inside = (0.0, 0.0, 1.0, 0.0)
    none = measured(flock(), instant(inside, (49.9, 0, 1, 0)))
    assert none["phi_wall"] == 0.0
    some = measured(flock(), instant(inside, (52.0, 0, 1, 0), (0.0, -54.0, 1, 0)))
    assert some["phi_wall"] == pytest.approx(3.0)


def test_an_agent_inside_an_obstacle_is_out_by_its_depth():
    island = flock(world__obstacles=ISLANDS)
    x, y = 16.0, 10.0  # above the lower edge y = 8 of the second island by 2 m, which is its nearest edge
    found = measured(island, instant((40, 40, 1, 0), (x, y, 1, 0)))
    assert found["phi_wall"] == pytest.approx(2.0)


def test_clearance_is_the_least_distance_to_walls_and_obstacles_over_time():
    """The arena's walls at 50 m; the second island ends 2 m from (16, 10); nothing stands in an open field."""
    near, far = (0.0, 46.5, 1.0, 0.0), (5.0, -20.0, 1.0, 0.0)
    assert measured(flock(), film([far, near], [far, far]))["clearance"] == pytest.approx(3.5)
    outside = measured(flock(), film([far, near], [far, (0.0, -54.0, 1.0, 0.0)]))
    assert outside["clearance"] == pytest.approx(-4.0) and outside["phi_wall"] == pytest.approx(4.0)
    island = flock(world__obstacles=ISLANDS)
    assert measured(island, instant(far, (16.0, 10.0, 1.0, 0.0)))["clearance"] == pytest.approx(-2.0)
    assert measured(island, instant(far, (16.0, 5.0, 1.0, 0.0)))["clearance"] == pytest.approx(3.0)
    nothing = flock(world__arena="none", world__walls="every_edge", start__kind="ball", start__radius=5.0)
    assert math.isnan(measured(nothing, instant(near, far))["clearance"])


def test_rotation_has_the_sign_of_its_direction():
    def ring(turn):
        # a flock that stays in one place of a circle flies tangentially; phi_LAP takes the centre of mass
        return [(30.0, 5.0 * i, 0.0, turn * 4.0) for i in (-1, 0, 1)]

    assert measured(flock(), instant(*ring(1.0)))["phi_lap"] == pytest.approx(1.0)
    both = measured(flock(), film(ring(1.0), ring(-1.0)))
    assert both["phi_lap"] == pytest.approx(0.0, abs=1e-12)
    assert both["phi_lap_abs"] == pytest.approx(1.0)
    radial = measured(flock(), instant((30, 0, 4, 0), (32, 0, 4, 0)))
    assert radial["phi_lap"] == pytest.approx(0.0, abs=1e-12)


def test_one_agent_alone_has_defined_order_parameters_but_no_nearest_neighbour():
    found = measured(flock(), instant((0, 0, 3, 0)))
    assert found["phi_corr"] == 0.0 and found["phi_coll"] == 0.0 and found["n_coll"] == 0.0
    assert found["n_min"] == 1.0 and found["n_disc"] == 1.0
    assert {name for name, value in found.items() if not math.isfinite(value)} == {"r_min", "r_min_mean"}


def test_the_order_of_agents_and_a_turned_or_moved_world_change_nothing(seed):
    rng = np.random.default_rng(seed)
    n = 40
    frames = np.concatenate([rng.uniform(-40.0, 40.0, (5, 2, n)), rng.normal(size=(5, 2, n))], axis=1)
    base = measured(flock(), frames)
    mixed = measured(flock(), frames[:, :, rng.permutation(n)])
    turned = frames.copy()
    turned[:, 0], turned[:, 1] = -frames[:, 1], frames[:, 0]
    turned[:, 2], turned[:, 3] = -frames[:, 3], frames[:, 2]
    for other in (mixed, measured(flock(), turned)):
        for key in ("phi_corr", "phi_vel", "r_min_mean", "r_min", "phi_coll", "n_disc", "n_min", "phi_lap", "phi_wall"):
            assert other[key] == pytest.approx(base[key], rel=1e-12, abs=1e-12), key
    moved = frames.copy()
    moved[:, 0] += 7.0
    free = measured(flock(world__side=1e4), moved)
    for key in ("phi_corr", "phi_vel", "r_min_mean", "phi_coll", "n_disc", "n_min"):
        assert free[key] == pytest.approx(base[key], rel=1e-9), key


def test_fitness_is_the_product_of_its_parts_and_perfect_for_a_perfect_flock():
    found = flock(agents=100, start__separation=1.0)
    q = found.resolved_metrics()
    perfect = {"phi_vel": q.v_flock, "phi_corr": 1.0, "phi_coll": 0.0, "phi_wall": 0.0, "n_disc": 0.0, "n_min": 100.0}
    assert found.judged(perfect)["fitness"] == pytest.approx(1.0, abs=1e-9)
    poor = {
        "phi_vel": 0.9 * q.v_flock,
        "phi_corr": 0.8,
        "phi_coll": 1e-4,
        "phi_wall": 1.0,
        "n_disc": 3.0,
        "n_min": 15.0,
    }
    parts = found.judged(poor)
    n = found.agents
    expected = {
        "f_speed": rising(poor["phi_vel"], q.v_flock, q.v_tol),
        "f_coll": peak(1e-4, q.a_tol),
        "f_disc": peak(3.0, n / 5.0),
        "f_cluster": rising(15.0, n / 5.0, n / 5.0),
        "f_wall": bell(1.0, q.r_tol),
        "f_corr": 0.8,
    }
    for key, value in expected.items():
        assert parts[key] == pytest.approx(value) and 0.0 < value < 1.0, key
    assert parts["fitness"] == pytest.approx(math.prod(expected.values()))
    assert found.judged({**poor, "phi_corr": -0.2})["fitness"] == 0.0
