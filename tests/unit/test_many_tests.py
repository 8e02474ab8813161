"""Holm's correction against its definition, and the property that it is made for."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from airflock.support.many_tests import holm_correction


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30), st.floats(0.001, 0.5))
def test_it_rejects_what_the_step_down_procedure_rejects(ps, level):
    """The smallest is compared with level/n, the next with level/(n - 1), until the first that is not rejected."""
    rejected = set()
    for rank, k in enumerate(sorted(range(len(ps)), key=lambda k: (ps[k], k))):
        if ps[k] * (len(ps) - rank) > level:
            break
        rejected.add(k)
    assert {k for k, p in enumerate(holm_correction(ps)) if p <= level} == rejected


def test_the_chance_of_any_false_rejection_is_the_level(seed):
    rng = np.random.default_rng(seed)
    false = np.mean([min(holm_correction(list(rng.random(55)))) <= 0.05 for _ in range(4000)])
    assert false == pytest.approx(0.05, abs=5.0 * math.sqrt(0.05 * 0.95 / 4000))


def test_what_is_no_number_counts_as_no_test():
    found = holm_correction([0.02, math.nan, 0.04])
    assert found[0] == 0.04 and math.isnan(found[1]) and found[2] == 0.04
