"""Racing inside a generation: the better half is that of whole races, flights are saved, cuts change nothing."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st

import toys
from airflock.runs.executors import ThreadExecutor
from airflock.runs.folder import Interrupted, open_folder
from airflock.search.evolution import run_study
from airflock.search.generations import remaining_candidates
from airflock.support.errors import ScenarioError

pytestmark = pytest.mark.usefixtures("undrawn")

RACE = {"racing": "optimistic", "random_numbers": "generation", "seeds": 4, "population": 16, "generations": 8}


def finished(folder, study, score=toys.bowl, watch=None, resume=False):
    open_folder(folder, study, resume=resume)
    return run_study(study, folder, ThreadExecutor(score, 2), watch)


@given(st.lists(st.floats(-100, 100), min_size=4, max_size=12), st.lists(st.floats(-5, 5), min_size=3, max_size=3))
def test_where_chance_is_common_the_better_half_is_never_dropped(skill, chance):
    """Values are skill plus the chance of the seed: then means differ as skills do, after every seed."""
    alive = list(range(len(skill)))
    for seen in range(1, 3):
        values = [[a + b for b in chance[:seen]] for a in skill]
        alive = remaining_candidates(values, alive, 3 - seen, True)
        mirrored = [[-value for value in row] for row in values]
        assert remaining_candidates(mirrored, list(range(len(skill))), 3 - seen, False) == remaining_candidates(
            values, list(range(len(skill))), 3 - seen, True
        )
    middle = sorted(skill, reverse=True)[(len(skill) + 1) // 2 - 1]
    assert {i for i, a in enumerate(skill) if a > middle + 1e-9} <= set(alive)


def test_a_candidate_that_the_best_flights_could_still_save_flies_on_and_a_failed_one_does_not():
    values = [[0.9], [0.6], [0.1], [None]]
    assert remaining_candidates(values, range(4), 3, True) == [0, 1, 2]  # (0.1 + 3 * 0.9) / 4 = 0.7, the middle has 0.6
    assert remaining_candidates(values, range(4), 1, True) == [0, 1]  # (0.1 + 0.9) / 2 = 0.5


def test_flights_are_saved_and_every_seed_is_common(tmp_path):
    result = finished(tmp_path / "a", toys.study(**RACE))
    assert result.fitness == pytest.approx(1.0, abs=0.1)
    table = pd.read_csv(tmp_path / "a" / "evaluations.csv")
    search = table[table["stage"] == "search"]
    assert 0.4 * 16 * 8 * 4 < len(search) < 0.95 * 16 * 8 * 4
    for _, one in search.groupby("generation"):
        flown = one.groupby("candidate")["seed"].apply(list)
        longest = max(flown, key=len)
        assert len(longest) == 4 and all(seeds == longest[: len(seeds)] for seeds in flown)
        means = one.groupby("candidate")["fitness"].mean()
        whole = flown[flown.apply(len) == 4].index
        assert set(means.nlargest(8).index) <= set(whole) or np.isnan(means).any()


def test_a_race_that_is_cut_off_ends_the_same(tmp_path):
    whole = finished(tmp_path / "whole", toys.study(**RACE))

    def stop(progress):
        if progress.fresh in (20, 61):
            raise KeyboardInterrupt

    with pytest.raises(Interrupted):
        finished(tmp_path / "cut", toys.study(**RACE), watch=stop)
    with pytest.raises(Interrupted):
        finished(tmp_path / "cut", toys.study(**RACE), watch=stop, resume=True)
    assert finished(tmp_path / "cut", toys.study(**RACE), resume=True).document() == whole.document()


def test_what_cannot_race_is_told_all_at_once():
    with pytest.raises(ScenarioError) as fault:
        toys.study({"objective": {"over_seeds": "worst"}}, racing="optimistic")
    told = str(fault.value)
    for words in ("at least 2 flights", "search.random_numbers = 'generation'", "leave over_seeds and over_scenarios"):
        assert words in told
