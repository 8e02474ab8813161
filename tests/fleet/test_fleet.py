"""Fleets in lock-step fly what the simulator flies, the same bits each time, and get home whatever fails."""

import errno
import io
import math
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from random import Random

import numpy as np
import pytest

import airflock
from airflock.core import random
from airflock.core.contract import State
from airflock.core.radio import lost
from airflock.drones.mavlink.autopilots import AUTOPILOTS, AutopilotCommands
from airflock.drones.mavlink.frames import common_dialect, frames_in
from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.flight_log import replay
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node_program import open_port, run_node as fly_node
from airflock.fleets import compare
from airflock.fleets.card_document import agent_sensors
from airflock.fleets.drone_faults import INJECTED_KINDS, InjectedFault, read_injected_faults
from airflock.fleets.lockstep import MotionNoise, SensorWords
from airflock.fleets.radio_channel import SOFTWARE_KEY, PacketNumbers, RadioChannel
from airflock.fleets.vehicle import POSITION_GAIN, STANDING_SPEED, SoftwareVehicle
from airflock.parts import RADIOS
from airflock.parts.radios import jitter, links
from airflock.recordings.scores import measure_recording
from airflock.recordings.simulation import simulate
from airflock.support.coordinates import FlightSite
from airflock.support.errors import ScenarioError
from fleets import card, fleet, scenario


def in_the_air(agents, duration, seed=0, faults=(), noisy=False, silent=False, **more):
    """A fleet that starts where the simulated agents start."""
    found = compare.with_metric_period(scenario(agents, duration, noisy, **more), 0.2)
    made = compare.software_card(found, stop_for_lost=silent)
    return compare.fly_in_lockstep(found, made, seed, faults=faults)


# ------------------------------------------------------------------------------------------- beside the simulator


def test_three_drones_fly_the_simulated_flight_for_a_minute():
    """No noise, signed packets of 0.04 mm, MAVLink setpoints: 1 cm after 60 s."""
    flown = in_the_air(3, 60.0)
    apart = compare.divergence(flown, [60.0])
    assert apart.fleet[0] < 0.01
    assert set(flown.phases()) == {MissionPhase.FLOCK} and not flown.log
    assert all(not any(node.refused.values()) for node in flown.nodes)


ODD = [
    {"radio.loss": 0.5, "radio.loss_at": 40.0}, {"radio.kind": "links"}, {"world.dimensions": "3"},
    {"body.delay": 0.35},
]  # fmt: skip


@pytest.mark.parametrize("settings", ODD, ids=str)
def test_with_lossy_radios_and_in_space_too(settings):
    """The ether throws the simulator's dice, so both lose the same packets: 1 cm after 3 s."""
    apart = compare.divergence(in_the_air(3, 3.2, **settings), [3.0], device="python")
    assert apart.fleet[0] < 0.01


@pytest.mark.parametrize("seed", range(5))
def test_ten_drones_are_within_a_centimetre_after_five_seconds(seed):
    """Also where an agent turns round; the simulation leaves itself by 2 to 12 cm after nudges of 1 cm."""
    apart = compare.divergence(in_the_air(10, 5.2, seed), [5.0])
    assert apart.fleet[0] < 0.01 < apart.nudged[0], apart


@pytest.mark.usefixtures("scored_plainly")
def test_the_recording_of_a_fleet_is_measured_like_any_other(tmp_path):
    from airflock.recordings.recording_files import load_recording, save

    flown = in_the_air(4, 4.0, noisy=True)
    made = compare.fleet_recording(flown)
    kept = load_recording(save(made, tmp_path / "fleet.nc"))
    assert measure_recording(kept)[0]["phi_vel"] == pytest.approx(measure_recording(made)[0]["phi_vel"])
    assert set(kept.position.dims) == {"time", "space", "keypoint", "individual"} and "own_position" in kept
    ages = kept.age.values[:, ~np.eye(4, dtype=bool)]  # nobody knows itself from the radio
    assert np.isnan(kept.age.values[:, np.eye(4, dtype=bool)]).all() and np.nanmin(ages) >= 0.0
    assert abs(np.nanmedian(ages) - flown.scenario.radio.delay) <= flown.card.period + 1e-6
    assert np.abs(kept.own_position.values - kept.position.values).max() < 3.0


SAME = "from test_fleet import same_again; import sys; sys.stdout.write(same_again())"


def same_again():
    """Digest of a short flight with every kind of dice."""
    return in_the_air(3, 3.0, 5, noisy=True, **{"radio.loss": 0.5}).digest()


def test_the_same_seed_gives_the_same_bits_in_two_processes():
    here = str(Path(__file__).parent)
    code = f"import sys; sys.path[:0] = [{here!r}, {str(Path(here).parent)!r}]; {SAME}"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    assert told.stdout == same_again() and len(told.stdout) == 64


