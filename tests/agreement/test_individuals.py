"""Agents that differ, fail, leave and join: what a flight does about them, by truths that need no engine."""

from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np
import pytest

import airflock
from airflock.engine import driver_text, fly_world, plan_of
from airflock.parts import FAULTS as KINDS
from airflock.recordings.scores import measure_recording
from airflock.recordings.simulation import recording_of
from airflock.scenarios.files import load, presets
from airflock.support.errors import FlightError, RuleError, ScenarioError
from inside import course, cpu

pytestmark = pytest.mark.usefixtures("scored_plainly")

SMALL = {"agents": 8, "duration": 6.0, "start.kind": "ball", "start.radius": 40.0}
OPEN = {"world.arena": "none", "world.walls": "every_edge"}
PAPER = "vasarhelyi_2018/4ms"


def flown(faults=(), name=PAPER, seed=3, **more):
    """A closed flight, interpreted, with its frames."""
    scenario = load(name, {**SMALL, **more, **({"faults": list(faults)} if faults else {})})
    return fly_world(scenario, seed, record=True, device="python")


def whole(flight):
    """Everything that a flight carries and has told, as bytes."""
    return flight._state.buffer.tobytes(), repr(flight.scores()), flight.step


# --------------------------------------------------------------------------------------------------------- presence


def test_who_leaves_is_met_by_nobody():
    """The others fly as if he had never been there, from the moment at which his last packet has been heard."""
    still = {"sensors.noise": 0.0, "radio.delay": 0.0, "metrics.period": 0.2}
    start = np.random.default_rng(2).normal(0.0, 15.0, (4, 8))
    start[2:] = 2.0
    alone = load(PAPER, {**SMALL, **still, "agents": 7, "body.noise": 0.0})
    crowd = load(PAPER, {**SMALL, **still, "agents": 8, "body.noise": 0.0})
    for gone in (0, 3, 7):
        flight = airflock.open(crowd, 1, start=start, device="python", record=True).remove(gone)
        flight.finish()
        others = [k for k in range(8) if k != gone]
        known = fly_world(alone, 1, record=True, start=start[:, others], device="python", precision=64)
        assert np.array_equal(flight.frames[:, :, others], known.frames)
        assert np.isnan(flight.frames[:, :, gone]).all() and np.isnan(flight.state[:, gone]).all()


def test_an_instant_in_flight_is_scored_as_in_its_recording():
    scenario = load(PAPER, {**SMALL, "duration": 12.0, "metrics.r_coll": 12.0, "metrics.collision_period": 0.2})
    flight = airflock.open(scenario, 5, device="python", record=True)
    flight.advance(3.0).remove(2).advance(2.01).remove(6).advance(4.0).add(2, [0.0, 0.0], [1.0, 0.0])
    scores = flight.finish()
    values, _ = measure_recording(recording_of(flight))
    for name in ("phi_vel", "phi_corr", "n_min", "r_min", "phi_coll", "n_coll", "phi_wall"):
        assert scores[name] == pytest.approx(values[name], rel=1e-9), name
    assert values["present"] == pytest.approx(scores["present"], abs=0.01)
    assert scores["present"] < 1.0


@pytest.mark.parametrize(("gone", "apart"), [(10, 30.0), (0, 30.0), (0, 4.0)])
def test_a_flight_that_ends_at_a_collision_counts_that_instant(gone, apart):
    """Two fly into each other, the third leaves at a step; with 4 m between the two it ends where it begins."""
    stops = {"metrics.stop": "collision", "metrics.r_coll": 5.0, "sensors.noise": 0.0, **SMALL, **OPEN, "agents": 3}
    leaves = [{"kind": "fails", "agents": [2], "at": 0.02 * gone}]
    scenario = load(PAPER, stops | {"dt": 0.02, "body.noise": 0.0, "model.p_rep": 0.0, "faults": leaves})
    start = np.array([[0.0, apart, 0.0], [0.0, 0.0, 900.0], [4.0, -4.0, 0.0], [0.0, 0.0, 0.0]])
    flight = airflock.open(scenario, 1, start=start, device="python", record=True)
    there = flight.finish()["present"]
    instants = flight.step + 1  # 0 to the one of the collision
    assert flight.time < 6.0 and (apart > 5.0 or instants == 1)
    assert there == pytest.approx((3 * gone + 2 * (instants - gone)) / (3 * instants), rel=1e-12)


VARIANTS = {"lossy": {"radio.loss": 0.5}, "waiting": {"body.delay": 0.15}}  # of PAPER


@pytest.mark.parametrize("name", [*sorted(presets()), *VARIANTS])
def test_every_preset_flies_with_agents_that_come_and_go(name):
    keys = VARIANTS.get(name, {})
    preset = PAPER if name in VARIANTS else name
    scenario = load(preset, keys)
    few = {"agents": min(scenario.agents, 4), "duration": 40.0 * scenario.flight.dt}
    scenario = load(preset, {**keys, **(few if scenario.goals.kind != "own" else {"duration": 0.1})})
    told = []
    for steps in (40, 7):
        flight = airflock.open(scenario, 3, device="python")
        flight.advance(steps=2).remove(1)
        while flight.step < 9:
            flight.advance(steps=min(steps, 9 - flight.step))
        far = 0.5 if scenario.world.edges == "bounce" else 1000.0  # m; nobody is put beyond faces that bounce
        place = [far] * scenario.dimensions
        flight.add(1, place).advance(steps=1).remove(0)
        while not flight.over:
            flight.advance(steps=steps)
        told.append((flight.state.tobytes(), repr(flight.finish())))
        assert np.isfinite(flight.state[:, 1]).all() and np.isnan(flight.state[:, 0]).all()
    assert told[0] == told[1]


