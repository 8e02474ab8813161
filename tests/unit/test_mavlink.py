"""Frames, signatures, coordinates and status packets: what is sent is what is received, and nothing else is."""

import math
import random
import struct

import pytest
from hypothesis import given, settings, strategies as st

from airflock.drones.mavlink import orders
from airflock.drones.mavlink.autopilots import AUTOPILOTS, AutopilotCommands
from airflock.drones.mavlink.frames import (
    FramePacker,
    FrameStream,
    common_dialect,
    frames_in,
    message_fields,
    message_layout,
)
from airflock.drones.mavlink.messages import (
    STATUS_MESSAGE,
    DroneStatus,
    TextPieces,
    parse_status,
    status_message,
    text_messages,
)
from airflock.drones.mavlink.signing import (
    MAX_STAMP,
    SIGNING_EPOCH,
    PacketReceiver,
    PacketSigner,
    read_key,
    stamp_of_time,
    write_key,
)
from airflock.support.coordinates import FLATTENING, SEMI_MAJOR, FlightSite, swap_enu_ned
from airflock.support.errors import LinkError
from attacks import attacks

common = common_dialect()
KEY = bytes(range(32))
NOW = 1_800_000_000_000_000  # µs
SITE = FlightSite(47.5, 19.0, 120.0)
STATUS = DroneStatus(NOW, (10.0, -20.0, 30.0), (1.0, -2.0, 0.5), 1.5, 6, True, 77, b"card", 88, 0.02, 9)
finite = st.floats(-1e3, 1e3, width=32)


def receiver(own=1, **more):
    return PacketReceiver(
        KEY, own, {STATUS_MESSAGE: range(1, 60), orders.TUNNEL_MESSAGE: (255,)}, started=NOW - 10**7, **more
    )


def packet(who=7, utc=NOW, key=KEY, told=STATUS):
    return PacketSigner(key, who)(status_message(told, SITE), utc)


# --------------------------------------------------------------------------------------------------------- frames


@given(st.sampled_from(sorted(common.mavlink_map)), st.binary(min_size=255, max_size=255))
@settings(max_examples=300)
def test_every_message_reads_as_pymavlink_reads_it(number, noise):
    known = message_layout(number)
    payload = noise[: known.size]
    expected = common.mavlink_map[number](*_in_order(number, known.unpack(payload)))
    found = message_fields(number, payload)
    for name in expected.fieldnames:
        a, b = found[name], getattr(expected, name)
        if isinstance(a, str):
            assert b.split("\0")[0].encode("ascii", "replace") == a.encode("ascii", "replace") or "\ufffd" in a
        else:
            assert repr(a if not isinstance(a, tuple) else list(a)) == repr(b if not isinstance(b, tuple) else list(b))


def _in_order(number, flat):
    kind = common.mavlink_map[number]
    known = message_layout(number)
    fields = {name: (index, 0) for name, index in (*known.numbers, *known.texts)}
    fields |= {name: (index, count) for name, index, count in known.arrays}
    for name in kind.fieldnames:
        index, count = fields[name]
        yield list(flat[index : index + count]) if count else flat[index]


@given(
    st.lists(st.tuples(finite, finite, finite), min_size=1, max_size=6), st.lists(st.binary(max_size=300)), st.data()
)
@settings(max_examples=150)
def test_a_line_with_rubbish_between_frames_loses_no_frame(velocities, rubbish, data):
    pack = FramePacker(3, 1)
    sent = [pack(common.MAVLink_local_position_ned_message(5, 1.0, 2.0, 3.0, *v)) for v in velocities]
    stream = b""
    for frame in sent:
        stream += data.draw(st.sampled_from([*rubbish, b"", b"\xfd\xff\x00\x00\x00\x07\xbf\x20\x00\x00"])) + frame
    stream += bytes(600)  # what could hide in a false start has now arrived
    line, found = FrameStream(), []
    while stream:
        cut = data.draw(st.integers(1, 700))
        found += line(stream[:cut])
        stream = stream[cut:]
    told = [(f.values()["vx"], f.values()["vy"], f.values()["vz"]) for f in found if f.message == 32 and f.system == 3]
    assert [tuple(map(_single, v)) for v in velocities] == told


