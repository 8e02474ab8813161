"""Kidger's thesis: the committed claims, and (--papers) what must hold flown again in full."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import airflock
from airflock.engine import score_flights
from airflock.search.study import load_study
from airflock.support.errors import AirflockError
from airflock_papers.claims import read_claims
from airflock_papers.kidger import PAPER, conduct, schemes

FOLDER = Path(__file__).parents[2] / "papers" / "kidger"
SEEDS = range(20)


@pytest.fixture(scope="module")
def committed():
    header, claims = read_claims(FOLDER / "claims.toml")
    return header, {claim.id: claim for claim in claims}


def test_committed_claims_hold_what_must_hold(committed):
    header, claims = committed
    assert header["command"] == "airflock paper kidger"
    for scene in ("city", "forest"):
        assert claims[f"schemes.{scene}.5"].ours == 0.0 and claims[f"schemes.{scene}.5"].runs == 20
        assert claims[f"schemes.{scene}.2"].low > 0.0
        assert claims[f"schemes.{scene}.goals"].ours >= 0.9
    for name in ("corners.swept", "corners.fast", "display.placed", "display.collisions", "cost.real_time"):
        assert claims[name].verdict == "holds", name
    for place in ("city.1", "city.0.5", "forest.1", "forest.2"):
        assert claims[f"learnt.{place}.fitness"].verdict == "holds"
        assert claims[f"learnt.{place}.n_coll"].low <= 0.0 and claims[f"learnt.{place}.n_env_coll"].high <= 0.0


def test_collisions_of_boids_with_one_another_are_on_the_list_in_four_scenes(committed):
    for scene in ("open_air", "city", "forest", "plane"):
        claim = committed[1][f"conduct.n_coll.{scene}"]
        assert claim.quote.startswith("The Boids consistently avoid collisions with one another")
        assert claim.bound == "ours == 0" and claim.ours == 0.0


def test_the_report_shows_every_claim_and_figure(committed):
    text = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert all(f"| {name} |" in text for name in committed[1])
    for name in ("city", "forest", "space", "rays", "flocked", "tuning_open_air", "tuning_city"):
        assert (FOLDER / "figures" / f"{name}.png").is_file() and f"figures/{name}.png" in text


@pytest.mark.parametrize("events", [[], [schemes.Overruled(1.0, 90.0, 1.0), schemes.Overruled(0.0, 0.0, 0.0)]])
def test_what_overruled_avoidance_is_told_where_somebody_collided(events):
    """Of no collision at all there is no share to tell: nothing is measured, in place of a division by 0."""
    columns = [*schemes.COLUMNS, "goals", "time_to_flock"]
    flown = pd.MultiIndex.from_product([schemes.SCENES, schemes.SCHEMES, range(2)])
    by_n = pd.MultiIndex.from_product([schemes.SCENES, range(1, 7), range(2)])
    tables = [pd.DataFrame(1.0, index, columns) for index in (flown, by_n)]
    found = {
        each.id: each for each in schemes.measured(schemes.Flown(tables[0], {"city": events, "forest": []}, tables[1]))
    }
    assert "schemes.forest.reason" not in found and ("schemes.city.reason" in found) == bool(events)
    assert not events or found["schemes.city.reason"].value.ours == 0.5


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_measures_of_a_boid_that_turns_to_its_goal(sign):
    """One that flies a circle of 1 rad/s towards a far goal heads for it after a quarter turn less 30 degrees."""
    t = np.arange(0.0, 20.0, 1.0 / 60.0)
    goal = np.array(conduct.GOAL) / np.linalg.norm(conduct.GOAL)
    side = np.cross(goal, [0.0, 0.0, 1.0])
    side *= sign / np.linalg.norm(side)
    velocity = np.cos(t)[:, None] * side + np.sin(t)[:, None] * goal
    dims = ("time", "space", "keypoint", "individual")
    arrays = {"velocity": velocity, "position": np.zeros_like(velocity)}
    boid = {name: (dims, a[:, :, None, None]) for name, a in arrays.items()}
    found = conduct.measures(xr.Dataset(boid, {"time": t}))
    assert found["turning"] == pytest.approx(1.0, rel=1e-3)
    assert found["towards"] == pytest.approx(math.radians(60.0), abs=0.02)


def test_an_unknown_part_is_refused_with_the_known_ones():
    with pytest.raises(AirflockError, match=r"only = 'scheme': unknown part; known: readings, conduct, alone, schemes"):
        PAPER.run(only="scheme", progress=lambda *_: None)


def columns(name, **keys):
    found = airflock.load(name, {key.replace("__", "."): value for key, value in keys.items()})
    rows = score_flights([found] * len(SEEDS), list(SEEDS))
    return {key: np.array([row[key] for row in rows]) for key in ("n_env_coll", "n_avoid", "goals_reached", "goals")}


@pytest.mark.parametrize("scene", ["city", "forest"])
def test_a_learnt_preset_differs_from_the_final_set_by_what_its_study_varies(scene):
    final, learnt = (airflock.load(f"kidger/{name}").document for name in (scene, f"learnt_{scene}"))
    varied = load_study(f"kidger/{scene}").space.keys
    assert {key: value for key, value in final.items() if key not in ("model", "title")} == {
        key: value for key, value in learnt.items() if key not in ("model", "title")
    }
    changed = {f"model.{key}" for key, value in learnt["model"].items() if value != final["model"][key]}
    assert changed == set(varied)
    assert all("airflock evolve" in learnt["model"][key.partition(".")[2]]["source"] for key in varied)


@pytest.mark.papers
@pytest.mark.parametrize("scene", ["city", "forest"])
def test_scheme_5_stays_out_of_obstacles_where_scheme_2_does_not(scene):
    capped = columns(f"kidger/{scene}")
    assert capped["n_env_coll"].sum() == 0.0
    assert capped["goals_reached"].sum() >= 0.9 * capped["goals"].sum()
    assert capped["n_avoid"].min() >= 5.0
    assert columns(f"kidger/{scene}", model__scheme="2")["n_env_coll"].min() > 0.0


@pytest.mark.papers
@pytest.mark.parametrize("part", ["presets", "shepherd", "cost", "learnt", "display"])
def test_parts_hold_when_flown_again(part):
    for claim in PAPER.run(only=part, progress=lambda *_: None):
        assert claim.verdict not in ("not reproduced", "does not hold"), claim


@pytest.mark.papers
def test_a_flock_of_vasarhelyi_stays_out_of_the_city():
    found = airflock.load("vasarhelyi_2018/city")
    rows = score_flights([found] * 5, list(range(5)))
    assert sum(row["n_env_coll"] for row in rows) == 0.0
    assert np.mean([row["phi_vel"] for row in rows]) > 1.5
