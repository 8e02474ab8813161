"""A league of laws: measures of swarms, ranks, resuming, a law of one's own, bad input; its flights cost nothing."""

import html
import math
import random
import tomllib
from collections import Counter
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import airflock
from airflock.recordings import simulate
from airflock.runs import Interrupted, write_toml_file
from airflock.runs.executors import ScenarioTask
from airflock.search.generations import total_finals, total_flights
from airflock.search.league_table import JUDGED_BY, compare_laws, read_league
from airflock.support import AirflockError, RuleError
from flocks import measured, scenario
from processes import called

MERIT = {"vasarhelyi_2018": 0.8, "viragh_2014": 0.5, "formation": 0.5, "couzin_2002": 0.0, "mine": 0.3}
COMMON = {"metrics.v_flock": 4.0, "metrics.r_cluster": 80.0, "start.separation": 8.0}
SEARCH = {"population": 40, "generations": 1, "pool": 0, "top": 1, "final_seeds": 2}
OWN = """
from dataclasses import dataclass
import airflock

COMMAND = "heading"

@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    turn: float = airflock.quantity(0.1, "1", low=0.01, high=1.0, source="ours", meaning="part of a right angle")

def decide(own, p):
    return own.hx - p.turn * own.hy, own.hy + p.turn * own.hx, own.hz
"""


def made(folder, name="league.toml", laws=("vasarhelyi_2018", "viragh_2014", "formation"), **changes):
    """Write the file of a small league; return its path."""
    table = {
        "scenario": "vasarhelyi_2018/4ms", "held_out": 8, "set": COMMON | {"agents": 4, "duration": 1.0, "dt": 0.1},
        "robots": {"slow": {"body.tau": 1.5}}, "worlds": {"square": {"world.side": 200.0}},
        "laws": laws if isinstance(laws, dict) else {law: {} for law in laws}, "search": SEARCH, **changes,
    }  # fmt: skip
    write_toml_file(folder / name, {key: value for key, value in table.items() if value is not None})
    return folder / name


@pytest.fixture
def flown(monkeypatch, undrawn):
    """Flights that are numbers of law and seed alone; counts those of each law."""
    count = Counter()

    def score(task, parameters, seed):
        law = task.scenario.model.name
        count[law] += 1
        if "stop" in count and sum(count.values()) > 2 * count["stop"]:
            raise KeyboardInterrupt
        luck, noise = random.Random(seed), random.Random(f"{law} {seed}")
        fitness = MERIT[law] and MERIT[law] + luck.gauss(0.0, 0.1) + noise.gauss(0.0, 0.01)
        parts = {"f_speed": 1.0, "f_wall": float(fitness > 0.0)}
        return {"phi_vel": 4.0, **parts, "fitness": fitness}

    def compile_driver(task):
        if task.scenario.model.name == "viragh_2014" and "broken" in count:
            raise RuleError("model viragh_2014: a rule does not compile")

    monkeypatch.setattr(ScenarioTask, "score", score)
    monkeypatch.setattr(ScenarioTask, "compile", compile_driver)
    monkeypatch.setattr(airflock.recordings, "simulate", partial(simulate, device="python"))
    return count


def rows(result):
    """Return the rows by law."""
    return {row["law"]: dict(row) for row in result.rows}


def test_measures_of_swarms_are_those_of_numpy(pytestconfig):
    """Eigenvalues by LAPACK; flocks of 2 to 14 agents, from all linked to all alone."""
    rng = np.random.default_rng(pytestconfig.getoption("seed"))
    for _ in range(40):
        n, reach = int(rng.integers(2, 15)), float(rng.uniform(5.0, 150.0))
        x, v = rng.uniform(0.0, 100.0, (2, n)), rng.normal(size=(2, n))
        apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=0) + 1e9 * np.eye(n)
        linked, heading = apart < reach, v / np.linalg.norm(v, axis=0)
        laplacian = np.diag(linked.sum(0)) - linked.astype(float)
        values = np.linalg.eigvalsh(laplacian)
        truth = {
            "order": np.mean((linked * (heading.T @ heading)).sum(0) / np.maximum(linked.sum(0), 1)),
            "safety": 1.0 - (apart < 12.0).sum() / (n * (n - 1)),
            "union": (n - (values < 1e-9).sum()) / (n - 1), "connectivity": max(values[1], 0.0) / n,
        }  # fmt: skip
        keys = {"metrics.kind": "swarmlab", "metrics.r_comm": reach, "metrics.r_coll": 12.0}
        found = measured(scenario(**keys), np.concatenate([x, v])[None])
        assert {name: found[name] for name in truth} == pytest.approx(truth, abs=2e-6), (n, reach)


