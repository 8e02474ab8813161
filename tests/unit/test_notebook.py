"""The Python names as a notebook uses them: names instead of scenarios, laws by name, seeds that can be one."""

import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import airflock
import toys
from airflock.parts.metrics import metric_sets as registry
from airflock.recordings.measures import milling
from airflock.runs.executors import ThreadExecutor
from airflock.runs.flight_store import FlightStore
from airflock.search.generations import conclude_study, run_search
from airflock.search.study import load_study
from airflock.support.errors import ParameterError, RecordingError, ScenarioError
from processes import called

pytestmark = pytest.mark.usefixtures("scored_plainly")

NAME = "vasarhelyi_2018/4ms"


@pytest.fixture(scope="module")
def short():
    return airflock.load(NAME, {"duration": 1.0, "agents": 4})


def test_names_and_files_fly_like_the_scenarios_that_they_stand_for(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text('duration = 1.0\nagents = 4\n[model]\nkind = "vicsek_1995"\n')
    scenario = airflock.load(path)
    score, simulate = (partial(door, device="python") for door in (airflock.score, airflock.simulate))
    assert score(path).equals(score(str(path))) and len(score(path)) == 1
    assert score(path, [2]).equals(score(scenario, [2]))
    assert simulate(path, 2).identical(simulate(scenario, 2))
    for door in (airflock.score, airflock.simulate):
        with pytest.raises(ScenarioError, match="did you mean vasarhelyi_2018/4ms?"):
            door("vasarhelyi_2018/4m")
        with pytest.raises(ScenarioError, match="int is not a scenario; give a Scenario, a preset's name"):
            door(7)


def test_a_law_may_be_given_by_its_name_or_its_file(tmp_path):
    from airflock.parts.laws.viragh_2014 import law as viragh_2014

    by_name = airflock.load(NAME, law="viragh_2014")
    assert by_name.model.name == "viragh_2014" and by_name.document["model"] == {"kind": "viragh_2014"}
    path = tmp_path / "mine.py"
    path.write_text(Path(viragh_2014.__file__).read_text())
    assert airflock.load(NAME, law=path).model.name == airflock.load(NAME, law=str(path)).model.name == "mine"
    with pytest.raises(ScenarioError, match="'vicsek': unknown model; did you mean vicsek_1995?"):
        airflock.load(NAME, law="vicsek")
    with pytest.raises(ScenarioError, match=r"law = 3 is not a law; give a module, a class, a mapping, or one of"):
        airflock.load(NAME, law=3)


@pytest.mark.parametrize(
    ("seed", "said"),
    [
        (1.5, r"seed = 1.5 is not a whole number in \[0, 2\^64 - 1\]"),
        ("one", "seed = 'one' is not a whole number"),
        (-1, r"seed = -1 lies outside \[0, 2\^64 - 1\]"),
        (1 + 2**64, r"seed = 18446744073709551617 lies outside \[0, 2\^64 - 1\]"),
    ],
)
def test_what_would_fly_as_another_seed_is_refused(short, seed, said):
    with pytest.raises(ParameterError, match=said):
        airflock.simulate(short, seed)
    with pytest.raises(ParameterError, match=said):
        airflock.score(short, [0, seed])


def test_the_largest_seed_flies_and_is_kept_in_a_file(short, tmp_path):
    flight = airflock.simulate(short, 2**64 - 1)
    again = airflock.load_recording(airflock.save(flight, tmp_path / "a.nc"))
    assert int(again.attrs["airflock_seed"]) == 2**64 - 1
    assert not np.array_equal(flight.position, airflock.simulate(short, 2**32 - 1).position)
    assert airflock.score(short, np.int64(2)).equals(airflock.score(short, np.arange(2)))


@pytest.mark.parametrize(
    ("seeds", "said"),
    [
        (0, "seeds = 0: no flight would be flown"),
        ([], "seeds = ..: no flight"),
        (-2, "give at least 1"),
        (1.5, "neither a whole number"),
    ],
)
def test_a_score_of_no_flight_is_refused(short, seeds, said):
    with pytest.raises(ParameterError, match=said):
        airflock.score(short, seeds)


def test_the_command_refuses_seeds_that_are_none():
    done = called("run", NAME, "--duration", "1", "--first-seed", "9" * 23)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == f"airflock: seed = {'9' * 23} lies outside [0, 2^64 - 1]\n"


@pytest.mark.parametrize(("given", "said"), [
    (lambda found: found["position"], "DataArray position, one variable; give the whole Dataset"),
    (lambda found: found["position"].values, "ndarray is no xarray Dataset; airflock.load_tracks makes one"),
    (lambda found: found["time"].to_dataframe("t"), "DataFrame is no xarray Dataset; airflock.load_tracks makes one"),
    (lambda found: "flight.nc", "flight.nc is a name; open it with airflock.load_recording"),
    (lambda found: None, "NoneType is no xarray Dataset"),
])  # fmt: skip
def test_what_is_no_recording_is_told_what_makes_one(short, tmp_path, given, said):
    wrong = given(airflock.simulate(short, device="python"))
    doors = (
        airflock.over_time, airflock.replay, milling.milling, airflock.plots.trajectories, airflock.plots.series,
        partial(airflock.video, path=tmp_path / "a.gif"), partial(airflock.save, path=tmp_path / "a.nc"),
        partial(airflock.export, path=tmp_path / "a.csv"),
    )  # fmt: skip
    for door in doors:
        with pytest.raises(RecordingError, match=said):
            door(wrong)


def test_what_is_no_scenario_is_told_by_its_kind_and_not_printed(short):
    array = airflock.simulate(short, device="python")["position"]
    for door in (airflock.plot, airflock.score, airflock.open, lambda what: airflock.sweep(what, {"agents": [2, 3]})):
        with pytest.raises(ScenarioError, match="^DataArray is not a scenario; .* airflock.load_tracks makes"):
            door(array)


@pytest.mark.parametrize("value", [0.4, "0.4"])
def test_a_sweep_over_a_single_value_is_told_to_give_a_list(short, value):
    with pytest.raises(ScenarioError, match="radio.delay = .*0.4.*: give the values to sweep over in a list"):
        airflock.sweep(short, {"radio.delay": value})


def test_scores_show_units_and_meanings_in_their_heads_and_stay_a_dataframe(short):
    table = airflock.score(short, seeds=2)
    page = table._repr_html_()
    assert '<th title="mean speed">phi_vel<br>m/s</th>' in page and "<br>&nbsp;</th>" in page  # phi_corr has no unit
    assert page.count("<th title=") == len(table.columns) and f"{table['phi_vel'].iloc[0]:.6f}" in page
    part = table[["phi_vel", "n_coll"]].round(3)
    assert part._repr_html_().count("<th title=") == 2  # of a part, what it holds
    assert type(table["phi_vel"]) is pd.Series and table.equals(pd.DataFrame(table))
    assert "units" in pickle.loads(pickle.dumps(table)).attrs
    swept = airflock.sweep(short, {"radio.delay": [0.2]}, seeds=1)
    assert "<th>radio.delay</th>" in swept._repr_html_() and "mean speed" in swept._repr_html_()
    with pd.option_context("display.notebook_repr_html", False):
        assert table._repr_html_() is None


def test_courses_say_their_units(short):
    course = airflock.over_time(airflock.simulate(short, device="python"))
    assert course.attrs["units"]["phi_vel"] == "m/s" and "speed" in course.attrs["meanings"]["phi_vel"]


@pytest.mark.parametrize("kind", sorted(registry.SETS))
def test_every_column_over_time_says_its_unit_and_meaning(short, kind):
    """Sums that make up an order parameter, such as those of Eq. 15, had none."""
    course = airflock.over_time(airflock.simulate(short, device="python"), {"metrics.kind": kind})
    assert set(course.attrs["units"]) == set(course.attrs["meanings"]) == set(course.columns)
    assert all(course.attrs["meanings"].values())


def test_measures_of_groups_are_found_by_tab():
    found = airflock.measures
    assert "measures" in dir(airflock) and found.milling is milling
    assert {"bursts", "contacts", "correlation", "delays", "milling", "neighbours", "shape"} <= set(dir(found))


def test_flights_moments_studies_and_results_show_themselves_with_units_and_meanings(short, tmp_path):
    flight = airflock.open(short, seed=3, device="python")
    assert "nothing is flown yet" in flight._repr_html_()
    flight.advance(0.5).push([1, 2], [1.0, 0.0]).remove(3)
    page = flight._repr_html_()
    assert "vasarhelyi_2018/4ms, seed 3: 0.5 of 1 s, 4 agents</b> (1 × push, 1 × remove, 1 absent)" in page
    speed = flight.scores()["phi_vel"]
    assert f"<td>phi_vel</td><td>{speed:.4g}</td><td>m/s</td><td>mean speed</td>" in page
    assert repr(flight.snapshot()) == "<Snapshot of vasarhelyi_2018/4ms, seed 3, at 0.5 s>"
    assert "inf" not in page and all(f"<td>{name}</td>" in page for name in flight.scores())

    study = load_study("vasarhelyi_2018/6ms")
    assert repr(study).startswith("<Study of vasarhelyi_2018/6ms: 11 parameters for fitness, 150 generations of 100 ")
    assert "<td>model.p_rep</td><td>0.01 … 0.5</td><td>1/s</td><td>linear</td>" in study._repr_html_()

    toy, executor = toys.study(), ThreadExecutor(toys.bowl, 1)
    (tmp_path / "a").mkdir()
    with FlightStore(tmp_path / "a") as store:
        found = conclude_study(toy, store, executor, run_search(toy, store, executor), tmp_path / "a")
    executor.close()
    assert repr(found).startswith(f"<Result {tmp_path / 'a'}: ") and f"on {found.seeds} fresh seeds>" in repr(found)
    for key, value in found.parameters.items():
        assert f"<td>{key}</td><td>{value:.4g}</td><td>" in found._repr_html_()
