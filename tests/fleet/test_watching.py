"""Watching a fleet: what an observer believes and what not, what the ether tells, cards that are written."""

import os
import random
import threading
import time
from hashlib import sha256

import numpy as np
import pytest
from typer.testing import CliRunner

import airflock
from airflock.cli.main import app
from airflock.core.agent import State
from airflock.drones.mavlink.messages import (
    CHANNEL_SYSTEM,
    FAULTS_ON_THE_WIRE,
    NAMED_REPORT,
    parse_report,
    report_message,
    text_messages,
)
from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.mavlink.signing import PacketSigner, write_key
from airflock.drones.onboard.card import read_card
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node_program import UdpAddresses, UdpPort
from airflock.drones.onboard.peers import HEARD_WITHIN
from airflock.fleets import compare
from airflock.fleets.drone_faults import INJECTED_KINDS, DroneFaults, InjectedFault
from airflock.fleets.fleet_observer import FleetObserver, TelemetryBroadcast, scenario_fault_name
from airflock.fleets.lockstep import START_TIME, OperatorStation, write_card_and_key
from airflock.fleets.radio_channel import SOFTWARE_KEY, RadioChannel
from airflock.fleets.realtime import fly_in_realtime
from airflock.parts import FAULTS
from airflock.studio.fleet_page import drone_html, faults_html, fleet_warning, members_html, notes_html
from airflock.studio.live_page import open_card_and_radios
from airflock.support.errors import AirflockError, CardError, StudioError
from airflock.view.scene import card_scene
from fleets import PRIVATE, card, fleet, scenario

START = [State(20.0 * i, 0.0, 0.0, 2.0, 0.0, 0.0) for i in range(3)]


def watched(seconds=0.0, key=SOFTWARE_KEY, **more):
    """A fleet of three in lock-step, and somebody who will watch it from now on."""
    f = fleet(scenario(3), start=START, **more)
    f.advance(seconds)
    return f, FleetObserver(f.card, key, now=f.now, utc=START_TIME + round(f.now * 1e6) - 1)


def said(f):
    return [datagram for node in f.nodes for datagram in node.status_datagrams(f.now)]


def listen(f, observer, seconds):
    """Fly on; the observer hears all packets, as they are sent."""
    for _ in range(round(seconds / 0.2)):
        for datagram in said(f):
            observer.take(datagram, f.now)
        observer.look(f.now)
        f.advance(0.2)


def test_drones_are_where_they_say_and_carried_on_between_packets():
    f, observer = watched()
    listen(f, observer, 3.0)
    for vehicle, member in zip(f.vehicles, f.card.members, strict=True):
        place = observer.place(member, f.now)
        assert np.linalg.norm(np.subtract(place, vehicle.state[:3])) < 0.5
        assert observer.peers[member].phase == MissionPhase.FLOCK
    assert observer.heard(f.now) == [1, 2, 3] and observer.flying(f.now) == [1, 2, 3] and not observer.refused
    assert [note.text for note in observer.notes] == ["heard, FLOCK"] * 3


@pytest.mark.parametrize(
    ("reason", "bent"),
    [
        ("signature", lambda data: data[:30] + bytes([data[30] ^ 1]) + data[31:]),
        ("stranger", lambda data: data[:5] + b"\x63" + data[6:]),
        ("replay", lambda data: data),
        ("short", lambda data: data[:9]),
    ],
)
def test_what_is_forged_or_replayed_changes_nothing(reason, bent):
    f, observer = watched()
    listen(f, observer, 0.4)
    first = said(f)[0]
    observer.take(first, f.now)
    known, notes = observer.peers[1].status, len(observer.notes)
    observer.take(bent(first), f.now)
    assert observer.peers[1].status == known and len(observer.notes) == notes and observer.refused == {reason: 1}


def test_any_bytes_are_refused_without_a_change(n=300):
    rng, (f, observer) = random.Random(7), watched()
    genuine = said(f)
    for _ in range(n):
        data = bytearray(rng.choice(genuine) if rng.random() < 0.5 else rng.randbytes(rng.randrange(120)))
        for _ in range(rng.randrange(1, 4) if data else 0):
            data[rng.randrange(len(data))] = rng.randrange(256)
        if bytes(data) not in genuine:
            observer.take(bytes(data), f.now)
    assert not observer.accepted_count and not observer.notes, "seed 7"
    for datagram in genuine:
        observer.take(datagram, f.now)
    assert observer.accepted_count == 3


