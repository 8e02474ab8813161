"""Certificates: verdicts by counting, interrupted and continued, written, checked, tampered with."""

import math
import random
import re
import tomllib

import pytest
import tomlkit
from _pytest.outcomes import Failed
from typer.testing import CliRunner

from airflock.certificates.campaign import (
    COUNT_PURPOSE,
    Campaign,
    certificate_seed,
    check_environment_keys,
    scenario_identity,
    used_and_unused_keys,
)
from airflock.certificates.certificate import NOT_SAID, check_certificate, scores_digest, with_checksum
from airflock.certificates.certification import ValueScreen, certify, run_campaign, value_batch
from airflock.certificates.counting import CampaignFlyer
from airflock.certificates.limits import parse_limit, parse_limits, rate_per_hour, take_look
from airflock.cli.main import app
from airflock.engine import score_flights
from airflock.runs.executors import FlightResult, ThreadExecutor
from airflock.runs.flight_store import FlightStore
from airflock.runs.folder import Interrupted, open_folder
from airflock.runs.search_space import with_parameters
from airflock.scenarios.files import load
from airflock.scenarios.scenario_builder import build_scenario
from airflock.support.errors import AirflockError, ScenarioError, StudyError

LIMIT = "r_min<1 at 2%"


def campaign(*limits, **how):
    scenario = load("vasarhelyi_2018/real_6ms")
    return Campaign(scenario, parse_limits(list(limits or (LIMIT,)), scenario), **how)


def dice(p):
    """A score in place of a flight: an event with probability p, that the seed alone decides."""

    def score(parameters, own):
        chance = random.Random(own)
        near = chance.random() < p + 10.0 * max(0.0, parameters.get("radio.delay", 0.0) - 1.5)
        found = {"r_min": 0.5 if near else 5.0, "phi_vel": 6.0 + chance.gauss(0.0, 0.1), "phi_wall": 0.0}
        return found | ({"closest": 0.4, "first": [600.0 * chance.random()]} if near else {})

    return score


def flown(asked, folder, p, *, budget=60.0, resume=False, score=None, **how):
    open_folder(folder, asked, resume=resume)
    executor = ThreadExecutor(score or dice(p), 2)
    try:
        return run_campaign(asked, folder, executor, budget, **how)
    finally:
        executor.close()


def test_a_rare_event_is_shown_a_frequent_one_refuted_and_one_at_the_limit_stays_open(tmp_path):
    shown = flown(campaign(), tmp_path / "a", 0.0)
    assert shown.shown and shown.verdicts[0].events == 0
    assert len(shown.rows) == math.ceil(math.log(0.025) / math.log(0.98)) and shown.verdicts[0].high <= 0.02
    refuted = flown(campaign(), tmp_path / "b", 0.3)
    assert refuted.verdicts[0].is_refuted and not refuted.shown and len(refuted.rows) < len(shown.rows)
    assert "refuted: r_min<1 happens at least" in refuted.statements[0]


def test_several_limits_share_what_may_go_wrong(tmp_path):
    found = flown(campaign(LIMIT, "phi_vel>=5 in 98%", "phi_wall>0 at 2%"), tmp_path / "a", 0.0)
    assert found.shown and len(found.rows) == math.ceil(math.log(0.05 / 3 / 2) / math.log(0.98))


def test_a_limit_that_no_budget_can_show_is_told_with_its_price(tmp_path):
    found = flown(campaign("r_min<1 at 1e-9/h"), tmp_path / "a", 0.0, budget=0.5)
    assert not found.shown and found.verdicts[0].flights_to_show > 2e10
    assert "needs 22,133," in found.statements[0] and "on this machine; the given time can show" in found.statements[0]


