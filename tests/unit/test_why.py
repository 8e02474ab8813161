"""Why two agents met: causes that were planted are named first, and nothing is named where nothing matters."""

import json
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

import airflock
from airflock.certificates import causes
from airflock.parts import FAULTS, RADIOS, SENSORS
from airflock.scenarios import presets, with_settings
from airflock.view import plot_why
from processes import called

SMALL = {
    "agents": 6, "duration": 120.0, "world.side": 70.0, "sensors.kind": "perfect", "body.noise": 0.05,
    "radio.delay": 0.2, "metrics.kind": "contacts",  # as futures are measured: all flights share their drivers
}  # fmt: skip
GAS = {"model.p_rep": 0.0, "model.c_frict": 0.0}  # agents that no rule keeps apart: the radio is not read
FUTURES = 60


def small(**keys):
    return airflock.load("vasarhelyi_2018/4ms", SMALL | keys)


def with_fault(kind, **numbers):
    return small(faults=[{"kind": kind, "agents": [0], "at": 20.0, **numbers}])


def line_of(request):
    """The error of a request, which is one line."""
    with pytest.raises(airflock.AirflockError) as error:
        request()
    assert "\n" not in str(error.value)
    return str(error.value)


def hits(scenario, count):
    """The first seeds whose flights have a collision, and none without what was planted."""
    events, without = (airflock.score(each, seeds=range(20))["n_coll"] for each in (scenario, small()))
    return [seed for seed in range(20) if events[seed] > 0 and without[seed] == 0][:count]


PLANTED = {
    "silent radio": (lambda: with_fault("radio_silent"), "faults[0]"),
    "offset of a receiver": (lambda: with_fault("gnss_offset", east=12.0), "faults[0]"),
    "frozen receiver": (lambda: with_fault("gnss_frozen"), "faults[0]"),
    "late packets": (lambda: small(**{"radio.delay": 3.0}), "radio.delay"),
}


@pytest.mark.parametrize("planted", PLANTED)
def test_a_planted_cause_is_named_first(planted):
    make, name = PLANTED[planted]
    for seed in hits(make(), 3):
        found = airflock.why(make(), seed, futures=FUTURES)
        assert found.causes and found.causes[0].without == name, (planted, seed, found.text)
        assert f"in {found.causes[0].events} of {FUTURES} futures instead of" in found.text


def test_what_no_rule_reads_changes_no_future_and_is_no_cause():
    gas = small(**GAS, **{"radio.delay": 2.0, "body.noise": 0.4})
    for seed in range(6):
        found = airflock.why(gas, seed, futures=FUTURES, interventions=["radio.delay"])
        rows = {(row.lead, row.without): row.events for row in found.rows}
        assert all(events == rows[lead, "nothing"] for (lead, _), events in rows.items()), seed
        assert found.causes == [] and found.avoidable_until is None
        assert "no cause is shown" in found.text.lower()


def test_a_flight_of_a_scenario_without_perturbations_has_nothing_to_take_away():
    calm = airflock.load("vicsek_1995/ordered", {"agents": 4})
    assert causes.declared_interventions(calm) == {}


def test_futures_are_the_same_whatever_the_threads_and_differ_between_seeds_of_flights():
    scenario = with_fault("radio_silent")
    first, second = hits(scenario, 2)
    one, two = (airflock.why(scenario, first, futures=FUTURES, threads=threads) for threads in (1, 2))
    assert one.rows == two.rows and one.document() == two.document()
    shown = StringIO()
    Console(file=shown, width=120).print(one)
    for text in (shown.getvalue(), one._repr_html_(), repr(one)):  # each shows the sentence
        assert one.event.split("(")[0] in text
    assert airflock.why(scenario, second, futures=FUTURES).rows != one.rows


def test_an_explanation_is_the_same_whatever_the_metrics_of_its_scenario():
    scenario = with_fault("radio_silent")
    seed, options = hits(scenario, 1)[0], {"futures": 10, "leads": [4.0]}
    usual = with_settings(scenario, {"metrics.kind": "vasarhelyi"})
    assert usual.metrics.kind != scenario.metrics.kind
    assert airflock.why(usual, seed, **options).rows == airflock.why(scenario, seed, **options).rows


