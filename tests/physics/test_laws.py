"""Transfer functions and forces of the models against what their papers say of them."""

import inspect
import math

import numpy as np
import pytest

from airflock.core.agent import HeardNeighbour, decide, sum_neighbours
from airflock.core.contract import State
from airflock.core.maths import bell, braking_curve, braking_distance, excess, peak, rising
from airflock.core.model import model
from airflock.parts.laws import vasarhelyi_2018, viragh_2014

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