def test_rates_are_per_flock_hour_and_drone_hour():
    one, other = campaign("r_min<1 at 0.3/h"), campaign("r_min<1 at 0.01/drone-h")
    p = one.probability(one.limits[0])
    assert p == pytest.approx(1.0 - math.exp(-0.3 / 6.0)) == other.probability(other.limits[0])
    assert rate_per_hour(p, one.flight_hours) == pytest.approx(0.3) == 30 * other.to_limit_unit(other.limits[0], p)


def test_what_was_interrupted_ends_as_if_it_had_not_been(tmp_path):
    wanted = flown(campaign(), tmp_path / "a", 0.004).document()
    sound, count = dice(0.004), 0

    def stopped(parameters, own):
        nonlocal count
        count += 1
        if count in (20, 70):
            raise KeyboardInterrupt
        return sound(parameters, own)

    for time in range(2):
        with pytest.raises(Interrupted, match=r"flights are stored in .*/b; continue with --resume"):
            flown(campaign(), tmp_path / "b", 0.0, resume=time > 0, score=stopped)
    found = flown(campaign(), tmp_path / "b", 0.0, resume=True, score=stopped).document()
    del wanted["worst"], found["worst"], wanted["seal"], found["seal"]  # they name the folder
    assert found == wanted


def test_flights_of_a_folder_that_does_not_stay_are_not_said_to_be_kept(tmp_path):
    def stopped(parameters, own):
        raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"interrupted: 0 flights are not kept; with --out .* they are"):
        flown(campaign(), tmp_path / "a", 0.0, score=stopped, is_stored=False)


def test_a_folder_of_another_campaign_is_refused(tmp_path):
    flown(campaign(), tmp_path / "a", 0.0)
    with pytest.raises(StudyError, match="already holds a campaign; continue it with --resume"):
        flown(campaign(), tmp_path / "a", 0.0)
    with pytest.raises(StudyError, match="holds another campaign: confidence = 0.95 there, 0.9 now"):
        flown(campaign(confidence=0.9), tmp_path / "a", 0.0, resume=True)


def test_a_campaign_goes_on_from_its_folder_alone_and_flies_no_more_once_it_is_over(tmp_path, monkeypatch):
    short = load("vasarhelyi_2018/4ms", {"agents": 3, "duration": 1.0})
    how = {"folder": tmp_path / "a", "precision": 64}
    begun = certify(short, ["r_min<0.01 at 20%", "phi_vel>=0 in 60%"], tolerance=["agents"], budget=20.0, **how)
    monkeypatch.setattr(ThreadExecutor, "fly", lambda _, flights: pytest.fail("flown") if flights else iter(()))
    again = certify(folder=tmp_path / "a", resume=True)
    before, now = (each.document() for each in (begun, again))
    assert {**now, "seal": before["seal"]} == before and now["tolerance"]["axis"]
    assert (tmp_path / "a" / "result.toml").read_text() != ""
    with pytest.raises(StudyError, match="^limit: .* holds this itself; leave it out"):
        certify(limit="r_min<1 at 1%", folder=tmp_path / "a", resume=True)
    with pytest.raises(StudyError, match="no scenario and no folder to resume"):
        certify(limit="r_min<1 at 1%")
    with pytest.raises(Failed):  # what is new takes flights
        certify(folder=tmp_path / "a", resume=True, tolerance=["radio.delay"])


def test_a_flight_that_fails_is_no_flight_that_went_well(tmp_path):
    asked = campaign()
    bad = certificate_seed(asked.hash, COUNT_PURPOSE, 30)

    def score(parameters, own):
        if own == bad:
            raise ZeroDivisionError("agent 3 finds no room")
        return dice(0.0)(parameters, own)

    for resume in (False, True):
        with pytest.raises(StudyError, match=f"flight 30, seed {bad}, failed: agent 3 finds no room"):
            flown(asked, tmp_path / "a", 0.0, score=score, resume=resume)


