"""Signed packets between drones: MAVLink 2 signatures with one secret per mission, and their strict reception.

A signature is the first six bytes of SHA-256 over secret, frame, link and stamp; a stamp counts 10
µs since 2015. The receiver checks header, length, sender and signature, then the stamp against the
own clock and against the last one of this sender. Only then does it keep the stamp, so that nothing
invalid can change its state.
"""

import hashlib
import hmac
import os
from collections import deque
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from airflock.drones.mavlink.frames import (
    CHECKSUM_LENGTH,
    FRAME_MAGIC,
    HEADER_LENGTH,
    SIGNATURE_LENGTH,
    SIGNED_FLAG,
    common_dialect,
    message_fields,
    message_layout,
    message_number,
)
from airflock.support import LinkError, os_error_message

KEY_LENGTH = 32  # bytes


def write_key(path: Path, key: bytes) -> None:
    """Write a key to a new file of mode 0600; never over another."""
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as error:
        raise LinkError(f"{path}: exists; a key is never overwritten") from error
    try:
        with os.fdopen(handle, "w", encoding="ascii") as file:
            file.write(key.hex() + "\n")
    except OSError as error:  # a full disk; half a key is none
        path.unlink(missing_ok=True)
        raise LinkError(f"{path}: cannot be written: {os_error_message(error)}") from error


def read_key(path: Path) -> bytes:
    """Read a key from its file; refuse a file that others can read."""
    try:
        mode, text = path.stat().st_mode, path.read_text(encoding="ascii").strip()
    except OSError as error:
        raise LinkError(f"{path}: the key cannot be read: {os_error_message(error)}") from error
    except UnicodeDecodeError as error:
        raise LinkError(f"{path}: is not a key; give {2 * KEY_LENGTH} hexadecimal digits") from error
    if mode & 0o077:
        raise LinkError(f"{path}: is readable by others (mode {mode & 0o777:04o}); chmod 600 {path}")
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != KEY_LENGTH:
        raise LinkError(f"{path}: is not a key; give {2 * KEY_LENGTH} hexadecimal digits")
    return key


SIGNING_EPOCH = 1_420_070_400_000_000  # 2015-01-01 in µs of Unix time
STAMPS_PER_SECOND = 100_000
MAX_STAMP = 2**48 - 1
PACKET_REFUSALS = ("short", "header", "length", "own", "stranger", "signature", "clock", "replay")


def stamp_of_time(utc: int) -> int:
    """Return the stamp of a time (µs of Unix time)."""
    return (utc - SIGNING_EPOCH) // 10


class PacketSigner:
    """Packs and signs the messages of one sender.

    last          : last used stamp, also from before a restart; stamps only grow, and no time is
                    taken from others
    recent_stamps : the latest stamps, by which an echo of an own frame is recognised
    """

    def __init__(self, key: bytes, system: int, component: int = 191, last: int = 0):
        self._mav = common_dialect().MAVLink(None, srcSystem=system, srcComponent=component)
        signing = self._mav.signing
        signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, 0
        self.last = last
        self.recent_stamps: deque[int] = deque(maxlen=256)

    def __call__(self, message: Any, utc: int) -> bytes:
        """Return the signed bytes of a message of the dialect, sent at utc (µs of Unix time)."""
        # A clock that was set back must not repeat a stamp: receivers would refuse all packets
        # until it has caught up.
        self.last = max(stamp_of_time(utc), self.last + 1)
        self.recent_stamps.append(self.last)
        self._mav.signing.timestamp = self.last
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return data


class ReceivedMessage(NamedTuple):
    """A genuine message: sender, stamp, message number, and payload without trailing zeros."""

    system: int
    stamp: int
    message: int
    payload: bytes

    @property
    def values(self) -> dict[str, Any]:
        """Return the fields by name."""
        return message_fields(self.message, self.payload)


