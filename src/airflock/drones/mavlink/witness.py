"""What the ether of a fleet in software tells who watches: who hears whom, and which faults hold. No drone obeys it.

A TUNNEL message of a system of its own: magic word, version, what is told (0: whose packets arrived at the subject;
above: that the fault of this number holds), the subject, and the systems that it is about, a bit each.
"""

import struct
from collections.abc import Collection
from typing import Any, NamedTuple

from airflock.drones.mavlink import dialect

MESSAGE = 385  # TUNNEL
WITNESS = 254  # system id; below the operator's, above all drones
CONTENT = struct.Struct("<2sBBB32s")
MAGIC, VERSION = b"AW", 1
HEARS = 0


class Told(NamedTuple):
    """One thing that is told.

    what : HEARS, or 1 and more: number of a kind of fault; subject : system id, 0 for none; systems : system ids
    """

    what: int
    subject: int
    systems: frozenset[int]


def message(what: int, subject: int, systems: Collection[int]) -> Any:
    """The dialect's message."""
    bits = sum(1 << system for system in set(systems))
    content = CONTENT.pack(MAGIC, VERSION, what, subject, bits.to_bytes(32, "little"))
    return dialect.common().MAVLink_tunnel_message(0, 0, 0, len(content), list(content.ljust(128, b"\0")))


def told_of(values: dict[str, Any]) -> Told | None:
    """What the fields of a message tell; None if it is not one of ours."""
    data = bytes(values["payload"])[: values["payload_length"]]
    if len(data) != CONTENT.size:
        return None
    magic, version, what, subject, raw = CONTENT.unpack(data)
    if magic != MAGIC or version != VERSION:
        return None
    bits = int.from_bytes(raw, "little")
    return Told(what, subject, frozenset(system for system in range(256) if bits >> system & 1))