def test_a_number_that_the_scenario_does_not_have_has_no_tolerance():
    exact = load("vasarhelyi_2018/4ms", {"sensors.kind": "perfect"})
    with pytest.raises(ScenarioError, match=r"sensors\.sd is not a number of this scenario; known: radio\.delay"):
        check_environment_keys(exact, ["sensors.sd"])
    with pytest.raises(ScenarioError, match=r"topology\.k is not a number of the environment; known: radio\.delay"):
        check_environment_keys(exact, ["topology.k"])


def test_the_tolerance_of_a_number_is_found_between_two_values(tmp_path):
    """Beyond a delay of 1.5 s the dice are loaded: P grows by 1 in 0.1 s, so 2 % is passed at 1.502 s."""
    found = flown(campaign(), tmp_path / "a", 0.0, keys=("radio.delay", "body.tau")).tolerance
    delay, tau = found["axis"]
    assert delay["safe"] <= 1.51 <= delay["not_shown"] < 1.1 * delay["safe"] and delay["nominal"] == 1.0
    assert tau["factor"] == 8.0 and "not_shown" not in tau


def test_a_campaign_goes_on_with_another_number_and_another_map_as_if_with_these_alone(tmp_path):
    """Flights at other values of other numbers are kept in the same folder."""
    flown(campaign(), tmp_path / "a", 0.0, keys=("radio.delay",), axes={"radio.delay": [1.0, 1.7], "body.tau": [1, 2]})
    axes = {"body.noise": [0.1, 0.2], "radio.delay": [1.0, 1.7]}
    again = flown(campaign(), tmp_path / "a", 0.0, keys=("body.tau",), axes=axes, resume=True)
    alone = flown(campaign(), tmp_path / "b", 0.0, keys=("body.tau",), axes=axes)
    assert again.tolerance == alone.tolerance and alone.tolerance["axis"][0]["factor"] == 8.0
    assert again.over == alone.over and [cell["verdict"] for cell in alone.over["cell"]] == ["safe", "unsafe"] * 2


def test_what_is_zero_is_moved_up_and_how_often_faults_strike_is_a_number_of_the_environment(tmp_path):
    """Events begin at gusts of 3 m/s, and where the second fault strikes 5 times as often."""
    faults = [{"kind": "motor", "at": 5.0, "number": 2}, {"kind": "stuck", "per_hour": 2.0, "lasts": 9.0}]
    scenario = load("vasarhelyi_2018/real_6ms", {"faults": faults})
    keys = used_and_unused_keys(scenario)
    assert {"wind.gust", "radio.loss", "faults[0].number", "faults[1].per_hour"} <= set(keys)
    assert "wind.at_6m" not in keys and keys[-2:] == ("radio.loss", "wind.gust")  # whose drivers must be compiled

    def score(values, own):
        near = values.get("wind.gust", 0.0) > 3.0 or values.get("faults[1].per_hour", 0.0) > 10.0
        return {"r_min": 0.5 if near else 5.0} | ({"closest": 0.4, "first": [9.0]} if near else {})

    asked = Campaign(scenario, parse_limits([LIMIT], scenario))
    keys = ("wind.gust", "faults[1].per_hour", "faults[0].number")
    gust, often, many = flown(asked, tmp_path / "a", 0.0, keys=keys, score=score).tolerance["axis"]
    assert gust["nominal"] == 0.0 and 2.8 <= gust["safe"] <= 3.0 < gust["not_shown"] <= 3.1 and "factor" not in gust
    assert 9.0 <= often["safe"] <= 10.0 < often["not_shown"] <= 11.0 and often["note"] == "stuck"
    assert many["safe"] == 16.0 and many["note"] == "motor"