@pytest.mark.parametrize("kind", ["constant", "links"])
def test_the_ether_loses_the_packets_that_the_simulator_loses(kind):
    """Counted by arrivals: the share that a radio of the simulator lets through at this distance."""
    k = links.Parameters(kind=kind, delay=0.2, loss=0.6 if kind == "constant" else 0.0, loss_at=80.0, far=60.0)
    ether = RadioChannel(RADIOS[kind], k, [1, 2], 3, 0.2)
    at, count = [(0.0, 0.0, 0.0), (70.0, 0.0, 0.0)], 4000
    heard = 0
    for step in range(count):
        ether.send(0.2 * step, 0, b"x")
        heard += len(list(ether.deliver(0.2 * step + 0.2, at)))
    if kind == "constant":
        share = 1.0 - lost(70.0, k)
    else:
        fast, slow = (links.received(70.0, float(link), k) for link in (0, 1))
        share = 1.0 - (1.0 - fast) ** 2 * (0.8 + 0.2 * (1.0 - slow))  # the slow link sends in each fifth period
    assert heard / count == pytest.approx(share, abs=0.03)


def test_the_ether_brings_packets_as_late_as_the_radio_says():
    k = jitter.Parameters(delay=0.2, jitter=0.3, longest=9.0)
    ether, at, late = RadioChannel(RADIOS["jitter"], k, [1, 2], 3, 0.1), [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0)], []
    for step in range(2000):
        ether.send(0.1 * step, 0, str(step).encode(), at)
    for tick in range(21_000):
        late += [0.01 * tick - 0.1 * int(data) - 0.2 for _, data in ether.deliver(0.01 * tick, at)]
    assert len(late) == 2000 and min(late) > -1e-6
    assert sum(late) / len(late) == pytest.approx(0.3 + 0.005, rel=0.1)  # looked for every 10 ms


