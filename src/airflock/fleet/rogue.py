"""Forged packets: what somebody sends who hears the drones, without their key or with it."""

import struct

from airflock.fleet.starting import KEY
from airflock.mavlink import dialect
from airflock.mavlink.coordinates import Site
from airflock.mavlink.frames import HEADER
from airflock.mavlink.signing import EPOCH, Signer
from airflock.mavlink.status import MESSAGE, message, status_of

WRONG = bytes(32)  # a key that no fleet has
NEWER = 1000  # µs; by which a false state is newer than the true one: of one age, the first counts
STAMP = struct.Struct("<Q")


def forged(genuine: bytes, site: Site, *, east: float, with_key: bool) -> bytes:
    """A packet that says that the sender of a genuine one is elsewhere.

    east : how far east of where it is, m; with_key: signed as its sender would, one stamp later
    """
    told = status_of(dialect.values(MESSAGE, genuine[HEADER : HEADER + genuine[1]]), site)
    assert told is not None, "what a node of this fleet sent"
    x, y, z = told.position
    stamp = STAMP.unpack(genuine[-12:-6] + b"\0\0")[0]
    sign = Signer(KEY if with_key else WRONG, genuine[5], last=stamp)
    false = told._replace(position=(x + east, y, z), time=told.time + NEWER)
    return sign(message(false, site), EPOCH + 10 * stamp)
