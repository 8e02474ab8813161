"""The smallest disturbance that breaks a flock: doses are what they say, seeds never meet, and each row flies again."""

import json
import math

import numpy as np
import pytest

import airflock
from airflock.certificates import disturbances
from airflock.certificates.causes import measured_by_contacts
from airflock.certificates.disturbances import Candidate, begin_of, disturbance
from airflock.parts import FAULTS
from processes import called

SMALL = {
    "agents": 6, "duration": 60.0, "dt": 0.02, "world.side": 100.0, "sensors.kind": "perfect", "body.noise": 0.02,
    "radio.delay": 0.2, "model.r0_rep": 20.0, "model.p_rep": 0.3, "model.c_frict": 0.3, "start.wall_clearance": 10.0,
}  # fmt: skip
MEASURED = [kind for kind, fault in FAULTS.items() if fault.leaves is None]


def small(**keys):
    return airflock.load("vasarhelyi_2018/4ms", SMALL | keys)


def line_of(request):
    """The error of a request, which is one line."""
    with pytest.raises(airflock.AirflockError) as error:
        request()
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.fixture(scope="module")
def broken():
    return airflock.attack(small(), ["gnss_offset", "wind=3"], limit=3.0, budget=600.0, threads=1)


@pytest.mark.parametrize("kind", [*MEASURED, "wind"])
def test_a_dose_is_the_length_the_loss_or_the_time_that_the_scenario_flies(kind):
    scenario = small()
    how = disturbance(kind, scenario)
    for amount in (0.25 * how.most, how.most):
        who = Candidate(2, 5, 0.5, 0.7)
        flown = airflock.load("vasarhelyi_2018/4ms", SMALL | how.settings(scenario, who, amount))
        if kind == "wind":
            assert math.hypot(flown.wind.east, flown.wind.north) == pytest.approx(amount) and not flown.faults
            continue
        (entry,) = flown.faults
        begin = begin_of(scenario, 5)
        assert entry.fault.name == kind and list(entry.agents) == [2] and entry.at == pytest.approx(begin)
        numbers = [getattr(entry.numbers, name) for name in how.numbers]
        if not numbers:
            assert how.unit == "s" and entry.lasts == pytest.approx(amount)
        else:
            dose = 1.0 - numbers[0] if how.numbers == ("share",) else math.hypot(*numbers)
            assert dose == pytest.approx(amount) and entry.lasts == pytest.approx(0.5 * (60.0 - begin))


def test_seeds_of_search_choice_and_judging_never_meet_nor_those_of_people_and_certificates():
    most = 1 << 30
    parts = [disturbances.SEARCH, disturbances.CHOICE, disturbances.JUDGING, 1 << 62]
    assert all(low + most <= high for low, high in zip(parts, parts[1:], strict=False)) and parts[0] > most


def test_a_branch_comes_as_near_as_the_whole_flight_with_the_same_disturbance():
    scenario = measured_by_contacts(small(), 0.5)
    target = disturbances._Target(scenario, "pair", 0.5, 1)
    target.fly_bases()
    drawn = np.random.default_rng(3)
    for kind in ("gnss_offset", "radio_silent", "motor"):
        how = disturbance(kind, scenario)
        who = Candidate(int(drawn.integers(6)), int(drawn.integers(16)), 0.6, float(drawn.uniform(-3.0, 3.0)))
        settings = how.settings(scenario, who, 0.3 * how.most)
        end = min(60.0, sum(how.time(scenario, who, 0.3 * how.most)) + disturbances.AFTER)
        margin, seconds = target.margin(0, who.moment, settings, how.time(scenario, who, 0.3 * how.most)[1])
        whole = airflock.open(airflock.load("vasarhelyi_2018/4ms", scenario.document | settings), disturbances.SEARCH)
        least = np.inf
        while whole.time < begin_of(scenario, who.moment) + seconds - 1e-9:
            positions = whole.advance(steps=1).state[:2]
            away = np.linalg.norm(positions[:, :, None] - positions[:, None, :], axis=0) + 1e9 * np.eye(6)
            least = min(least, away.min()) if whole.time > begin_of(scenario, who.moment) else least
        assert end <= begin_of(scenario, who.moment) + seconds + 1e-9 and seconds <= 60.0
        # Branches are measured at the samples of the flight, which may miss the nearest moment.
        assert least <= margin + 0.5 + 1e-4 and margin + 0.5 < least + 0.5, (kind, who)


def test_the_dose_that_breaks_a_flock_breaks_it_on_fresh_seeds_and_half_of_it_less_often(broken):
    offset, wind = broken.rows
    assert offset.kind == "gnss_offset" and 3.0 < offset.dose < 50.0 and broken.undisturbed[0] == 0, broken.text
    assert offset.low <= offset.dose <= offset.high
    settings = offset.settings
    (entry,) = settings["faults"]
    assert math.hypot(entry["east"], entry["north"]) == pytest.approx(offset.dose, rel=0.26)
    half = {"faults": [entry | {"east": 0.5 * entry["east"], "north": 0.5 * entry["north"]}]}
    shares = []
    for change in (settings, half):
        flown = measured_by_contacts(airflock.load("vasarhelyi_2018/4ms", SMALL | change), 3.0)
        shares.append(float((airflock.score(flown, seeds=range(100))["n_coll"] > 0).mean()))
    assert shares[0] > 0.3 and shares[0] > shares[1] + 0.1
    again = measured_by_contacts(broken.attacked("gnss_offset"), 3.0)
    assert airflock.score(again, seeds=[offset.seed])["n_coll"].iloc[0] > 0  # the flight that is to be replayed


