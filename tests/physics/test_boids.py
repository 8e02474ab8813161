"""Boids, particles and schools: what the models must do, whatever the drivers; grid against all pairs."""

import math

import numba
import numpy as np
import pytest

from airflock.core.maths import angle_between, arc_cosine
from airflock.engine import plan_of, score_flight
from airflock.parts.bodies.turning import Parameters as Turning, move as turn
from airflock.parts.laws import reynolds_1987 as boids
from airflock.scenarios.files import load
from airflock.world import edges, rays
from inside import cpu, measuring, tables


def test_arc_cosine_is_the_library_s():
    x = np.linspace(-1.0, 1.0, 4001)
    assert max(abs(arc_cosine(c) - math.acos(c)) for c in x) < 3e-8


def test_small_angles_between_directions_are_as_exact_as_large_ones(seed):
    rng = np.random.default_rng(seed)
    for angle in (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.5, 1.0, 1.1, 2.0, 3.0, math.pi - 1e-7, math.pi):
        a, b = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        found = angle_between(*a, *(math.cos(angle) * a + math.sin(angle) * b))
        assert abs(found - angle) < 3e-8 * min(max(angle, 1e-8), 1.0) + 1e-15
    assert angle_between(0.0, 0.0, 0.0, 1.0, 0.0, 0.0) == pytest.approx(0.5 * math.pi, abs=3e-8)


def test_a_boid_sees_within_half_its_field_of_view_and_everybody_below_the_floor():
    p = boids.Parameters(fov_c_deg=90.0)

    def sees(angle_deg, r):
        angle = math.radians(angle_deg)
        sums = boids.neighbour(r * math.cos(angle), r * math.sin(angle), 0.0, r * r, 0, 0, 0, 1.0, 0.0, 0.0, p)
        return sums.near_c

    assert (sees(44.0, 0.3), sees(46.0, 0.3), sees(180.0, 0.3)) == (1.0, 0.0, 0.0)
    assert (sees(44.0, 0.51), sees(180.0, 0.014), sees(180.0, 0.016)) == (0.0, 1.0, 0.0)


def test_cohesion_and_separation_of_one_neighbour_cancel_in_the_program_s_form():
    p = boids.Parameters(w_a=0.0)
    sums = boids.neighbour(0.1, 0.05, -0.1, 0.0225, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, p)
    assert boids.flocking(sums, p) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_turning_body_turns_by_its_rate_and_keeps_its_speed():
    b = Turning(speed=3.0, turn=0.7)
    v = turn(3.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.1, b)
    assert math.hypot(*v) == pytest.approx(3.0)
    assert math.atan2(v[1], v[0]) == pytest.approx(0.07, abs=1e-6)
    assert turn(3.0, 0.0, 0.0, 0.0, 1.0, 0.0, 10.0, b) == pytest.approx((0.0, 3.0, 0.0), abs=1e-6)


def test_edges_clamp_reflect_and_wrap():
    assert edges.bounce(1.6, 2.0, 1.5) == (1.5, -2.0)
    assert edges.bounce(-1.4, -2.0, 1.5) == (-1.4, -2.0)
    assert edges.wrap(1.6, 2.0, 1.5) == pytest.approx((-1.4, 2.0))
    assert edges.nearest_image(2.9, 1.5) == pytest.approx(-0.1)