def _single(x):
    return struct.unpack("<f", struct.pack("<f", x))[0]


@given(st.binary(max_size=600))
@settings(max_examples=300)
def test_any_bytes_are_read_without_an_exception(data):
    frames_in(data)
    line = FrameStream()
    for k in range(0, len(data), 7):
        line(data[k : k + 7])
    assert receiver()(data, NOW) is None  # nobody signed it


# ----------------------------------------------------------------------------------------------------- signatures


def test_pymavlink_accepts_what_we_sign_and_we_what_it_signs():
    theirs = common.MAVLink(None, 1, 191)
    theirs.signing.secret_key, theirs.signing.timestamp = KEY, stamp_of_time(NOW) - 1
    assert theirs.decode(bytearray(packet())).get_type() == "UTM_GLOBAL_POSITION"
    got = receiver()(packet(), NOW)
    assert (got.system, got.stamp, got.message) == (7, stamp_of_time(NOW), STATUS_MESSAGE)


def test_a_forged_stamp_locks_nobody_out():
    """pymavlink 2.4.50 keeps the stamp before it compares the signature: one such datagram, and a neighbour is mute."""
    ours, forged = receiver(), bytearray(packet())
    forged[-12:-6] = MAX_STAMP.to_bytes(6, "little")
    assert ours(bytes(forged), NOW) is None
    assert ours.refused["signature"] == 1 and not ours.heard
    assert ours(packet(), NOW) is not None


def test_a_replay_is_refused_after_a_restart_too():
    before, old = receiver(), packet()
    assert before(old, NOW) and before(old, NOW) is None
    fresh = PacketReceiver(KEY, 1, {STATUS_MESSAGE: range(1, 60)}, started=NOW + 500_000)  # half a second later
    assert fresh(old, NOW + 500_000) is None and fresh.refused["replay"] == 1
    behind = PacketReceiver(KEY, 1, {STATUS_MESSAGE: range(1, 60)}, started=NOW - 10**6, last_stamps=before.heard)
    assert behind(old, NOW) is None, "the own clock went back over the restart; what was heard is still known"
    assert fresh(packet(utc=NOW + 600_000), NOW + 600_000) is not None