def test_a_recording_is_explained_as_its_flight_and_a_changed_one_is_refused(tmp_path):
    scenario = with_fault("radio_silent")
    seed = hits(scenario, 1)[0]
    recording = airflock.simulate(scenario, seed)
    options = {"futures": 10, "leads": [4.0], "interventions": ["faults[0]"]}
    file = airflock.save(recording, tmp_path / "flight.nc")
    assert airflock.why(file, **options).rows == airflock.why(scenario, seed, **options).rows
    recording["position"][5] += 0.01
    assert "it is another flight" in line_of(lambda: airflock.why(recording, **options))


def test_a_fault_that_was_begun_by_hand_is_a_cause_of_the_recorded_flight():
    scenario, flight = small(), None
    for seed in range(20):
        flight = airflock.open(scenario, seed, record=True).advance(20.0).fault("radio_silent", 0)
        flight.finish()
        if sum(part["n_coll"] for part in (*(w.scores for w in flight.windows), flight.scores())) > 0:
            break
    found = airflock.why(airflock.recording_of(flight), futures=FUTURES, leads=[4.0])
    assert found.time > 20.0 and found.causes[0].without == "faults[0]", (seed, found.text)
    assert "Without radio_silent (faults[0])" in found.text


def test_noise_that_a_recorded_flight_drew_anew_later_does_not_bind_its_futures():
    scenario = with_fault("radio_silent")
    flight = airflock.open(scenario, hits(scenario, 1)[0], record=True)
    flight.advance(10.0).event("branch", world=7).finish()
    flown = causes._flown_flight(airflock.recording_of(flight), None, None, None, None, False)
    for until, world in ((500, 0), (1500, 7)):  # s 5 and 15 at 0.01 s
        start = flown.open(until, fresh=True)
        assert start.world == world and start.branch(5).advance(10.0).world == 5


KINDS = (
    [{"radio.kind": kind} for kind in RADIOS]
    + [{"sensors.kind": kind} for kind in SENSORS]
    + [{"faults": [{"kind": kind, "at": 1.0, "agents": [1]}, {"kind": "motor", "per_hour": 2.0}]} for kind in FAULTS]
    + [{"wind.kind": kind, "wind.east": 2.0, "wind.gust": 1.0} for kind in ("simple", "dryden")]
    + [{"groups": [{"name": "a", "agents": 2, "sensors": {"noise": 0.1}, "body": {"tau": 2.0, "noise": 0.4}}]}]
)


@pytest.mark.parametrize("keys", KINDS, ids=str)
def test_what_is_taken_away_is_no_longer_there_for_every_kind_of_part(keys):
    scenario = airflock.load("vasarhelyi_2018/real_4ms", {"agents": 4} | keys)
    for name, settings in causes.declared_interventions(scenario).items():
        without = with_settings(scenario, settings)
        left = causes.declared_interventions(without)
        if name == "body.tau":
            assert without.body.tau == 0.5 * scenario.body.tau
        else:
            assert name not in left, (keys, name)
        # Numbers of entries stay, by which other faults are drawn.
        assert len(without.faults) == len(scenario.faults)
        assert set(causes.declared_interventions(scenario)) - {name} <= set(left) | {"body.tau"}


def test_every_preset_can_fly_on_without_what_it_declares():
    for name in presets():
        scenario = airflock.load(name)
        for settings in causes.declared_interventions(scenario).values():
            assert with_settings(scenario, settings).agents == scenario.agents


@pytest.mark.parametrize("name", ["vicsek_1995/ordered", "vasarhelyi_2018/4ms"])  # a periodic box, and one with walls
def test_the_pair_that_met_is_the_nearest_one_of_all_also_across_edges_of_a_periodic_box(name):
    rng = np.random.default_rng(5)
    for case in range(20):
        flight = airflock.open(airflock.load(name, {"agents": 5}), case, device="python")
        side = flight.scenario.world.side
        flight.place(list(range(5)), rng.uniform(-0.5, 0.5, (5, 2)) * side)
        flight.remove(int(rng.integers(5)))
        there, places = np.flatnonzero(flight.present), flight.state[:2].T
        away = {(i, j): places[i] - places[j] for i in there for j in there if i < j}
        if flight.scenario.world.edges == "periodic":
            away = {pair: each - side * np.round(each / side) for pair, each in away.items()}
        least = min(away, key=lambda pair: np.hypot(*away[pair]))
        found, distance = causes._nearest_pair(flight)
        assert found == least and distance == pytest.approx(np.hypot(*away[least]), rel=1e-5), case


