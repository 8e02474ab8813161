"""Statistics of counts: what a ratio says where nothing was counted."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from airflock_papers import bounds, statistics
from airflock_papers.claims import Claim, Measured, header, judge, read_claims, write_claims
from airflock_papers.statements import Statement

NOTHING = np.zeros(20)
SOME = np.array([0.0] * 12 + [1.0, 2.0, 1.0, 4.0, 1.0, 3.0, 1.0, 2.0])
SIDES = ("low > 1", "high < 1", "ours > 1", "ours < 1", "ours == 1")


def holding(value: statistics.Estimate) -> list[str]:
    return [bound for bound in SIDES if bounds.holds(bound, value._asdict())]


def test_nothing_over_nothing_shows_neither_more_nor_less() -> None:
    found = statistics.ratio(NOTHING, NOTHING)
    assert math.isnan(found.ours) and (found.low, found.high) == (0.0, math.inf)
    assert holding(found) == []


def test_something_over_nothing_is_more_and_nothing_over_something_is_less() -> None:
    assert holding(statistics.ratio(SOME, NOTHING)) == ["low > 1", "ours > 1"]
    assert holding(statistics.ratio(NOTHING, SOME)) == ["high < 1", "ours < 1"]


def test_one_count_in_twenty_flights_shows_nothing() -> None:
    once = np.eye(20)[0]
    found = statistics.ratio(once, NOTHING)
    assert found.ours == math.inf and found.low == 0.0  # a third of all resamples hold no count at all
    assert holding(found) == ["ours > 1"]


@given(st.floats(0.1, 10.0))
def test_a_ratio_is_that_of_the_means_and_lies_in_its_interval(factor: float) -> None:
    found = statistics.ratio(factor * SOME, SOME)
    assert found.ours == pytest.approx(factor)
    assert found.low <= found.ours <= found.high


def test_a_claim_about_nothing_is_written_and_read_as_it_was_judged(tmp_path: Path) -> None:
    statement = Statement(
        id="a", kind="ours", where="here", statement="more", quantity="n_coll", at="x", bound="low > 1"
    )
    claims = judge({"a": statement}, [Measured("a", "n_coll", "x", statistics.ratio(NOTHING, NOTHING))])
    write_claims(tmp_path / "claims.toml", claims, header("", ""))
    (read,) = read_claims(tmp_path / "claims.toml")[1]
    assert read.verdict == "does not hold" and math.isnan(read.ours) and read.high == math.inf
    assert set(Claim.as_dict(read)) == set(claims[0].as_dict()) >= {"low", "verdict"}
    assert "ours" not in read.as_dict()  # JSON has no such number