class PacketReceiver:
    """Accepts signed frames of known senders, each once, and near the own time.

    key                  : secret of the mission
    own_id               : own system id, from which nothing is accepted
    senders              : system ids that may send a message, by its number
    started              : own time at the start, µs of Unix time: older packets are refused, so
                           that a restart accepts no replay
    last_stamps          : last stamp of each system, kept from before a restart
    max_clock_difference : largest difference between a sender's clock and the own one, s
    """

    def __init__(
        self,
        key: bytes,
        own_id: int,
        senders: Mapping[int, Collection[int]],
        *,
        started: int,
        last_stamps: Mapping[int, int] | None = None,
        max_clock_difference: float = 1.0,
    ):
        self._key, self._own = key, own_id
        self._senders = {message: frozenset(systems) for message, systems in senders.items()}
        # Nothing sent before the start is accepted, so a restart needs no file against replays.
        # Time is never taken from a peer.
        self._min_stamp, self._max_clock_difference = (
            stamp_of_time(started),
            round(max_clock_difference * STAMPS_PER_SECOND),
        )
        self.heard = {int(system): stamp for system, stamp in (last_stamps or {}).items() if 0 <= stamp <= MAX_STAMP}
        self._last_datagrams: dict[int, bytes] = {}  # system → the last datagram of it that was accepted
        self.refused = dict.fromkeys(PACKET_REFUSALS, 0)
        self.accepted_count = 0
        self.clock_differences: dict[int, float] = {}  # s; of senders of whom nothing but such packets came
        self.own_id_stamp: int | None = None  # stamp of the last genuine, fresh frame that bears our own system id

    def __call__(self, datagram: bytes, utc: int) -> ReceivedMessage | None:
        """Return the message of a datagram that arrived at utc (µs of Unix time); None if it is refused."""
        reason = self._refusal_reason(datagram, utc)
        if reason:
            self.refused[reason] += 1
            # A genuine frame with the own id is an echo of ours, or a second drone with our number:
            # the node decides which.
            if reason == "own":
                self.own_id_stamp = _datagram_stamp(datagram)
            elif reason == "clock" and datagram[5] not in self._last_datagrams:
                difference = _datagram_stamp(datagram) - stamp_of_time(utc)
                self.clock_differences[datagram[5]] = difference / STAMPS_PER_SECOND
            return None
        system, stamp, message = datagram[5], _datagram_stamp(datagram), message_number(datagram)
        self.heard[system] = stamp
        self._last_datagrams[system] = bytes(datagram)
        self.accepted_count += 1
        payload = bytes(datagram[HEADER_LENGTH : HEADER_LENGTH + datagram[1]])
        return ReceivedMessage(system, stamp, message, payload)

    def _refusal_reason(self, data: bytes, utc: int) -> str:
        """Return the reason to refuse a datagram, or an empty text. Changes nothing."""
        # The order is the point: nothing wrong may change state. pymavlink keeps the stamp before
        # it compares the signature, so one forged datagram locks a neighbour out for good.
        if len(data) < HEADER_LENGTH + CHECKSUM_LENGTH + SIGNATURE_LENGTH + 1:
            return "short"
        message = message_number(data)
        if data[0] != FRAME_MAGIC or data[2] != SIGNED_FLAG or message not in self._senders:
            return "header"
        layout = message_layout(message)
        length = data[1]
        if (
            layout is None
            or not 0 < length <= layout.size
            or len(data) != HEADER_LENGTH + length + CHECKSUM_LENGTH + SIGNATURE_LENGTH
        ):
            return "length"
        if data[5] != self._own and data[5] not in self._senders[message]:
            return "stranger"
        if data != self._last_datagrams.get(data[5]):
            tag = hashlib.sha256(self._key + data[:-6]).digest()[:6]
            if not hmac.compare_digest(tag, bytes(data[-6:])):
                return "signature"
        stamp = _datagram_stamp(data)
        if abs(stamp - stamp_of_time(utc)) > self._max_clock_difference:
            return "clock"
        if stamp <= max(self.heard.get(data[5], 0), self._min_stamp):
            return "replay"
        return "own" if data[5] == self._own else ""


def _datagram_stamp(data: bytes) -> int:
    return int.from_bytes(data[-12:-6], "little")
