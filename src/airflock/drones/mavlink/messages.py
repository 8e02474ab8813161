"""Messages between drones: the status that each drone broadcasts, and the reports of a radio channel in software.

A status is one UTM_GLOBAL_POSITION of 95 signed bytes, which any ground station can show. Its 18
bytes of `uas_id` carry fields that MAVLink has no place for: version 2, phase, mission (4 bytes),
hash of the flight card (4), battery (%), error of the own clock (10 ms), number of neighbours
heard, and what latitude, longitude and the three velocities lost by rounding, a byte each.

A report is a TUNNEL message about one thing: which drones a drone hears, or which drones a fault
affects.

A line for a person, by an autopilot or a node, is one STATUSTEXT, or several where it is longer
than 50 letters.
"""

import struct
from collections.abc import Collection
from functools import lru_cache
from typing import Any, NamedTuple

from airflock.drones.mavlink.frames import common_dialect, message_fields
from airflock.support import FlightSite, printable, swap_enu_ned

STATUS_MESSAGE = 340  # UTM_GLOBAL_POSITION
STATUS_VERSION = 2  # version 1 had no parts of whole numbers
EXTRA_FORMAT = struct.Struct("<BBI4sBBB5b")
# Five spare bytes of uas_id carry what 1.1 cm and 1 cm/s lose: agents that turn round magnify a
# millimetre (0.29 m after 5 s became 0.24 mm).
PARTS_PER_UNIT = 254  # of a whole number, so that a half of it, either way, fits into a byte
ROUNDED_FIELDS = ("lat", "lon", "vx", "vy", "vz")
ON_GROUND_STATE, AIRBORNE_STATE = 2, 3  # UTM_FLIGHT_STATE
ALL_VALID_FLAGS = 0x3F  # UTM_DATA_AVAIL_FLAGS: time, position, both altitudes, both velocities


class DroneStatus(NamedTuple):
    """State of one drone as it broadcasts it.

    time        : at which the state holds, µs of Unix time
    position    : east, north, up from the site, m; resolved to 0.04 mm, height to 1 mm
    velocity    : the same axes, m/s; resolved to 0.04 mm/s
    accuracy    : one standard deviation of the position, m
    phase       : number of the phase of its mission
    mission     : number of the mission
    card        : first four bytes of the card's hash
    battery     : %
    clock_error : s
    peers       : number of members that it hears
    """

    time: int
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    accuracy: float
    phase: int
    is_airborne: bool
    mission: int
    card: bytes
    battery: int = 100
    clock_error: float = 0.0
    peers: int = 0


def status_message(status: DroneStatus, site: FlightSite) -> Any:
    """Return the dialect's message of a status; numbers beyond its range are clipped."""
    # UTM_GLOBAL_POSITION holds degrees and cm/s; any ground station shows it without knowing us.
    at = site.to_geodetic(*status.position)
    exact = at.latitude * 1e7, at.longitude * 1e7, *(100.0 * v for v in swap_enu_ned(*status.velocity))
    lat, lon, vx, vy, vz = whole = round(exact[0]), round(exact[1]), *(_clip(v, -32767, 32767) for v in exact[2:])
    # What rounding took away, in 1/254 of the last digit: at most a half, either way, so it fits
    # into a signed byte.
    parts = [_clip(PARTS_PER_UNIT * (a - b), -127, 127) for a, b in zip(exact, whole, strict=True)]
    extra = EXTRA_FORMAT.pack(
        STATUS_VERSION,
        status.phase & 0xFF,
        status.mission & 0xFFFFFFFF,
        status.card[:4],
        _clip(status.battery, 0, 100),
        _clip(100.0 * status.clock_error, 0, 255),
        _clip(status.peers, 0, 255),
        *parts,
    )
    return common_dialect().MAVLink_utm_global_position_message(
        status.time, list(extra), lat, lon,
        _clip(1000.0 * at.altitude, -(2**31), 2**31 - 1), _clip(1000.0 * status.position[2], -(2**31), 2**31 - 1),
        vx, vy, vz, _clip(1000.0 * status.accuracy, 0, 65535), 0, 0, 0, 0, 0, 0,
        AIRBORNE_STATE if status.is_airborne else ON_GROUND_STATE, ALL_VALID_FLAGS,
    )  # fmt: skip


def parse_status(values: dict[str, Any], site: FlightSite) -> DroneStatus | None:
    """Return the status in the fields of a message; None if it is not one of ours or of this version."""
    version, phase, mission, card, battery, clock, peers, *parts = EXTRA_FORMAT.unpack(bytes(values["uas_id"]))
    if (
        version != STATUS_VERSION
        or values["flags"] != ALL_VALID_FLAGS
        or values["flight_state"] not in (ON_GROUND_STATE, AIRBORNE_STATE)
    ):
        return None
    lat, lon, vx, vy, vz = (values[k] + part / PARTS_PER_UNIT for k, part in zip(ROUNDED_FIELDS, parts, strict=True))
    at = site.local(lat * 1e-7, lon * 1e-7, values["alt"] * 1e-3)
    velocity = swap_enu_ned(vx * 0.01, vy * 0.01, vz * 0.01)
    return DroneStatus(
        values["time"],
        at,
        velocity,
        values["h_acc"] * 1e-3,
        phase,
        values["flight_state"] == AIRBORNE_STATE,
        mission,
        card,
        battery,
        clock * 0.01,
        peers,
    )