@pytest.mark.parametrize("three", [False, True])
def test_outer_noise_of_a_block_is_that_of_each_step(three):
    noise, seed = MotionNoise(2**40 + 7, 3, three), 2**40 + 7
    for step in (0, 1, 2, 255, 256, 1001, 4096):
        for drone in range(3):
            words = random.random_words(seed, random.OUTER, 0, step if three else step // 2, drone)
            four = (*random.normal_pair(*words[:2]), *random.normal_pair(*words[2:]))
            flat = (*(four[2:] if step % 2 else four[:2]), 0.0)
            assert noise(step, drone) == (four[:3] if three else flat)


def test_words_of_a_block_are_those_of_each_measurement():
    words = SensorWords(2**40 + 7, 3)
    for number in (0, 1, 15, 16, 4097):
        for drone in range(3):
            for draw in (0, 1):
                assert words(number, draw, drone) == random.random_words(
                    2**40 + 7, random.SENSOR, 0, number, drone, draw
                )


def test_numbers_of_a_block_of_packets_are_those_of_each_pair():
    drawn, seed = PacketNumbers(2**40 + 7, 6), 2**40 + 7
    for number in (0, 1, 15, 16, 4097):
        for to in range(6):
            for who in range(6):
                assert drawn(number, to, who) == random.pair_uniform(seed, random.PACKET, 0, number, to, who, 6)


# ----------------------------------------------------------------------------------------------- single drones differ


def start_of(found, seed):
    """Where the simulated agents of a seed start, (component, agent)."""
    return np.array([[*s[:2], *s[3:5]] for s in compare.simulated_start(found, seed)]).T


WEAK = [{"name": "slow", "agents": 1, "model": {"v_flock": 2.0}, "body": {"tau": {"value": 1.4, "spread": 0.1}}},
        {"name": "rest"}]  # fmt: skip
OTHER = [{"name": "other", "agents": [1], "model": {"kind": "viragh_2014", "v_flock": 3.0}}, {"name": "rest"}]
BEFALLEN = {
    "groups": {"groups": WEAK},
    "law of a group": {"groups": OTHER},
    "weak motor": {"faults": [{"kind": "motor", "at": 1.0, "agents": [1]}]},
    "drift": {"faults": [{"kind": "gnss_drift", "at": 1.0, "agents": [0]}]},
    "deaf": {"faults": [{"kind": "radio_deaf", "at": 0.5, "lasts": 1.5, "agents": [2]}]},
    "stuck": {"faults": [{"kind": "stuck", "at": 2.0, "agents": [2]}]},
    "pretender": {"faults": [{"kind": "pretender", "at": 1.0, "agents": [1], "east": -6.0}]},
    "frozen radio": {"faults": [{"kind": "radio_frozen", "at": 1.0, "lasts": 3.0, "agents": [1]}]},
}


@pytest.mark.parametrize("name", BEFALLEN)
def test_groups_and_faults_of_a_scenario_act_on_a_fleet_as_in_the_simulator(name):
    """Each changes the flight by more than 20 cm within 5 s, and the fleet is within 5 cm of the changed simulation."""
    seed, settings = 1, BEFALLEN[name]
    crowd = {"world.side": 60.0, "start.separation": 6.0}
    found, plain = (compare.with_metric_period(scenario(3, 5.2, **crowd, **more), 0.2) for more in (settings, {}))
    flown = compare.fly_in_lockstep(found, compare.software_card(found, stop_for_lost=False, seed=seed), seed)
    unlike = compare.fly_in_lockstep(plain, compare.software_card(plain, stop_for_lost=False), seed)
    assert np.abs(flown.array()[:, :, :2] - unlike.array()[:, :, :2]).max() > 0.2
    assert compare.divergence(flown, [5.0], device="python").fleet[0] < 0.05


def test_numbers_of_each_member_stand_on_the_card():
    made = compare.software_card(scenario(3, groups=WEAK), seed=1)
    assert [made.pilot(who).p.v_flock for who in made.members] == [2.0, 4.0, 4.0]
    taus = [made.pilot(who).b.tau for who in made.members]
    assert taus[0] != 1.4 and taus[1:] == [1.0, 1.0]
    real = card(scenario(3, groups=WEAK))
    assert real.pilot(1).b.tau == 1.4, "a real drone brings its own tolerance"
    with pytest.raises(ScenarioError, match=r"groups are of 3 agents, and 5 drones are to fly; set agents = 5"):
        card(scenario(3, groups=WEAK), members=range(1, 6))


def test_each_drone_measures_by_the_numbers_of_its_group():
    groups = [{"name": "poor", "agents": [1], "sensors": {"noise": {"value": 1.0, "spread": 0.1}}}]
    found = scenario(3, groups=groups)
    noise = [s.noise for s in agent_sensors(found, 3, 5)]
    assert noise == found.agent_values("s", "noise", 5) and noise[0] == noise[2] != noise[1] != 1.0


def test_laws_of_members_stand_on_the_card():
    made = card(scenario(3, groups=OTHER))
    assert [made.pilot(who).model.name for who in made.members] == ["vasarhelyi_2018", "viragh_2014", "vasarhelyi_2018"]
    assert [made.pilot(who).p.v_flock for who in made.members] == [4.0, 3.0, 4.0]
    assert made.groups == ()  # neither law asks for them


def test_whoever_stays_flies_on_what_a_drone_sent_before_it_dropped_out():
    """As in a simulation from which it drops out later by the delay: until then its last packets are on their way."""
    crowd = {"world.side": 60.0, "start.separation": 6.0}

    def without(at):
        return compare.with_metric_period(
            scenario(3, 6.0, **crowd, faults=[{"kind": "fails", "at": at, "agents": [1]}]), 0.2
        )

    found = without(1.0)
    flown = compare.fly_in_lockstep(found, compare.software_card(found, stop_for_lost=False), 1).array()[:, :, :2]
    known = [
        simulate(without(1.0 + later), 1, precision=64, start=start_of(found, 1), device="python")
        .position.transpose("time", "individual", "space", "keypoint").values.reshape(-1, 3, 2)
        for later in (found.radio.delay, 0.0)
    ]  # fmt: skip
    apart = [np.abs(flown[: len(one)] - one)[:, [0, 2]].max() for one in known]
    assert apart[0] < 0.05 < 0.5 < apart[1]


@pytest.mark.parametrize("fault", [{"kind": "fails", "at": 2.0}, {"kind": "battery", "at": 1.0, "endurance": 1.0}])
def test_a_drone_that_drops_out_falls_silent_and_comes_down(fault):
    found = compare.with_metric_period(scenario(3, 12.0, faults=[{**fault, "agents": [1]}]), 0.2)
    flown = compare.fly_in_lockstep(found, compare.software_card(found, stop_for_lost=False), 1)
    rows = flown.array()
    assert np.isfinite(rows[:10, 1]).all() and np.isnan(rows[10:, 1]).all() and np.isfinite(rows[:, [0, 2]]).all()
    assert flown.vehicles[1].state.z == 0.0 and not flown.vehicles[1].armed and flown.vehicles[0].state.z > 5.0
    assert flown.packet_ages()[-1, [0, 2], 1].min() > 8.0, "nothing was sent after 2 s"
    assert [(t, who) for t, who, note in flown.log if "drops out" in note] == [(2.0, 2)]
    assert measure_recording(compare.fleet_recording(flown))[0]["present"] == pytest.approx(
        (3 * 10 + 2 * (len(rows) - 10)) / (3 * len(rows))
    )


def test_who_pretends_lies_to_the_others_alone():
    """The packet is signed and of the same time; only the position in it is another one."""
    found = compare.with_metric_period(
        scenario(2, 3.0, faults=[{"kind": "pretender", "at": 1.0, "agents": [1], "east": 7.0}]), 0.2
    )
    flown = compare.fly_in_lockstep(found, compare.software_card(found, stop_for_lost=False), 1)
    peer, late = flown.nodes[0].peers.all[2], flown.packet_ages()[-1, 0, 1]
    true = flown.array()[-1 - round(late / 0.2), 1]
    assert peer.state is not None and peer.state.x - true[0] == pytest.approx(7.0, abs=0.01)
    assert peer.state.y == pytest.approx(true[1], abs=0.01)
    assert flown.array()[-1, 1, 9] == pytest.approx(flown.array()[-1, 1, 0], abs=0.01), "it knows where it is"
    assert sum(flown.nodes[0]._receiver.refused.values()) == 0


def test_a_vehicle_without_motors_lies_on_the_ground_whatever_it_is_asked():
    """It fell through the ground where it was asked to climb."""
    v = vehicle()
    v.state, v.armed, v.mode, v.motor = State(0.0, 0.0, 3.0, 0.0, 0.0, 0.0), True, "OURS", False
    for k in range(1500):
        v.target, v.setpoint_at = (0.0, 0.0, 2.0), 0.01 * k
        v.step(0.01 * k, 0.01)
    assert v.state.z == 0.0


# ------------------------------------------------------------------------------------------------ whole missions


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_drones_that_take_off_beside_each_other_keep_apart(kind, seed):
    """Each keeps its place by a position that is off by a metre, and drifts; all start at the first order."""
    f = fleet(scenario(6, noisy=True), seed, autopilot=kind)
    f.advance(10.0)
    f.order(OrderKind.START, at=10.0)
    f.advance(35.0)
    assert set(f.phases()) <= {MissionPhase.GATHER, MissionPhase.FLOCK}, (seed, f.log[-6:])
    at = f.array()[:, :, :3]
    gaps = np.linalg.norm(at[:, :, None] - at[:, None], axis=-1) + 1e3 * np.eye(6)
    assert gaps.min() > 3.0, (seed, gaps.min())


@pytest.mark.parametrize(("apart", "errors", "starts"), [
    (4.0, (0.3, 0.3), True), (4.0, (0.7, 0.7), False), (4.0, (0.2, 1.2), False), (8.0, (2.0, 2.0), True),
])  # fmt: skip
def test_drones_arm_only_if_they_stand_apart_whatever_the_errors_of_their_positions(apart, errors, starts):
    f = fleet(scenario(2))
    for x, error, v in zip((0.0, apart), errors, f.vehicles, strict=True):
        v.state, v.accuracy = v.state._replace(x=x, y=0.0), error
    f.advance(10.0)
    assert (set(f.phases()) == {MissionPhase.CLEARED}) == starts
    missing = [note for _, _, note in f.log if "stands 4.0 m away; needs 3 m and the accuracy of both" in note]
    assert bool(missing) != starts


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_a_whole_mission_from_the_ground_and_back(kind):
    f = fleet(scenario(3, 300.0, **{"radio.delay": 0.2}), autopilot=kind)
    f.advance(10.0)
    assert set(f.phases()) == {MissionPhase.CLEARED} and not any(v.armed for v in f.vehicles)
    f.order(OrderKind.START, at=10.0)
    f.advance(45.0)
    assert set(f.phases()) == {MissionPhase.FLOCK} and min(v.state.z for v in f.vehicles) > 15.0
    f.order(OrderKind.HOLD, target=2)
    f.advance(6.0)
    assert f.nodes[1].phase == MissionPhase.HOLD and math.hypot(*f.vehicles[1].state[3:]) < 0.3
    f.order(OrderKind.RESUME, target=2)
    f.advance(8.0)
    assert f.nodes[1].phase == MissionPhase.FLOCK
    f.order(OrderKind.RETURN)
    f.advance(110.0)
    assert set(f.phases()) == {MissionPhase.DONE} and not any(v.armed for v in f.vehicles)
    rows = f.array()
    gaps = np.linalg.norm(rows[:, :, None, :3] - rows[:, None, :, :3], axis=-1) + 1e9 * np.eye(3)
    assert gaps.min() > 1.5
    for v in f.vehicles:
        assert math.dist(v.state[:3], v.home) < 3.0


def grounded(faults, seconds=60.0, **more):
    """A mission of three with faults, which begin after 55 s in the air; phases that each drone went through."""
    f = fleet(scenario(3, 600.0, **{"radio.delay": 0.2}), faults=faults, **more)
    f.advance(10.0)
    f.order(OrderKind.START, at=10.0)
    f.advance(45.0 + seconds)
    return f


FAULTS = [
    (InjectedFault("pilot", (2,), 56.0), {2: MissionPhase.MANUAL}, "mode is not ours"),
    (InjectedFault("gnss", (2,), 56.0), {2: MissionPhase.DONE}, "no position for too long"),
    (InjectedFault("battery", (2,), 56.0, amount=20.0), {2: MissionPhase.DONE}, "just enough for the way home"),
    (InjectedFault("battery", (2,), 56.0, amount=5.0), {2: MissionPhase.DONE}, "battery is critical"),
    (
        InjectedFault("outage", (), 56.0),
        {1: MissionPhase.DONE, 2: MissionPhase.DONE, 3: MissionPhase.DONE},
        "nobody has been heard for too long",
    ),
]


@pytest.mark.parametrize(("fault", "ends", "line"), FAULTS, ids=lambda v: getattr(v, "kind", ""))
def test_what_fails_ends_as_the_table_says(fault, ends, line):
    f = grounded([fault], 110.0)
    assert any(line in note for _, who, note in f.log if who in ends), f.log[-9:]
    for who, phase in ends.items():
        assert f.nodes[who - 1].phase == phase, f.log[-9:]
    others = {node.phase for node in f.nodes if node.member not in ends}
    assert others <= {MissionPhase.FLOCK, MissionPhase.HOLD, MissionPhase.RETURN, MissionPhase.LAND, MissionPhase.DONE}


def test_silence_does_not_end_in_a_collision():
    """15 s in which nobody hears anybody: with the rule of silence no two drones meet, without it they do."""
    mute, lows = (InjectedFault("outage", (), 5.0, 20.0),), {}
    for silent in (True, False):
        rows = in_the_air(10, 20.0, 3, mute, noisy=True, silent=silent).array()[25:, :, :3]
        gaps = np.linalg.norm(rows[:, :, None] - rows[:, None], axis=-1) + 1e9 * np.eye(10)
        lows[silent] = float(gaps.min())
    assert lows[True] > 3.0 > lows[False]


def test_a_drone_that_hovers_out_of_range_does_not_make_others_stop_in_the_flock():
    """Its clock is wrong, so it holds; who stopped for it 15 s after it was lost stood where others flew."""
    rows = in_the_air(10, 34.2, 15, (InjectedFault("clock", (2,), amount=0.5),), noisy=True, silent=True).array()[
        100:, :, :3
    ]
    gaps = np.linalg.norm(rows[:, :, None] - rows[:, None], axis=-1) + 1e9 * np.eye(10)
    assert gaps.min() > 3.0, "0.73 m where it was taken to come at twice the flock's speed"


@pytest.mark.parametrize(("kind", "seconds"), [("px4", 30.0), ("ardupilot", 48.0)])
def test_whose_node_died_lands_while_the_others_stand(kind, seconds):
    """PX4 sinks a second after the last setpoint, ArduPilot nine after the last heartbeat; the others wait for 20 s."""
    found = compare.with_metric_period(scenario(4, seconds, noisy=True), 0.2)
    card = compare.software_card(found, stop_for_lost=True, vehicle=kind)
    f = compare.fly_in_lockstep(found, card, 3, faults=(InjectedFault("node", (2,), 5.0),))
    at = f.array()[round(25.0 / card.period), 1]
    assert at[2] < 8.0, "when it is given up it is far below the flock"
    assert f.vehicles[1].mode == "LAND" and not f.vehicles[1].armed
    assert f.vehicles[1].state.z == 0.0


def test_who_holds_stays_where_it_came_to_stand():
    """A minute of outer noise does not carry it away: by its own navigation it is where it was."""
    found = compare.with_metric_period(scenario(2, 60.0, noisy=True), 0.2)
    f = fleet(found, 1, start=compare.simulated_start(found, 1))
    f.advance(1.0)
    f.order(OrderKind.HOLD)
    f.advance(10.0)
    stands = [v.measured for v in f.vehicles]
    f.advance(60.0)
    assert set(f.phases()) == {MissionPhase.HOLD}
    for before, v in zip(stands, f.vehicles, strict=True):
        assert math.dist(before[:2], v.measured[:2]) < 1.5


def test_a_clock_that_is_half_a_second_off_never_starts():
    f = fleet(scenario(3, 300.0, **{"radio.delay": 0.2}), faults=[InjectedFault("clock", (2,), amount=0.5)])
    f.advance(10.0)
    f.order(OrderKind.START, at=10.0)
    f.advance(20.0)
    assert f.nodes[1].phase == MissionPhase.READY and not f.vehicles[1].armed
    assert any("missing: clock: -0.50 s" in note for _, who, note in f.log if who == 2), f.log


def test_who_forges_packets_changes_nothing_without_the_key_and_little_with_it():
    """Without: the same bits. With: what jumps is refused, and the drone itself tells that it has a double."""
    settings = {"radio.delay": 0.2, "world.side": 60.0, "start.separation": 6.0}
    plain = in_the_air(3, 5.0, **settings)
    rogue = in_the_air(3, 5.0, faults=(InjectedFault("rogue", (2,), 1.0, amount=30.0),), **settings)
    assert rogue.digest() == plain.digest() and rogue.nodes[0].refused["signature"] > 10
    impostor = in_the_air(3, 5.0, faults=(InjectedFault("impostor", (2,), 1.0, amount=30.0),), **settings)
    assert impostor.nodes[0].refused["jump"] > 10 and impostor.nodes[0].peers.all[2].state is not None
    assert math.dist(impostor.nodes[0].peers.all[2].state[:2], impostor.vehicles[1].state[:2]) < 5.0
    assert any("another sender signs as member 2" in note for _, who, note in impostor.log if who == 2)
    near = in_the_air(3, 5.0, faults=(InjectedFault("impostor", (2,), 1.0, amount=3.0),), **settings)
    assert near.digest() != plain.digest(), "what is plausible is believed: the key is what is trusted"


def test_faults_are_checked_at_once(tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text('[[fault]]\nkind = "outage"\nwho = [1, 3]\nbegin = 5\nend = 9.5\n')
    assert read_injected_faults(path, (1, 2, 3)) == (InjectedFault("outage", (1, 3), 5, 9.5),)
    path.write_text('x = 1\n[[fault]]\nkind = "storm"\n[[fault]]\nkind = "loss"\nwho = [9]\nwhom = 1\namount = 2.0\n')
    with pytest.raises(ScenarioError) as fault:
        read_injected_faults(path, (1, 2, 3))
    for part in ("x is not known", f"none of {', '.join(INJECTED_KINDS)}", "who = [9]", "whom is not known"):
        assert any(part in line for line in fault.value.errors), part
    path.write_text("[[fault")
    with pytest.raises(ScenarioError):
        read_injected_faults(path, (1,))
    path.write_text('[[fault]]\nkind = "clock"\namount = 3.0\nbegin = 10\n')  # it would be wrong from 0 s on
    with pytest.raises(ScenarioError, match="leave out begin and end"):
        read_injected_faults(path, (1,))


# ------------------------------------------------------------------------------------------------------- vehicles


def vehicle(kind="px4"):
    found = scenario(1)
    return SoftwareVehicle(kind, 1, FlightSite(47.5, 19.0, 120.0), (0.0, 0.0, 0.0), found.body.rule, found.body.numbers)


@pytest.mark.parametrize(("kind", "travels"), [("px4", (6.0, 9.0)), ("ardupilot", (6.0, 9.0))])
def test_after_the_last_setpoint_a_vehicle_stops_within_its_time_out(kind, travels):
    """At 4 m/s: 1 s of time-out and 1 s of relaxation."""
    v = vehicle(kind)
    v.state, v.armed, v.mode = State(0.0, 0.0, 20.0, 4.0, 0.0, 0.0), True, "OURS"
    v.target, v.setpoint_at = (4.0, 0.0, 0.0), 0.0
    for k in range(1500):
        v.step(0.01 * k, 0.01)
    assert travels[0] < v.state.x < travels[1]
    assert v.mode == ("LAND" if kind == "px4" else "OURS")


@pytest.mark.parametrize(("kind", "mode"), [("px4", "LAND"), ("ardupilot", "HOLD"), ("px4", "PILOT")])
def test_an_autopilot_holds_its_place_where_it_hovers_or_lands(kind, mode):
    """It brakes from 4 m/s, and then is a damped spring in white noise: variance D τ² / gain along each axis."""
    found, rng = scenario(1, noisy=True), np.random.default_rng(7)

    def noise(step):
        return tuple(rng.standard_normal(3).tolist())

    v = SoftwareVehicle(
        kind, 1, FlightSite(47.5, 19.0, 120.0), (0.0, 0.0, 0.0), found.body.rule, found.body.numbers, noise
    )
    v.state, v.armed, v.mode = State(0.0, 0.0, 900.0, 4.0, 0.0, 0.0), True, mode
    rows = []
    for k in range(40_000):
        v.step(0.01 * k, 0.01)
        rows.append(v.state)
    stood = next(k for k, s in enumerate(rows) if math.hypot(s.vx, s.vy) < STANDING_SPEED)
    assert 1.0 < rows[stood].x < 5.0
    off = np.array([(s.x - rows[stood].x, s.y - rows[stood].y) for s in rows[stood:]])
    assert np.mean(off**2) == pytest.approx(found.body.noise * found.body.tau**2 / POSITION_GAIN, rel=0.25)
    assert 900.0 - rows[-1].z == pytest.approx(400.0 if mode == "LAND" else 0.0, abs=60.0)


def test_an_autopilot_does_not_hold_a_place_by_a_navigation_that_stands_still():
    v = vehicle()
    v.state, v.armed, v.mode = State(0.0, 0.0, 90.0, 0.0, 0.0, 0.0), True, "HOLD"
    v.step(0.0, 0.01)
    v.frozen_state = v.measured
    v.state = v.state._replace(x=30.0)
    assert v.autopilot_velocity() == (0.0, 0.0, 0.0)
    v.frozen_state = None
    assert v.autopilot_velocity() == pytest.approx((-1.0, 0.0, 0.0)), "back to its place, at most at a metre a second"


@pytest.mark.parametrize(("action", "mode"), [(3, "RTL"), (4, "LAND"), (5, "HOLD")])
def test_px4_does_what_its_parameter_says_when_setpoints_end(action, mode):
    v = vehicle()
    v.parameters["COM_OBL_RC_ACT"] = action
    v.state, v.armed, v.mode, v.setpoint_at = State(0.0, 0.0, 20.0, 4.0, 0.0, 0.0), True, "OURS", 0.0
    v.step(0.9, 0.01)
    assert v.mode == "OURS"
    v.step(1.1, 0.01)
    assert v.mode == mode


@pytest.mark.parametrize(("action", "mode"), [(0, "OURS"), (1, "RTL"), (5, "LAND"), (7, "HOLD")])
def test_ardupilot_does_what_its_parameter_says_when_heartbeats_end(action, mode):
    """Five seconds after the last heartbeat of its own station, and of no other."""
    v, say, stranger = (
        vehicle("ardupilot"),
        AutopilotCommands(AUTOPILOTS["ardupilot"], 1),
        AutopilotCommands(AUTOPILOTS["ardupilot"], 9),
    )
    v.parameters["FS_GCS_ENABLE"] = action
    v.state, v.armed, v.mode = State(0.0, 0.0, 20.0, 0.0, 0.0, 0.0), True, "OURS"
    v.step(60.0, 0.01)
    assert v.mode == "OURS", "nobody has ever been there"
    v.receive(say.heartbeat(), 60.0)
    v.receive(stranger.heartbeat(), 63.0)
    v.step(64.9, 0.01)
    assert v.mode == "OURS"
    v.step(65.1, 0.01)
    assert v.mode == mode


def test_a_vehicle_whose_navigation_is_frozen_still_stops():
    """Its controller keeps the velocity of inertial sensors; by the frozen one it would gain speed without end."""
    v = vehicle()
    v.state, v.armed, v.mode = State(0.0, 0.0, 20.0, 4.0, 0.0, 0.0), True, "OURS"
    v.frozen_state = v.measured
    for k in range(600):
        v.setpoint_at = 0.01 * k
        v.step(0.01 * k, 0.01)
    assert v.measured == State(0.0, 0.0, 20.0, 4.0, 0.0, 0.0), "what it tells stands still"
    assert abs(v.state.vx) < 0.1 and 2.0 < v.state.x < 8.0


def test_px4_takes_our_mode_only_after_a_second_of_setpoints():
    v, say = vehicle(), AutopilotCommands(AUTOPILOTS["px4"], 1)

    def result(data, now):
        return [f.values()["result"] for f in frames_in(v.receive(data, now)) if f.message == 77]

    assert result(say.set_mode(AUTOPILOTS["px4"].ours), 0.0) == [2]
    for k in range(25):
        v.receive(say.velocity((0.0, 0.0, 0.0), 0), 0.05 * k)
    assert result(say.set_mode(AUTOPILOTS["px4"].ours), 1.2) == [0] and v.mode == "OURS"
    assert result(say.set_mode(12345), 1.2) == [2]


def test_a_vehicle_takes_any_bytes_and_only_finite_setpoints():
    v, rng, say = vehicle(), Random(4), AutopilotCommands(AUTOPILOTS["px4"], 1)
    for _ in range(300):
        v.receive(rng.randbytes(rng.randrange(300)), 0.0)
    pack = common_dialect()
    bad = pack.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0x0DC7, 0, 0, 0, math.nan, 0, 0, 0, 0, 0, 0, 0)
    v.receive(bytes(600) + say._pack(bad), 0.0)
    assert v.target == (0.0, 0.0, 0.0) and v.setpoint_at < 0.0


# ---------------------------------------------------------------------------------------------- on the real clock


def free_ports(count):
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def test_a_node_on_sockets_gets_ready_and_its_log_is_flown_again(tmp_path):
    """One node and one vehicle on UDP until the node is ready, or for 20 s; then its log gives the same outputs."""
    found = scenario(1, 60.0)
    made = card(found, members=[1])
    node_port, vehicle_port, radio_port, far_port = free_ports(4)
    craft = vehicle()
    craft.start_time = time.time_ns() // 1000
    begun, log, said = time.monotonic(), io.StringIO(), []
    line = open_port(f"udp:127.0.0.1:{vehicle_port}>127.0.0.1:{node_port}")
    ports = [
        open_port(f"udp:127.0.0.1:{node_port}>127.0.0.1:{vehicle_port}"),
        open_port(f"udp:127.0.0.1:{radio_port}>127.0.0.1:{far_port}"),
    ]

    over = threading.Event()

    def live():
        while not over.wait(0.02):
            now = time.monotonic() - begun
            for data in line.read():
                line.write(craft.receive(data, now))
            line.write(craft.due_telemetry(now))

    beside = threading.Thread(target=live)
    beside.start()
    try:
        fly_node(
            made, 1, SOFTWARE_KEY, ports, tmp_path / "memory", log, said.append,
            has_ended=lambda: any("CLEARED" in s for s in said) or time.monotonic() - begun > 20.0,
        )  # fmt: skip
    finally:
        over.set()
        beside.join()
    for port in (*ports, line):
        port.close()
    assert any("READY → CLEARED" in text for text in said), said
    assert not craft.armed
    ticks = list(replay(log.getvalue().splitlines(), made, SOFTWARE_KEY))
    assert ticks and all(tick.same for tick in ticks)
    assert (tmp_path / "memory").exists()


def test_a_full_disk_does_not_bring_a_drone_down(tmp_path):
    """Its log and its memory can no longer be written: it says so, once for each, and ticks on."""

    class Full(io.StringIO):
        def write(self, text):
            if self.tell() + len(text) > 2000:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return super().write(text)

    ports, said, log = [open_port(f"udp:127.0.0.1:{number}") for number in free_ports(2)], [], Full()
    begun = time.monotonic()
    fly_node(
        card(scenario(1, 60.0), members=[1]), 1, SOFTWARE_KEY, ports, tmp_path / "absent" / "memory", log, said.append,
        has_ended=lambda: len([s for s in said if "goes on" in s]) >= 2
        or time.monotonic() - begun > 20.0,
    )  # fmt: skip
    for port in ports:
        port.close()
    told = [text for text in said if "goes on without it" in text]
    assert len(told) == 2 and any("log" in t and "No space" in t for t in told) and any("memory" in t for t in told)
    assert "ticks" in said[-1] and len(log.getvalue()) <= 2000


@pytest.mark.usefixtures("scored_plainly")
def test_a_fleet_in_python_is_that_of_the_command(monkeypatch):
    import json

    from typer.testing import CliRunner

    import airflock
    from airflock.cli.main import app
    from airflock.support.errors import ScenarioError

    # the simulator beside both flies interpreted: tests above have it compiled
    monkeypatch.setattr(compare, "simulate", lambda *given, **named: simulate(*given, **named | {"device": "python"}))
    small = {"agents": 3, "duration": 2.0}
    found = airflock.fleet("vasarhelyi_2018/real_4ms", seeds=[4, 5], settings=small, beside=True)
    words = "vasarhelyi_2018/real_4ms --agents 3 --duration 2 --seeds 2 --first-seed 4 --against simulator --json"
    told = json.loads(CliRunner().invoke(app, ["fleet", *words.split()]).stdout)
    assert [run["sha256"] for run in told["runs"]] == [run["sha256"] for run in found.runs]
    assert [line["name"] for line in told["comparison"]] == [line.name for line in found.comparison]
    assert found.table.attrs["units"]["phi_vel"] == "m/s" and found.divergence.times
    with pytest.raises(
        ScenarioError, match=r"vehicle = 'px5' is none of px4, ardupilot; did you mean px4\?\n.*\n.*rad"
    ):
        airflock.fleet("vasarhelyi_2018/real_4ms", vehicle="px5", card="c.json", settings={"radio.dela": 1.0})


@pytest.mark.parametrize(("vehicle", "body", "settings", "flown"), [
    ("ardupilot", None, {}, "autopilot"), ("px4", None, {}, "multirotor"),
    ("ardupilot", "multirotor", {}, "multirotor"),
    ("ardupilot", None, {"body.tau": 1.5}, "multirotor"), ("px4", "autopilot", {}, "autopilot"),
])  # fmt: skip
def test_imitations_of_ardupilot_move_as_it_was_measured_unless_another_body_is_meant(vehicle, body, settings, flown):
    few = {"agents": 2, "duration": 0.4, "world.side": 120.0}
    found = airflock.fleet("vasarhelyi_2018/real_4ms", settings=few | settings, vehicle=vehicle, body=body)
    assert found.scenario.body.rule.name == flown
    if flown == "autopilot":
        b = found.scenario.body
        assert (b.delay, b.tau, b.a_max, b.jerk) == (0.4, 1.2, 2.5, 5.0)
        assert any("numbers of the file's multirotor are left out" in note for note in found.scenario.notes)