def test_a_line_of_agents_has_the_connectivity_of_a_path_and_all_linked_have_one():
    """Fiedler 1973: a path of n has 2 - 2 cos(pi/n), a complete graph n."""
    for n in (2, 3, 7):
        line = np.array([[10.0 * np.arange(n), 0.0 * np.arange(n), np.ones(n), np.zeros(n)]])
        for reach, truth in ((11.0, (2.0 - 2.0 * math.cos(math.pi / n)) / n), (1000.0, 1.0), (9.0, 0.0)):
            found = measured(scenario(**{"metrics.kind": "swarmlab", "metrics.r_comm": reach}), line)
            assert found["connectivity"] == pytest.approx(truth, abs=1e-6)
            assert found["union"] == (0.0 if reach < 10.0 else 1.0) and found["safety"] == 1.0
            assert found["order"] == pytest.approx(0.0 if reach < 10.0 else 1.0, abs=1e-6)


def test_measures_of_swarms_are_refused_where_positions_have_images():
    with pytest.raises(AirflockError, match="not defined with world.edges = 'periodic'; give bounce or open"):
        airflock.load("vicsek_1995/ordered", {"metrics.kind": "swarmlab"})


def test_laws_are_ranked_where_they_can_be_distinguished(tmp_path, flown):
    result = airflock.league(made(tmp_path), tmp_path / "a", threads=2)
    ranks = {row["law"]: result.ranks(row) for row in result.rows}
    assert ranks == {"vasarhelyi_2018": (1, 1), "viragh_2014": (2, 3), "formation": (2, 3)}
    for law, row in rows(result).items():
        value = row["values"]["fitness"]
        assert value["low"] < np.mean(row["held_out"]) < value["high"] and len(row["held_out"]) == 8
        assert row["tuning_flights"] == flown[law] - 8, "flights that judge are none that tune"
    page = (tmp_path / "a" / "league.html").read_text()
    assert "2 to 3" in page and (tmp_path / "a" / "league.png").is_file()
    for law in ranks:
        assert f"cells/{law}_slow_square/replay.html" in page
        assert (tmp_path / "a" / "cells" / f"{law}_slow_square" / "replay.html").is_file()


def test_equal_laws_are_seldom_distinguished(pytestconfig):
    """At most a twentieth of leagues of five equal laws distinguishes any two of them; 14 of 100 has p < 1e-3."""
    rng = np.random.default_rng(pytestconfig.getoption("seed"))
    wrong = 0
    for _ in range(100):
        luck = rng.normal(size=20)
        flights = [{"law": f"law_{k}", "robot": "r", "world": "w", "reason": "", "held_out": luck + rng.normal(size=20)}
                   for k in range(5)]  # fmt: skip
        wrong += any(each["p"] < 0.05 for each in compare_laws(flights))
    assert wrong < 14


def test_same_digits_with_other_threads_in_another_order_and_after_an_interruption(tmp_path, flown):
    first = airflock.league(made(tmp_path), tmp_path / "a", threads=1)
    turned = made(tmp_path, "turned.toml", laws=("formation", "viragh_2014", "vasarhelyi_2018"))
    assert rows(airflock.league(turned, tmp_path / "b", threads=3)) == rows(first)
    flown.clear()
    flown["stop"] = 30
    with pytest.raises(Interrupted, match="--resume"):
        airflock.league(made(tmp_path), tmp_path / "c", threads=2)
    del flown["stop"]
    resumed = airflock.league(out=tmp_path / "c", resume=True)
    assert resumed.document() == first.document()
    assert (tmp_path / "c" / "result.toml").read_bytes() == (tmp_path / "a" / "result.toml").read_bytes()


def test_a_law_of_ones_own_is_a_further_row_beside_rows_that_are_taken_over(tmp_path, flown):
    (tmp_path / "mine.py").write_text(OWN)
    base = airflock.league(made(tmp_path), tmp_path / "a")
    flown.clear()
    more = airflock.league(tmp_path / "a" / "result.toml", tmp_path / "b", law=[str(tmp_path / "mine.py")])
    assert set(flown) == {"mine"} and rows(base).items() <= rows(more).items()
    assert more.ranks(rows(more)["mine"]) == (4, 4)
    at_once = airflock.league(made(tmp_path), tmp_path / "c", law=[str(tmp_path / "mine.py")])
    assert rows(at_once) == rows(more) and at_once.comparisons == more.comparisons
    added = airflock.league(out=tmp_path / "a", resume=True, law=[str(tmp_path / "mine.py")])
    assert rows(added) == rows(more)
    with pytest.raises(AirflockError, match="if you trust it, add --trust"):
        airflock.league(out=tmp_path / "a", resume=True)


def test_rows_whose_fitness_is_not_that_of_their_flights_are_not_taken_over(tmp_path, flown):
    airflock.league(made(tmp_path), tmp_path / "a")
    text = (tmp_path / "a" / "result.toml").read_text()
    mean = tomllib.loads(text)["rows"][0]["values"]["fitness"]["mean"]
    (tmp_path / "b.toml").write_text(text.replace(f"mean = {mean!r}", "mean = 0.99"))
    with pytest.raises(airflock.AirflockError, match="b.toml: is damaged: .*: its fitness is not that of its flights"):
        airflock.league(tmp_path / "b.toml", tmp_path / "b")
    assert not (tmp_path / "b").exists()