def test_equal_faults_go_together():
    twice = small(faults=[{"kind": "motor", "per_hour": 9.0}] * 2 + [{"kind": "stuck", "per_hour": 9.0}])
    found = causes.declared_interventions(twice)
    assert [name for name in found if name.startswith("faults")] == ["faults[0]", "faults[2]"]
    assert [entry.at for entry in with_settings(twice, found["faults[0]"]).faults] == [1e6, 1e6, None]


def certificate(tmp_path):
    """A certificate of flights with a silent radio, with the folder that keeps them."""
    file = tmp_path / "silent.toml"
    folder = tmp_path / "silent_flights"
    made = airflock.certify(with_fault("radio_silent"), "r_min<3 at 1e-3/h", flights=12, folder=folder)
    made.save(file)
    return made, file


def test_every_flight_of_a_certificate_with_an_event_is_explained_and_its_planted_cause_ranks_first(tmp_path):
    made, file = certificate(tmp_path)
    found = airflock.why(file)
    assert len(found.flights) == made.verdicts[0].events > 2
    assert found.causes[0] == "radio_silent (faults[0])" and "radio_silent (faults[0]) in" in found.text
    assert found.document() == airflock.why(made).document()
    axes = plot_why(found).axes[0]
    assert [bar.get_width() for bar in axes.patches][::-1] == found.table["named_in"].tolist()
    one = airflock.why(file, found.flights[0].seed, futures=FUTURES, leads=[4.0])
    assert one.event == found.flights[0].event and one.causes[0].without == "faults[0]"
    (tmp_path / "silent_flights").rename(tmp_path / "elsewhere")
    few = airflock.why(file)
    assert {flight.seed for flight in few.flights} <= {flight.seed for flight in found.flights}
    assert len(few.flights) == min(5, len(found.flights)) and "only the worst flights are known" in few.notes[0]
    damaged, garbage = tmp_path / "damaged.toml", tmp_path / "garbage.toml"
    damaged.write_text(file.read_text().replace("[[worst]]", "[[worse]]"))
    garbage.write_text("agents = [")
    lines = {
        "damaged.toml: is damaged: ": lambda: airflock.why(damaged),
        "garbage.toml: ": lambda: airflock.why(garbage, 1),
        "seed 3 is no flight with an event; there are ": lambda: airflock.why(file, 3),
        "a certificate holds its scenario and events; leave out": lambda: airflock.why(file, limit=2.0),
        "nothing to explain: no flight has an event": lambda: airflock.why(
            airflock.certify(small(duration=5.0), "r_min<0.01 at 20%", flights=14)
        ),
        "limit polarisation<0.9: left out, as it has no moment": lambda: airflock.why(
            airflock.certify(small(**{"metrics.kind": "order"}), "polarisation>=0.9 in 90%", flights=14)
        ),
    }
    for text, request in lines.items():
        line = line_of(request)
        assert text in line, (text, line)


def test_a_flight_counts_once_among_those_that_name_a_cause_however_many_leads_it_has():
    def row(lead, without, events):
        return causes.CauseRow(lead, without, events, 20, 0.0, 1.0, 0.0, without == "sensors")

    rows = [row(lead, *each) for lead in (8.0, 4.0, 2.0) for each in (("nothing", 15), ("sensors", 1), ("wind", 14))]
    flights = tuple(causes.WhyResult(small(), seed, "They met", 9.0, (0, 1), tuple(rows)) for seed in (1, 2))
    found = causes.HitCauses("mine", flights)
    assert found.text == "Flights with an event, by cause: sensors in 2 of 2."
    assert found.table.to_dict("list") == {
        "without": ["sensors", "wind"], "named_in": [2, 0], "events": [6, 84], "events_of_nothing": [90, 90],
        "tried_in": [2, 2],
    }  # fmt: skip


