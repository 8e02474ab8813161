"""What a drone tells its neighbours: one UTM_GLOBAL_POSITION of 95 signed bytes, which any ground station can show.

Its 18 bytes of `uas_id` carry what MAVLink has no place for: version 2, phase, mission (4 bytes), hash of the flight
card (4), battery (%), error of the own clock (10 ms), neighbours heard, and what latitude, longitude and the three
velocities lost to their whole numbers, a byte each.
"""

import struct
from functools import lru_cache
from typing import Any, NamedTuple

from airflock.drones.mavlink import dialect
from airflock.support.coordinates import Site, turned

MESSAGE = 340  # UTM_GLOBAL_POSITION
VERSION = 2  # version 1 told no parts of whole numbers
EXTRA = struct.Struct("<BBI4sBBB5b")
PARTS = 254  # of a whole number, so that a half of it, either way, fits into a byte
WHOLE = ("lat", "lon", "vx", "vy", "vz")
ON_GROUND, AIRBORNE = 2, 3  # UTM_FLIGHT_STATE
ALL_VALID = 0x3F  # UTM_DATA_AVAIL_FLAGS: time, position, both altitudes, both velocities


class Status(NamedTuple):
    """State of one drone as it tells it.

    time     : at which the state holds, µs of Unix time
    position : east, north, up from the site, m; resolved to 0.04 mm, height to 1 mm
    velocity : the same axes, m/s; resolved to 0.04 mm/s
    accuracy : of the position, m, one standard deviation
    phase    : number of the phase of its mission
    airborne : whether it flies
    mission, card : number of the mission, first four bytes of the card's hash
    battery  : %, clock_error : s, peers : how many it hears
    """

    time: int
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    accuracy: float
    phase: int
    airborne: bool
    mission: int
    card: bytes
    battery: int = 100
    clock_error: float = 0.0
    peers: int = 0


def message(status: Status, site: Site) -> Any:
    """The dialect's message of a status; numbers beyond what it can hold are clipped."""
    at = site.geodetic(*status.position)
    exact = at.latitude * 1e7, at.longitude * 1e7, *(100.0 * v for v in turned(*status.velocity))
    lat, lon, vx, vy, vz = whole = round(exact[0]), round(exact[1]), *(_fit(v, -32767, 32767) for v in exact[2:])
    parts = [_fit(PARTS * (a - b), -127, 127) for a, b in zip(exact, whole, strict=True)]
    extra = EXTRA.pack(
        VERSION, status.phase & 0xFF, status.mission & 0xFFFFFFFF, status.card[:4], _fit(status.battery, 0, 100),
        _fit(100.0 * status.clock_error, 0, 255), _fit(status.peers, 0, 255), *parts,
    )  # fmt: skip
    return dialect.common().MAVLink_utm_global_position_message(
        status.time, list(extra), lat, lon,
        _fit(1000.0 * at.altitude, -(2**31), 2**31 - 1), _fit(1000.0 * status.position[2], -(2**31), 2**31 - 1),
        vx, vy, vz, _fit(1000.0 * status.accuracy, 0, 65535), 0, 0, 0, 0, 0, 0,
        AIRBORNE if status.airborne else ON_GROUND, ALL_VALID,
    )  # fmt: skip


def status_of(values: dict[str, Any], site: Site) -> Status | None:
    """The status in the fields of a message; None if it is not one of ours or of this version."""
    version, phase, mission, card, battery, clock, peers, *parts = EXTRA.unpack(bytes(values["uas_id"]))
    if version != VERSION or values["flags"] != ALL_VALID or values["flight_state"] not in (ON_GROUND, AIRBORNE):
        return None
    lat, lon, vx, vy, vz = (values[k] + part / PARTS for k, part in zip(WHOLE, parts, strict=True))
    at = site.local(lat * 1e-7, lon * 1e-7, values["alt"] * 1e-3)
    velocity = turned(vx * 0.01, vy * 0.01, vz * 0.01)
    return Status(
        values["time"], at, velocity, values["h_acc"] * 1e-3, phase, values["flight_state"] == AIRBORNE, mission, card,
        battery, clock * 0.01, peers,
    )  # fmt: skip


@lru_cache(maxsize=256)
def status_in(payload: bytes, site: Site) -> Status | None:
    """The status in the payload of a message; where many members live in one process, a packet is read once."""
    return status_of(dialect.values(MESSAGE, payload), site)


def _fit(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)
