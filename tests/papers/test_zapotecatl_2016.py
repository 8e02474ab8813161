"""The verdicts of the reproduction of Zapotecatl et al. 2016."""

import numpy as np
import pandas as pd
import pytest

from airflock.papers.zapotecatl_2016 import COARSE_OFF, RADII, published
from airflock.papers.zapotecatl_2016.verdicts import collision_floor, collision_mean, distance


def test_flights_as_good_as_the_figure_have_no_distance_to_it():
    figures = published()
    flown = pd.concat({seed: figures for seed in range(3)}).reorder_levels([1, 2, 0]).sort_index()
    means = flown.groupby(level=[0, 1]).mean()
    worse = means.copy()
    worse.loc[COARSE_OFF] -= 0.5
    for against, table in ((figures, means), (figures.drop(COARSE_OFF), worse)):  # as --quick compares
        found = distance("sequential", "quality", flown, table, against)
        assert found.ours == pytest.approx(0.0, abs=1e-12)
        assert found.verdict == "reproduced"


def test_one_flight_with_a_sticking_pair_is_not_the_floor_of_collisions():
    index = pd.MultiIndex.from_product([RADII, RADII, range(5)])
    flown = pd.DataFrame({"f_collision": np.tile([3e-4, 3e-4, 3e-4, 3e-4, 2e-2], 36)}, index=index)
    assert collision_floor("sequential", flown).verdict == "reproduced"
    assert collision_mean("sequential", flown, flown.groupby(level=[0, 1]).mean()).verdict == "not reproduced"
