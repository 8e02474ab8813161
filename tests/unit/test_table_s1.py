"""Claims about Table S1 follow from the numbers behind them."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from airflock.papers.claims import read_claims
from airflock.papers.vasarhelyi_2018 import evolved, table_s1
from airflock.papers.vasarhelyi_2018.published import optimum
from airflock.scenarios.files import load, presets


def flights(fitness):
    return pd.DataFrame({"fitness": fitness, "r_min_mean": np.full(len(fitness), 13.5)})


def parameters(v):
    p = optimum(v).parameters
    return {f"model.{name}": getattr(p, name) for name in table_s1.COLUMNS}


def test_pairs_decide_and_not_the_luck_of_seeds():
    luck = np.random.default_rng(1).normal(0.0, 0.1, 400)
    better = table_s1.against_published(6, flights(0.81 + luck), flights(0.80 + luck))
    assert better.verdict == "reproduced" and abs(better.low - 0.01) < 1e-9
    worse = table_s1.against_published(6, flights(0.78 + luck), flights(0.80 + luck))
    assert worse.verdict == "not reproduced" and "-0.020" in worse.reason


def test_printed_optima_show_both_surprises_and_lie_in_ranges_around_them():
    for v in (4, 6, 8, 16, 32):
        p = parameters(v)
        distances = flights(np.full(10, 0.8)).assign(r_min_mean=optimum(v).published["r_min_mean"][0])
        assert table_s1.soft_repulsion(v, p, distances).verdict == "reproduced"
        assert table_s1.long_alignment(v, p).verdict == "reproduced"
        around = {key: (0.9 * value, 1.1 * value) for key, value in p.items()}
        assert table_s1.working_range(v, around).ours == 11.0
        few = {key: span for key, span in around.items() if key < "model.p_s"}
        assert table_s1.working_range(v, few).verdict == "not reproduced"


def test_hard_cores_and_short_alignment_are_told_apart():
    p = parameters(6) | {"model.r0_rep": 14.0, "model.r0_frict": 20.0}
    assert table_s1.soft_repulsion(6, p, flights(np.full(10, 0.8))).verdict == "not reproduced"
    assert table_s1.long_alignment(6, p).verdict == "not reproduced"


def test_independent_runs_are_alike_or_not():
    walls = {"model.v_shill": 19.5, "model.a_shill": 3.25}
    best = SimpleNamespace(fitness=0.82, above=3000, candidates=15000, parameters=walls)
    close, far = (SimpleNamespace(fitness=value, parameters=walls) for value in (0.81, 0.70))
    assert table_s1.alike(6, [best, close]).verdict == "reproduced"
    found = table_s1.alike(6, [best, far])
    assert found.verdict == "not reproduced"
    assert found.reason == (
        "0.820, 0.700; v_shill 19.5, 19.5 (printed 19.7), a_shill 3.25, 3.25 (printed 3.54)"
    )  # whether a run that differs has found the printed optimum
    assert table_s1.working(6, best).ours == 3000


def test_a_preset_of_an_optimum_is_that_of_table_s1_with_other_parameters(tmp_path):
    keys = {f"model.{name}": 1.0 + 0.125 * i for i, name in enumerate(table_s1.COLUMNS)}
    data = table_s1.Data(
        {6: [SimpleNamespace(parameters=keys)]}, {6: flights(np.array([0.8, 0.9]))}, {6: flights(np.array([0.7, 0.8]))}
    )
    path = tmp_path / "ours.toml"
    path.write_text(
        evolved.preset(6, data, presets()["vasarhelyi_2018/6ms"].read_text(encoding="utf-8")), encoding="utf-8"
    )
    ours, printed = load(path), optimum(6)
    assert {f"model.{name}": getattr(ours.parameters, name) for name in table_s1.COLUMNS} == keys
    assert (ours.body, ours.radio, ours.sensors, ours.world) == (
        printed.body, printed.radio, printed.sensors, printed.world,
    )  # fmt: skip
    assert not ours.published and "0.100" in path.read_text(encoding="utf-8")


def test_the_page_tells_how_it_is_made_and_sets_ours_beside_the_printed(tmp_path):
    keys = {f"model.{name}": 2.0 for name in table_s1.COLUMNS}
    best = SimpleNamespace(parameters=keys, ranges={key: (1.0, 3.0) for key in keys})
    data = table_s1.Data({6: [best]}, {6: flights(np.full(4, 0.8))}, {6: flights(np.full(4, 0.7))})
    evolved.write(tmp_path, [table_s1.against_published(6, data.ours[6], data.published[6])], data)
    header, (claim,) = read_claims(tmp_path / "evolved.toml")
    assert header["seeds"].endswith("paired flights 0 to 3") and header["runs"] == "1 at 6 m/s"
    assert claim.ours == 0.1
    assert "| `r0_rep` | 41.1 \\| 2 [1, 3] |" in (tmp_path / "EVOLVED.md").read_text(encoding="utf-8")