def test_a_lonely_agent_flies_on_and_its_instants_do_not_count():
    scenario = load(PAPER, {**SMALL, "agents": 3})
    flight = airflock.open(scenario, 1, device="python").advance(2.0)
    before = flight.scores()
    flight.remove(0).remove(1).advance(1.0)
    after = flight.scores()
    assert {k: v for k, v in after.items() if k != "present"} == {k: v for k, v in before.items() if k != "present"}
    assert np.isfinite(flight.state[:, 2]).all()
    flight.remove(2).advance(1.0)
    assert np.isnan(flight.state).all() and flight.scores()["phi_vel"] == before["phi_vel"]


@pytest.mark.parametrize("agents", [5, 15])
@pytest.mark.parametrize("first", ["last", 1])
def test_random_numbers_of_the_others_do_not_depend_on_who_left(agents, first):
    """Noise and lost packets are drawn by the numbers of agents, not by their places in memory.

    Of 15 agents, lanes behind them are filled up; after the last one has left, the others still lie at their numbers.
    """
    far = {"agents": agents, "duration": 3.0, "radio.range": 0.0, "radio.loss": 0.5, **OPEN}
    far |= {"start.kind": "ball", "start.radius": 800.0}
    gone = [agents - 1 if first == "last" else first, 2]
    known = airflock.open(load(PAPER, far), 4, device="python").advance(2.0)
    by_hand = airflock.open(load(PAPER, far), 4, device="python").advance(0.5)
    by_hand.remove(gone[0]).advance(0.7).remove(gone[1]).advance(0.8)
    recorded_faults = [
        {"kind": "fails", "at": at, "agents": [agent]} for at, agent in zip((0.5, 1.2), gone, strict=True)
    ]
    by_fault = airflock.open(load(PAPER, far | {"faults": recorded_faults}), 4, device="python").advance(2.0)
    others = [agent for agent in range(agents) if agent not in gone]
    for flight in (by_hand, by_fault):
        assert np.array_equal(flight.state[:, others], known.state[:, others])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda f: f.remove(8), "agent = 8: this flight has the agents 0 to 7"),
        (lambda f: f.remove(2).remove(2), r"agent = 2: it is absent at t = 1 s"),
        (lambda f: f.add(2, [0, 0]), "add: agent 2 is there already"),
        (lambda f: f.remove(2).add(2, [0]), r"position = \[0\] is not \[east, north\] in m"),
        (lambda f: f.remove(2).push(2, [1, 1]), "agent = 2: it is absent"),
        (lambda f: f.remove(2).look(2), "agent = 2: it is absent"),
        (lambda f: f.event("remove"), "are not what it needs"),
        (lambda f: f.fault("moter", [1]), r"faults\[0\].kind = 'moter': unknown kind of fault; did you mean motor"),
        (lambda f: f.fault("motor", [9]), r"faults\[0\].agents: there is no agent 9; this flock has the agents 0 to 7"),
        (lambda f: f.event("fault", kind="motor", agents=[1], share=2.0), r"share = 2 lies outside \[0, 1\]"),
    ],
)
def test_what_makes_no_sense_is_one_line(call, said):
    flight = airflock.open(load(PAPER, SMALL), 1, device="python").advance(1.0)
    with pytest.raises((FlightError, ScenarioError), match=said) as fault:
        call(flight)
    assert "\n" not in str(fault.value)


# ----------------------------------------------------------------------------------------------------------- faults

ONCE = {"at": 1.0, "agents": [2]}


def path(found, agent=2):
    """Positions of one agent, (time, axis)."""
    return found.frames[:, :2, agent]


@pytest.mark.parametrize("name", [PAPER, "vasarhelyi_2018/real_gnss", "zapotecatl_2016/best", "vicsek_1995/ordered"])
def test_faults_that_never_come_leave_the_text_of_the_driver(name):
    never = [
        {"kind": "motor", "at": 1e6},
        {"kind": "battery", "per_hour": 0.0},
        {"kind": "stuck", "at": 2.0, "lasts": 0.0},
    ]
    one = {"groups": [{"name": "all", "body": {}, "model": {}}]}
    scenario = load(name)
    assert driver_text(load(name, {"faults": never})) == driver_text(scenario) == driver_text(load(name, one))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_nothing_is_felt_before_a_fault_begins_and_something_after(kind):
    sound = flown(**{"radio.kind": "links"})
    ill = flown(
        [{"kind": kind, **ONCE, **({"endurance": 0.5} if kind == "battery" else {})}], **{"radio.kind": "links"}
    )
    assert np.array_equal(ill.frames[:5], sound.frames[:5])  # samples before 1 s
    assert not np.array_equal(ill.frames[5:, :4], sound.frames[5:, :4])


def test_without_motors_an_agent_keeps_its_velocity():
    v = flown([{"kind": "motor", "share": 0.0, **ONCE}]).frames[:, 2:4, 2]
    assert np.array_equal(v[5:], np.repeat(v[5:6], len(v) - 5, axis=0)) and not np.array_equal(v[4], v[5])


