"""Growing flights, warm starts and averaged means: what is compared with what, and that a cut changes nothing."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st

import toys
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import Interrupted, open_folder
from airflock.runs.search_space import declared_numbers
from airflock.search.evolution import run_study
from airflock.search.generations import LONGEST, SHARES, FlightLength, averaged_means
from airflock.support.errors import ScenarioError

pytestmark = pytest.mark.usefixtures("undrawn")

WHOLE = 600.0


def finished(folder, study, score=toys.bowl, **options):
    open_folder(folder, study, resume=False)
    return run_study(study, folder, ThreadExecutor(score, 2), **options)


def hasty(parameters, seed):
    """A bowl whose short flights look far better than whole ones: what goes wrong does so late."""
    values = toys.bowl(parameters, seed)
    return {**values, "fitness": values["fitness"] + 5.0 * (1.0 - parameters.get("duration", WHOLE) / WHOLE)}


def test_the_length_doubles_when_half_of_a_generation_is_as_good_as_the_best_of_the_first():
    length = FlightLength(400, True, growing=True)
    assert length.share == 1 / 8 and not length.whole
    length.end_generation([0.1, 0.2, 0.3])
    length.end_generation([0.2, 0.29, 0.9])  # its median is not yet as good as 0.3
    assert length.share == 1 / 8
    length.end_generation([None, 0.3, 0.4])
    assert length.share == 1 / 4
    length.end_generation([0.0, 0.0, 0.0])  # flat: nothing to learn from flights so short
    assert length.share == 1 / 2


@given(st.lists(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=6), min_size=80, max_size=80), st.booleans())
def test_whatever_the_values_most_generations_fly_whole_flights_and_signs_do_not_matter(generations, maximise):
    one, other = (FlightLength(80, best, growing=True) for best in (maximise, not maximise))
    shares = []
    for values in generations:
        assert one.share == other.share
        shares.append(one.share)
        one.end_generation(values)
        other.end_generation([-value for value in values])
    assert shares == sorted(shares) and one.whole
    assert all(shares.count(share) <= 80 // LONGEST for share in SHARES[:-1])


def test_whole_flights_alone_are_ranked_however_good_short_ones_look(tmp_path):
    study = toys.study(flights="growing", population=16, generations=40)
    result = finished(tmp_path / "a", study, hasty)
    assert result.fitness == pytest.approx(1.0, abs=0.03) and result.largest < 1.1
    assert result.parameters["model.p_rep"] == pytest.approx(0.2, abs=0.05)
    table = pd.read_csv(tmp_path / "a" / "evaluations.csv")
    search = table[table["stage"] == "search"]
    assert set(search["duration_flown"].dropna()) == {75.0, 150.0, 300.0}
    assert result.above <= search["duration_flown"].isna().sum() < result.candidate_count == len(search)
    assert table.loc[table["stage"] != "search", "duration_flown"].isna().all()


def test_a_search_that_is_cut_off_among_short_flights_ends_the_same(tmp_path):
    keys = {"flights": "growing", "population": 8, "generations": 24, "averages": 2, "start": "scenario"}
    whole = finished(tmp_path / "whole", toys.study(**keys), hasty)

    def stop(progress):
        if progress.fresh in (21, 70):
            raise KeyboardInterrupt

    open_folder(tmp_path / "cut", toys.study(**keys), resume=False)
    for _ in range(2):
        with pytest.raises(Interrupted):
            run_study(toys.study(**keys), tmp_path / "cut", ThreadExecutor(hasty, 2), stop)
    assert run_study(toys.study(**keys), tmp_path / "cut", ThreadExecutor(hasty, 2)).document() == whole.document()


def test_a_warm_start_flies_near_the_scenario_s_own_numbers_and_a_cold_one_in_the_middle(tmp_path):
    centres = {}
    for start in ("scenario", "middle"):
        study = toys.study(start=start, spread=0.01, population=40, generations=1, pool=0, top=1)
        finished(tmp_path / start, study)
        with FlightStore(tmp_path / start, write=False) as store:
            centres[start] = np.array(store.asked(CandidateBatch("search", 0, 0))).mean(axis=0)
    known = declared_numbers(study.scenario)
    own = study.space.point({key: known[key][1] for key in study.space.keys})
    assert centres["scenario"] == pytest.approx(own, abs=0.01)
    assert centres["middle"] == pytest.approx([0.5] * 3, abs=0.01)


def test_averages_are_those_of_the_last_half_and_quarter_and_scatter_less():
    means = [np.array([float(i)]) for i in range(8)]
    assert [float(each[0]) for each in averaged_means(means, 3)] == [5.5, 6.5, 7.0]
    assert averaged_means(means[:1], 2)[0] == 0.0 and averaged_means(means, 0) == []
    chance = np.random.default_rng(1).normal(size=(400, 64))
    scatter = np.std([averaged_means(list(row[:, None]), 1)[0][0] for row in chance])
    assert scatter == pytest.approx(1.0 / np.sqrt(32.0), rel=0.15)  # of independent means


def test_averages_fly_in_the_final(tmp_path):
    result = finished(tmp_path / "a", toys.study(averages=2, restarts=1))
    assert list(result.finalists["origin"]).count("mean") == 2 * (1 + 2)


def test_faults_of_these_keys_are_told_together():
    search = {"algorithm": "ga", "flights": "growing", "generations": 4, "averages": 2, "start": "scenario"}
    with pytest.raises(ScenarioError) as fault:
        toys.study({"space": {"duration": {"low": 10.0, "high": 20.0}}}, **search)
    for words in (
        "search.flights = 'growing' is for algorithm cmaes, but search.algorithm = 'ga'",
        "search.averages = 2 is for algorithm cmaes",
        "search.start = 'scenario' is for algorithm cmaes",
        "search.flights = 'growing' needs at least 8 generations, but search.generations = 4",
        "sets the duration, which the space does, too",
    ):
        assert words in str(fault.value)
    with pytest.raises(ScenarioError, match="search.flights = 'shrinking' is none of whole, growing"):
        toys.study(flights="shrinking")
