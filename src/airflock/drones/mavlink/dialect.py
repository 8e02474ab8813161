"""The dialect: pymavlink's tables of the common messages, used to pack and to know layouts, never to receive.

`pymavlink.dialects.v20.common` needs neither NumPy nor a compiler; `pymavlink.mavutil` would bring NumPy: not used.
"""

from functools import cache
from typing import Any, NamedTuple

from airflock.support import LinkError


@cache
def common_dialect() -> Any:
    """The module of the common dialect; LinkError where pymavlink is not installed."""
    try:
        from pymavlink.dialects.v20 import common as found
    except ImportError as fault:
        raise LinkError("MAVLink needs pymavlink: pip install 'airflock[fly]'") from fault
    return found


class MessageLayout(NamedTuple):
    """Layout of one message on the wire.

    unpack : payload of full length → values in wire order; size : of that payload, bytes
    crc_extra : byte that goes into the checksum and stands for the message's definition
    single, texts : names of numbers and of texts, with the index of the value
    arrays : name, index of the first value, how many values
    """

    name: str
    unpack: Any
    size: int
    crc_extra: int
    numbers: tuple[tuple[str, int], ...]
    arrays: tuple[tuple[str, int, int], ...]
    texts: tuple[tuple[str, int], ...]


@cache
def message_layout(message: int) -> MessageLayout | None:
    """Layout of a message by its number; None where the dialect does not know it."""
    kind = common_dialect().mavlink_map.get(message)
    if kind is None:
        return None
    single, arrays, texts, index = [], [], [], 0
    by_place = sorted(zip(kind.orders, kind.fieldnames, kind.fieldtypes, strict=True))
    for (_, name, type_), count in zip(by_place, kind.array_lengths, strict=True):
        if type_ == "char":
            texts.append((name, index))
        elif count:
            arrays.append((name, index, count))
        else:
            single.append((name, index))
        index += 1 if type_ == "char" else max(1, count)
    unpacker = kind.unpacker
    return MessageLayout(
        kind.msgname, unpacker.unpack, unpacker.size, kind.crc_extra, tuple(single), tuple(arrays), tuple(texts)
    )


def message_fields(message: int, payload: bytes) -> dict[str, Any]:
    """Fields of a message by name; a payload that was cut at its trailing zeros is filled up again.

    Raises LinkError where the dialect does not know the message or the payload is too long for it.
    """
    known = message_layout(message)
    if known is None or len(payload) > known.size:
        raise LinkError(f"message {message} with {len(payload)} bytes is not in the common dialect")
    flat = known.unpack(payload.ljust(known.size, b"\0"))
    found: dict[str, Any] = {name: flat[index] for name, index in known.numbers}
    for name, index, count in known.arrays:
        found[name] = flat[index : index + count]
    for name, index in known.texts:
        found[name] = flat[index].split(b"\0", 1)[0].decode("ascii", "replace")
    return found


def checksum(data: bytes, crc_extra: int) -> int:
    """Checksum of a frame's bytes after the first, with the message's extra byte (CRC-16/MCRF4XX)."""
    found = common_dialect().x25crc(data)
    found.accumulate(bytes((crc_extra,)))
    return int(found.crc)