def test_half_a_motor_reaches_half_the_acceleration():
    quiet = {"agents": 1, "sensors.noise": 0.0, "body.noise": 0.0, "start.speed": 0.0, **OPEN}
    sound = flown(**quiet).frames[:, 2:4, 0]
    weak = flown([{"kind": "motor", "share": 0.5, "at": 0.0}], **quiet).frames[:, 2:4, 0]
    speed = [np.linalg.norm(v, axis=1)[2] for v in (sound, weak)]
    assert speed[1] == pytest.approx(0.5 * speed[0], rel=0.2)  # a lag of 1 s, after 0.4 s


def test_a_constant_error_of_all_receivers_shifts_the_flock_and_nothing_else():
    open_air = {**OPEN, "sensors.noise": 0.0, "radio.delay": 0.0}
    sound = flown(**open_air)
    off = flown([{"kind": "gnss_offset", "at": 0.0, "east": 7.0, "north": -3.0}], **open_air)
    assert np.allclose(off.frames[:, :4], sound.frames[:, :4], atol=1e-9)  # only differences are perceived


def test_an_agent_that_is_off_shies_from_a_wall_that_is_not_there():
    alone = {"agents": 1, "sensors.noise": 0.0, "body.noise": 0.0, "duration": 60.0}
    east, farthest = np.array([[0.0], [0.0], [4.0], [0.1]]), []
    for recorded_faults in ([], [{"kind": "gnss_offset", "at": 0.0, "east": 60.0}]):
        scenario = load(PAPER, {**alone, **({"faults": recorded_faults} if recorded_faults else {})})
        farthest.append(fly_world(scenario, 1, record=True, start=east, device="python").frames[:, 0].max())
    assert farthest[0] - farthest[1] == pytest.approx(60.0, abs=2.0)


def test_a_drift_is_the_offset_it_has_grown_to():
    drift = {"kind": "gnss_drift", "at": 0.0, "east": 2.0, "grows": 1.0}
    open_air = {**OPEN, "sensors.noise": 0.0, "agents": 3}
    flight = airflock.open(load(PAPER, {**SMALL, **open_air, "faults": [drift | {"agents": [1]}]}), 1, device="python")
    for time, error in ((0.4, 0.8), (1.0, 2.0), (2.0, 2.0)):
        flight.advance(time - flight.time).sense()
        view = flight.look(1)
        assert view.own.x - view.true.x == pytest.approx(error, abs=1e-9)
        assert view.own.vx == view.true.vx


@pytest.mark.parametrize(("kind", "heard", "hears"), [("radio_silent", False, True), ("radio_deaf", True, False)])
@pytest.mark.parametrize("radio", ["constant", "links"])
def test_a_radio_that_is_silent_or_deaf(kind, heard, hears, radio):
    keys = {**SMALL, "radio.kind": radio, "radio.near": 500.0, "radio.received_near": 1.0, "radio.range": 1e4}
    flight = airflock.open(
        load(PAPER, {**keys, "faults": [{"kind": kind, "at": 0.0, "agents": [2]}]}), 1, device="python"
    )
    flight.advance(2.0).sense()
    others = {other.who for other in flight.look(0).heard}
    assert (2 in others) == heard and {1, 3, 4, 5, 6, 7} <= others
    assert bool(flight.look(2).heard) == hears


def told_of(flight, who):
    """What agent 0 has just heard of another one."""
    (found,) = (other.state for other in flight.look(0).heard if other.who == who)
    return found


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_frozen_radio_repeats_the_packet_that_it_sent_last(noise):
    """With its errors: they are part of what was sent. Two faults, so that the second one repeats a newer packet."""
    keys = {"sensors.noise": noise, "radio.delay": 0.4, "radio.range": 1e4, "duration": 8.0}
    hit = {"kind": "radio_frozen", "agents": [2]}
    recorded_faults = [hit | {"at": 1.0, "lasts": 2.0}, hit | {"at": 3.6, "lasts": 1.0}]
    flight = airflock.open(load(PAPER, {**SMALL, **keys, "faults": recorded_faults}), 1, device="python")
    told = []
    for _ in range(30):
        flight.advance(0.2).sense()
        told.append(told_of(flight, 2))
    for k in range(2, 30):
        sent = 0.2 * (k + 1) - 0.4  # s; what was sent then arrives 0.4 s later
        frozen = 1.0 <= sent + 1e-9 < 3.0 or 3.6 <= sent + 1e-9 < 4.6
        assert (told[k] == told[k - 1]) == frozen, sent


def test_a_frozen_receiver_repeats_the_position_that_it_reported_last():
    """It was thought to report its true position when it froze, which no receiver knows."""
    recorded_faults = [{"kind": "gnss_frozen", "at": 1.1, "agents": [2], "lasts": 2.0}]
    flight = airflock.open(load(PAPER, {**SMALL, "radio.range": 1e4, "faults": recorded_faults}), 1, device="python")
    believed, told = [], []
    for _ in range(25):
        flight.advance(0.2).sense()
        believed.append(tuple(flight.look(2).own[:2]))
        told.append(told_of(flight, 2)[:2])
    still = [0.2 * (k + 1) for k in range(1, 25) if believed[k] == believed[k - 1]]
    assert still == pytest.approx(np.arange(1.2, 3.1, 0.2))
    heard = [0.2 * (k + 1) for k in range(1, 25) if told[k] == told[k - 1]]
    assert heard == pytest.approx(np.arange(2.2, 4.1, 0.2)), "a second later, by the delay"