def test_why_a_drone_does_something_stands_on_the_page_once_in_its_own_words():
    f, observer = watched()
    text = "a<b> & " + "x" * 80
    f.nodes[1].autopilot_link.lines.append(text)
    for _ in range(5):
        f.advance(0.2)
        for node in f.nodes:
            for datagram in (*node.status_datagrams(f.now), *node.tick(f.now).texts):
                observer.take(datagram, f.now)
    assert [note.text for note in observer.notes if note.member == 2 and "x" in note.text] == [text]
    assert "drone 2: a&lt;b&gt; &amp; xxx" in notes_html(observer) and not observer.refused


def test_who_sends_false_states_leaves_lines_as_they_are():
    f, _ = watched()
    faults = [InjectedFault(kind, (1,), 0.0, 9.0, 30.0) for kind in ("rogue", "impostor")]
    channel = RadioChannel(
        f.scenario.radio.rule, f.scenario.radio.numbers, f.card.members, 0, 0.1, faults, site=f.card.site
    )
    line = PacketSigner(SOFTWARE_KEY, 1)(text_messages("no valid position", 1)[0], START_TIME)
    channel.send(0.0, 0, line)
    at = [s[:3] for s in START]
    assert list(channel.deliver(2.0, at)) == [(1, line), (2, line)]


def test_another_key_is_told():
    f, observer = watched(key=bytes(32))
    assert fleet_warning(observer, f.now) == ""
    listen(f, observer, 3.0)
    assert "signed with a different key" in fleet_warning(observer, f.now) and not observer.accepted_count


def test_who_falls_silent_is_told_once_and_told_again_when_heard():
    f, observer = watched()
    listen(f, observer, 0.4)
    for _ in range(20):
        f.advance(0.2)
        for datagram in said(f)[1:]:
            observer.take(datagram, f.now)
        observer.look(f.now)
    assert observer.heard(f.now) == [2, 3] and f.now - observer.peers[1].heard_at > HEARD_WITHIN
    stays = observer.place(1, f.now)
    assert stays == observer.place(1, f.now + 100.0), "who is silent is not carried on for ever"
    listen(f, observer, 0.4)
    assert [note.text for note in observer.notes if note.member == 1] == ["heard, FLOCK", "silent", "heard again"]


def test_an_order_of_the_operator_is_told_and_one_of_another_key_is_not():
    f, observer = watched()
    utc = START_TIME + round(f.now * 1e6)
    genuine = OperatorStation(f.card, PRIVATE)
    observer.take(genuine.order(OrderKind.RETURN, utc), f.now)
    assert [note.text for note in observer.notes] == ["the operator orders return"]
    other = OperatorStation(f.card, bytes(range(32)))
    observer.take(other.order(OrderKind.LAND, utc + 10), f.now)
    assert len(observer.notes) == 1


def test_whom_the_ether_says_to_be_heard_is_a_link_for_a_while_both_ways_or_one():
    f, observer = watched()
    teller = TelemetryBroadcast(f.card.members, [InjectedFault("loss", (2, 3), 0.0, 5.0, 0.5)])
    one, two, _ = said(f)
    for to, datagram in ((1, one), (0, two), (2, one)):
        teller.note_arrival(to, datagram, f.now)
    utc = START_TIME + round(f.now * 1e6)
    for datagram in teller.report(f.now, utc):
        observer.take(datagram, f.now)
    assert observer.links(f.now) == {(1, 2): True, (3, 1): False}
    assert observer.faults == {"loss": {2, 3}} and observer.notes[-1].text == "fault loss: drones 2, 3"
    assert teller.report(f.now + 0.1, utc) == []
    observer.look(f.now + 3.0)
    assert not observer.links(f.now + 3.0) and not observer.faults and observer.notes[-1].text == "fault loss is over"


def test_several_faults_of_one_kind_are_told_with_all_whom_they_befall():
    f, observer = watched()
    teller = TelemetryBroadcast(f.card.members, [InjectedFault("loss", (who,), 0.0, 5.0, 0.5) for who in (1, 3)])
    for datagram in teller.report(f.now, START_TIME + round(f.now * 1e6)):
        observer.take(datagram, f.now)
    assert observer.faults == {"loss": {1, 3}}