def test_a_change_of_ones_own_is_compared_like_what_is_taken_away():
    scenario = with_fault("radio_silent")
    own = ["faults[0]", "world.side=400"]
    found = airflock.why(scenario, hits(scenario, 1)[0], futures=FUTURES, leads=[4.0], interventions=own)
    assert [row.without for row in found.rows][:3] == ["nothing", *own]
    assert found.change(own[1]) == "with world.side=400"


def test_the_smallest_set_ends_the_event_and_no_single_thing_of_it_does():
    scenario = with_fault("gnss_offset", east=12.0)
    for seed in hits(scenario, 4):
        found = airflock.why(scenario, seed, futures=FUTURES)
        rows = {row.without: row for row in found.rows if row.lead == found.rows[-1].lead}
        for name in found.smallest_set if len(found.smallest_set) > 1 else ():
            assert rows[name].share > causes.FEW, seed
        if found.smallest_set:
            assert any(
                row.without.split(" + ") == [*found.smallest_set] and row.share <= causes.FEW for row in found.rows
            )


def test_the_picture_has_a_line_for_each_intervention_over_the_leads_that_were_flown():
    scenario = with_fault("radio_silent")
    found = airflock.why(scenario, hits(scenario, 1)[0], futures=10)
    axes = plot_why(found).axes[0]
    drawn = {bars.get_label(): bars[0] for bars in axes.containers}
    assert list(drawn) == [found.change(name) for name in dict.fromkeys(row.without for row in found.rows)]
    for row in found.rows:
        line = drawn[found.change(row.without)]
        assert (row.lead, row.share) in zip(line.get_xdata(), line.get_ydata(), strict=True)
    assert axes.xaxis_inverted()


def test_the_command_explains_a_flight_as_the_function_does(tmp_path):
    scenario = "vasarhelyi_2018/4ms"
    keys = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    keys += ["--set", "faults=[{kind = 'radio_silent', agents = [0], at = 20.0}]", "--futures", "20", "--leads", "4"]
    seed = hits(with_fault("radio_silent"), 1)[0]
    done = called("why", scenario, "--seed", seed, *keys, "--json", "--plot", tmp_path / "why.png")
    assert done.returncode == 0, done.stderr
    found = airflock.why(with_fault("radio_silent"), seed, futures=20, leads=[4.0])
    assert json.loads(done.stdout)["text"] == found.text and (tmp_path / "why.png").stat().st_size > 1000


def test_a_contact_with_the_world_is_an_event_too():
    blind = small(**GAS, **{"model.v_shill": 0.0})
    found = airflock.why(blind, 1, event="world", futures=10, leads=[1.0], interventions=["radio.delay"])
    assert "touched a wall" in found.event and found.agents == ()
    assert [row.events for row in found.rows] == [10, 10]  # nothing turns them, so all of them touch it


def test_faulty_requests_are_refused_in_a_line():
    scenario, safe = with_fault("radio_silent"), small(duration=5.0)
    seed = hits(scenario, 1)[0]
    lines = {
        "nothing to explain; the smallest distance was": lambda: airflock.why(safe, 0),
        "seed: is needed": lambda: airflock.why(scenario),
        "interventions: radio.dely: unknown; this flight has radio.delay, ": lambda: airflock.why(
            scenario, seed, interventions=["radio.dely"]
        ),
        "interventions = 'radio.delay' is no list": lambda: airflock.why(scenario, seed, interventions="radio.delay"),
        "event = 'pairs': did you mean pair?": lambda: airflock.why(scenario, seed, event="pairs"),
        "limit = 0.0 m lies outside (0, 1000] m": lambda: airflock.why(scenario, seed, limit=0.0),
        "leads = [0.0] is no list of times": lambda: airflock.why(scenario, seed, leads=[0.0]),
        "leads = 4.0 is no list of times": lambda: airflock.why(scenario, seed, leads=4.0),
        "futures = 3 is not a whole number within [10, ": lambda: airflock.why(scenario, seed, futures=3),
        "budget = 0 is no time above 0 s": lambda: airflock.why(scenario, seed, budget=0),
        "it happens at the start": lambda: airflock.why(scenario, seed, limit=500.0),
        "one agent meets nobody": lambda: airflock.why(small(agents=1), 0),
    }
    for text, request in lines.items():
        line = line_of(request)
        assert text in line, (text, line)