def test_each_number_has_its_share_of_the_time_that_is_left_and_compiling_takes_none_of_it(monkeypatch):
    """The first number took all of a short time; those behind it were not tried."""
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])

    class Executor:
        def fly(self, flights):
            now[0] += 30.0  # a driver is compiled
            yield FlightResult(flights[0], {"r_min": 5.0})

    class Kept:
        flown = staticmethod(lambda _: {})
        land = staticmethod(lambda *_: None)
        fly = FlightStore.fly

    screen = ValueScreen(CampaignFlyer(campaign(), Kept(), Executor(), until=80.0), 0.02)
    screen.share_time(4)
    assert screen.flyer.left == 20.0
    screen.begin(value_batch("tolerance", {"wind.gust": 1.0}), {"wind.gust": 1.0})
    assert screen.flyer.left == 20.0 and now == [30.0]
    now[0] += 5.0
    screen.share_time(3)
    assert screen.flyer.left == 25.0


def test_numbers_of_faults_are_those_that_a_file_would_say():
    """Brute force: the flight of a scenario whose file says so."""
    faults = [{"kind": "motor", "at": 1.0, "number": 1}, {"kind": "stuck", "per_hour": 900.0, "lasts": 2.0}]
    said = [{**faults[0], "number": 3}, {**faults[1], "per_hour": 3600.0}]
    small = {"agents": 4, "duration": 6.0, "dt": 0.1}
    one = load("vasarhelyi_2018/4ms", {**small, "faults": faults})
    moved = with_parameters(one, {"faults[0].number": 3.0, "faults[1].per_hour": 3600.0})
    flights = [moved, load("vasarhelyi_2018/4ms", {**small, "faults": said}), one]
    there, same, before = score_flights(flights, [1] * 3, device="python")
    assert there == same != before


def test_a_map_says_which_cells_are_safe_and_bounds_each(tmp_path):
    axes = {"radio.delay": [0.5, 1.0, 1.7], "body.tau": [0.5, 1.0]}
    told = flown(campaign(), tmp_path / "a", 0.0, axes=axes).over
    verdicts = {tuple(cell["values"]): cell["verdict"] for cell in told["cell"]}
    assert verdicts == {(d, t): "safe" if d < 1.5 else "unsafe" for d in axes["radio.delay"] for t in axes["body.tau"]}
    assert all(cell["high"] <= 0.02 for cell in told["cell"] if cell["verdict"] == "safe")
    with pytest.raises(ScenarioError) as fault:
        certify("vasarhelyi_2018/real_6ms", LIMIT, over={"radio.dely": [0.0, 1.0], "body.tau": [1.0, -1.0]})
    assert "did you mean radio.delay?" in str(fault.value) and "body.tau = -1.0 lies outside" in str(fault.value)