def test_the_copy_by_another_radio_is_a_replay_and_any_other_bytes_need_a_signature():
    ours, told = receiver(), packet()
    assert ours(told, NOW) and ours(told, NOW) is None and ours(bytearray(told), NOW) is None
    assert ours.refused["replay"] == 2 and ours.accepted_count == 1
    assert ours(told, NOW + 10**8) is None and ours.refused["clock"] == 1
    for bit in range(8 * len(told)):
        bent = bytearray(told)
        bent[bit // 8] ^= 1 << bit % 8
        assert ours(bytes(bent), NOW) is None
    assert ours.refused["signature"] > 400 and ours.refused["replay"] == 2 and ours.accepted_count == 1
    ahead = told[:-12] + (int.from_bytes(told[-12:-6], "little") + 1).to_bytes(6, "little") + told[-6:]
    assert ours(ahead, NOW) is None, "a newer stamp under the old signature"
    assert ours(packet(utc=NOW + 10), NOW + 10) is not None


@pytest.mark.parametrize("off", [-61.0, -1.01, 1.01, 60.0, 2.4e9])
def test_a_clock_that_is_wrong_moves_nobody_elses(off):
    """A member with the key whose clock says 2104: refused, and our own stamps stay ours."""
    ours, signer = receiver(), PacketSigner(KEY, 1)
    assert (
        ours(packet(utc=max(SIGNING_EPOCH, min(NOW + round(off * 1e6), SIGNING_EPOCH + 10 * MAX_STAMP))), NOW) is None
    )
    signer(status_message(STATUS, SITE), NOW)
    assert ours.refused["clock"] == 1 and signer.last == stamp_of_time(NOW)


def test_stamps_grow_over_a_restart_with_a_clock_that_went_back():
    first = PacketSigner(KEY, 7)
    first(status_message(STATUS, SITE), NOW)
    again = PacketSigner(KEY, 7, last=first.last)
    assert receiver(last_stamps={7: first.last})(again(status_message(STATUS, SITE), NOW - 10**6), NOW) is not None


def test_who_may_send_what():
    ours = receiver()
    assert ours(packet(who=1), NOW) is None and ours.refused["own"] == 1
    assert ours(packet(who=200), NOW) is None and ours.refused["stranger"] == 1
    assert ours(packet(who=255), NOW) is None, "the operator has orders to give, not states"
    order = orders.order_message(orders.OperatorOrder(orders.OrderKind.LAND, 0, 77, NOW), bytes(32))
    assert ours(PacketSigner(KEY, 7)(order, NOW), NOW) is None, "a peer has no orders to give"


def test_ten_thousand_attacks_change_nothing_and_hide_nothing():
    counts = attacks(10_000, seed=11)
    assert counts["accepted"] == 0 and counts["crashes"] == 0
    assert counts["genuine"] == counts["genuine_accepted"] == 200


# ----------------------------------------------------------------------------------------------------- coordinates


def test_turning_twice_is_the_identity():
    assert swap_enu_ned(*swap_enu_ned(1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert swap_enu_ned(1.0, 0.0, 0.0) == (0.0, 1.0, 0.0) and swap_enu_ned(0.0, 0.0, 1.0)[2] == -1.0


@given(st.floats(-80, 80), st.floats(-180, 179.999), st.floats(0, 3000), st.tuples(*[st.floats(-2e3, 2e3)] * 3))
def test_there_and_back_again(latitude, longitude, altitude, at):
    site = FlightSite(latitude, longitude, altitude)
    assert site.local(*site.to_geodetic(*at)) == pytest.approx(at, abs=1e-5)


def _earth_centred(latitude, longitude, height):
    phi, lam, e2 = math.radians(latitude), math.radians(longitude), FLATTENING * (2.0 - FLATTENING)
    n = SEMI_MAJOR / math.sqrt(1.0 - e2 * math.sin(phi) ** 2)
    flat = (n + height) * math.cos(phi)
    return flat * math.cos(lam), flat * math.sin(lam), (n * (1.0 - e2) + height) * math.sin(phi)


@given(st.floats(-70, 70), st.floats(-180, 180), st.floats(0, 3000), st.floats(-700, 700), st.floats(-700, 700))
def test_the_plane_is_the_tangent_plane_within_half_a_metre(latitude, longitude, altitude, x, y):
    at = FlightSite(latitude, longitude, altitude).to_geodetic(x, y, 0.0)
    a, b = _earth_centred(latitude, longitude, altitude), _earth_centred(*at)
    d = [q - p for p, q in zip(a, b, strict=True)]
    phi, lam = math.radians(latitude), math.radians(longitude)
    east = -math.sin(lam) * d[0] + math.cos(lam) * d[1]
    north = -math.sin(phi) * (math.cos(lam) * d[0] + math.sin(lam) * d[1]) + math.cos(phi) * d[2]
    assert math.hypot(east - x, north - y) < 0.5


def test_the_date_line_is_no_wall():
    x, _, _ = FlightSite(10.0, 179.9999, 0.0).local(10.0, -179.9999, 0.0)
    assert 0.0 < x < 30.0


# ---------------------------------------------------------------------------------------------- status and orders


@given(
    st.tuples(*[st.floats(-3e3, 3e3)] * 3), st.tuples(*[st.floats(-300, 300)] * 3), st.integers(0, 13), st.booleans()
)
def test_a_status_arrives_as_it_was_told(at, velocity, phase, airborne):
    told = STATUS._replace(position=at, velocity=velocity, phase=phase, is_airborne=airborne)
    heard = parse_status(receiver()(packet(told=told), NOW).values, SITE)
    assert heard.position == pytest.approx(at, abs=6e-4) and heard.velocity == pytest.approx(velocity, abs=3e-5)
    assert heard._replace(position=at, velocity=velocity) == told


def test_a_status_takes_95_bytes_and_none_of_another_kind_passes():
    assert len(packet(told=STATUS)) == 95
    values = receiver()(packet(), NOW).values
    for key, value in (("flags", 1), ("flight_state", 16), ("uas_id", (1, *values["uas_id"][1:]))):
        assert parse_status(values | {key: value}, SITE) is None


def test_only_the_operators_key_gives_orders():
    pytest.importorskip("cryptography")
    private, public = orders.new_operator_keys()
    other, _ = orders.new_operator_keys()
    order = orders.OperatorOrder(orders.OrderKind.GOTO, 3, 77, NOW, NOW + 5, (475000000, 190000000, 140000))
    heard = receiver()(PacketSigner(KEY, 255)(orders.order_message(order, private), NOW), NOW).values
    assert orders.parse_order(heard, public) == order
    assert (
        orders.parse_order(
            receiver()(PacketSigner(KEY, 255)(orders.order_message(order, other), NOW), NOW).values, public
        )
        is None
    )
    changed = list(heard["payload"])
    for k in range(orders.ORDER_FORMAT.size + orders.SEAL_LENGTH):
        bent = changed.copy()
        bent[k] ^= 1 << random.Random(k).randrange(8)
        assert orders.parse_order(heard | {"payload": bent}, public) is None


# ------------------------------------------------------------------------------------------- autopilots and files


def test_what_a_node_says_to_its_autopilot():
    for kind in AUTOPILOTS.values():
        say = AutopilotCommands(kind, 4)
        (frame,) = frames_in(say.velocity((1.0, 2.0, 3.0), 7))
        told = frame.values()
        assert (told["vx"], told["vy"], told["vz"], told["target_system"]) == (2.0, 1.0, -3.0, 4)
        ignored = common.POSITION_TARGET_TYPEMASK_X_IGNORE | common.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
        assert told["type_mask"] & ignored == ignored and not told["type_mask"] & 0x38
        (frame,) = frames_in(say.set_mode(kind.ours))
        p = frame.values()
        mode = int(p["param2"]) << 16 | int(p["param3"]) << 24 if kind.name == "px4" else int(p["param2"])
        assert mode == kind.ours
    assert AUTOPILOTS["px4"].parameter_value(struct.unpack("<f", struct.pack("<i", 5))[0], 6) == 5.0


def test_key_files(tmp_path):
    path = tmp_path / "mission.key"
    write_key(path, KEY)
    assert read_key(path) == KEY and path.stat().st_mode & 0o777 == 0o600
    with pytest.raises(LinkError, match="never overwritten"):
        write_key(path, KEY)
    path.chmod(0o644)
    with pytest.raises(LinkError, match="readable by others"):
        read_key(path)
    path.chmod(0o600)
    path.write_text("beef")
    with pytest.raises(LinkError, match="64 hexadecimal"):
        read_key(path)
    with pytest.raises(LinkError, match="the key cannot be read"):
        read_key(tmp_path / "absent")


# ---------------------------------------------------------------------------------------------------------- lines


@given(st.lists(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=260), max_size=6), st.data())
def test_lines_that_are_sent_twice_arrive_once_each_if_every_piece_arrives_once(lines, data):
    pack, join, arrived = FramePacker(1, 191), TextPieces(), []
    for number, line in enumerate(lines, 1):
        pieces = [frames_in(pack(message))[0].values() for message in text_messages(line, number)]
        lost = data.draw(st.lists(st.sampled_from([None, 0, 1]), min_size=len(pieces), max_size=len(pieces)))
        for turn in (0, 1):
            arrived += [join(piece) for piece, gone in zip(pieces, lost, strict=True) if gone != turn]
    # A piece that is lost the first time leaves the line to the second; an empty line says nothing.
    assert [text for text in arrived if text is not None] == lines


def test_short_texts_of_an_autopilot_are_lines_of_their_own():
    join = TextPieces()
    for _ in range(2):
        assert join({"id": 0, "chunk_seq": 0, "text": "Arm: Throttle (RC3) is not neutral"}) is not None
