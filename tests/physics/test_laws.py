"""Transfer functions and forces of the models against what their papers say of them."""

import inspect
import math

import numpy as np
import pytest

from airflock.core.agent import HeardNeighbour, decide, sum_neighbours
from airflock.core.contract import State
from airflock.core.maths import bell, braking_curve, braking_distance, excess, peak, rising
from airflock.core.model import model
from airflock.core.vocabulary import Own, Percept
from airflock.engine import fly_world
from airflock.parts.laws import (
    network,
    olfati_saber_2006,
    potential_field,
    reynolds_1999,
    vasarhelyi_2018,
    viragh_2014,
)
from airflock.scenarios import load
from airflock.support import ParameterError

MODELS = [model(vasarhelyi_2018), model(viragh_2014)]
A, P = [1.0, 3.0, 8.0], [0.3, 1.0, 5.0]


@pytest.mark.parametrize("a", A)
@pytest.mark.parametrize("p", P)
def test_braking_curve_never_asks_for_more_than_a(a, p):
    r = np.linspace(1e-3, 400.0, 40_001)
    v = np.array([braking_curve(x, a, p) for x in r])
    deceleration = np.diff(0.5 * v**2) / np.diff(r)
    assert deceleration.max() <= a * (1.0 + 1e-9)
    assert (np.diff(v) > 0.0).all()


@pytest.mark.parametrize("a", A)
@pytest.mark.parametrize("p", P)
def test_braking_curve_is_continuous_and_smooth(a, p):
    joint = a / (p * p)  # m, where the gain hands over to the deceleration
    below, above = (braking_curve(joint * k, a, p) for k in (1.0 - 1e-9, 1.0 + 1e-9))
    assert below == pytest.approx(above, rel=1e-8)
    slopes = [(braking_curve(joint * (k + 1e-6), a, p) - braking_curve(joint * k, a, p)) for k in (1.0 - 1e-6, 1.0)]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-4)
    assert braking_curve(0.0, a, p) == braking_curve(-5.0, a, p) == 0.0


@pytest.mark.parametrize("a", A)
@pytest.mark.parametrize("p", P)
def test_braking_distance_inverts_the_braking_curve(a, p):
    for v in np.linspace(0.01, 40.0, 200):
        assert braking_curve(braking_distance(v, a, p), a, p) == pytest.approx(v, rel=1e-9)


@pytest.mark.parametrize("a", A)
def test_a_large_gain_makes_the_braking_curve_that_of_constant_deceleration(a):
    """Table S3 of Vásárhelyi et al. 2018, p^frict: v = sqrt(2 a r) as p grows, v² short of it by (a/p)²."""
    r = np.linspace(1.0, 100.0, 200)
    gaps = [max(math.sqrt(2.0 * a * x) - braking_curve(x, a, p) for x in r) for p in (3.0, 30.0, 300.0)]
    assert gaps[0] > 50.0 * gaps[1] > 2500.0 * gaps[2] > 0.0  # a hundredth for ten times the gain
    assert gaps[2] < 1e-4


@pytest.mark.parametrize("a", A)
def test_a_small_gain_makes_the_end_of_braking_long_and_smooth(a):
    """The same: below v = a/p the deceleration p v falls with the speed, so that half of it takes ln 2 / p."""
    for p in (0.3, 1.0, 5.0):
        v = 0.5 * a / p
        speeds = (v, 0.5 * v)
        places = [braking_distance(speed, a, p) for speed in speeds]
        slopes = [(braking_curve(x * (1.0 + 1e-7), a, p) - braking_curve(x, a, p)) / (x * 1e-7) for x in places]
        decelerations = [speed * slope for speed, slope in zip(speeds, slopes, strict=True)]
        assert decelerations == pytest.approx([0.5 * a, 0.25 * a], rel=1e-5)  # smoother than a, and ever more so
        x = np.linspace(*places, 2001)
        time = np.trapezoid([1.0 / braking_curve(each, a, p) for each in x[::-1]], x[::-1])
        assert time == pytest.approx(math.log(2.0) / p, rel=1e-5)  # constant deceleration: v / (2 a), 2.8 times less


