"""Kinds of radio against closed forms: tables, packets that meet, shadows, bursts, delays that differ."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st

from airflock.core.radio import PacketReception, arrival_probability, packets
from airflock.estimate.identification.radio_links import table_entries
from airflock.parts import RADIOS
from airflock.parts.radios import bursts, congestion, jitter, links, shadow, table
from airflock.support.errors import RecordingError

ENTRIES = [f"received_{n}" for n in range(table.ENTRIES)]


@given(st.lists(st.floats(0.0, 1.0), min_size=16, max_size=16), st.floats(1.0, 50.0), st.floats(0.0, 1000.0))
def test_a_table_is_linear_between_its_entries_and_ends(shares, spacing, distance):
    k = table.Parameters(spacing=spacing, **dict(zip(ENTRIES, shares, strict=True)))
    known = np.interp(distance / spacing, np.arange(17.0), [*shares, 0.0], right=0.0)
    assert table.missed(distance, k) == pytest.approx(1.0 - known, abs=1e-9)


def test_a_table_is_found_again_in_the_packets_that_it_let_through():
    rng = np.random.default_rng(5)
    shares = np.linspace(0.95, 0.1, table.ENTRIES)
    k = table.Parameters(spacing=8.0, **dict(zip(ENTRIES, shares.tolist(), strict=True)))
    distance = rng.uniform(0.0, 15 * 8.0, 200_000)
    got = rng.uniform(size=len(distance)) >= np.vectorize(table.missed, excluded=[1])(distance, k)
    found = table_entries(pd.DataFrame({"distance": distance, "got": got.astype(int)}), 8.0)
    assert found.pop("spacing") == 8.0
    np.testing.assert_allclose(list(found.values()), shares, atol=0.02)
    near = table_entries(pd.DataFrame({"distance": distance[distance < 40.0], "got": got[distance < 40.0]}), 8.0)
    assert near["received_15"] == near["received_5"]  # nobody flew farther apart
    with pytest.raises(RecordingError, match="no column got"):
        table_entries(pd.DataFrame({"distance": distance}), 8.0)
    with pytest.raises(RecordingError, match="no pair within 0.016 m"):
        table_entries(pd.DataFrame({"distance": distance + 1.0, "got": got}), 0.001)


def test_packets_meet_as_often_as_random_packets_do():
    """Begin at random times; one is lost if another begins within its airtime before or after it."""
    rng, talkers, k = np.random.default_rng(3), 12, congestion.Parameters(airtime=0.003, rate=10.0)
    begins = np.sort(rng.uniform(0.0, 1000.0, 10_000))
    others = rng.uniform(0.0, 1000.0, int(1000.0 * k.rate * (talkers - 1)))
    edges = np.sort(others)
    met = np.searchsorted(edges, begins + k.airtime) > np.searchsorted(edges, begins - k.airtime)
    assert congestion.collided(float(talkers), k) == pytest.approx(met.mean(), abs=0.02)
    assert congestion.collided(1.0, k) == 0.0
    sent = packets(7.0, k.rate, 0.2)
    assert congestion.missed(12.0, sent, k) == pytest.approx(congestion.collided(12.0, k) ** sent)
    assert congestion.missed_few(12.0, sent, k) == pytest.approx(congestion.missed(12.0, sent, k))


@given(st.floats(1.0, 400.0), st.floats(0.0, 60.0), st.floats(1.0, 5.0))
def test_a_wall_is_a_distance_at_which_the_signal_has_lost_as_many_decibels(distance, wall, exponent):
    k = shadow.Parameters(wall=wall, exponent=exponent)
    far = shadow.stretched(distance, 0.0, k)
    assert 10.0 * exponent * math.log10(far / distance) == pytest.approx(wall, abs=1e-9)
    assert shadow.stretched(distance, 1.0, k) == distance
    assert shadow.missed(distance, 0.0, k) >= shadow.missed(distance, 1.0, k) - 1e-12
    assert shadow.missed(distance, 1.0, k) == pytest.approx(1.0 - links.received(distance, 0.0, k))


def test_bursts_have_their_share_and_their_length():
    """Of a chain of two states: rates per period are those of exponential times."""
    k, period = bursts.Parameters(outage_rate=0.5, outage_time=1.0, received_good=1.0, received_bad=0.0), 0.05
    ether = PacketReception(RADIOS["bursts"], k, 7, 2, period)
    came = np.array([ether.any_arrives(0, 1, number, {"distance": 10.0}) for number in range(60_000)])
    assert 1.0 - came.mean() == pytest.approx(0.5 / 1.5, rel=0.1)
    ends = np.flatnonzero(np.diff(came.astype(int)) == 1)
    begins = np.flatnonzero(np.diff(came.astype(int)) == -1)
    lengths = ends[: len(begins)] - begins[: len(ends)]
    assert lengths.mean() * period == pytest.approx(period / (1.0 - math.exp(-period)), rel=0.1)


def test_jitter_has_its_mean_and_its_longest():
    k = jitter.Parameters(jitter=0.3, longest=50.0)
    ether = PacketReception(RADIOS["jitter"], k, 11, 2, 0.2)
    waits = np.array([ether.late(1, 0, number, {"distance": 5.0}) for number in range(20_000)])
    assert waits.mean() == pytest.approx(0.3, rel=0.03) and np.median(waits) == pytest.approx(
        0.3 * math.log(2), rel=0.04
    )
    assert jitter.late(1e-9, jitter.Parameters(jitter=1.0, longest=2.0)) == 2.0


def test_shares_of_all_kinds_fall_with_the_distance_or_not_at_all():
    for name, radio in RADIOS.items():
        k = radio.Parameters(loss=0.2)
        shares = [arrival_probability(radio, k, float(r)) for r in (1.0, 30.0, 60.0)]
        assert all(0.0 <= one <= 1.0 for one in shares), name
        assert shares[0] >= shares[1] - 0.1 >= shares[2] - 0.3, name
