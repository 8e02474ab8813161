"""Claims about Table S1 follow from the numbers behind them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from airflock.scenarios.files import load, presets
from airflock_papers.claims import judge, read_claims
from airflock_papers.statements import load as load_statements
from airflock_papers.vasarhelyi_2018 import evolved, searches, table_s1
from airflock_papers.vasarhelyi_2018.published import optimum

PARTIAL = ("f_speed", "f_coll", "f_disc", "f_wall", "f_cluster", "f_corr")
STATEMENTS = load_statements("airflock_papers.vasarhelyi_2018")


def flights(fitness, f_wall=1.0, r_min_mean=13.5):
    """Flights whose fitness is that of their speed and their walls."""
    n = len(fitness)
    ones = {name: np.ones(n) for name in PARTIAL}
    ones |= {"f_speed": np.asarray(fitness) / f_wall, "f_wall": np.full(n, f_wall)}
    return pd.DataFrame({"fitness": fitness, "r_min_mean": np.full(n, r_min_mean), **ones})


def result(parameters, fitness=0.82, largest=0.9):
    around = {key: (0.9 * value, 1.1 * value) for key, value in parameters.items()}
    return SimpleNamespace(
        fitness=fitness, largest=largest, above=3000, candidate_count=15000, parameters=parameters, ranges=around
    )


def parameters(v, **changed):
    p = optimum(v).parameters
    return {f"model.{name}": changed.get(name, getattr(p, name)) for name in table_s1.COLUMNS}


def data(v, ours, printed, runs):
    return table_s1.Data({v: runs}, {v: ours}, {v: printed}, {})


def verdicts(found, v=6):
    measured = [m for m in table_s1.measured(found) if not m.id.startswith("s1.linear")]
    return {claim.id.removesuffix(f".{v}ms"): claim for claim in judge(STATEMENTS, measured)}


def test_pairs_decide_and_not_the_luck_of_seeds():
    luck = np.random.default_rng(1).normal(0.0, 0.1, 400)
    runs = [result(parameters(6)), result(parameters(6)), result(parameters(6))]
    better = verdicts(data(6, flights(0.81 + luck), flights(0.80 + luck), runs))["s1.gain"]
    assert better.verdict == "holds" and abs(better.low - 0.01) < 1e-9
    worse = verdicts(data(6, flights(0.78 + luck), flights(0.80 + luck), runs))["s1.gain"]
    assert worse.verdict == "does not hold" and abs(worse.ours + 0.02) < 1e-9


def test_a_gain_at_the_walls_alone_is_none_without_them():
    runs = [result(parameters(6))] * 3
    found = verdicts(data(6, flights(np.full(9, 0.7)), flights(np.full(9, 0.35), f_wall=0.5), runs))
    assert abs(found["s1.gain"].ours - 0.35) < 1e-9
    assert abs(found["s1.gain.no_wall"].ours) < 1e-9


def test_printed_optima_show_both_surprises_and_lie_in_their_own_ranges():
    for v in (4, 6, 8, 16, 32):
        ours = flights(np.full(10, 0.8), r_min_mean=optimum(v).published["r_min_mean"][0])
        found = verdicts(data(v, ours, ours, [result(parameters(v))] * (3 if v <= 8 else 1)), v)
        assert found["s1.soft"].verdict == found["s1.long"].verdict == found["s1.twice"].verdict == "reproduced"
        ranges = {name: found[f"s1.range.{name}"].verdict for name in table_s1.COLUMNS}
        everything = {"p_frict", "a_frict"} if v == 4 else set()  # their printed range is all of the space
        assert {name for name, verdict in ranges.items() if verdict == "not testable"} == everything
        assert set(ranges.values()) <= {"reproduced", "not testable"}


def test_hard_cores_short_alignment_and_values_out_of_range_are_told_apart():
    p = parameters(6, r0_rep=14.0, r0_frict=20.0, v_shill=7.0)
    found = verdicts(data(6, flights(np.full(10, 0.8)), flights(np.full(10, 0.8)), [result(p)] * 3))
    wrong = {name for name, claim in found.items() if claim.verdict == "not reproduced"}
    assert {"s1.soft", "s1.long", "s1.twice", "s1.range.r0_rep", "s1.range.r0_frict", "s1.range.v_shill"} <= wrong
    assert "s1.range.p_rep" not in wrong


def test_independent_runs_are_alike_or_not():
    ours = flights(np.full(10, 0.8))
    for worst, verdict in ((0.81, "reproduced"), (0.70, "not reproduced")):
        runs = [result(parameters(6), fitness) for fitness in (0.82, 0.82, worst)]
        found = verdicts(data(6, ours, ours, runs))["s1.alike"]
        assert found.verdict == verdict
        assert "(printed 19.7)" in found.note  # whether a run that differs has found the printed optimum


def test_committed_runs_say_what_the_runs_said(tmp_path, monkeypatch):
    monkeypatch.setattr(searches, "_path", lambda: tmp_path / "runs.csv")
    rng = np.random.default_rng(2)
    found = {
        v: [result(parameters(v, v_shill=15.0 * rng.random()), rng.random(), rng.random()) for _ in range(several)]
        for v, several in table_s1.RUNS.items()
    }
    searches.write(found)
    kept, fresh = searches.measured(searches.runs()), searches.measured(searches.by_rank(found))
    assert [(each.id, each.at, each.note) for each in kept] == [(each.id, each.at, each.note) for each in fresh]
    assert np.allclose([each.value.ours for each in kept], [each.value.ours for each in fresh], rtol=1e-8, atol=1e-9)
    assert len(kept) == 8  # five luckiest candidates, three spreads


def test_pairs_are_the_seeds_that_both_have_flown():
    luck = np.random.default_rng(3).normal(0.0, 0.1, 1600)
    gain, _ = table_s1.gains(6, flights(0.82 + luck), flights(0.80 + luck[:400]), None)
    assert gain.value.runs == 400 and abs(gain.value.ours - 0.02) < 1e-9 and gain.value.sd < 1e-9


def test_parameters_in_proportion_to_the_speed_have_the_exponent_1():
    runs = {v: [result(parameters(v, r0_rep=7.0 * v * (1.0 + 0.01 * (v % 3))))] for v in (4, 6, 8, 16, 32)}
    rows = {v: flights(np.full(4, 0.8)) for v in runs}
    found = {m.id: m for m in table_s1.measured(table_s1.Data(runs, rows, rows, {}))}["s1.linear.r0_rep"]
    assert abs(found.value.ours - 1.0) < 0.02 and found.value.low < 1.0 < found.value.high


def test_a_preset_of_an_optimum_is_that_of_table_s1_with_other_parameters(tmp_path):
    keys = {f"model.{name}": 1.0 + 0.125 * i for i, name in enumerate(table_s1.COLUMNS)}
    shown = table_s1.Data(
        {6: [SimpleNamespace(parameters=keys)]},
        {6: flights(np.array([0.8, 0.9]))},
        {6: flights(np.array([0.7, 0.8]))},
        {},
    )
    path = tmp_path / "ours.toml"
    path.write_text(
        evolved.preset(6, shown, presets()["vasarhelyi_2018/6ms"].read_text(encoding="utf-8")), encoding="utf-8"
    )
    ours, printed = load(path), optimum(6)
    assert {f"model.{name}": getattr(ours.parameters, name) for name in table_s1.COLUMNS} == keys
    assert (ours.body, ours.radio, ours.sensors, ours.world) == (
        printed.body, printed.radio, printed.sensors, printed.world,
    )  # fmt: skip
    assert not ours.published and "+0.100" in path.read_text(encoding="utf-8")


def test_the_page_tells_how_it_is_made_and_sets_ours_beside_the_printed(tmp_path):
    keys = {f"model.{name}": 2.0 for name in table_s1.COLUMNS}
    best = SimpleNamespace(parameters=keys, ranges={key: (1.0, 3.0) for key in keys})
    shown = table_s1.Data({6: [best]}, {6: flights(np.full(4, 0.8))}, {6: flights(np.full(4, 0.7))}, {})
    gain = table_s1.gains(6, shown.ours[6], shown.published[6], None)[:1]
    evolved.write(tmp_path, judge(STATEMENTS, gain), shown)
    header, (claim,) = read_claims(tmp_path / "evolved.toml")
    assert header["seeds"].endswith("paired flights 0 to 3") and header["runs"] == "1 at 6 m/s"
    assert claim.ours == 0.1
    assert "| `r0_rep` | 41.1 \\| 2 [1, 3] |" in (tmp_path / "EVOLVED.md").read_text(encoding="utf-8")
