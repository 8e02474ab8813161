"""Tuning: what it starts from, how it shares time, and that it continues where it was left, with tiny real flights."""

import hashlib
import re
import tomllib
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, strategies as st

import airflock
from airflock.certificates.campaign import campaign_from_request, scenario_identity
from airflock.cli.options import parse_seconds
from airflock.engine import score_flights
from airflock.runs.flight_store import FlightStore
from airflock.runs.folder import Interrupted, read_request
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.search import tuning_run as tuning
from airflock.search.generations import RACE_ROUNDS
from airflock.search.tune_report import default_rows, replay_files
from airflock.search.tuning_run import (
    CERTIFY_SHARE,
    HARDEN,
    MOST_SEEDS,
    POPULATION,
    SEARCH,
    TRIED,
    default_limits,
    infeasible_limit_lines,
    make_plan,
    prepare_start,
    read_plan,
    tune,
)
from airflock.support.errors import RecordingError, ScenarioError, StudyError

SEEDS = "SELECT seed FROM flight WHERE stage=?"
MINE = {
    "agents": 4, "duration": 20.0, "dt": 0.1, "model": {"kind": "vasarhelyi_2018", "v_flock": 6.0, "p_rep": 0.2},
    "world": {"side": 120.0, "walls": "nearest_per_axis"}, "radio": {"delay": 0.4},  # a driver of others
}  # fmt: skip


def test_it_starts_from_the_law_s_numbers_at_this_speed_and_leaves_alone_what_the_file_says():
    mine = build_scenario(MINE, "mine")
    start, notes = prepare_start(mine)
    shipped = load("vasarhelyi_2018/6ms")
    assert start.parameters.p_rep == 0.2 and start.radio.delay == 0.4 and start.agents == 4
    for name in ("r0_rep", "c_frict", "v_shill", "a_shill"):
        assert getattr(start.parameters, name) == pytest.approx(getattr(shipped.parameters, name), rel=1e-3)
    assert "scaled to 6 m/s" in notes[0]
    assert prepare_start(prepare_start(mine)[0])[0].parameters == start.parameters
    assert prepare_start(load("vicsek_1995/ordered"))[0].parameters == load("vicsek_1995/ordered").parameters


@pytest.mark.parametrize(("side", "room"), [(120.0, 6.0), (59.0, 3.0), (53.0, 0.0)])
def test_room_at_walls_is_given_where_there_is_place_for_it_and_the_file_says_nothing(side, room):
    crowded = {**MINE, "agents": 12, "world": {"side": side}}  # fits with 12 m between agents
    found, notes = prepare_start(build_scenario(crowded, "mine"))
    assert found.start.wall_clearance == room
    assert any(f"nearer than {room:g} m" in note for note in notes) == bool(room)
    said = build_scenario({**crowded, "start": {"wall_clearance": 0.1}}, "mine")
    assert prepare_start(said)[0].start.wall_clearance == 0.1


@given(st.floats(1.0, 1e5), st.floats(0.05, 500.0))
def test_a_plan_fits_into_its_budget_or_says_what_would(budget, rate):
    try:
        plan = make_plan(budget, rate)
    except StudyError as fault:
        assert "too small" in str(fault) and "give at least" in str(fault)
        return
    q = plan.search
    raced = sum(max(q["top"], round(share * q["pool"])) * seeds for share, seeds in RACE_ROUNDS)
    finalists = q["top"] + 1 + q["averages"]
    flown = POPULATION * q["seeds"] * q["generations"] + raced + (finalists + 1) * q["final_seeds"]
    assert flown <= SEARCH * budget * rate * 1.05 + 16 and TRIED * plan.seeds <= HARDEN * budget * rate + 1e-6
    assert plan.seconds == CERTIFY_SHARE * budget and pytest.approx(1.0) == SEARCH + HARDEN + CERTIFY_SHARE