def test_curves_hold_their_shares_and_a_kind_that_breaks_nothing_says_so(broken):
    for row in broken.rows:
        for dose, events, flights, low, high in row.curve:
            assert dose > 0.0 and low <= events / flights <= high
    wind = broken.rows[1]
    assert wind.agent is None and math.isinf(wind.dose) and wind.low == pytest.approx(3.0) and wind.seed is None
    assert "wind: nothing up to 3 m/s was found to do so; 0% of flights at most." in broken.text
    assert broken.document()["rows"][0]["kind"] == "gnss_offset" and list(broken.table["kind"]) == [
        "gnss_offset",
        "wind",
    ]


def test_threads_change_no_result(broken):
    other = airflock.attack(small(), ["gnss_offset", "wind=3"], limit=3.0, budget=600.0, threads=2)
    assert other.document() == broken.document()


def test_the_command_writes_a_scenario_that_flies_the_disturbance(tmp_path):
    keys = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    out = tmp_path / "broken.toml"
    done = called("attack", "vasarhelyi_2018/4ms", "--kinds", "gnss_offset, motor", "--budget", "20s", "--limit", "3",
                  "--json", "--out", out, *keys)  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["rows"]
    assert {row["kind"] for row in rows} == {"gnss_offset", "motor"}
    for row in rows:
        file = tmp_path / f"broken_{row['kind']}.toml"
        assert file.is_file() == (row["dose"] is not None)  # what breaks nothing flies no file
        if not file.is_file():
            continue
        flown = airflock.load(file)
        assert flown.faults[0].fault.name == row["kind"] and flown.faults[0].agents[0] == row["agent"]


@pytest.mark.parametrize(("unit", "dose"), [("1", "a loss of 40%"), ("m", "0.4 m"), ("s", "0.4 s")])
def test_a_dose_in_a_sentence_has_its_unit_and_a_share_says_of_what(unit, dose):
    row = disturbances.AttackRow(
        "motor", unit, 0.4, 0.3, 0.5, 0.5, 1, 2.0, 3.0, math.nan, ((0.4, 50, 100, 0.4, 0.6),), {}, 1, 9.0, 1.0
    )
    found = disturbances.AttackResult(small(), "Two agents meet", 0.5, (0, 100), (row,))
    low = "30%" if unit == "1" else "0.3"
    assert f"motor: {dose} (between {low} and {dose.replace('4', '5')}, 95 %) for agent 1" in found.text


def test_a_flock_that_breaks_as_often_without_a_disturbance_has_no_smallest_dose():
    line = line_of(lambda: airflock.attack(small(duration=10.0), "wind=1", limit=10.0, probability=0.05, budget=0.01))
    assert "breaks without any disturbance" in line and " of 100 flights have the event" in line


def test_faulty_requests_are_refused_in_a_line():
    scenario = small()
    lines = {
        "kinds: gnss_ofset: unknown; did you mean gnss_offset": lambda: airflock.attack(scenario, ["gnss_ofset"]),
        "kinds: names none; gnss_offset,": lambda: airflock.attack(scenario, []),
        "kinds: stuk: unknown; did you mean stuck": lambda: airflock.attack(scenario, "wind, stuk"),
        "kinds: fails: an agent that drops out has no dose": lambda: airflock.attack(scenario, ["fails"]),
        "kinds: motor=7: 7 is no largest dose in 1; 1 is usual": lambda: airflock.attack(scenario, ["motor=7"]),
        "kinds: wind=much: much is no largest dose in m/s": lambda: airflock.attack(scenario, ["wind=much"]),
        "kinds: wind: given 2 times": lambda: airflock.attack(scenario, ["wind", "wind=3"]),
        "probability = 1 lies outside [0.05, 0.95]": lambda: airflock.attack(scenario, ["wind"], probability=1.0),
        "budget = 0 s is no time above 0 s": lambda: airflock.attack(scenario, ["wind"], budget=0.0),
        "event = 'par': did you mean pair?": lambda: airflock.attack(scenario, ["wind"], event="par"),
        "breaks without any disturbance: 24 of 24 flights": lambda: airflock.attack(scenario, ["wind"], limit=90.0),
        "has neither walls nor obstacles nor a scene to touch": lambda: airflock.attack(
            airflock.load("vicsek_1995/ordered", {"agents": 4, "duration": 5.0}), ["wind"], event="world"
        ),
        "one agent meets nobody": lambda: airflock.attack(small(agents=1), ["wind"]),
        "radio_silent: vasarhelyi_2018/4ms cannot suffer it": lambda: airflock.attack(
            small(update="sequential", **{"radio.delay": 0.0, "sensors.period": 0.0}), ["radio_silent"]
        ),
    }
    for text, request in lines.items():
        line = line_of(request)
        assert text in line, (text, line)