def test_rays_end_where_shapely_says(seed):
    from shapely.geometry import LineString, Polygon

    rng = np.random.default_rng(seed)
    corners = [(-2.0, -1.5), (2.5, -1.0), (1.0, 2.0), (-1.5, 1.5)]
    rows = [[*a, *b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    for _ in range(100):
        x, y, angle = *rng.uniform(-0.8, 0.8, 2), rng.uniform(0.0, 2 * math.pi)
        ux, uy = math.cos(angle), math.sin(angle)
        whole = LineString([(x, y), (x + 10 * ux, y + 10 * uy)]).intersection(Polygon(corners)).length
        assert rays.to_edges(x, y, ux, uy, rows, 0, 4) == pytest.approx(whole, rel=1e-9)
        box = LineString([(x, y), (x + 10 * ux, y + 10 * uy)]).intersection(
            Polygon([(-1, -2), (1, -2), (1, 2), (-1, 2)])
        )
        assert rays.to_box(x, y, 0.0, ux, uy, 0.0, 1.0, 2.0, 3.0, [], 0) == pytest.approx(box.length, rel=1e-6)
        assert rays.to_cylinder(x, y, 0.0, ux, uy, 0.0, 1.5, 0.0, 3.0, [], 0) == pytest.approx(
            -(x * ux + y * uy) + math.sqrt((x * ux + y * uy) ** 2 + 2.25 - x * x - y * y), rel=1e-6
        )


def crowd(world, side, duration=0.1):
    return load("zapotecatl_2016/best", {
        "agents": 300, "update": "synchronous", "dt": 0.02, "duration": duration, "metrics.kind": "vasarhelyi",
        "metrics.period": 0.04, "metrics.r_coll": 0.1, "metrics.r_cluster": 0.2, "start.kind": "arena",
        "start.separation": 0.0, "world.edges": world, "world.side": side, "world.height": side,
    })  # fmt: skip


def both(found, seed, start=None, by_cells="python"):
    """Final states by all pairs, interpreted, and by cells on that device; their order parameters are the same."""
    flown, values = [], []
    for grid, device in ((False, "python"), (True, by_cells)):
        plan = plan_of(found, precision=64, grid=grid, near=grid, given_start=start is not None)
        assert plan.grid == plan.near == grid
        done = cpu.fly_on_cpu(plan, tables(found, plan, seed), start, device)
        flown.append(done.state)
        values.append(done.values)
    assert values[1] == pytest.approx(values[0], rel=1e-9, abs=1e-9, nan_ok=True)
    return flown


def scattered(side, seed):
    """A start: 300 agents at random places of a box."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.uniform(-0.5 * side, 0.5 * side, (3, 300)), rng.normal(0.0, 0.1, (3, 300))])


@pytest.mark.parametrize("world", ["bounce", "periodic"])
@pytest.mark.parametrize("side", [1.3, 3.0])
def test_grid_is_all_pairs(world, side, seed):
    """In a box without edges cells are interpreted, between walls compiled: one driver for all flocks that bounce."""
    start = scattered(side, seed) if world == "bounce" else None  # or drawn
    one, two = both(crowd(world, side), seed, start, "cpu" if world == "bounce" else "python")
    assert np.abs(one[3:]).max() > 0.0
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-12)


def test_grid_is_all_pairs_in_a_plane_of_many_lines(seed):
    one, two = both(load("vicsek_1995/transition", {"agents": 500, "world.side": 21.0, "duration": 4.0}), seed)
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-10)


STRETCHED = {"line": (400.0, 1.2, 1.2), "plane": (60.0, 60.0, 1.2), "plane of many lines": (1.2, 30.0, 30.0)}


@pytest.mark.parametrize("shape", STRETCHED)
def test_a_flock_along_a_line_or_in_a_plane_is_met_in_full(shape, seed):
    """Its box has far more room for cells than agents; the cells grow, and nobody is missed. The walls are far away."""
    found = crowd("bounce", 1000.0, 0.2)
    rng = np.random.default_rng(seed)
    place = rng.uniform(-0.5, 0.5, (300, 3)) * STRETCHED[shape]
    place[1::2] = place[::2] + rng.normal(0.0, 0.1, (150, 3))  # everybody has company
    start = np.concatenate([place.T, rng.normal(0.0, 0.1, (3, 300))])
    one, two = both(found, seed, start, "cpu")
    assert np.abs(one[:3] - start[:3]).max() > 1e-3
    np.testing.assert_allclose(one, two, rtol=0.0, atol=1e-12 * STRETCHED[shape][0])


@pytest.mark.parametrize("together", [20, 2])
def test_groups_by_cells_are_those_of_all_pairs(together, seed):
    """Tight groups, some of them across the edges of the box, and agents alone; a group has its own mean."""
    found = load("zapotecatl_2016/best", {
        "agents": 300, "update": "synchronous", "metrics.kind": "groups", "metrics.r_cluster": 0.25,
        "metrics.max_e": 3.0, "world.edges": "periodic", "world.side": 4.0, "world.height": 4.0,
    })  # fmt: skip
    rng = np.random.default_rng(seed)
    centres = np.repeat(rng.uniform(-2.0, 2.0, (3, 300 // together)), together, axis=1)
    place = (centres + rng.normal(0.0, 0.1, (3, 300)) + 2.0) % 4.0 - 2.0
    frames = np.concatenate([place, rng.normal(0.0, 0.1, (3, 300))])[None]
    plans = [plan_of(found, precision=64, grid=near, near=near) for near in (False, True)]
    one, two = (measuring.score_tables(plan, tables(found, plan, 0), frames, device="python")[0] for plan in plans)
    assert one["n_groups"] > 5.0 and one["share_alone"] > 0.0
    assert two == pytest.approx(one, rel=1e-9, abs=1e-9)


def test_the_number_of_threads_changes_no_bit_of_a_grid(seed):
    found, start = crowd("bounce", 3.0), scattered(3.0, seed)
    plan = plan_of(found, precision=64, grid=True, near=True, given_start=True)
    most = numba.get_num_threads()
    states, values = [], []
    for threads in sorted({1, min(2, most), most}):
        numba.set_num_threads(threads)
        flown = cpu.fly_on_cpu(plan, tables(found, plan, seed), start)
        states.append(flown.state)
        values.append(flown.values)
    numba.set_num_threads(most)
    assert all((state == states[0]).all() for state in states)
    assert all(value == values[0] for value in values)


def test_a_periodic_box_too_small_for_images_is_met_in_all_pairs():
    assert not plan_of(crowd("periodic", 0.9), grid=True).grid  # reach 0.5 m
    assert plan_of(crowd("periodic", 1.0), grid=True).grid


def test_particles_are_ordered_at_low_noise_and_not_at_high():
    settings = {"agents": 300, "world.side": 8.66, "duration": 800.0}
    at = {eta: score_flight(load("vicsek_1995/transition", {"model.eta": eta, **settings})) for eta in (0.1, 2.0, 6.28)}
    assert at[0.1]["polarisation"] > 0.9
    assert at[0.1]["polarisation"] > at[2.0]["polarisation"] > at[6.28]["polarisation"]
    # without order the mean heading is a random walk: Rayleigh mean sqrt(pi / (4 n))
    assert at[6.28]["polarisation"] == pytest.approx(math.sqrt(math.pi / 1200.0), rel=0.1)


def test_the_four_groups_of_couzin():
    found = {
        name: score_flight(load(f"couzin_2002/{name}"))
        for name in ("swarm", "torus", "dynamic_parallel", "highly_parallel")
    }
    assert found["swarm"]["polarisation"] < 0.25
    assert found["swarm"]["milling"] < 0.3
    assert found["torus"]["polarisation"] < 0.3
    assert found["torus"]["milling"] > 0.5
    assert found["dynamic_parallel"]["polarisation"] > 0.8
    assert found["highly_parallel"]["polarisation"] > 0.98


def test_a_short_flight_of_the_paper_has_its_quality():
    found = score_flight(load("zapotecatl_2016/best", {"dt": 0.004, "duration": 89.996}), 1)
    assert 0.88 < found["quality"] < 0.96
    six = ["extension_cm", "polarization_deg", "f_collision", "cns_ext", "cns_pol", "quality"]
    assert list(found) == [*six, "polarisation"]
