"""A multirotor that holds a command: the closed form is the stepped motion."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings, strategies as st

from airflock.parts.bodies import held, motion

DT = 0.01


@settings(deadline=None, max_examples=60)
@given(st.floats(0.1, 3.0), st.floats(0.5, 10.0), st.floats(0.01, 30.0), st.integers(1, 300))
def test_closed_form_is_the_stepped_motion(tau, a_max, gap, steps):
    b = SimpleNamespace(tau=tau, a_max=a_max, noise=0.0, drag=0.0)
    v = 0.0
    for _ in range(steps):
        v, _, _ = motion.move(v, 0.0, 0.0, v, 0.0, 0.0, gap, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, DT, b)
    left, limited = held.gap_left(gap, steps * DT, tau, held.decay_rate(tau, DT), a_max)
    # equal but for the one step in which the limit ends, where the acceleration changes by at most a_max dt / tau
    assert left == pytest.approx(gap - v, abs=a_max * DT * DT / tau + 1e-9)
    assert 0.0 <= limited <= steps * DT + 1e-12


@given(st.floats(0.1, 3.0), st.floats(0.5, 10.0), st.floats(0.01, 30.0), st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_two_times_one_after_another_are_their_sum(tau, a_max, gap, first, second):
    rate = held.decay_rate(tau, 0.0)
    middle, _ = held.gap_left(gap, first, tau, rate, a_max)
    both, _ = held.gap_left(middle, second, tau, rate, a_max)
    assert both == pytest.approx(held.gap_left(gap, first + second, tau, rate, a_max)[0], rel=1e-9, abs=1e-12)


def test_rate_of_small_steps_is_one_over_tau():
    assert held.decay_rate(0.8, 1e-9) == pytest.approx(1.0 / 0.8, rel=1e-6)
    assert pytest.approx(math.exp(-20 * DT * held.decay_rate(0.5, DT))) == (1.0 - DT / 0.5) ** 20


@pytest.mark.parametrize("tau", [0.1, 0.5, 3.0])
def test_a_velocity_wanders_as_far_as_many_noisy_steps_let_it(tau):
    noise, variance = 0.3, 0.0
    for _ in range(round(20.0 * tau / DT)):  # each step keeps 1 - DT/tau of the gap, and adds 2 noise DT
        variance = (1.0 - DT / tau) ** 2 * variance + 2.0 * noise * DT
    assert noise * held.wander(tau, DT) == pytest.approx(variance, rel=1e-12)
    assert held.wander(tau, 0.0) == tau