@pytest.mark.parametrize("joined", [False, True])
def test_a_fault_that_is_named_in_flight_repeats_what_was_last(joined):
    flight = airflock.open(load(PAPER, {**SMALL, "radio.range": 1e4, "radio.delay": 0.0}), 1, device="python")
    flight.advance(2.0)
    if joined:
        flight.remove(2).advance(0.6).add(2, [5.0, -4.0], [1.0, 0.0]).advance(0.6)
    flight.sense()
    last = flight.look(2).own, told_of(flight, 2)
    flight.advance(0.1).fault("gnss_frozen", agents=[2]).fault("radio_frozen", agents=[2]).advance(0.1).sense()
    assert flight.look(2).own[:2] == pytest.approx(last[0][:2], abs=1e-6)
    assert told_of(flight, 2) == pytest.approx(last[1], abs=1e-6)
    flight.advance(1.0).sense()
    assert flight.look(2).own[:2] == pytest.approx(last[0][:2], abs=1e-6)
    assert told_of(flight, 2) == pytest.approx(last[1], abs=1e-6)


@pytest.mark.parametrize("kinds", [("gnss_offset", "gnss_frozen"), ("gnss_frozen", "gnss_offset")])
def test_what_is_frozen_was_off_already_and_is_off_no_further(kinds):
    keys = {**SMALL, "sensors.noise": 0.0, "radio.range": 1e4}
    at = {"gnss_offset": 0.0, "gnss_frozen": 2.0}
    recorded_faults = [{"kind": kind, "at": at[kind], "agents": [2]} for kind in kinds]
    flight = airflock.open(load(PAPER, {**keys, "faults": recorded_faults}), 1, device="python").advance(1.8).sense()
    last = flight.look(2).own
    assert last.x == pytest.approx(flight.look(2).true.x + 10.0, abs=1e-5)
    flight.advance(1.0).sense()
    assert flight.look(2).own[:2] == pytest.approx(last[:2], abs=1e-5)


def test_a_clock_that_is_ahead_extrapolates_too_far():
    """From 1 s on, the delay: what was sent before the flight was stamped by a clock that was right."""
    keys = {"radio.kind": "links", "radio.near": 500.0, "radio.received_near": 1.0, "radio.range": 1e4}
    keys |= {"sensors.noise": 0.0, "body.noise": 0.0}
    found = []
    for recorded_faults in ([], [{"kind": "clock", "at": 0.0, "agents": [2], "ahead": 1.5}]):
        flight = airflock.open(
            load(PAPER, {**SMALL, **keys, **({"faults": recorded_faults} if recorded_faults else {})}),
            1,
            device="python",
        )
        flight.advance(1.0).sense()
        found.append((flight.look(0).heard, flight.look(2).heard))
    ages = [[other.age for other in heard if other.who in (0, 2)] for pair in found for heard in pair]
    assert ages == [[pytest.approx(a)] for a in (1.0, 1.0, -0.5, 2.5)]


def test_who_pretends_knows_where_it_is():
    flight = airflock.open(
        load(PAPER, {**SMALL, "sensors.noise": 0.0, "radio.delay": 0.0, "radio.range": 1e4,
                     "faults": [{"kind": "pretender", "at": 0.0, "agents": [2], "east": 20.0}]}), 1, device="python",
    )  # fmt: skip
    flight.advance(1.0).sense()
    true = flight.look(2).own
    (told,) = (other.state for other in flight.look(0).heard if other.who == 2)
    assert true == flight.look(2).true and told[:2] == pytest.approx((true.x + 20.0, true.y))


def test_a_stuck_command_stays():
    c = flown([{"kind": "stuck", **ONCE}]).frames[:, 4:6, 2]
    assert np.array_equal(c[5:], np.repeat(c[4:5], len(c) - 5, axis=0))


def test_a_battery_lands_the_agent_when_it_is_empty():
    found = flown([{"kind": "battery", **ONCE, "endurance": 2.0}])
    gone = np.isnan(found.frames[:, 0, 2])
    assert gone.tolist() == [k * 0.2 >= 3.0 - 1e-9 for k in range(len(gone))]
    assert found.values["present"] == pytest.approx(1.0 - 3.01 / 6.01 / 8.0)


def test_faults_that_come_at_random_come_as_often_as_they_should():
    scenario = load(PAPER, {"agents": 20, "duration": 3600.0, "faults": [{"kind": "motor", "per_hour": 30.0}]})
    from airflock.scenarios.fault_entries import draw_onsets

    counts = [draw_onsets(scenario, seed) for seed in range(60)]
    assert np.mean([len(found) for found in counts]) == pytest.approx(30.0, abs=4.0 * np.sqrt(30.0 / 60.0))
    agents = np.bincount([onset.agent for found in counts for onset in found], minlength=20)
    assert ((agents - agents.mean()) ** 2 / agents.mean()).sum() < 45.0  # chi squared, 19 degrees of freedom
    other = draw_onsets(scenario, 0, world=1)
    assert other != counts[0]


def test_any_cuts_and_any_way_to_say_it_give_the_same_bits():
    recorded_faults = [
        {"kind": "gnss_frozen", "at": 1.01, "agents": [1], "lasts": 1.5}, {"kind": "motor", "per_hour": 4000.0},
        {"kind": "battery", "at": 0.5, "agents": [3], "endurance": 1.23}, {"kind": "stuck", "at": 2.0, "number": 2},
    ]  # fmt: skip
    scenario = load(PAPER, {**SMALL, "faults": recorded_faults})
    closed = fly_world(scenario, 3, record=True, device="python")
    for steps in (1, 7, 100):
        flight = airflock.open(scenario, 3, record=True, device="python")
        while not flight.over:
            flight.advance(steps=steps)
        scores = flight.finish()
        assert flight.frames.tobytes() == closed.frames.tobytes()
        assert repr(scores) == repr(scenario.judged(closed.values))
    sensed = airflock.open(scenario, 3, record=True, device="python")
    while not sensed.over:
        sensed.sense().advance(steps=20)
    assert repr(sensed.finish()) == repr(scores)


