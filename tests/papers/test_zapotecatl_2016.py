"""What the reproduction of Zapotecatl et al. 2016 rests on: the program's count of collisions, and the verdicts."""

import numpy as np
import pandas as pd
import pytest

from airflock.papers.zapotecatl_2016 import COARSE_OFF, RADII, published
from airflock.papers.zapotecatl_2016.marks import in_contact, marked
from airflock.papers.zapotecatl_2016.verdicts import collision_floor, distance


def chain(order):
    """Boids 4 cm apart in a row: each touches the next (r_b = 5 cm), in a given order of indices."""
    place = np.zeros((len(order), 3))
    place[:, 0] = 0.04 * np.array(order)
    return in_contact(place, 0.05)


def test_the_program_misses_the_end_of_a_chain_and_eq_18_does_not():
    touching = chain([0, 1, 2])
    assert touching.any(axis=1).all()
    assert marked(touching).tolist() == [True, True, False]  # 1 is marked already, so the pair 1, 2 is never tested
    assert marked(chain([1, 0, 2])).all()  # with the middle one first nobody is missed


def test_the_program_never_counts_more_than_collide(seed):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        touching = in_contact(rng.uniform(0.0, 0.25, (40, 3)), 0.05)
        assert not (marked(touching) & ~touching.any(axis=1)).any()


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
