"""More flights late, windows of means and a second final: a search that ends where flights are best on average."""

import random

import numpy as np
import pytest

import toys
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import CandidateBatch, FlightStore
from airflock.runs.folder import Interrupted, open_folder
from airflock.search.evolution import run_study, study_from_request
from airflock.search.generations import run_search, total_flights, windowed_means
from airflock.support.errors import ScenarioError

pytestmark = pytest.mark.usefixtures("undrawn")

SAFE = 0.288  # where expected() is largest


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    monkeypatch.setattr("airflock.search.evolution.draw_study", lambda *_: None)


def courage(parameters):
    """How far p_rep goes, 0 to 1."""
    return (parameters["model.p_rep"] - 0.01) / 0.49


def expected(u):
    """Mean fitness of gamble."""
    return (1.0 + 0.4 * u) * (1.0 - 0.6 * u * u)


def gamble(parameters, seed):
    """Courage makes nearly all flights better, and a few of them end at once: most flights are best at 0.9."""
    u = courage(parameters)
    chance = random.Random(seed)
    return {"fitness": 0.0 if chance.random() < 0.6 * u * u else 1.0 + 0.4 * u + chance.gauss(0.0, 0.01)}


def ends(tmp_path, name, **keys):
    """Courage of the last mean of a search of 1,200 flights or so."""
    study = toys.study(population=20, top=0, **keys)
    open_folder(tmp_path / name, study, resume=False)
    with FlightStore(tmp_path / name) as store:
        store.begin({})
        (mean,) = run_search(study, store, ThreadExecutor(gamble, 1))
        assert store.count() == total_flights(study)
    return courage(study.space.parameters(mean))


def test_single_flights_end_where_most_are_good_and_more_flights_late_where_their_mean_is(tmp_path):
    single = [ends(tmp_path, f"single{seed}", generations=60, seed=seed) for seed in range(3)]
    late = [ends(tmp_path, f"late{seed}", generations=21, late_seeds=12, seed=seed) for seed in range(3)]
    assert expected(SAFE) > max(expected(SAFE - 0.05), expected(SAFE + 0.05))
    assert np.mean([expected(u) for u in late]) > np.mean([expected(u) for u in single]) + 0.05
    assert abs(np.median(late) - SAFE) < abs(np.median(single) - SAFE)


def test_flights_of_a_candidate_grow_in_equal_ratios_up_to_late_seeds():
    for keys in (
        {"late_seeds": 9},
        {"seeds": 3, "late_seeds": 24, "generations": 40},
        {"generations": 1},
        {"seeds": 5},
    ):
        study = toys.study(**{"generations": 72, **keys})
        first, last = study.whole("seeds"), max(study.whole("seeds"), study.whole("late_seeds"))
        grown = [study.seeds(generation) for generation in range(study.whole("generations"))]
        assert grown == sorted(grown) and grown[0] == first and (grown[-1] == last or len(grown) == 1)
        assert grown[: int(0.3 * len(grown))] == [first] * int(0.3 * len(grown))


def test_windows_are_means_of_equal_parts_of_the_last_half():
    means = [np.array([float(i)]) for i in range(12)]
    assert [float(each[0]) for each in windowed_means(means, 3)] == [6.5, 8.5, 10.5]
    assert windowed_means(means, 0) == [] and len(windowed_means(means[:3], 5)) == 2