def test_scenario_seed_and_events_are_the_same_bits():
    flight = airflock.open(load(PAPER, SMALL), 6, record=True, device="python")
    flight.advance(1.0).fault("motor", 3, share=0.1).advance(0.5).remove(5, "landed").advance(0.31)
    flight.event("fault", kind="gnss_drift", agents=[0, 1], lasts=1.0)
    flight.advance(0.2).add(5, [10.0, 0.0]).change({"model.p_rep": 0.2}).advance(1.0)
    again = airflock.open(flight.origin[0], 6, record=True, device="python", events=[e.plain() for e in flight.events])
    while again.step < flight.step:
        again.advance(steps=min(13, flight.step - again.step))
    assert whole(again) == whole(flight) and again.events == flight.events and again.faults == flight.faults
    assert again.frames.tobytes() == flight.frames.tobytes()
    assert [fault["kind"] for fault in flight.faults] == ["motor", "gnss_drift", "gnss_drift"]


def test_going_back_and_branching_with_faults():
    scenario = load(
        PAPER, {**SMALL, "faults": [{"kind": "motor", "per_hour": 5000.0}, {"kind": "fails", "at": 2.0, "number": 1}]}
    )
    flight = airflock.open(scenario, 4, device="python").advance(1.0)
    moment = flight.snapshot()
    first = whole(flight.advance(3.0))
    assert whole(flight.branch().restore(moment).advance(3.0)) == first
    other = flight.restore(moment).branch(7).advance(3.0)
    assert whole(flight.restore(moment).advance(3.0)) == first
    begun = [fault for fault in flight.faults if fault["begin"] < 1.0]
    assert [fault for fault in other.faults if fault["begin"] < 1.0] == begun and other.faults != flight.faults


def test_a_recording_tells_what_befell_whom():
    import json

    recording = airflock.simulate(load(PAPER, {**SMALL, "faults": [{"kind": "fails", **ONCE}]}), 1, device="python")
    told = json.loads(recording.attrs["airflock_faults"])["faults"]
    assert told == [{"kind": "fails", "agent": 2, "begin": 1.0, "end": None}]
    assert recording.confidence.values[:, 0, 2].tolist() == [1.0] * 5 + [0.0] * 26
    assert measure_recording(recording)[0]["present"] == pytest.approx(1.0 - 26.0 / 31.0 / 8.0)


class Magnet:
    """A kind of a user's own, as a namespace."""

    NAME = "magnet"

    def sense(x, y, z, vx, vy, vz):
        return x, y, z, vy, -vx, vz


def test_a_kind_of_ones_own_flies(tmp_path):
    found = load(PAPER, {**SMALL, "faults": [{"kind": "magnet", **ONCE}]}, faults=Magnet)
    one = fly_world(found, 3, record=True, device="python").frames
    (tmp_path / "magnet.py").write_text(
        "def sense(x, y, z, vx, vy, vz):\n    return x, y, z, vy, -vx, vz\n", encoding="utf-8"
    )
    text = 'extends = "vasarhelyi_2018/4ms"\nagents = 8\nduration = 6.0\n[start]\nkind = "ball"\nradius = 40.0\n'
    text += '[[faults]]\nkind = "magnet.py"\nat = "1000 ms"\nagents = [2]\n'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ScenarioError, match="if you trust it, add --trust"):
        load(tmp_path / "mine.toml")
    two = fly_world(load(tmp_path / "mine.toml", trust=True), 3, record=True, device="python").frames
    assert np.array_equal(one, two)
    assert not np.array_equal(one, flown().frames)


def two_of_three(vx):
    return vx, vx


@pytest.mark.parametrize(
    ("rules", "said"),
    [
        ({}, "has no rule"),
        ({"sense": lambda x, speed: x}, "asks for 'speed'"),
        ({"motion": two_of_three}, "returns 2 of 3 numbers"),
    ],
)
def test_a_kind_that_is_none_is_one_line(rules, said):
    with pytest.raises(RuleError, match=said):
        plan_of(load(PAPER, {"faults": [{"kind": "odd", "at": 1.0}]}, faults=airflock.fault(rules, "odd")))


