"""What neighbours' data suffer: shares received against distance, packets in time."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airflock.body.radio import Parameters, lost, packets, received

K = Parameters(loss=0.3)


def test_loss_grows_with_the_square_of_the_distance():
    assert lost(0.0, K) == 0.0
    assert lost(80.0, K) == pytest.approx(0.3)
    assert lost(40.0, K) == pytest.approx(0.3 / 4.0)
    assert lost(1e4, K) == 1.0


def test_links_receive_what_the_drone_setup_reports():
    """Near-perfect below 20 m; 40-80 % beyond, up to 50 m, where outages begin; the long link reaches twice as far."""
    assert all(received(r, 0.0, K) >= 0.95 for r in (1.0, 10.0, 20.0))
    middle = [received(r, 0.0, K) for r in np.linspace(30.0, 50.0, 9)]
    assert all(0.4 - 1e-12 <= share <= 0.8 for share in middle)
    assert received(100.0, 0.0, K) == pytest.approx(0.1)
    for r in (5.0, 30.0, 49.0, 90.0):
        assert received(2.0 * r, 1.0, K) == pytest.approx(received(r, 0.0, K))


@given(st.floats(0.0, 500.0), st.floats(0.0, 500.0))
def test_a_farther_agent_is_never_heard_better(r, s):
    near, far = sorted((r, s))
    assert received(far, 0.0, K) <= received(near, 0.0, K) + 1e-12
    assert lost(near, K) <= lost(far, K)


@given(st.floats(0.1, 50.0), st.floats(0.02, 2.0), st.integers(1, 2000))
def test_a_link_sends_its_rate_in_packets(rate, period, steps):
    sent = sum(packets(float(step), rate, period) for step in range(steps))
    assert sent == pytest.approx(math.floor(steps * rate * period + 1e-6), abs=1)
