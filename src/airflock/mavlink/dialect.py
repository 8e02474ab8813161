"""The dialect: pymavlink's tables of the common messages, used to pack and to know layouts, never to receive.

`pymavlink.dialects.v20.common` needs neither NumPy nor a compiler; `pymavlink.mavutil` would bring NumPy: not used.
"""

from functools import cache
from typing import Any, NamedTuple

from airflock.errors import LinkError


@cache
def common() -> Any:
    """The module of the common dialect; LinkError where pymavlink is not installed."""
    try:
        from pymavlink.dialects.v20 import common as found
    except ImportError as fault:
        raise LinkError("MAVLink needs pymavlink: pip install 'airflock[fly]'") from fault
    return found


class Layout(NamedTuple):
    """Layout of one message on the wire.

    unpack : payload of full length → values in wire order; size : of that payload, bytes
    crc_extra : byte that goes into the checksum and stands for the message's definition
    fields : name, index of its first value, how many values (0: a single one), whether it is text
    """

    name: str
    unpack: Any
    size: int
    crc_extra: int
    fields: tuple[tuple[str, int, int, bool], ...]


@cache
def layout(message: int) -> Layout | None:
    """Layout of a message by its number; None where the dialect does not know it."""
    kind = common().mavlink_map.get(message)
    if kind is None:
        return None
    fields, index = [], 0
    by_place = sorted(zip(kind.orders, kind.fieldnames, kind.fieldtypes, strict=True))
    for (_, name, type_), count in zip(by_place, kind.array_lengths, strict=True):
        text = type_ == "char"
        fields.append((name, index, 0 if text else count, text))
        index += max(1, 0 if text else count)
    return Layout(kind.msgname, kind.unpacker.unpack, kind.unpacker.size, kind.crc_extra, tuple(fields))


def values(message: int, payload: bytes) -> dict[str, Any]:
    """Fields of a message by name; a payload that was cut at its trailing zeros is filled up again.

    Raises LinkError where the dialect does not know the message or the payload is too long for it.
    """
    known = layout(message)
    if known is None or len(payload) > known.size:
        raise LinkError(f"message {message} with {len(payload)} bytes is not in the common dialect")
    flat = known.unpack(payload.ljust(known.size, b"\0"))
    found: dict[str, Any] = {}
    for name, index, count, text in known.fields:
        if text:
            found[name] = flat[index].split(b"\0", 1)[0].decode("ascii", "replace")
        else:
            found[name] = flat[index : index + count] if count else flat[index]
    return found


def checksum(data: bytes, crc_extra: int) -> int:
    """Checksum of a frame's bytes after the first, with the message's extra byte (CRC-16/MCRF4XX)."""
    found = common().x25crc(data)
    found.accumulate(bytes((crc_extra,)))
    return int(found.crc)
