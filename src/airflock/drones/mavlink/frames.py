"""MAVLink 2 frames: layouts of messages, packing, and the search for whole frames in a stream of bytes.

A frame is 0xFD, length of the payload, two bytes of flags, sequence, system, component, three bytes
of message number, payload, checksum and, if flag 1 is set, 13 bytes of signature. A wire delivers
bytes: frames are recognised by their checksum. After bytes that are no frame the search goes on at
the next byte, so that no false start hides a frame.

`pymavlink.dialects.v20.common` supplies the layouts of the common messages. It needs neither NumPy
nor a compiler; `pymavlink.mavutil` would import NumPy and is not used. pymavlink packs, but never
receives.
"""

from functools import cache
from typing import Any, NamedTuple

from airflock.support import LinkError


@cache
def common_dialect() -> Any:
    """Return the module of the common dialect; raise LinkError where pymavlink is not installed."""
    try:
        from pymavlink.dialects.v20 import common as found
    except ImportError as error:
        raise LinkError("MAVLink needs pymavlink: pip install 'airflock[fly]'") from error
    return found


class MessageLayout(NamedTuple):
    """Layout of one message on the wire.

    unpack    : function from a payload of full length to the values in wire order
    size      : length of the payload, bytes
    crc_extra : byte that stands for the message's definition in the checksum
    numbers   : name and index of each number
    arrays    : name, index of the first value, count of values
    texts     : name and index of each text
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
    """Return the layout of a message by its number; None where the dialect does not know it."""
    kind = common_dialect().mavlink_map.get(message)
    if kind is None:
        return None
    single, arrays, texts, index = [], [], [], 0
    # The wire order of fields is by size, not by declaration: `orders` maps one to the other.
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
    """Return the fields of a message by name; trailing zeros that the sender cut off are restored.

    Raises LinkError where the dialect does not know the message or the payload is too long for it.
    """
    layout = message_layout(message)
    if layout is None or len(payload) > layout.size:
        raise LinkError(f"message {message} with {len(payload)} bytes is not in the common dialect")
    # MAVLink 2 cuts trailing zeros off; the layout needs the full length.
    flat = layout.unpack(payload.ljust(layout.size, b"\0"))
    fields: dict[str, Any] = {name: flat[index] for name, index in layout.numbers}
    for name, index, count in layout.arrays:
        fields[name] = flat[index : index + count]
    for name, index in layout.texts:
        fields[name] = flat[index].split(b"\0", 1)[0].decode("ascii", "replace")
    return fields


def checksum(data: bytes, crc_extra: int) -> int:
    """Return the checksum of a frame's bytes after the first, with the message's extra byte (CRC-16/MCRF4XX)."""
    accumulator = common_dialect().x25crc(data)
    accumulator.accumulate(bytes((crc_extra,)))
    return int(accumulator.crc)


FRAME_MAGIC = 0xFD
HEADER_LENGTH = 10
CHECKSUM_LENGTH = 2
SIGNATURE_LENGTH = 13
SIGNED_FLAG = 1  # incompatibility flag


class MavlinkFrame(NamedTuple):
    """A whole frame with a valid checksum: sender, message number, and payload without trailing zeros."""

    system: int
    component: int
    message: int
    payload: bytes

    def values(self) -> dict[str, Any]:
        """Return the fields by name."""
        return message_fields(self.message, self.payload)


class FramePacker:
    """Packs messages of one sender and numbers its frames as MAVLink requires."""

    def __init__(self, system: int, component: int):
        self._mav = common_dialect().MAVLink(None, srcSystem=system, srcComponent=component)

    def __call__(self, message: Any) -> bytes:
        """Return the unsigned bytes of a message of the dialect."""
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return data


def message_number(head: bytes) -> int:
    """Return the message number of a frame from its first bytes (at least HEADER_LENGTH of them)."""
    return int.from_bytes(head[7:10], "little")


def frame_at(data: bytes, start: int) -> tuple[MavlinkFrame | None, int]:
    """Return the frame that starts at an index, and how many bytes it takes.

    (None, 0): more bytes are needed to decide. (None, 1): no frame starts here.
    """
    if data[start] != FRAME_MAGIC:
        return None, 1
    head = data[start : start + HEADER_LENGTH]
    if len(head) < HEADER_LENGTH:
        return None, 0
    length, flags, layout = head[1], head[2], message_layout(message_number(head))
    # An unknown message cannot be checked, because its extra byte is unknown: it is rubbish to us.
    # A length of zero never occurs, for MAVLink 2 keeps at least one byte.
    if layout is None or length > layout.size or length == 0 or flags & ~SIGNED_FLAG:
        return None, 1
    end = start + HEADER_LENGTH + length
    whole = end + CHECKSUM_LENGTH + (SIGNATURE_LENGTH if flags & SIGNED_FLAG else 0)
    if len(data) < whole:
        return None, 0
    sent_checksum = int.from_bytes(data[end : end + CHECKSUM_LENGTH], "little")
    # Only the checksum distinguishes a frame from a payload byte that happens to be 0xFD, so a
    # mismatch costs one byte, not the length that the false header claims.
    if sent_checksum != checksum(data[start + 1 : end], layout.crc_extra):
        return None, 1
    return MavlinkFrame(head[5], head[6], message_number(head), data[start + HEADER_LENGTH : end]), whole - start


def frames_in(datagram: bytes) -> list[MavlinkFrame]:
    """Return all whole frames in one datagram; a partial frame is dropped."""
    frames, start = [], 0
    while start < len(datagram):
        frame, taken = frame_at(datagram, start)
        if frame is not None:
            frames.append(frame)
        start += max(taken, 1)
    return frames


class FrameStream:
    """Frames from a serial line; keeps at most one partial frame between two calls."""

    def __init__(self) -> None:
        self._rest = b""

    def __call__(self, data: bytes) -> list[MavlinkFrame]:
        """Take bytes and return the frames that are complete now."""
        return [frame for frame, _ in self._frames_and_bytes(data)]

    def whole_frames(self, data: bytes) -> list[bytes]:
        """Take bytes and return those of complete frames, with their signatures."""
        return [whole for _, whole in self._frames_and_bytes(data)]

    def _frames_and_bytes(self, data: bytes) -> list[tuple[MavlinkFrame, bytes]]:
        self._rest += data
        frames, start = [], 0
        while start < len(self._rest):
            frame, taken = frame_at(self._rest, start)
            if taken == 0:
                break
            if frame is not None:
                frames.append((frame, self._rest[start : start + taken]))
            start += taken
        self._rest = self._rest[start:]
        return frames
