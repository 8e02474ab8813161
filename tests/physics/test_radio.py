"""What neighbours' data suffer: shares received against distance, packets in time."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from airflock.core.radio import FEW_PACKETS, either, loss_probability, lost, packets
from airflock.parts import RADIOS
from airflock.parts.radios.links import Parameters, missed, missed_few, power, received, thrice

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


@given(st.floats(0.0, 1.0), st.integers(0, 65535))
def test_powers_by_products_are_powers(x, n):
    assert power(x, n) == pytest.approx(x**n, rel=1e-9, abs=1e-300)
    assert thrice(x, n & 3) == pytest.approx(x ** (n & 3), rel=1e-12)


@given(st.floats(0.0, 500.0), st.integers(0, FEW_PACKETS), st.integers(0, FEW_PACKETS))
def test_nothing_arrives_where_every_packet_is_missed(distance, fast, slow):
    each = [1.0 - received(distance, 0.0, K)] * fast + [1.0 - received(distance, 1.0, K)] * slow
    assert missed(distance, fast, slow, K) == pytest.approx(math.prod(each), rel=1e-9)
    assert missed_few(distance, fast, slow, K) == pytest.approx(math.prod(each), rel=1e-9)


@given(st.floats(0.0, 500.0), st.integers(0, 2000))
def test_nothing_arrives_where_one_of_two_mishaps_happens(distance, step):
    known = {"distance": distance}
    assert loss_probability(RADIOS["constant"], K, step, 0.2, known) == lost(distance, K)  # a constant radio sends once
    linked = Parameters(kind="links", loss=0.3)
    sent = packets(step, linked.fast_rate, 0.2), packets(step, linked.slow_rate, 0.2)
    arrives = (1.0 - lost(distance, linked)) * (1.0 - missed(distance, *sent, linked))
    assert loss_probability(RADIOS["links"], linked, step, 0.2, known) == pytest.approx(1.0 - arrives, abs=1e-12)
    assert either(0.4, 1.0) == pytest.approx(1.0) and either(0.0, 0.4) == 0.4


@given(st.floats(0.1, 50.0), st.floats(0.02, 2.0), st.integers(1, 2000))
def test_a_link_sends_its_rate_in_packets(rate, period, steps):
    sent = sum(packets(float(step), rate, period) for step in range(steps))
    assert sent == pytest.approx(math.floor(steps * rate * period + 1e-6), abs=1)
