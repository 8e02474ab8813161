"""The digits of Tables S1 and S2, the test of a whole column, and the search inside the digits."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from airflock.core.maths import FAR
from airflock.support.many_tests import holm_correction
from airflock_papers import statistics
from airflock_papers.flights import Flights
from airflock_papers.vasarhelyi_2018 import program_wall, rounding, rounding_search
from airflock_papers.vasarhelyi_2018.published import COLUMNS, SPEEDS, optimum
from airflock_papers.vasarhelyi_2018.rounding import NAMES, TARGETS, Target, box, half_digit, row_p, slack
from airflock_papers.vasarhelyi_2018.rounding_search import FITTED, MEASURED, Kept, Point, Surface, point, trajectories


@pytest.mark.parametrize("v", SPEEDS)
def test_presets_hold_the_printed_digits_of_both_tables(v: int) -> None:
    low, high = box(v).T
    values = np.array([getattr(optimum(v).parameters, name) for name in NAMES])
    assert values == pytest.approx((low + high) / 2.0, rel=1e-12) and (low < high).all()
    for row, texts in rounding.MEANS.items():
        assert optimum(v).published[row][0] == float(texts[SPEEDS.index(v)])


def test_half_of_a_last_digit() -> None:
    assert [half_digit(text) for text in ("0.13", "103", "3.20", "0.94e-6")] == pytest.approx([0.005, 0.5, 0.005, 5e-9])


@given(st.floats(29.0, 30.2), st.floats(0.01, 0.5), st.integers(2, 200))
def test_one_row_is_judged_as_everywhere(mean: float, sd: float, runs: int) -> None:
    wanted = statistics.welch(statistics.Estimate(mean, sd, None, None, runs), 29.6, 0.15, 100)
    assert row_p(32, "phi_vel", np.array([mean]), np.array([sd]), runs, False)[0] == pytest.approx(wanted, rel=1e-9)
    inside = abs(mean - 29.6) <= slack(32, "phi_vel")
    digits = row_p(32, "phi_vel", np.array([mean]), np.array([sd]), runs, True)[0]
    assert digits == pytest.approx(1.0) if inside else digits >= wanted * (1.0 - 1e-9)


def test_a_row_without_a_spread_is_equal_or_not() -> None:
    means, none = np.array([1.0, 0.999]), np.zeros(2)
    assert row_p(4, "f_disc", means, none, 100, False).tolist() == [1.0, 0.0]
    assert row_p(6, "f_wall", np.array([0.9996]), np.zeros(1), 100, True).tolist() == [1.0]


def test_the_joint_p_is_the_least_after_holm_and_the_walls_are_taken_by_either_average() -> None:
    rng = np.random.default_rng(1)
    flown = {
        row: optimum(8).published[row][0] + (optimum(8).published[row][1] or 0.0) * rng.normal(size=100)
        for row in COLUMNS
    }
    flown |= {"f_wall_program": np.full(100, 0.5), "fitness_program": flown["fitness"]}
    joint, rows = rounding.judged(8, flown, Target("eq15", False))
    alone = [
        statistics.welch(statistics.mean(flown[r]), optimum(8).published[r][0], optimum(8).published[r][1] or 0.0, 100)
        for r in COLUMNS
    ]
    assert list(rows.values()) == pytest.approx(holm_correction(alone)) and joint == min(rows.values()) > 0.05
    other, rows = rounding.judged(8, flown, Target("program", False))
    assert other == rows["f_wall"] < 1e-6 and list(rows.values()).count(other) == 1


@given(st.lists(st.lists(st.floats(-2.0, 3.0), min_size=3, max_size=3), min_size=2, max_size=12), st.floats(0.01, 2.0))
def test_the_programs_average_is_that_of_its_statistics(excursions: list[list[float]], period: float) -> None:
    total, weight, begun = 0.0, 0, False
    for instant in excursions:  # as the program sums: a step counts from the first on, with 0 until the first exit
        out = [e for e in instant if e > 0.0]
        begun = begun or bool(out)
        if out:
            total += sum(out) / len(out)
            weight += 1
        elif not begun:
            weight += 1
    wanted = total / weight if begun else 0.0
    samples = []
    for k, instant in enumerate(excursions):
        agents = [program_wall.agent(e) for e in instant]
        sums = program_wall.Agent(*(sum(column) for column in zip(*agents, strict=True)))
        samples.append(program_wall.sample(sums, k * period))
    how = {"sum": sum, "min": min, "max": max}
    over = {n: how[program_wall.OVER_TIME[n]](getattr(s, n) for s in samples) for n in program_wall.Sample._fields}
    assert over["exit"] < FAR or wanted == 0.0
    assert program_wall.total(over)["phi_wall_program"] == pytest.approx(wanted, rel=1e-6, abs=1e-12)


def test_trajectories_move_one_parameter_at_a_time_inside_the_box() -> None:
    x = trajectories(3).reshape(3, len(NAMES) + 1, len(NAMES))
    assert x.min() >= 0.0 and x.max() <= 1.0
    assert ((np.abs(np.diff(x, axis=1)) > 1e-9).sum(axis=2) == 1).all()


def drawn(rng: np.random.Generator, x: np.ndarray, column: dict[str, float]) -> Point:
    """Flights of a made-up column: the nearest neighbours lie farther apart with p_rep, all else is as printed."""
    rows = {name: [column[name.removesuffix("_program")]] * 8 for name in MEASURED}
    gap = 23.2 + 2.0 * (x[NAMES.index("p_rep")] - 0.7)
    rows["r_min_mean"] = (gap + 0.01 * rng.normal(size=8)).tolist()
    return Point("map", str(x[0]), tuple(x), rows)


def test_the_search_finds_the_digit_that_a_row_asks_for() -> None:
    rng = np.random.default_rng(2)
    column = {row: optimum(16).published[row][0] for row in COLUMNS}
    surface = Surface([drawn(rng, x, column) for x in rng.random((60, len(NAMES)))])
    for target in TARGETS[:2]:
        best = surface.best(16, target, 0)
        assert best[NAMES.index("p_rep")] == pytest.approx(0.7, abs=0.02)
    assert set(FITTED) == set(MEASURED) - {"f_disc", "f_cluster"}


def test_a_point_that_is_kept_is_not_flown_again(tmp_path, monkeypatch) -> None:
    flown = []

    def score(scenarios, seeds, *, threads, on_done):
        flown.append(list(seeds))
        return [dict.fromkeys(MEASURED, 0.5) for _ in seeds]

    monkeypatch.setattr(rounding_search, "score_flights", score)
    x = np.full(len(NAMES), 0.5)
    for _ in range(2):
        store = Kept(tmp_path / "column.jsonl")
        found = point(store, 4, "map", "0", x, range(7, 9), Flights(), "a point")
    assert flown == [[7, 8]] and found.x == tuple(x) and found.rows["fitness"] == [0.5, 0.5]
    assert Kept(tmp_path / "column.jsonl").find("map", "1") is None