def test_numbers_that_are_not_sure_are_drawn_by_each_seed(tmp_path):
    document = dict(load("vasarhelyi_2018/real_6ms").document)
    document["radio"] = {**document["radio"], "delay": {"value": 1.0, "unit": "s", "interval": [0.8, 1.4]}}
    scenario = build_scenario(document, "mine")
    asked = Campaign(scenario, parse_limits([LIMIT], scenario), flies_intervals=True)
    drawn = [asked.parameters(s)["radio.delay"] for s in range(500)]
    assert 0.8 <= min(drawn) < 0.82 and 1.38 < max(drawn) <= 1.4 and asked.parameters(7) == asked.parameters(7)
    assert type(drawn[0]) is float  # the line that replays a flight has it after --set, where np.float64(1.1) is a text
    said = flown(asked, tmp_path / "a", 0.0).disclaimers
    assert any(
        "radio.delay anywhere in the given intervals, but not numbers that are wrong in it" in text for text in said
    )
    assert flown(campaign(), tmp_path / "b", 0.0).disclaimers == list(NOT_SAID)
    with pytest.raises(ScenarioError, match="no number has an interval"):
        certify("vasarhelyi_2018/real_6ms", LIMIT, uncertain=True)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A certificate of real flights, tiny ones in plain Python, as a file."""
    folder = tmp_path_factory.mktemp("written")
    tiny = load(
        "vasarhelyi_2018/real_4ms", {"agents": 3, "duration": 4.0, "dt": 0.1, "world.side": 30.0, "metrics.period": 0.5}
    )
    found = certify(tiny, ["r_min<9 at 99%", "phi_wall>0"], flights=24, device="python", folder=folder / "flights")
    return found, found.save(folder / "certificate.toml")


def test_events_are_those_of_every_motion_step(written):
    """The smallest distance of a flight is looked for at every step, between the samples of the order parameters."""
    found, _ = written
    hit = [row for row in found.rows if "closest" in row]
    assert hit and all(row["closest"] <= row["r_min"] + 1e-12 for row in hit)
    assert any(row["closest"] < row["r_min"] for row in hit)
    assert found.verdicts[0].events == sum(row.get("closest", math.inf) < 9.0 for row in found.rows)


def test_a_certificate_holds_all_that_it_takes_to_check_it(written, tmp_path):
    found, path = written
    copy = tmp_path / "alone.toml"
    copy.write_bytes(path.read_bytes())
    again = check_certificate(copy)
    assert again.same and again.flown == 24 and found.check().same
    document = tomllib.loads(path.read_text())
    assert document["shown"] == found.shown and document["flights"]["identity"] == scenario_identity(
        found.campaign.scenario
    )
    assert scenario_identity(load(path.parent / "flights" / "scenario.toml")) == scenario_identity(
        found.campaign.scenario
    )
    assert found.worst[0]["value"] == min(row.get("closest", row["r_min"]) for row in found.rows)
    assert "yes" in found._repr_html_() and "Certificate of" in repr(found)


def lucky(limit, flights):
    """Counting that stopped where it looked best, its bound computed as if that had been fixed beforehand."""
    only = limit["looks"][0]
    found = take_look(flights, 0, only["above"], only["below"])
    only.update(flights=flights, events=0, low=found.low, high=found.high)
    limit.update(flights=flights, events=0, low=found.low, high=found.high, shown=True)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda d: d["limit"][0].update(high=0.001), "its bounds do not follow from its counts"),
        (lambda d: d["limit"][0]["looks"][0].update(above=0.5), "its bounds do not follow from its counts"),
        (lambda d: d["check"]["digests"].__setitem__(3, "0" * 12), "flight 3, seed [0-9]+: other bits"),
        (lambda d: d["flights"].update(first_seed=7), "its seeds are not those that the scenario fixes"),
        (lambda d: lucky(d["limit"][0], 20), "its looks are not those that the limit fixes"),
    ],
)
def test_what_is_changed_and_sealed_again_is_still_found(written, tmp_path, change, told):
    document = tomllib.loads(written[1].read_text())
    del document["seal"]
    change(document)
    path = tmp_path / "c.toml"
    path.write_text(tomlkit.dumps(with_checksum(document)))
    (fault,) = check_certificate(path).faults
    assert re.search(told, fault)


def test_a_certificate_of_another_scenario_version_or_format_is_refused(written, tmp_path):
    text, path = written[1].read_text(), tmp_path / "c.toml"
    for old, new, told in (
        (
            "duration = 4.0\nagents = 3",
            "duration = 4.0\nagents = 4",
            "those of another scenario than the one that it holds",
        ),
        ("format = 1\n", "format = 2\n", "is of format 2; this Airflock reads format 1"),
        ('airflock = "', 'airflock = "9.', "made by airflock 9."),
        ("seal =", "sea =", "is not a certificate"),
    ):
        changed = text.replace(old, new)
        if "agents" in old:
            changed = text.replace("agents = 3", "agents = 4")
        path.write_text(changed)
        with pytest.raises(StudyError, match=told):
            check_certificate(path)


def test_a_digest_tells_nan_and_null_apart_from_numbers_but_not_from_each_other():
    assert scores_digest({"a": math.nan}) == scores_digest({"a": None}) != scores_digest({"a": 0.0})


@pytest.mark.parametrize(
    ("text", "event", "probability"),
    [
        ("r_min<1 at 1%", "r_min<1", 0.01),
        ("r_min < 1.5 at 0.01/flight", "r_min<1.5", 0.01),
        ("phi_vel>=3 in 99%", "phi_vel<3", 0.01),
        ("phi_corr > 0.5 in 0.9", "phi_corr<=0.5", 0.1),
        ("n_coll>=1 at 6 / h", "n_coll>=1", 1.0 - math.exp(-1.0)),
        ("phi_wall>0 at 0.2/drone-h", "phi_wall>0", 1.0 - math.exp(-1.0)),
        ("r_min<3", "r_min<3", None),
    ],
)
def test_limits_are_read(text, event, probability):
    limit = parse_limit(text, load("vasarhelyi_2018/real_6ms"))
    found = limit.probability(1.0 / 6.0, 30)
    assert limit.event == event and (found is None if probability is None else found == pytest.approx(probability))


def invoked(*arguments):
    return CliRunner().invoke(app, ["certify", *(str(a) for a in arguments)])


def test_all_faults_are_told_at_once_before_anything_flies(tmp_path):
    wrong = ["--limit", "rmin<1 at 1/h", "--limit", "phi_vel<3 at 1/h", "--limit", "r_min<1 at 1e-3", "--limit", "near"]
    done = invoked("vasarhelyi_2018/real_6ms", *wrong, "--confidence", "2", "--budget", "soon", "--out", "a.png")
    assert isinstance(done.exception, AirflockError)
    lines = str(done.exception).splitlines()
    for told in (
        "did you mean r_min?", "give it /flight, or as 'phi_vel>=3 in 99%'", "say how often", "cannot be read",
        "confidence = 2 lies outside", "--budget soon: write a time", "a.png: ending .png is not .toml",
    ):  # fmt: skip
        assert sum(told in line for line in lines) == 1, told


@pytest.mark.parametrize(
    ("rate", "said"), [("1e9/h", "every flight may have it"), ("1e-320/h", "no number of flights could show that")]
)
def test_limits_that_say_nothing_or_can_never_be_shown_are_refused(rate, said):
    """The first was called shown, by no flight at all; the second ended in an overflow."""
    with pytest.raises(ScenarioError, match=rf"limit 'r_min<1 at {rate}': allows the event in \S+ of flights: {said}"):
        parse_limit(f"r_min<1 at {rate}", load("vasarhelyi_2018/real_6ms"))


def test_distances_are_not_certified_beside_collisions_that_are_looked_for_less_often():
    """The radius of collisions stays the scenario's then, and so does how often they are looked for."""
    both = ["r_min<1 at 1%", "n_coll>=1 at 1%"]
    seldom = load("vasarhelyi_2018/real_6ms", {"metrics.collision_period": 1.0})
    with pytest.raises(
        ScenarioError, match="n_coll is measured every metrics.collision_period = 1 s, and r_min at every"
    ):
        parse_limits(both, seldom)
    assert len(parse_limits(both, load("vasarhelyi_2018/real_6ms"))) == 2 and len(parse_limits(both[:1], seldom)) == 1


@pytest.mark.parametrize(("limit", "status"), [("r_min<0.001 at 50%", 0), ("r_min<100 at 10%", 1)])
def test_the_exit_status_says_whether_the_limit_is_shown(tmp_path, limit, status):
    small = ["--agents", "3", "--duration", "1", "--set", "dt=0.1", "--device", "python"]
    path = tmp_path / "c.toml"
    done = invoked("vasarhelyi_2018/real_4ms", "--limit", limit, *small, "--out", path, "--json")
    assert done.exit_code == status, done.output
    assert tomllib.loads(path.read_text())["shown"] == (status == 0)
    checked = invoked(path, "--check")
    assert checked.exit_code == 0 and "same bits" in checked.output
    other = invoked(path, "--check", "--set", "body.tau=2", "--agents", "4")
    assert "leave out --set, --agents" in str(other.exception)