@pytest.mark.parametrize("name", ["onset", "at_x", "sent_lasts", "per_hour"])
def test_numbers_of_a_kind_have_no_names_that_a_flight_keeps(name):
    """A number called onset was overwritten by when the fault began, in flights alone."""
    from airflock.core.parameters import Parameters, quantity

    declared = {
        "__annotations__": {name: float},
        name: quantity(5.0, "m", low=0.0, high=9.0, meaning="x", source="ours"),
    }
    record = dataclass(frozen=True, kw_only=True)(type("Parameters", (Parameters,), declared))
    with pytest.raises(RuleError, match=f"Parameters.{name}: "):
        airflock.fault({"Parameters": record, "sense": Magnet.sense}, "odd")


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"kind": "motor"}, "give at, when it begins, or per_hour, how often it comes"),
        ({"kind": "motor", "at": 1.0, "per_hour": 2.0}, "give at, when it begins, or per_hour"),
        ({"kind": "motor", "at": 1.0, "until": 0.5}, r"until = 0.5 s is not after at = 1 s"),
        ({"kind": "motor", "at": 1.0, "group": "heavy"}, "unknown group; the scenario has none"),
        ({"kind": "motor", "at": 1.0, "number": 101}, "is not a whole number up to 100"),
        ({"kind": "motor", "at": 1.0, "agents": [100]}, "there is no agent 100; this flock has the agents 0 to 99"),
        ({"kind": "motor", "at": 1.0, "agents": 3}, "is not a list of numbers of agents"),
        ({"kind": "motor", "at": "1 furlong"}, "the unit is s"),
        ({"kind": "motor", "at": 1.0, "shar": 0.5}, "did you mean"),
        ({"kind": "fails", "at": 1.0, "until": 3.0}, "fails does not end"),
        ({"at": 1.0}, "unknown kind of fault"),
        (3, "faults is not a list of tables"),
    ],
)
def test_bad_entries_are_one_line_each(entry, said):
    with pytest.raises(ScenarioError, match=said):
        load(PAPER, {"faults": [entry]})


def test_all_that_is_wrong_is_said_at_once():
    with pytest.raises(ScenarioError) as found:
        load(PAPER, {"faults": [{"kind": "moter", "at": 1.0}, {"kind": "motor", "at": -1.0}], "radio.delay": 99.0})
    assert len(str(found.value).splitlines()) == 3


def test_agents_that_see_each_other_as_they_are_have_no_faults_of_perception():
    assert load("zapotecatl_2016/best", {"faults": [{"kind": "motor", "at": 1.0}]}).faults
    with pytest.raises(ScenarioError, match="update = 'sequential' is for agents that see each other as they are"):
        load("zapotecatl_2016/best", {"faults": [{"kind": "gnss_drift", "at": 1.0}]})


# ----------------------------------------------------------------------------------------------------------- groups


def test_a_group_flies_as_it_is_told():
    groups = [{"name": "slow", "agents": 4, "model": {"v_flock": 2.0}}, {"name": "fast", "model": {"v_flock": 6.0}}]
    apart = {"radio.range": 0.0, **OPEN, "duration": 15.0, "body.noise": 0.0, "sensors.noise": 0.0, "start.speed": 4.0}
    speed = np.linalg.norm(flown(**apart, groups=groups).frames[-1, 2:4], axis=0)
    assert speed == pytest.approx([2.0] * 4 + [6.0] * 4, rel=0.01)


def test_tolerances_are_drawn_as_they_are_told():
    spread = {"name": "all", "body": {"tau": {"value": 1.0, "spread": 0.1}}, "model": {"p_rep": {"spread": 0.02}}}
    scenario = load(PAPER, {"agents": 2000, "world.side": 3000.0, "groups": [spread]})
    tau, p_rep = (np.array(scenario.agent_values(*key, 5)) for key in (("b", "tau"), ("p", "p_rep")))
    assert tau.mean() == pytest.approx(1.0, abs=0.01) and tau.std() == pytest.approx(0.1, rel=0.07)
    assert p_rep.mean() == pytest.approx(scenario.parameters.p_rep, abs=0.003)
    assert abs(np.corrcoef(tau, p_rep)[0, 1]) < 0.1
    assert (
        np.array_equal(tau, scenario.agent_values("b", "tau", 5)) and tau[0] != scenario.agent_values("b", "tau", 6)[0]
    )


def test_numbers_of_their_own_that_are_the_same_are_the_plain_flight():
    """Each agent its row, all with the same numbers: the bits of the flight with one record for all."""
    plain, base = flown(), load(PAPER)
    groups = [{"name": "one", "agents": [0], "body": {"tau": 1.5}}, {"name": "rest"}]
    scenario = load(PAPER, {**SMALL, "groups": groups})
    plan = plan_of(scenario, precision=64, record=True, grid=False)
    from dataclasses import replace

    from inside import tables

    numbers = tables(scenario, plan, 3)
    same = replace(numbers, own=np.full_like(numbers.own, base.body.tau))
    assert np.array_equal(cpu.fly_on_cpu(plan, same, device="python").frames, plain.frames)
    assert not np.array_equal(cpu.fly_on_cpu(plan, numbers, device="python").frames, plain.frames)


def test_a_group_measures_by_numbers_of_its_own():
    """Whose receiver is exact believes its true place, though that of others errs; the others' bits stay theirs."""
    exact = [{"name": "exact", "agents": [0, 5], "sensors": {"noise": 0.0}}, {"name": "rest"}]
    apart = {**SMALL, "radio.range": 0.0}
    flights = [airflock.open(load(PAPER, {**apart, "groups": g}), 3, device="python") for g in ([], exact)]
    for flight in flights:
        flight.advance(3.0).sense()
    off = [np.abs(flight.measured - flight.state).max(axis=0) for flight in flights]
    others = [k for k in range(8) if k not in (0, 5)]
    assert (off[1][[0, 5]] == 0.0).all() and (off[0] > 0.0).all()
    assert np.array_equal(off[0][others], off[1][others])
    alone = load(PAPER, {**apart, "sensors.noise": 0.0, "groups": [{"agents": [2], "sensors": {"noise": 0.3}}]})
    assert alone.has_sensor_error and not alone.without_sensor_errors.has_sensor_error