@pytest.mark.parametrize("p", P)
def test_a_higher_deceleration_makes_alignment_more_local(p):
    """Table S3, a^frict: what differs by v aligns up to a distance that falls with a, to v / p at the least."""
    for v in (2.0, 10.0, 40.0):
        reach = [braking_distance(v, a, p) for a in (0.5, 1.0, 3.0, 8.0)]
        assert all(near <= far for far, near in zip(reach, reach[1:], strict=False))
        assert reach[0] > reach[-1] or v <= 0.5 * p
        assert braking_distance(v, 1e6, p) == pytest.approx(v / p)


def test_an_agent_on_the_braking_curve_stops_in_time():
    """dx/dt = -D(x) reaches the stopping point, never passes it and never brakes harder than a."""
    a, p, dt = 3.0, 1.2, 1e-3
    x, v = 60.0, braking_curve(60.0, a, p)
    for _ in range(30_000):
        x -= v * dt
        slower = braking_curve(x, a, p)
        assert (v - slower) / dt <= a * 1.01
        v = slower
    assert 0.0 <= x < 1e-3


def test_transfer_functions_have_their_published_ends():
    """F1, F2, F3 (Vásárhelyi et al. 2018, Eqs 17-20)."""
    assert (rising(2.4, 4.0, 1.5), rising(4.0, 4.0, 1.5), rising(9.0, 4.0, 1.5)) == (0.0, 1.0, 1.0)
    assert rising(3.25, 4.0, 1.5) == pytest.approx(0.5)
    assert rising(2.5, 4.0, 1.5) == pytest.approx(0.0, abs=1e-15)
    assert (bell(0.0, 2.0), bell(2.0, 2.0)) == (1.0, pytest.approx(math.exp(-1.0)))
    assert (peak(0.0, 3e-5), peak(3e-5, 3e-5)) == (1.0, 0.25)
    rises = [rising(x, 4.0, 1.5) for x in np.linspace(2.0, 5.0, 500)]
    assert (np.diff(rises) >= 0.0).all()


def test_excess_is_the_share_above():
    assert excess(4.0, 1.0) == 0.75
    assert excess(4.0, 5.0) == 0.0


def pair(law, p, own, other):
    """Sums of one agent that hears one neighbour."""
    return np.array(sum_neighbours(law, p, own, [HeardNeighbour(1, other, 0.0)], 0))


def states(seed, count=200):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        own, other = (State(*rng.normal(0.0, 15.0, 3), *rng.normal(0.0, 4.0, 3)) for _ in range(2))
        yield own, other


@pytest.mark.parametrize("law", MODELS, ids=lambda law: law.name)
def test_pair_forces_are_antisymmetric(law, seed):
    """What a neighbour adds to me I add to it with the opposite sign: the sum over a flock is zero."""
    p = law.Parameters(r0_rep=30.0)
    strongest = 0.0
    for own, other in states(seed):
        mine, yours = pair(law, p, own, other), pair(law, p, other, own)
        np.testing.assert_allclose(mine, -yours, atol=1e-12)
        strongest = max(strongest, np.abs(mine).max())
    assert strongest > 0.5


@pytest.mark.parametrize("law", MODELS, ids=lambda law: law.name)
def test_rotating_the_world_rotates_the_forces(law, seed):
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))  # a rotation or a reflection of space

    def turned(state):
        return State(*turn @ state[:3], *turn @ state[3:])

    p = law.Parameters(r0_rep=30.0)
    for own, other in states(seed, 50):
        np.testing.assert_allclose(pair(law, p, turned(own), turned(other)), turn @ pair(law, p, own, other), atol=1e-9)


