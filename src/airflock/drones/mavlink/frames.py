"""MAVLink 2 frames: packing, and finding whole frames in bytes from a wire.

A frame is 0xFD, length of the payload, two bytes of flags, sequence, system, component, three bytes of message number,
payload, checksum and, if flag 1 is set, 13 bytes of signature. What a wire delivers is bytes: frames are found by their
checksum, and after rubbish the search goes on at the next byte, so that no false start hides what follows it.
"""

from typing import Any, NamedTuple

from airflock.drones.mavlink import dialect

MAGIC = 0xFD
HEADER = 10
CHECKSUM = 2
SIGNATURE = 13
SIGNED = 1  # incompatibility flag
LONGEST = HEADER + 255 + CHECKSUM + SIGNATURE


class Frame(NamedTuple):
    """A whole frame with a right checksum: who sent it, what it is, and its payload without trailing zeros."""

    system: int
    component: int
    message: int
    payload: bytes

    def values(self) -> dict[str, Any]:
        """Its fields by name."""
        return dialect.values(self.message, self.payload)


class Packer:
    """Packs messages of one sender; counts its frames as MAVLink wants it."""

    def __init__(self, system: int, component: int):
        self._mav = dialect.common().MAVLink(None, srcSystem=system, srcComponent=component)

    def __call__(self, message: Any) -> bytes:
        """Bytes of a message of the dialect, unsigned."""
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return data


def message_number(head: bytes) -> int:
    """Number of the message of a frame that starts with these bytes (at least HEADER of them)."""
    return int.from_bytes(head[7:10], "little")


def frame_at(data: bytes, start: int) -> tuple[Frame | None, int]:
    """The frame that starts at an index, and how many bytes it takes.

    (None, 0) means that more bytes must come before this can be told; (None, 1) that no frame starts here.
    """
    if data[start] != MAGIC:
        return None, 1
    head = data[start : start + HEADER]
    if len(head) < HEADER:
        return None, 0
    length, flags, known = head[1], head[2], dialect.layout(message_number(head))
    if known is None or length > known.size or length == 0 or flags & ~SIGNED:
        return None, 1
    end = start + HEADER + length
    whole = end + CHECKSUM + (SIGNATURE if flags & SIGNED else 0)
    if len(data) < whole:
        return None, 0
    told = int.from_bytes(data[end : end + CHECKSUM], "little")
    if told != dialect.checksum(data[start + 1 : end], known.crc_extra):
        return None, 1
    return Frame(head[5], head[6], message_number(head), data[start + HEADER : end]), whole - start


def frames_in(datagram: bytes) -> list[Frame]:
    """All whole frames in one datagram; a part of a frame is lost."""
    found, start = [], 0
    while start < len(datagram):
        frame, taken = frame_at(datagram, start)
        if frame is not None:
            found.append(frame)
        start += max(taken, 1)
    return found


class Stream:
    """Frames from a serial line: keeps what is not whole yet, at most one frame's length."""

    def __init__(self) -> None:
        self._rest = b""

    def __call__(self, data: bytes) -> list[Frame]:
        """Frames that are whole now."""
        return [frame for frame, _ in self._whole(data)]

    def raw(self, data: bytes) -> list[bytes]:
        """The bytes of frames that are whole now, with their signatures."""
        return [whole for _, whole in self._whole(data)]

    def _whole(self, data: bytes) -> list[tuple[Frame, bytes]]:
        self._rest += data
        found, start = [], 0
        while start < len(self._rest):
            frame, taken = frame_at(self._rest, start)
            if taken == 0:
                break
            if frame is not None:
                found.append((frame, self._rest[start : start + taken]))
            start += taken
        self._rest = self._rest[start:]
        return found