# Thirty nodes of one process read the same packet: decoding it once is enough. A drone on its own
# gains nothing.
@lru_cache(maxsize=256)
def parse_status_payload(payload: bytes, site: FlightSite) -> DroneStatus | None:
    """Return the status in a payload, cached: in a fleet in software many members read the same packet."""
    return parse_status(message_fields(STATUS_MESSAGE, payload), site)


def _clip(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)


TEXT_MESSAGE = 253  # STATUSTEXT
TEXT_LENGTH = 50  # letters of one message
NOTICE = 5  # MAV_SEVERITY


def text_messages(text: str, number: int) -> list[Any]:
    """Return the dialect's messages of a line with a number (1 to 65535); the last one is not full."""
    data, make = text.encode("ascii", "replace"), common_dialect().MAVLink_statustext_message
    starts = range(0, len(data) + 1, TEXT_LENGTH)
    return [make(NOTICE, data[k : k + TEXT_LENGTH], number, k // TEXT_LENGTH) for k in starts]


class TextPieces:
    """Joins the STATUSTEXT messages of one sender; lost ones are taken from a repetition of the line."""

    def __init__(self) -> None:
        self._number, self._last = 0, (0, "")
        self._pieces: dict[int, str] = {}

    def __call__(self, values: dict[str, Any]) -> str | None:
        """Return the line that a message completes; None for a repetition, or where a piece is missing."""
        number = values["id"]
        if number == 0:  # a line of one message
            return str(values["text"])
        if number != self._number:
            self._number, self._pieces = number, {}
        self._pieces[values["chunk_seq"]] = values["text"]
        count = 1 + max(self._pieces)
        # MAVLink counts no pieces: the last one is known by the room that is left in it.
        if len(self._pieces[count - 1]) == TEXT_LENGTH or len(self._pieces) < count:
            return None
        text = "".join(self._pieces.pop(k) for k in range(count))
        is_repeated, self._last = (number, text) == self._last, (number, text)
        return None if is_repeated else text


TUNNEL_MESSAGE = 385  # TUNNEL
CHANNEL_SYSTEM = 254  # system id; below the operator's, above all drones
REPORT_FORMAT = struct.Struct("<2sBBB32s")
REPORT_MAGIC, REPORT_VERSION = b"AW", 1
HEARS_REPORT = 0
NAMED_REPORT = 255  # a kind of fault without a number: its name stands behind the report
MOST_NAME = 128 - REPORT_FORMAT.size  # bytes
# Numbers of kinds of fault on the wire: the place in this list, from 1 on. Fleets and observers of
# other versions read them, so that it only grows; nothing in it moves or goes.
FAULTS_ON_THE_WIRE = (
    "outage", "partition", "loss", "jitter", "duplicate", "corrupt", "rogue", "impostor", "node", "motor", "gnss",
    "battery", "pilot", "clock", "reboot", "streams", "uplink", "throttle", "no_gnss", "voltage", "capacity",
    "autopilot_clock", "clock_drift", "battery of the scenario", "clock of the scenario", "fails", "gnss_drift",
    "gnss_frozen", "gnss_offset", "gnss_spoofed", "motor of the scenario", "pretender", "radio_deaf", "radio_frozen",
    "radio_range", "radio_silent", "stuck",
)  # fmt: skip


class ChannelReport(NamedTuple):
    """One fact about the radio channel or the faults of a fleet in software.

    fault   : name of the kind of fault; empty if the report says whom the subject hears
    subject : system id; 0 for none
    systems : system ids that the subject hears, or that the fault affects
    """

    fault: str
    subject: int
    systems: frozenset[int]


def report_message(fault: str, subject: int, systems: Collection[int]) -> Any:
    """Return the dialect's message of a report; a kind of fault without a number is sent by its name."""
    numbered = fault in FAULTS_ON_THE_WIRE
    kind = FAULTS_ON_THE_WIRE.index(fault) + 1 if numbered else NAMED_REPORT if fault else HEARS_REPORT
    bits = sum(1 << system for system in set(systems))
    content = REPORT_FORMAT.pack(REPORT_MAGIC, REPORT_VERSION, kind, subject, bits.to_bytes(32, "little"))
    content += fault.encode()[:MOST_NAME] if kind == NAMED_REPORT else b""
    return common_dialect().MAVLink_tunnel_message(0, 0, 0, len(content), list(content.ljust(128, b"\0")))


def parse_report(values: dict[str, Any]) -> ChannelReport | None:
    """Return the report in the fields of a message; None if it is not one of ours, or of a newer kind of fault."""
    data = bytes(values["payload"])[: values["payload_length"]]
    if len(data) < REPORT_FORMAT.size:
        return None
    magic, version, kind, subject, raw = REPORT_FORMAT.unpack(data[: REPORT_FORMAT.size])
    name = printable(data[REPORT_FORMAT.size :].decode(errors="replace"))
    if magic != REPORT_MAGIC or version != REPORT_VERSION or bool(name) != (kind == NAMED_REPORT):
        return None
    if HEARS_REPORT < kind < NAMED_REPORT:
        if kind > len(FAULTS_ON_THE_WIRE):
            return None
        name = FAULTS_ON_THE_WIRE[kind - 1]
    bits = int.from_bytes(raw, "little")
    return ChannelReport(name, subject, frozenset(system for system in range(256) if bits >> system & 1))