@pytest.mark.parametrize("kind", INJECTED_KINDS)
def test_a_fault_is_told_without_an_amount_that_nobody_knows(kind):
    f, observer = watched()
    teller = TelemetryBroadcast(f.card.members, [InjectedFault(kind, (2,), 0.0, 5.0, 0.5)])
    for datagram in teller.report(f.now, START_TIME + round(f.now * 1e6)):
        observer.take(datagram, f.now)
    assert f"<b>{kind}</b>, drone 2: " in faults_html(observer) and "amount" not in faults_html(observer)


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_of_the_scenario_is_told_by_what_its_kind_does(kind):
    """Three kinds are called as other faults of fleets are: these say that they are of the scenario."""
    f, observer = watched()
    befalls = DroneFaults(scenario(3, faults=[{"kind": kind, "at": 0.2, "agents": [0, 2]}]), 0)
    teller = TelemetryBroadcast(f.card.members, [InjectedFault("motor", (2,), 0.0, 5.0)])
    for now in (0.0, 1.0):
        befalls.until(now)
        for datagram in teller.report(now, START_TIME + round((f.now + now) * 1e6), befalls.active_kinds(now)):
            observer.take(datagram, f.now + now)
    told = scenario_fault_name(kind)
    assert observer.faults == {"motor": {2}, told: {1, 3}} and told != "motor"
    assert f"<b>{told}</b>, drones 1, 3: " in faults_html(observer) and not faults_html(observer).endswith(": </p>")


def test_what_the_ether_tells_needs_the_key_and_its_own_system():
    f, observer = watched()
    utc = START_TIME + round(f.now * 1e6)
    told = report_message("", 1, {2, 3})
    for key, system in ((bytes(32), CHANNEL_SYSTEM), (SOFTWARE_KEY, 2)):
        observer.take(PacketSigner(key, system)(told, utc), f.now)
    assert not observer.links(f.now) and not observer.accepted_count


@pytest.mark.parametrize("systems", [set(), {1}, set(range(1, 251))])
@pytest.mark.parametrize("what", ["", *FAULTS_ON_THE_WIRE, "a kind of one's own, höher"])
def test_what_is_told_comes_back(what, systems):
    made = report_message(what, 7, systems)
    back = parse_report({"payload": made.payload, "payload_length": made.payload_length})
    assert back == (what, 7, systems)


def test_numbers_of_faults_on_the_wire_stay_and_every_shipped_kind_has_one():
    """What stood at these places flies in other versions: the list only grows."""
    first = sha256("\n".join(FAULTS_ON_THE_WIRE[:37]).encode()).hexdigest()
    assert first.startswith("3618fab3919a0694")
    assert len(FAULTS_ON_THE_WIRE) == len(set(FAULTS_ON_THE_WIRE)) < NAMED_REPORT
    assert {*INJECTED_KINDS, *map(scenario_fault_name, FAULTS)} <= set(FAULTS_ON_THE_WIRE)


def test_kind_of_fault_without_a_number_is_heard_by_its_name():
    f, observer = watched()
    teller = TelemetryBroadcast(f.card.members, [])
    for datagram in teller.report(f.now, START_TIME + round(f.now * 1e6), {"<gale>": {0}}):
        observer.take(datagram, f.now)
    assert observer.faults == {"<gale>": {1}} and "<b>&lt;gale&gt;</b>, drone 1: " in faults_html(observer)


def test_report_of_a_number_that_is_not_known_is_no_report():
    made = report_message("stuck", 7, {1})
    payload = bytes(made.payload)
    newer = payload[:3] + bytes([len(FAULTS_ON_THE_WIRE) + 1]) + payload[4:]
    assert parse_report({"payload": newer, "payload_length": made.payload_length}) is None


def test_the_field_of_a_card_holds_fence_and_walls_at_their_heights():
    made = card(scenario(3))
    field = card_scene(made)
    lines = {line.name: line.points for line in field.lines}
    assert np.ptp(lines["fence"][..., 2]) == pytest.approx(made.high - made.low)
    assert np.abs(lines["arena"][..., :2]).max() == 60.0 and set(lines["arena"][..., 2].ravel()) == {made.height}
    assert np.abs(lines["fence"][..., :2]).max() > 60.0 and field.span > 60.0


