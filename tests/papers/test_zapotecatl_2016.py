"""What is measured for Zapotecatl et al. 2016: places, trends and distances of made-up flights."""

import numpy as np
import pandas as pd
import pytest

from airflock_papers.claims import judge
from airflock_papers.statements import load
from airflock_papers.zapotecatl_2016 import COARSE_OFF, RADII, published
from airflock_papers.zapotecatl_2016.verdicts import TRENDS, distance, minimum, trend

STATEMENTS = load("airflock_papers.zapotecatl_2016")


def grid(value, seeds=5, spread=1e-6):
    """Flights of every configuration; value(r_s, r_a) in their measures, which differ a little by seed."""
    index = pd.MultiIndex.from_product([RADII, RADII, range(seeds)])
    values = np.array([value(r_s, r_a) + spread * seed for r_s, r_a, seed in index], dtype=float)
    return pd.DataFrame({column: values for column in TRENDS}, index=index)


def verdicts(measured):
    return {claim.id: claim.verdict for claim in judge(STATEMENTS, measured)}


def test_flights_as_good_as_the_figure_have_no_distance_to_it():
    figures = published()
    flown = pd.concat({seed: figures for seed in range(3)}).reorder_levels([1, 2, 0]).sort_index()
    means = flown.groupby(level=[0, 1]).mean()
    worse = means.copy()
    worse.loc[COARSE_OFF] -= 0.5
    for against, table in ((figures, means), (figures.drop(COARSE_OFF), worse)):  # as --quick compares
        found = distance("sequential", "quality", flown, table, against)
        assert found.value.ours == pytest.approx(0.0, abs=1e-12)
        assert verdicts([found]) == {"sequential.rmse.quality": "agrees"}


@pytest.mark.parametrize(("place", "verdict"), [((0, 30), "reproduced"), ((10, 30), "not reproduced")])
def test_a_minimum_elsewhere_is_seen(place, verdict):
    flown = grid(lambda r_s, r_a: 1.64 + 0.1 * ((r_s, r_a) != place), spread=0.01)
    means = flown.groupby(level=[0, 1]).mean()
    assert verdicts(minimum("extension_cm", (0, 30), 1.64, flown, means))["minimum.extension_cm.place"] == verdict


@pytest.mark.parametrize("column", TRENDS)
def test_a_trend_and_its_opposite_are_told_apart(column):
    for axis, sign in TRENDS[column].items():
        rising, falling = (grid(lambda *r, s=s, k=axis: 1.0 + s * r[k]) for s in (0.01, -0.01))
        right, wrong = (rising, falling) if sign > 0 else (falling, rising)
        assert trend(column, axis, sign, right).value.ours == 0.0
        assert trend(column, axis, sign, wrong).value.ours == 1.0
        assert trend(column, axis, sign, grid(lambda *_: 1.0)).value.ours == 1.0  # what changes nothing is no trend