@pytest.mark.parametrize("law", MODELS, ids=lambda law: law.name)
def test_a_lone_agent_wishes_to_fly_straight_at_its_preferred_speed(law):
    p = law.Parameters()
    found = decide(law, p, State(5.0, 6.0, 7.0, 1.0, 2.0, -2.0), [], [], time=0.0, period=0.2)
    assert found.command == pytest.approx(np.array([1.0, 2.0, -2.0]) / 3.0 * p.v_flock)
    assert found.memory is None


def test_the_desired_velocity_is_rescaled_or_capped(seed):
    """Always v_flock long (the authors' program), or at most v_max (Eq. 11 as printed)."""
    law = MODELS[0]
    for limit, low, high in (("rescale", 4.0, 4.0), ("cap", 0.0, 6.0)):
        p = law.Parameters(limit=limit, r0_rep=40.0, p_rep=0.5)
        lengths = [
            np.linalg.norm(decide(law, p, own, [HeardNeighbour(1, other, 0.0)], [], time=0.0, period=0.2).command)
            for own, other in states(seed)
        ]
        assert low - 1e-9 <= min(lengths) <= max(lengths) <= high + 1e-9
        assert max(lengths) == pytest.approx(high, rel=1e-6)


def test_repulsion_pushes_apart_within_its_range_only():
    law, p = MODELS[0], vasarhelyi_2018.Parameters(r0_rep=10.0, p_rep=0.2, c_frict=0.0)
    still = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for distance, push in ((4.0, -0.2 * 6.0), (9.9, -0.2 * 0.1), (10.0, 0.0), (25.0, 0.0)):
        found = pair(law, p, still, State(distance, 0.0, 0.0, 0.0, 0.0, 0.0))
        assert found == pytest.approx([push, 0.0, 0.0], abs=1e-9)


def test_alignment_acts_only_above_the_allowed_difference():
    law, p = MODELS[0], vasarhelyi_2018.Parameters(p_rep=0.0, v_frict=1.0, c_frict=0.5, r0_frict=85.0)
    still = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for speed, pull in ((0.9, 0.0), (3.0, 0.5 * (3.0 - 1.0))):
        assert pair(law, p, still, State(20.0, 0.0, 0.0, 0.0, speed, 0.0))[1] == pytest.approx(pull, abs=1e-9)


@pytest.mark.parametrize("law", MODELS, ids=lambda law: law.name)
def test_a_wall_turns_an_agent_round_and_a_far_one_does_nothing(law):
    p = law.Parameters()
    towards = State(0.0, 0.0, 0.0, p.v_flock, 0.0, 0.0)
    near, far = (
        decide(law, p, towards, [], [(distance, -1.0, 0.0, 0.0)], time=0.0, period=0.2).command
        for distance in (0.0, 500.0)
    )
    assert near[0] < 0.5 * p.v_flock
    assert far == pytest.approx((p.v_flock, 0.0, 0.0))


def test_friction_of_2014_counts_distance_from_within_the_repulsion_range():
    """Twice the difference is pulled twice as much; the slope is constant up to r0 - r2 + r_min, then 1 over square."""
    law, p = MODELS[1], viragh_2014.Parameters(p_rep=0.0, r0_rep=20.0, r2_frict=8.0, r_min_frict=5.0, c_frict=30.0)
    still = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for distance, slope in ((1.0, 1.2), (17.0, 1.2), (22.0, 0.3), (32.0, 0.075)):
        for speed in (0.5, 1.0):
            found = pair(law, p, still, State(distance, 0.0, 0.0, 0.0, speed, 0.0))
            assert found == pytest.approx([0.0, slope * speed, 0.0], abs=1e-9)


