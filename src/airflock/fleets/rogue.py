"""False packets: what somebody sends who hears the drones, without their key or with it; what a drone itself does."""

import struct
from collections.abc import Callable

from airflock.core.agent import State
from airflock.drones.mavlink import dialect
from airflock.drones.mavlink.frames import HEADER
from airflock.drones.mavlink.signing import EPOCH, Signer
from airflock.drones.mavlink.status import MESSAGE, Status, message, status_of
from airflock.fleets.starting import KEY
from airflock.support.coordinates import Site

WRONG = bytes(32)  # a key that no fleet has
NEWER = 1000  # µs; by which a false state is newer than the true one: of one age, the first counts
STAMP = struct.Struct("<Q")


def forged(genuine: bytes, site: Site, *, east: float, with_key: bool) -> bytes:
    """A packet that says that the sender of a genuine one is elsewhere.

    east : how far east of where it is, m; with_key: signed as its sender would, one stamp later
    """
    told, stamp = _read(genuine, site)
    x, y, z = told.position
    sign = Signer(KEY if with_key else WRONG, genuine[5], last=stamp)
    false = told._replace(position=(x + east, y, z), time=told.time + NEWER)
    return sign(message(false, site), EPOCH + 10 * stamp)


def retold(genuine: bytes, site: Site, tell: Callable[[State], State]) -> bytes:
    """What a drone sends in place of a genuine packet of its own: another state of the same time, signed as that is."""
    told, stamp = _read(genuine, site)
    false = tell(State(*told.position, *told.velocity))
    if false == (*told.position, *told.velocity):
        return genuine
    sign = Signer(KEY, genuine[5], last=stamp - 1)
    return sign(message(told._replace(position=false[:3], velocity=false[3:]), site), EPOCH + 10 * stamp)


def _read(genuine: bytes, site: Site) -> tuple[Status, int]:
    """What a packet of a node of this fleet says, and its stamp."""
    told = status_of(dialect.values(MESSAGE, genuine[HEADER : HEADER + genuine[1]]), site)
    assert told is not None, "what a node of this fleet sent"
    return told, STAMP.unpack(genuine[-12:-6] + b"\0\0")[0]