@pytest.mark.parametrize(("agents", "few"), [(4, 1), (7, 1), (30, 6), (100, 20)])
def test_a_group_may_be_a_share_of_any_flock(agents, few):
    keys = {"agents": agents, "start.separation": 0.0, "groups": [{"name": "few", "agents": "20 %"}, {"name": "rest"}]}
    sizes = {group.name: len(group.agents) for group in load(PAPER, keys).groups}
    assert sizes == {"few": few, "rest": agents - few}


@pytest.mark.parametrize(
    ("groups", "said"),
    [
        ([{"agents": float("inf")}], "groups.0..agents = inf is neither a list of agents"),
        ([{"agents": "0 %"}], "groups.0..agents = '0 %' is neither a list of agents, a share such as '20 %', nor"),
        ([{"agents": "120%"}, {}], "groups.0..agents = '120%' is neither a list of agents"),
        ([{"agents": 101}], "is neither a list of agents, a share such as .20 %., nor a number of them up to 100"),
        ([{"agents": [1, 2]}, {"agents": [2]}], "agent 2 is in another group already"),
        ([{"agents": [100]}], "there is no agent 100"),
        ([{"agents": 60}, {"agents": 60}], "up to 40, as many as are left of 100"),
        ([{"name": "a"}, {"name": "b"}], "only one group may take the agents that are left"),
        ([{"model": {"p_rep": -1.0}}], r"groups\[0\].model.p_rep = -1 1/s lies outside"),
        ([{"model": {"p_rep": {"spread": -0.1}}}], "is not a standard deviation"),
        (
            [{"model": {"p_rep": {"spread": {"low": 0.1}}}}],
            r"p_rep.spread = \{.low.: 0.1\} is not a standard deviation",
        ),
        ([{"body": {"kind": "direct"}}], "one body carries all; only numbers differ from group to group"),
        ([{"bodies": {}}], r"groups\[0\].bodies: unknown key"),
        ([{"body": {"delay": 0.4}}], "all bodies follow their commands after one dead time; set body.delay"),
        ([{"sensors": {"period": 1.0}}], "all measure and decide at the same times"),
        ([{"sensors": {"kind": "gnss"}}], "all measure by one sensor; only numbers differ from group to group"),
        ({"a": 1}, "groups is not a list of tables"),
    ],
)
def test_bad_groups_are_one_line_each(groups, said):
    with pytest.raises(ScenarioError, match=said) as found:
        load(PAPER, {"groups": groups})
    assert len(str(found.value).splitlines()) == 1


def test_a_law_that_solves_for_the_whole_flock_has_one_set_of_numbers():
    with pytest.raises(ScenarioError, match="solves for the whole flock, with one set of numbers"):
        load("dimock_2003/published", {"groups": [{"model": {"r_c": 3.0}}]})


def test_faults_of_a_recording_are_told_where_people_look(tmp_path):
    from airflock.recordings.attributes import faults_line, recorded_faults
    from airflock.support.errors import RecordingError

    recording = airflock.simulate(load(PAPER, {**SMALL, "faults": [{"kind": "fails", **ONCE}]}), 1, device="python")
    assert faults_line(recorded_faults(recording)) == "1 fault: fails of agent 2 at 1 s"
    figure = airflock.plots.series(recording)
    assert "fails (2)" in "".join(text.get_text() for axes in figure.axes for text in axes.texts)
    with pytest.raises(RecordingError, match="airflock_faults is damaged"):
        recorded_faults(recording.assign_attrs(airflock_faults='{"faults": [3]}'))


def test_groups_are_scored_alone_and_against_each_other():
    from airflock.support.errors import RecordingError

    groups = [{"name": "left", "agents": 4}, {"name": "right"}]
    start = np.zeros((4, 8))
    start[0, :4], start[0, 4:], start[1] = -30.0, 30.0, np.tile(np.arange(4) * 10.0, 2)
    start[2, :4], start[3, 4:] = 3.0, 3.0  # left flies east, right flies north
    apart = {**OPEN, "radio.range": 0.0, "sensors.noise": 0.0, "body.noise": 0.0, "duration": 1.0, "groups": groups}
    scenario = load(PAPER, {**SMALL, **apart, "model.v_flock": 3.0})
    recording = airflock.simulate(scenario, 1, start=start, device="python")
    table = airflock.score(recording, groups=True)
    assert table.index.tolist() == ["all", "left", "right", "left to right"]
    assert table.loc["left", "phi_corr"] == pytest.approx(1.0) and table.loc["all", "phi_corr"] < 0.6
    between = table.loc["left to right"]
    assert between["phi_between"] == pytest.approx(0.0, abs=1e-6)
    x = recording.position.values[:, :, 0]
    gap = x[:, :, None, 4:] - x[:, :, :4, None]
    assert between["r_between"] == pytest.approx(np.linalg.norm(gap, axis=1).min(), rel=1e-5)
    assert 50.0 < between["r_centres"] < 61.0 and table.attrs["units"]["r_centres"] == "m"
    whole = airflock.score(recording).iloc[0]
    assert table.loc["all", "phi_vel"] == whole["phi_vel"]
    with pytest.raises(RecordingError, match=r"its scenario has no \[\[groups\]\]"):
        airflock.score(airflock.simulate(load(PAPER, SMALL), 1, device="python"), groups=True)


