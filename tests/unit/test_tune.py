"""Tuning: what it starts from, how it shares time, and that it continues where it was left, with tiny real flights."""

import json
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from airflock.certify.seeds import identity
from airflock.errors import StudyError
from airflock.evolve.race import ROUNDS
from airflock.scenarios.files import load
from airflock.scenarios.making import make
from airflock.tune import run as tuning
from airflock.tune.plan import CERTIFY, HARDEN, POPULATION, SEARCH, TRIED, plan_of
from airflock.tune.run import tune
from airflock.tune.start import start_of

MINE = {
    "agents": 4, "duration": 20.0, "dt": 0.1, "model": {"kind": "vasarhelyi_2018", "v_flock": 6.0, "p_rep": 0.2},
    "world": {"side": 120.0}, "radio": {"delay": 0.4},
}  # fmt: skip


def test_it_starts_from_the_law_s_numbers_at_this_speed_and_leaves_alone_what_the_file_says():
    mine = make(MINE, "mine")
    start, notes = start_of(mine)
    shipped = load("vasarhelyi_2018/6ms")
    assert start.parameters.p_rep == 0.2 and start.radio.delay == 0.4 and start.agents == 4
    for name in ("r0_rep", "c_frict", "v_shill", "a_shill"):
        assert getattr(start.parameters, name) == pytest.approx(getattr(shipped.parameters, name), rel=1e-3)
    assert "scaled to 6 m/s" in notes[0]
    assert start_of(start_of(mine)[0])[0].parameters == start.parameters
    assert start_of(load("vicsek_1995/ordered"))[0].parameters == load("vicsek_1995/ordered").parameters


@given(st.floats(1.0, 1e5), st.floats(0.05, 500.0))
def test_a_plan_fits_into_its_budget_or_says_what_would(budget, rate):
    try:
        plan = plan_of(budget, rate)
    except StudyError as fault:
        assert "too small" in str(fault) and "give at least" in str(fault)
        return
    q = plan.search
    raced = sum(max(q["top"], round(share * q["pool"])) * seeds for share, seeds in ROUNDS)
    flown = POPULATION * q["generations"] + raced + (q["top"] + 2) * q["final_seeds"]
    assert flown <= SEARCH * budget * rate * 1.05 + 16 and TRIED * plan.seeds <= HARDEN * budget * rate + 1e-6
    assert plan.seconds == CERTIFY * budget and pytest.approx(1.0) == SEARCH + HARDEN + CERTIFY


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A tuning of a few seconds; and how many flights a second were assumed."""
    folder = tmp_path_factory.mktemp("tuned") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "_rate", lambda *_: 300.0)
        patch.setattr("airflock.evolve.run.draw", lambda *_: None)  # the study's own pictures
        return tune(make(MINE, "mine"), folder, budget=4.0, limit=["r_min<0.1 at 10%"]), folder


def test_the_folder_holds_what_to_fly_what_was_shown_and_a_report(done):
    found, folder = done
    assert identity(load(folder / "tuned.toml")) == identity(found.scenario)
    told = tomllib.loads((folder / "certificate.toml").read_text())
    assert told["shown"] == found.shown and told["flights"]["identity"] == identity(found.scenario)
    page = (folder / "report.html").read_text()
    for text in ("What was assumed", "model.p_rep", "on fresh seeds", *found.certificate.statements, "@page"):
        assert text.replace("<", "&lt;").replace(">", "&gt;") in page or text in page
    assert 'src="data:image/png' in page and "http" not in page
    assert (folder / "figures.pdf").read_bytes().startswith(b"%PDF")


def test_it_continues_stage_by_stage_to_the_same_end(done, tmp_path, monkeypatch):
    found, folder = done
    monkeypatch.setattr(tuning, "_rate", lambda *_: pytest.fail("the plan is kept"))
    monkeypatch.setattr("airflock.evolve.run.draw", lambda *_: None)
    with pytest.raises(StudyError, match="holds a tuning already; continue it with --resume"):
        tune(make(MINE, "mine"), folder)
    with pytest.raises(StudyError, match="holds the tuning of another scenario"):
        tune(make({**MINE, "agents": 5}, "mine"), folder, resume=True)
    steps = json.loads((folder / "hardening.json").read_text())
    again = tune(make(MINE, "mine"), folder, limit=["r_min<0.1 at 10%"], resume=True)
    assert again.result.parameters == found.result.parameters
    assert json.loads((folder / "hardening.json").read_text()) == steps
    assert again.certificate.verdicts[0].events == found.certificate.verdicts[0].events
    kept = (folder / "hardening.json").read_text()
    (folder / "hardening.json").write_text("[1]")
    with pytest.raises(StudyError, match=r"hardening.json: holds list"):
        tune(make(MINE, "mine"), folder, limit=["r_min<0.1 at 10%"], resume=True)
    (folder / "hardening.json").write_text(kept)
    with pytest.raises(StudyError, match="holds no tuning to resume"):
        tune(make(MINE, "mine"), tmp_path / "new", resume=True)