@given(st.floats(1e3, 1e5), st.floats(1.0, 500.0), st.integers(1, 30_000))
def test_a_limit_that_the_budget_cannot_show_is_told_beforehand_with_a_budget_that_can(budget, rate, of_100_000):
    """Nothing happened in n flights: its bound at the first look, which half of alpha pays, is that of (1 - p)^n."""
    asked = campaign_from_request(
        prepare_start(build_scenario(MINE, "mine"))[0], [f"r_min<3 at {of_100_000}e-5/flight"], 0.95
    )
    plan = make_plan(budget, rate)
    lines = infeasible_limit_lines(asked, plan)
    counted = int(2.0 / 3.0 * plan.seconds * rate)  # the rest of the time is for how far numbers may change
    assert bool(lines) == ((1.0 - of_100_000 * 1e-5) ** counted > 0.025)
    for line in lines:
        assert (
            infeasible_limit_lines(asked, make_plan(parse_seconds(re.search(r"--budget (\S+),", line)[1]), rate)) == []
        )


@pytest.fixture(scope="module")
def seen():
    """What the tuning of `done` told while it went on."""
    return []


@pytest.fixture(scope="module")
def done(tmp_path_factory, seen):
    """A tuning of a few seconds; and how many flights a second were assumed."""
    folder = tmp_path_factory.mktemp("tuned") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "measure_flight_rate", lambda *_: 300.0)
        patch.setattr("airflock.search.evolution.draw_study", lambda *_: None)  # the study's own pictures
        patch.setattr(
            "airflock.search.tuning_run.used_and_unused_keys", lambda _: ("radio.delay", "agents")
        )  # one driver
        return tune(
            build_scenario(MINE, "mine"), folder, budget=4.0, limit=["r_min<0.1 at 10%"], watch=seen.append
        ), folder


def test_it_tells_its_stages_in_their_order_and_their_flights(done, seen):
    tolerances = ["tolerance of radio.delay", "tolerance of agents"]
    stages = ["search", "finals", "hardening", "counting", *tolerances, "report"]
    assert list(dict.fromkeys(each.stage for each in seen)) == stages
    for stage in ("search", "hardening"):
        flights = [(each.done, each.total) for each in seen if each.stage == stage and each.total]
        assert flights == sorted(flights) and 0 < flights[-1][0] <= flights[-1][1]
    counted = [each.done for each in seen if each.stage == "counting"]
    assert counted[-1] == len(done[0].certificate.rows)


def test_the_folder_holds_what_to_fly_what_was_shown_and_a_report(done):
    found, folder = done
    assert scenario_identity(load(folder / "tuned.toml")) == scenario_identity(found.scenario)
    told = tomllib.loads((folder / "certificate.toml").read_text())
    assert told["shown"] == found.shown and told["flights"]["identity"] == scenario_identity(found.scenario)
    shown = found._repr_html_()
    assert "tuned.toml</b>, in " in shown and "<td>model.p_rep</td>" in shown
    assert all(verdict.limit.text.replace("<", "&lt;") in shown for verdict in found.certificate.verdicts)
    page = (folder / "report.html").read_text()
    for text in ("What was assumed", "model.p_rep", "on fresh seeds", *found.certificate.statements, "@page"):
        assert text.replace("<", "&lt;").replace(">", "&gt;") in page or text in page
    assert 'src="data:image/png' in page and "http" not in page
    assert (folder / "figures.pdf").read_bytes().startswith(b"%PDF")
    for row in (
        ("radio.delay", "0.4 s"),
        ("duration", "20.0 s"),
        ("world.side", "120.0 m"),
        ("model.v_flock", "6.0 m/s"),
    ):
        assert "<tr><td>{}</td><td>{}</td>".format(*row) in page


@pytest.mark.parametrize(
    ("settings", "are", "are_not"),
    [
        ({}, {"body.tau", "sensors.scale"}, {"radio.near", "wind.gust_time"}),
        ({"radio.kind": "links", "wind.gust": 1.0}, {"radio.near", "wind.gust_time"}, {"radio.loss_at", "wind.at_6m"}),
        ({"radio.loss": 0.1, "wind.kind": "dryden"}, {"radio.loss_at", "wind.at_6m"}, {"wind.gust_time", "radio.far"}),
    ],
)
def test_only_numbers_that_a_flight_reads_are_assumed(settings, are, are_not):
    """Brute force: what is left out changes no bit of a flight when it is changed."""
    scenario = build_scenario(MINE, "mine", {"duration": 2.0, **settings})
    told = {key for key, _, _ in default_rows(scenario)}
    assert are <= told and not are_not & told
    others = [build_scenario(MINE, "mine", {"duration": 2.0, **settings, key: 12.5}) for key in are_not]
    flown, *same = score_flights([scenario, *others], [1] * 3, device="python")
    assert same == [flown] * 2


