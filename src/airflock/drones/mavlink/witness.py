"""What the ether of a fleet in software tells who watches: who hears whom, and which faults hold. No drone obeys it.

A TUNNEL message of a system of its own: magic word, version, what is told (0: whose packets arrived at the subject;
above: that the fault of this number holds), the subject, and the systems that it is about, a bit each.
"""

import struct
from collections.abc import Collection
from typing import Any, NamedTuple

from airflock.drones.mavlink import dialect

TUNNEL_MESSAGE = 385  # TUNNEL
CHANNEL_SYSTEM = 254  # system id; below the operator's, above all drones
REPORT_FORMAT = struct.Struct("<2sBBB32s")
REPORT_MAGIC, REPORT_VERSION = b"AW", 1
HEARS_REPORT = 0


class ChannelReport(NamedTuple):
    """One thing that is told.

    what : HEARS, or 1 and more: number of a kind of fault; subject : system id, 0 for none; systems : system ids
    """

    kind: int
    subject: int
    systems: frozenset[int]


def report_message(kind: int, subject: int, systems: Collection[int]) -> Any:
    """The dialect's message."""
    bits = sum(1 << system for system in set(systems))
    content = REPORT_FORMAT.pack(REPORT_MAGIC, REPORT_VERSION, kind, subject, bits.to_bytes(32, "little"))
    return dialect.common_dialect().MAVLink_tunnel_message(0, 0, 0, len(content), list(content.ljust(128, b"\0")))


def parse_report(values: dict[str, Any]) -> ChannelReport | None:
    """What the fields of a message tell; None if it is not one of ours."""
    data = bytes(values["payload"])[: values["payload_length"]]
    if len(data) != REPORT_FORMAT.size:
        return None
    magic, version, what, subject, raw = REPORT_FORMAT.unpack(data)
    if magic != REPORT_MAGIC or version != REPORT_VERSION:
        return None
    bits = int.from_bytes(raw, "little")
    return ChannelReport(what, subject, frozenset(system for system in range(256) if bits >> system & 1))