@pytest.mark.parametrize("beta", [0.1, 0.3, 0.5])
def test_cucker_smale_velocities_meet_within_the_rates_of_the_theorem(beta, seed):
    """However a flock starts; each step keeps a share of the deviation between those of the nearest and farthest."""
    n, dt, k, sigma = 8, 0.05, 0.05, 10.0
    rng = np.random.default_rng(seed)
    start = np.vstack([rng.uniform(-30.0, 30.0, (2, n)), rng.normal(0.0, 5.0, (2, n))])
    law = {"model.k": k, "model.sigma": sigma, "model.beta": beta}
    scenario = load("cucker_smale_2007/flock", {"agents": n, "duration": 20.0, "dt": dt, "metrics.period": dt} | law)
    frames = fly_world(scenario, 1, precision=64, record=True, start=start, device="python").frames
    offsets = frames[:, :2, :, None] - frames[:, :2, None, :]
    farthest = np.sqrt((offsets**2).sum(axis=1)).max()
    deviation = np.sqrt(((frames[:, 2:4] - frames[:, 2:4].mean(axis=2, keepdims=True)) ** 2).sum(axis=(1, 2)))
    steps = np.arange(len(frames))
    slowest = n * k * (1.0 + (farthest / sigma) ** 2) ** -beta
    assert (deviation <= deviation[0] * (1.0 - dt * slowest) ** steps * (1.0 + 1e-9)).all()
    assert (deviation >= deviation[0] * (1.0 - dt * n * k) ** steps * (1.0 - 1e-9)).all()
    assert deviation[-1] < 0.5 * deviation[0]
    mean = frames[:, 2:4].mean(axis=2)
    np.testing.assert_allclose(mean, np.broadcast_to(mean[0], mean.shape), atol=1e-9)  # which the law keeps


def test_olfati_saber_agents_gather_to_a_lattice_and_stand():
    """Deviation energy per edge over d², and velocity mismatch per agent over that of the start."""
    scenario = load("olfati_saber_2006/lattice")
    frames = fly_world(scenario, 1, record=True).frames
    x, v = frames[-1, :2], frames[-1, 2:4]
    away = np.hypot(*(x[:, :, None] - x[:, None, :]))
    d, edges = scenario.parameters.d, (away > 0.0) & (away < scenario.parameters.r)
    assert edges.sum() / scenario.agents > 4.0  # most agents have six
    assert ((away[edges] - d) ** 2).sum() / (edges.sum() + 1) / d**2 < 1e-3
    mismatch = [(each - each.mean(axis=1, keepdims=True)) ** 2 for each in (frames[0, 2:4], v)]
    assert mismatch[1].sum() < 1e-2 * mismatch[0].sum()


def test_olfati_saber_pairs_rest_at_the_distance_of_the_lattice():
    p = olfati_saber_2006.Parameters(a=3.0, b=5.0)
    along = [olfati_saber_2006.neighbour(r, 0.0, 0.0, r, 0.0, 0.0, 0.0, p).x for r in (5.0, p.d, 8.0, p.r, 20.0)]
    assert along[0] < 0.0 < along[2] and along[1] == pytest.approx(0.0, abs=1e-9) and along[3:] == [0.0, 0.0]


def test_reynolds_1999_never_turns_faster_than_its_limit(seed):
    rng, p = np.random.default_rng(seed), reynolds_1999.Parameters(turn=0.4, a_max=50.0)
    for _ in range(100):
        v = rng.normal(0.0, 3.0, 3)
        speed = np.linalg.norm(v)
        sums = reynolds_1999.Sums(*rng.normal(0.0, 10.0, 9), 3.0, 3.0)
        walls = reynolds_1999.Walls(*rng.normal(0.0, 10.0, 3))
        a = reynolds_1999.decide(Own(*v, *(v / speed)), sums, walls, Percept(0.0, 0.0, 0.0, 0.0), p)
        across = np.linalg.norm(np.cross(v / speed, a))
        assert across <= p.turn * max(speed, 0.1 * p.v_max) * (1.0 + 1e-6)