def test_numbers_of_groups_are_assumed():
    grouped = build_scenario({**MINE, "groups": [{"agents": 2, "body": {"tau": 2.0}}]}, "mine")
    assert {"body.tau", "body.a_max", "sensors.noise"} <= {key for key, _, _ in default_rows(grouped)}


def test_it_continues_stage_by_stage_to_the_same_end(done, tmp_path, monkeypatch):
    found, folder = done
    monkeypatch.setattr(tuning, "measure_flight_rate", lambda *_: pytest.fail("the plan is kept"))
    monkeypatch.setattr("airflock.search.evolution.draw_study", lambda *_: None)
    monkeypatch.setattr("airflock.search.tuning_run.used_and_unused_keys", lambda _: ("radio.delay", "agents"))
    with pytest.raises(StudyError, match="already holds a tuning; continue it with --resume"):
        tune(build_scenario(MINE, "mine"), folder)
    with pytest.raises(StudyError, match="holds the tuning of another scenario"):
        tune(build_scenario({**MINE, "agents": 5}, "mine"), folder, resume=True)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*.*") if path.suffix in (".html", ".pdf")}
    flights = flown(folder)
    again = tune(build_scenario(MINE, "mine"), folder, resume=True)  # limits are those that it began with
    assert [each.text for each in again.certificate.campaign.limits] == ["r_min<0.1 at 10%"]
    assert again.result.parameters == found.result.parameters
    assert again.certificate.verdicts[0].events == found.certificate.verdicts[0].events
    alone = tune(None, folder, resume=True)
    assert {**alone.document(), "seconds": 0.0} == {**again.document(), "seconds": 0.0} and alone.steps == found.steps
    assert flown(folder) == flights and before == {path: path.stat().st_mtime_ns for path in before}
    with pytest.raises(StudyError, match="holds another tuning: limits = "):
        tune(None, folder, limit=["r_min<0.1 at 20%"], resume=True)
    with pytest.raises(StudyError, match="holds no tuning to resume"):
        tune(build_scenario(MINE, "mine"), tmp_path / "new", resume=True)