def test_the_better_half_of_the_finalists_flies_on_and_the_winner_is_the_best_of_all_flights_of_the_best(tmp_path):
    study = toys.study(windows=2, averages=1, again=2, final_seeds=5)
    open_folder(tmp_path / "a", study, resume=False)
    result = run_study(study, tmp_path / "a", ThreadExecutor(lambda p, seed: toys.bowl(p, seed, noise=0.3), 1))
    with FlightStore(tmp_path / "a", write=False) as store:
        rounds = [store.flown(CandidateBatch(*batch)) for batch in (("final", 0, 0), ("final", 0, 1), ("again", 0, 0))]
        seeds = {seed for (seed,) in store.rows("SELECT seed FROM flight WHERE stage IN ('final', 'again', 'score')")}
    assert list(result.finalists["origin"]) == ["mean"] * 4 + ["top"] * 3
    flights, alive = {k: [] for k in range(7)}, list(range(7))
    for flown, count, left in zip(rounds, (1, 4, 10), (4, 2, 1), strict=True):  # a third of 5 is 1; then all the others
        assert {place for place, _ in flown} == set(range(len(alive)))
        for place, k in enumerate(alive):
            flights[k] += [flown[place, j]["fitness"] for j in range(count)]
        alive = sorted(alive, key=lambda k: -np.mean(flights[k]))[:left]
    assert result.finalists["fitness"].to_numpy() == pytest.approx([np.mean(flights[k]) for k in range(7)])
    assert result.parameters["model.p_rep"] == result.finalists["model.p_rep"][alive[0]] and len(seeds) == 5 + 10 + 5


def test_a_search_that_is_cut_off_among_its_late_flights_ends_the_same(tmp_path):
    keys = {"generations": 10, "late_seeds": 3, "windows": 2, "again": 1, "restarts": 1}
    open_folder(tmp_path / "whole", toys.study(**keys), resume=False)
    whole = run_study(toys.study(**keys), tmp_path / "whole", ThreadExecutor(toys.bowl, 2))

    def stop(progress):
        if progress.fresh in (70, 120):
            raise KeyboardInterrupt

    open_folder(tmp_path / "cut", toys.study(**keys), resume=False)
    for _ in range(2):
        with pytest.raises(Interrupted):
            run_study(toys.study(**keys), tmp_path / "cut", ThreadExecutor(toys.bowl, 2), stop)
    assert run_study(toys.study(**keys), tmp_path / "cut", ThreadExecutor(toys.bowl, 2)).document() == whole.document()
    with FlightStore(tmp_path / "whole", write=False) as store:
        seeds = [seed for (seed,) in store.rows("SELECT seed FROM flight WHERE stage = 'search'")]
    flown = 2 * 8 * sum(toys.study(**keys).seeds(generation) for generation in range(10))
    assert len(set(seeds)) == len(seeds) == flown  # every flight has a seed of its own


def test_faults_of_these_keys_are_told_together():
    with pytest.raises(ScenarioError) as fault:
        toys.study(windows=1.5, late_seeds=-1.0)
    assert "search.late_seeds = -1" in str(fault.value)
    with pytest.raises(ScenarioError) as fault:
        toys.study(algorithm="ga", windows=2)
    assert "search.windows = 2 is for algorithm cmaes" in str(fault.value)
    with pytest.raises(ScenarioError, match="search.again compares one fitness"):
        toys.study({"objective": {"limits": ["r_min<3 at 1%"]}}, again=2)


def test_the_fast_search_takes_a_third_of_the_flights_and_goes_with_limits():
    (fast, usual), limits = (
        (study_from_request("vasarhelyi_2018/6ms", fast=fast) for fast in (True, False)),
        ["r_min<3 at 1%"],
    )

    def cost(study):
        q, top = study.search, study.search.top
        race = 4 * q.pool + 16 * max(q.top, round(0.25 * q.pool))
        finalists = 1 + q.averages + q.windows + top
        on = (finalists / 3 + 2 / 3 * ((finalists + 1) // 2)) if q.again else finalists
        final = q.final_seeds * (on + 2 * q.again + 1)
        return total_flights(study) + race + final

    assert 0.3 < cost(fast) / cost(usual) < 1 / 3
    with_limits = study_from_request("vasarhelyi_2018/6ms", fast=True, limit=limits, search_keys={"population": 20})
    assert (with_limits.search.again, with_limits.search.seeds, with_limits.search.population) == (0, 2, 20)