def test_forces_of_the_potential_field_are_the_slopes_of_its_potentials():
    p, step = potential_field.Parameters(), 1e-4

    def between(r):
        return p.alpha * (math.log(r) + p.d_0 / r)

    def surface(rho):
        return 0.5 * p.eta * (1.0 / rho - 1.0 / p.rho_0) ** 2

    for r in (5.0, p.d_0, 50.0):
        slope = (between(r + step) - between(r - step)) / (2.0 * step)
        assert potential_field.neighbour(r, 0.0, 0.0, r, p).x == pytest.approx(slope, abs=1e-6)
    for rho in (3.0, 10.0, 29.0):
        slope = (surface(rho + step) - surface(rho - step)) / (2.0 * step)
        assert potential_field.boundary(rho, 1.0, 0.0, 0.0, p).x == pytest.approx(-slope, rel=1e-5)
    assert (
        potential_field.neighbour(70.0, 0.0, 0.0, 70.0, p).x == potential_field.boundary(31.0, 1.0, 0.0, 0.0, p).x == 0
    )


@pytest.mark.parametrize("widths", [(), (5,), (18, 2), (7, 18, 4)])
def test_the_law_network_is_the_network_of_its_layers(widths, seed):
    rng = np.random.default_rng(seed)
    sizes = [network.INPUTS, *widths, network.OUTPUTS]
    layers = [
        (rng.normal(0.0, 0.5, (out, into)), rng.normal(0.0, 0.2, out))
        for into, out in zip(sizes, sizes[1:], strict=False)
    ]
    p = network.Parameters(weights=tuple(network.network_weights(layers)), v_max=150.0)
    a = rng.normal(0.0, 1.0, network.INPUTS)
    expected = a
    for number, (weights, bias) in enumerate(layers, 1):
        expected = weights @ expected + bias
        expected = np.tanh(expected) if number < len(layers) else expected
    found = (*a, 1.0)
    for number in range(len(widths)):
        found = network.layer(network.BLOCK * number, found, p)
    first = network.BLOCK * len(widths)
    assert [network.unit_sum(first + network.ROW * k, found, p) for k in range(3)] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("layers", "words"),
    [
        ([([[0.0] * 17] * 3, [0.0] * 3)], "layer 1 of 1 has weights of shape 3 x 17 .*; expected 3 x 18"),
        ([([[0.0] * 18] * 3, [0.0] * 2)], "and 2 biases; expected 3 x 18, and a bias a unit"),
        ([([[0.0] * 18] * 8, [0.0] * 8), ([[0.0] * 9] * 3, [0.0] * 3)], "layer 2 of 2 .* 3 x 9 .* expected 3 x 8"),
        ([([[0.0] * 18] * 19, [0.0] * 19), ([[0.0] * 19] * 3, [0.0] * 3)], "19 x 18 .* expected 1 to 18 x 18"),
        ([([[0.0] * 18] * 18, [0.0] * 18)] * 6 + [([[0.0] * 18] * 3, [0.0] * 3)], "7 layers take 2109 numbers"),
        ([([["x"] * 18] * 3, [0.0] * 3)], "layer 1 of 1 is no pair of rows of numbers and biases"),
        ([], "give 1 to 6 layers"),
    ],
)
def test_weights_of_a_wrong_shape_are_one_line_with_both_shapes(layers, words):
    with pytest.raises(ParameterError, match=words) as caught:
        network.network_weights(layers)
    assert len(str(caught.value).splitlines()) == 1


def test_an_agent_runs_without_arrays_or_compilers():
    """core.agent and core.pilot import nothing that a companion computer lacks."""
    import subprocess
    import sys

    code = (
        "import sys; import airflock.core.agent, airflock.core.pilot;"
        "import airflock.parts.laws.vasarhelyi_2018, airflock.parts.laws.viragh_2014;"
        "print([m for m in ('numpy', 'numba', 'xarray', 'pydantic', 'shapely') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
    assert inspect.signature(decide).parameters["time"].default is not None