def flown(folder):
    """Number of flights in each store below a folder."""
    found = {}
    for path in sorted(folder.rglob("*.sqlite")):
        with FlightStore(path.parent, write=False) as store:
            found[path.parent.name] = store.count()
    assert set(found) == {"study", "hardening_flights", "certificate_flights"} and all(found.values())
    return found


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A log of four drones as a table, of a lag of 0.5 s that the scenario does not know."""
    flown = airflock.simulate(build_scenario({**MINE, "duration": 60.0, "body": {"tau": 0.5}}, "true"), seed=3)
    columns = {"t": np.repeat(flown["time"].values, 4), "id": np.tile(np.arange(4), flown.sizes["time"])}
    for axis, name in enumerate("xy"):
        for what, prefix in (("position", ""), ("velocity", "v"), ("command", "c")):
            values = flown[what].squeeze("keypoint").transpose("time", "individual", "space").values
            columns[f"{prefix}{name}"] = values[..., axis].ravel()
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def test_a_plan_with_margins_of_an_earlier_version_is_refused_in_one_line(done, tmp_path):
    held = read_request(done[1], "tuning")
    assert read_plan({**held, "margins": []}, tmp_path) == read_plan(held, tmp_path)
    with pytest.raises(StudyError, match=r"margins are no longer widened; remove the line `margins` to go on"):
        read_plan({**held, "margins": ["radio.delay"]}, tmp_path)


def test_logs_are_identified_once_and_what_they_told_is_tuned_and_reported(logs, tmp_path, monkeypatch):
    monkeypatch.setattr(tuning, "measure_flight_rate", lambda *_: 300.0)
    monkeypatch.setattr("airflock.search.evolution.draw_study", lambda *_: None)
    monkeypatch.setattr("airflock.search.tuning_run.used_and_unused_keys", lambda _: ("radio.delay",))
    how = {"like": build_scenario(MINE, "mine"), "warm": True, "budget": 4.0, "limit": ["r_min<0.1 at 10%"]}
    found = tune([logs], tmp_path / "a", **how)
    tau = load(tmp_path / "a" / "identified.toml").body.tau
    assert (
        tau == pytest.approx(0.5, rel=0.1) and found.scenario.body.tau == tau != build_scenario(MINE, "mine").body.tau
    )
    assert tomllib.loads((tmp_path / "a" / "study" / "request.toml").read_text())["search"]["start"] == "scenario"
    told = {number["key"]: number for number in found.document()["identified"]["numbers"]}
    assert told["body.tau"]["low"] < 0.5 < told["body.tau"]["high"] and "reason" in told["radio.delay"]
    page = (tmp_path / "a" / "report.html").read_text()
    for text in ("What was identified", "body.tau", told["radio.delay"]["reason"], "log.csv"):
        assert text in page
    monkeypatch.setattr("airflock.search.tuning_run.identify", lambda *_, **__: pytest.fail("identified already"))
    again = tune([logs], tmp_path / "a", resume=True, **how)
    assert again.identify_report == found.identify_report and scenario_identity(again.scenario) == scenario_identity(
        found.scenario
    )
    other = tmp_path / "log.csv"
    other.write_text(logs.read_text() + "\n")
    with pytest.raises(StudyError, match="holds the tuning of other logs .logs differs.; give another --out"):
        tune([other], tmp_path / "a", resume=True, **how)


def test_the_report_plays_the_worst_flights_and_tells_the_card_of_the_next(done):
    found, folder = done
    page = (folder / "report.html").read_text()
    worst = int(found.certificate.worst[0]["seed"])
    assert 'href="worst_1.html"' in page and str(worst) in page
    show = (folder / "worst_1.html").read_text()
    assert show.startswith("<!DOCTYPE html>") and "tuned.toml" in show
    assert f"airflock fly prepare {folder / 'tuned.toml'} --site LAT,LON,ALT --members 1-4" in page
    speed = 1.5 * found.scenario.parameters.v_flock
    assert f"{speed:.4g} m/s" in page and "safety.speed_max" in page


def test_the_worst_flight_of_each_limit_is_played(tmp_path, monkeypatch):
    """Of several limits the first alone had all replays; the flight with the only contact had none."""
    monkeypatch.setattr("airflock.recordings.simulate", lambda _, seed: seed)
    shows = []
    monkeypatch.setattr("airflock.view.replay", lambda seed: SimpleNamespace(save=lambda _: shows.append(seed)))
    worst = [{"limit": limit, "seed": seed} for limit, seeds in (("a", (1, 2, 3)), ("b", (4, 1))) for seed in seeds]
    made = SimpleNamespace(worst=worst, campaign=SimpleNamespace(parameters=lambda _: {}))
    found = SimpleNamespace(certificate=made, scenario=build_scenario(MINE, "mine"), folder=tmp_path)
    assert list(replay_files(found)) == shows == [1, 4, 2]
    worst += [{"limit": limit, "seed": seed} for limit, seed in (("c", 5), ("d", 6), ("e", 7))]
    assert list(replay_files(found)) == [1, 4, 5, 6, 7]


def test_the_report_says_what_was_flown_and_which_files_it_is_about(done):
    """Numbers are those of the stores, and checksums those of the files that lie beside it."""
    found, folder = done
    page = (folder / "report.html").read_text()
    for name, rows in (("study", ("search", "final", "score")), ("certificate_flights", ("count",))):
        with FlightStore(folder / name, write=False) as store:
            for stage in rows:
                seeds = [s for (s,) in store.rows(SEEDS, (stage,))]
                assert f"<td>{len(seeds):,}</td><td>{min(seeds)} to {max(seeds)}</td>" in page
    assert hashlib.sha256((folder / "tuned.toml").read_bytes()).hexdigest() in page
    told = tomllib.loads((folder / "certificate.toml").read_text())
    assert told["seal"] in page and told["flown"]["rules"] in page
    axis = told["tolerance"]["axis"][0]
    assert f"<td>{axis['key']}</td>" in page and "not shown at" in page and "fewer than 10 % of flights" in page


def test_ctrl_c_between_stages_says_how_to_go_on(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(tuning, "measure_flight_rate", lambda *_: 300.0)
    monkeypatch.setattr(tuning, "search_set", lambda *_: SimpleNamespace(dead_reason=""))
    monkeypatch.setattr(tuning, "harden_set", interrupted)
    with pytest.raises(Interrupted, match="all flights so far are kept in .*; continue with --resume"):
        tune(build_scenario(MINE, "mine"), tmp_path / "a", budget=4.0, limit=["r_min<0.1 at 10%"])


def test_limits_are_by_default_on_collisions_and_where_there_are_walls_on_contacts():
    assert default_limits(build_scenario(MINE, "mine")) == ["r_min<3 at 0.01/h", "clearance<0 at 0.01/h"]
    assert default_limits(build_scenario({**MINE, "world": {"arena": "none"}, "start": {"kind": "ball"}}, "mine")) == [
        "r_min<3 at 0.01/h"
    ]
    with pytest.raises(ScenarioError, match="metrics.kind = 'order' has no r_min to limit; say what is to be shown"):
        default_limits(load("vicsek_1995/ordered"))


def test_search_hardening_and_certificate_hold_to_the_same_limits_on_seeds_that_never_meet(done):
    found, folder = done
    study = tomllib.loads((folder / "study" / "request.toml").read_text())
    assert study["limits"] == ["r_min<0.1 at 10%"] == [limit.text for limit in found.certificate.campaign.limits]
    assert found.result.limits[0]["keeps"] and found.result.limits[0]["limit"] == "r_min<0.1 at 10%"
    with FlightStore(folder / "study", write=False) as store:
        searched = {
            stage: {s for (s,) in store.rows(SEEDS, (stage,))} for stage in ("search", "race", "final", "score")
        }
    with FlightStore(folder / "certificate_flights", write=False) as store:
        certified = {seed for (seed,) in store.rows("SELECT seed FROM flight")}
    parts = [*searched.values(), certified]
    assert all(parts) and sum(map(len, parts)) == len(set().union(*parts))
    assert min(map(min, parts)) > 2 * MOST_SEEDS  # hardening has the seeds from 0 on


def test_logs_without_a_law_and_laws_without_logs_are_one_line(logs, tmp_path):
    for what, more, words in (
        ([logs, logs], {}, "tune takes one scenario; for logs, give --like"),
        ([logs], {"heard": logs}, "logs, give --like"),
        (build_scenario(MINE, "mine"), {"like": build_scenario(MINE, "mine")}, "give log files, not a scenario"),
    ):
        with pytest.raises(ScenarioError, match=words):
            tune(what, tmp_path / "a", **more)
    with pytest.raises(RecordingError, match=r"missing.csv: No such file"):
        tune([tmp_path / "missing.csv"], tmp_path / "a", like=build_scenario(MINE, "mine"))
    assert not (tmp_path / "a").exists()


def test_what_was_said_before_the_search_is_not_said_again(capsys):
    from airflock.cli.search_verbs import _print_tuned
    from airflock.search.tuning_run import TuneResult

    evolved = SimpleNamespace(fitness=0.5, low=0.4, high=0.6, seeds=10, limits=[])
    told = SimpleNamespace(statements=["r_min<3: shown"])
    made = type("Tuned", (SimpleNamespace,), {"__rich__": TuneResult.__rich__})(
        notes=("scaled", "out of reach"), result=evolved, steps=(), why="no", certificate=told, folder="tuned"
    )
    _print_tuned(made, ["out of reach"])
    printed = capsys.readouterr().out
    assert "start: scaled" in printed and "out of reach" not in printed