def test_a_group_that_is_never_there_is_a_row_without_numbers(seed):
    """It ended the table of all others with "no individual is present"."""
    groups = [{"name": "gone", "agents": 2}, {"name": "rest"}]
    recorded_faults = [{"kind": "fails", "at": 0.0, "group": "gone"}]
    scenario = load(PAPER, {**SMALL, "duration": 1.0, "groups": groups, "faults": recorded_faults})
    recording = airflock.simulate(scenario, seed, device="python")
    table = airflock.score(recording, groups=True)
    assert table.loc["gone", "present"] == 0.0 and table.loc["gone"].drop("present").isna().all()
    assert table.loc["gone to rest"].isna().all()
    assert table.loc["rest", "phi_vel"] == table.loc["all", "phi_vel"] > 0.0


def test_a_recording_names_the_group_of_each_agent(tmp_path, seed):
    groups = [{"name": "old ones", "agents": [1, 5]}, {"name": "new", "agents": 2}]
    recording = airflock.simulate(load(PAPER, {**SMALL, "duration": 1.0, "groups": groups}), seed, device="python")
    names = ["new", "old ones", "new", "", "", "old ones", *[""] * (recording.sizes["individual"] - 6)]
    assert recording.group.values.tolist() == names and recording.group.dims == ("individual",)
    airflock.save(recording, tmp_path / "a.nc")
    again = airflock.load_recording(tmp_path / "a.nc")
    assert again.coords["group"].equals(recording.coords["group"])
    assert again.position.where(again.group == "new", drop=True).sizes["individual"] == 2
    assert airflock.score(again).equals(airflock.score(recording))
    assert "group" not in airflock.simulate(load(PAPER, {**SMALL, "duration": 1.0}), seed, device="python").coords


def test_what_the_page_shows_works(tmp_path):
    """The examples of docs/faults.md, as they stand there."""
    import re
    from pathlib import Path

    text = (Path(__file__).resolve().parents[2] / "docs" / "faults.md").read_text(encoding="utf-8")
    tables = re.findall(r"```toml\n(.*?)```", text, re.S)
    shown, own = re.findall(r"```python\n(.*?)```", text, re.S)
    path = tmp_path / "mine.toml"
    path.write_text(f"{tables[0]}\n{tables[1]}", encoding="utf-8")
    assert [entry.fault.name for entry in load(path).faults] == ["motor", "gnss_drift"]
    assert load(path).varied == (("p", "p_rep"), ("b", "tau"), ("b", "a_max"))
    known = {}
    exec(shown.replace("seed=1)", 'seed=1, device="python")'), known)
    assert [fault["kind"] for fault in known["flight"].faults] == ["motor"] and known["flight"].present.all()
    for kind in KINDS:
        assert f"`{kind}`" in text, kind
    (tmp_path / "compass.py").write_text(own, encoding="utf-8")
    path.write_text('extends = "vasarhelyi_2018/4ms"\n[[faults]]\nkind = "compass.py"\nat = 1.0\n', encoding="utf-8")
    assert load(path, trust=True).fault_kinds[0].name == "compass"


def test_a_recording_with_gaps_flies_again_to_the_same_bits(tmp_path):
    recording = airflock.simulate(load(PAPER, {**SMALL, "faults": [{"kind": "fails", **ONCE}]}), 1, device="python")
    path = airflock.save(recording, tmp_path / "flight.nc")
    assert "same bits" in str(airflock.validate(path))


def test_a_fault_that_has_waited_for_its_compiler_begins_when_it_is_taken_over(monkeypatch):
    waiting = []

    def later(job):
        waiting.append((Future(), job))
        return waiting[-1][0]

    monkeypatch.setattr(course, "run_in_background", later)
    flight = airflock.open(load(PAPER, SMALL), 1, device="python").advance(1.0)
    flight.fault("motor", [2], wait=False, share=0.0).fault("radio_silent", [1], wait=False).advance(0.5)
    assert flight.waiting and not flight.faults
    future, job = waiting[-1]
    future.set_result(job())
    flight.advance(0.5)
    at_once = airflock.open(load(PAPER, SMALL), 1, device="python").advance(1.5)
    at_once.fault("motor", [2], share=0.0).fault("radio_silent", [1]).advance(0.5)
    assert flight.faults == at_once.faults and len(flight.faults) == 2
    assert np.array_equal(flight.state, at_once.state)


@pytest.mark.parametrize("agents", [[0], [31], [31, 32], [39], [3, 38]])
def test_whoever_suffers_nobody_else_is_flown_otherwise(agents):
    """Loops take the lanes with faults by themselves (blocks of 32). Who is in range is found at 1.2 s anew."""
    flock = {"agents": 40, "duration": 3.0, "start.radius": 60.0}
    plain = flown([], **flock).frames
    sound = flown([{"kind": "motor", "at": 1.03, "lasts": 0.8, "agents": agents, "share": 1.0}], **flock).frames
    dead = flown([{"kind": "motor", "at": 1.03, "agents": agents, "share": 0.0}], **flock).frames
    others = [i for i in range(40) if i not in agents]
    np.testing.assert_allclose(sound, plain, rtol=0.0, atol=1e-9)
    assert np.array_equal(dead[:7, :4, others], plain[:7, :4, others])  # up to 1.2 s, by 0.2 s
    assert (np.abs(dead[8:, :2, agents] - plain[8:, :2, agents]).max(axis=(0, 1)) > 0.0).all()
    stays = dead[7:, 2:4, agents]
    assert np.array_equal(stays, np.repeat(stays[:1], len(stays), axis=0))