def test_a_law_that_never_flocks_or_does_not_compile_has_a_row_with_the_reason(tmp_path, flown):
    flown["broken"] = 1
    found = airflock.league(made(tmp_path, laws=("viragh_2014", "couzin_2002", "vasarhelyi_2018")), tmp_path / "a")
    reasons = {law: row["reason"] for law, row in rows(found).items()}
    assert "f_wall is zero in 100 % of flights" in reasons["couzin_2002"]
    assert "a rule does not compile" in reasons["viragh_2014"] and not reasons["vasarhelyi_2018"]
    ranks = {law: found.ranks(row) for law, row in rows(found).items()}
    assert ranks == {"viragh_2014": None, "couzin_2002": None, "vasarhelyi_2018": (1, 1)}
    page = (tmp_path / "a" / "league.html").read_text()
    assert all(reason in html.unescape(page) for reason in reasons.values())
    assert tomllib.loads((tmp_path / "a" / "result.toml").read_text())["rows"][0]["reason"] == reasons["viragh_2014"]


WRONG = [
    ({"worldz": {}}, "worldz: unknown key; did you mean worlds?"),
    ({"held_out": 1}, "held_out = 1 is not a whole number of flights in [2, 1e6]"),
    ({"robots": None}, "robots is missing; write a table [robots.NAME]"),
    ({"robots": {"a/b": {}}}, "robots.a/b: a name is made of letters"),
    ({"robots": {"slow": {"radio.dealy": 1.0}}}, "radio.dealy: unknown key; did you mean radio.delay?"),
    ({"set": COMMON | {"metrics.kind": "groups"}}, "set.metrics.kind is that of the league"),
    ({"set": {k: v for k, v in COMMON.items() if k != "start.separation"}}, 'set."start.separation" is missing'),
    ({"laws": {"viragh": {}}}, "unknown model; did you mean viragh_2014?"),
    ({"laws": {"viragh_2014": {"sapce": {}}}}, "laws.viragh_2014.sapce: unknown key; known: file, set, space"),
    ({"laws": {"viragh_2014": {"space": {"model": {"r0": {"low": 1.0}}}}}}, "space.model.r0 is not a number"),
    ({"laws": {"own": {"file": "mine.py"}}}, "laws.own: would run the code in"),
    ({"search": {"popluation": 3}}, "search.popluation: unknown key"),
]


@pytest.mark.parametrize(("change", "line"), WRONG, ids=[line[:25] for _, line in WRONG])
def test_a_wrong_league_is_refused_with_one_line_before_anything_is_written(tmp_path, flown, change, line):
    path = made(tmp_path, **change)
    done = called("league", path, "--out", tmp_path / "a")
    assert done.returncode == 2 and line in done.stderr and len(done.stderr.splitlines()) == 1, done.stderr
    assert not (tmp_path / "a").exists() and not flown


def test_every_law_flies_at_the_speed_that_fitness_asks_for(tmp_path):
    """Also one whose default is another; a law whose speed is no number of its own is refused."""
    (tmp_path / "mine.py").write_text(OWN + "\ndef preferred_speed(p):\n    return 3.0 + p.turn\n")
    keys = {"agents": 4, "duration": 1.0, "metrics.v_flock": 7.0}
    path = made(tmp_path, set=COMMON | keys, laws=("vasarhelyi_2018", "viragh_2014", "couzin_2002"))
    found = read_league(path, [str(tmp_path / "mine.py")], None, trust=False)
    for cell in found.cells[:3]:
        flown = found.scenario(cell, JUDGED_BY, trust=False)
        assert (flown.model.speed(flown.parameters) or 7.0) == flown.metrics.v_flock == 7.0
    with pytest.raises(AirflockError, match=r"mine: flies at 3.1 m/s, but metrics.v_flock = 7 m/s; set its speed"):
        found.scenario(found.cells[3], JUDGED_BY, trust=False)


def test_every_cell_of_the_example_can_fly():
    found = read_league(Path(__file__).parents[2] / "examples" / "league.toml", (), None, trust=False)
    assert [found.study(cell, trust=False).scenario.model.name for cell in found.cells] == list(found.laws)


def test_the_league_of_the_package_is_as_large_as_it_says():
    """Two robots, three worlds, 30 drones for 120 s, 3,000 flights of tuning, 200 that judge; each cell can fly."""
    found = read_league(None, (), None, trust=False)
    assert len(found.table["robots"]) == 2 and len(found.table["worlds"]) == 3 and found.held_out == 200
    for cell in found.cells:
        flight = found.scenario(cell, JUDGED_BY, trust=False).flight
        assert (flight.agents, flight.duration) == (30, 120.0)
    study = found.study(found.cells[0], trust=False)
    assert total_flights(study) + total_finals(study) == pytest.approx(3000, rel=0.1)