def test_tables_name_every_drone_and_what_it_is_at():
    f, observer = watched()
    assert members_html(observer, f.now).count("not heard") == 3
    listen(f, observer, 1.0)
    table = members_html(observer, f.now)
    assert table.count("<td>flock</td>") == 3 and "20.0" in table
    assert "hears 2 of 2" in drone_html(observer, 2, f.now) and "drone 3: heard" in notes_html(observer)


def test_a_fleet_on_the_real_clock_is_heard_where_it_flies():
    """Its packets, who hears whom and which faults hold come over UDP, and say what the recording says."""
    port = UdpPort(UdpAddresses(("127.0.0.1", 0), None))
    found = compare.with_metric_period(scenario(2, 1.5, **{"radio.delay": 0.1}), 0.2)
    made = compare.software_card(found, stop_for_lost=True, realtime=True)
    observer = FleetObserver(made, SOFTWARE_KEY, now=time.monotonic(), utc=time.time_ns() // 1000)
    over = threading.Event()

    def hear():
        while not over.wait(0.02):
            for datagram in port.read():
                observer.take(datagram, time.monotonic())

    ears = threading.Thread(target=hear)
    ears.start()
    try:
        flown = fly_in_realtime(
            found, made, 1, "tasks", start=compare.simulated_start(found, 1), watcher=port.here,
            faults=(InjectedFault("outage", (2,), 0.0, 1e6),),
        )  # fmt: skip
    finally:
        over.set()
        ears.join()
        port.close()
    assert observer.accepted_count > 10
    assert observer.faults == {"outage": {2}} and not observer.links(time.monotonic()), "links of a drone without radio"
    path = flown.array()[:, :, :3]
    for place, member in enumerate(made.members):
        gaps = np.linalg.norm(path[:, place] - observer.peers[member].status.position, axis=1)
        assert gaps.min() < 2.0


def test_the_card_of_a_fleet_in_software_is_written_and_never_over_a_real_one(tmp_path):
    made, path = card(scenario(2)), tmp_path / "fleet.json"
    write_card_and_key(path, made)
    write_card_and_key(path, made)
    assert read_card(path).hash == made.hash and os.stat(tmp_path / "fleet.key").st_mode & 0o777 == 0o600
    found, key, radios = open_card_and_radios(path, None, ["udp:127.0.0.1:14699"])
    radios.close()
    assert key == SOFTWARE_KEY and found.members == (1, 2)
    real = tmp_path / "mission.json"
    write_key(real.with_suffix(".key"), bytes(range(32)))
    with pytest.raises(CardError, match="is of a real mission"):
        write_card_and_key(real, made)
    assert not real.exists()


def test_what_is_wrong_with_card_key_and_radios_is_told_at_once(tmp_path):
    with pytest.raises(CardError) as told:
        open_card_and_radios(tmp_path / "none.json", None, ["udp:nowhere", "wifi:1"])
    lines = str(told.value).splitlines()
    assert len(lines) == 4 and "none.json" in lines[0] and "none.key" in lines[1] and "wifi:1" in lines[3]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["watch", "fleet.json", "--seed", "3", "--set", "model.p_rep=0.2"], "settings and seed need a scenario"),
        (["watch", "vasarhelyi_2018/4ms", "--radio", "udp:0.0.0.0:14600"], "radios needs the flight card"),
        (["fleet", "vasarhelyi_2018/real_4ms", "--card", "f.json"], "add --mode tasks or processes"),
        (["fleet", "vasarhelyi_2018/real_4ms", "--mode", "tasks", "--card", "f.txt"], ".json"),
    ],
)
def test_options_that_do_not_go_together_are_one_line(given, words):
    told = CliRunner().invoke(app, given).exception
    assert isinstance(told, AirflockError) and words in str(told) and len(str(told).splitlines()) == 1


def test_a_card_is_watched_by_the_same_function_as_a_scenario(tmp_path):
    with pytest.raises(StudioError, match="law needs a scenario"):
        airflock.watch(tmp_path / "a.json", law="vicsek_1995")
