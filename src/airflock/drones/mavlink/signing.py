"""Signed packets between drones: MAVLink 2 signatures with one secret per mission, sent and strictly received.

A signature is the first six bytes of SHA-256 over secret, frame, link and stamp; a stamp counts 10 µs since 2015. The
receiver checks in an order in which nothing that is wrong can change its state: header, length, sender, signature,
then the stamp against the own clock and against the last one of this sender, and only then is the stamp kept. Of a
packet that comes by two radios the second has the bytes of the first, whose signature has been found right.
pymavlink's check keeps the stamp first, so that one forged datagram locks a neighbour out.
"""

import hashlib
import hmac
from collections import deque
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from airflock.drones.mavlink import dialect
from airflock.drones.mavlink.frames import CHECKSUM, HEADER, MAGIC, SIGNATURE, SIGNED, message_number

EPOCH = 1_420_070_400_000_000  # 2015-01-01 in µs of Unix time
STAMPS_PER_SECOND = 100_000
LAST_STAMP = 2**48 - 1
REFUSALS = ("short", "header", "length", "own", "stranger", "signature", "clock", "replay")


def stamp_at(utc: int) -> int:
    """Stamp of a time (µs of Unix time)."""
    return (utc - EPOCH) // 10


class Signer:
    """Packs and signs messages of one sender.

    last   : stamp that was used last, also before a restart; stamps only grow, and no time is taken from others
    recent : the stamps that were used last, by which an echo of an own frame is known
    """

    def __init__(self, key: bytes, system: int, component: int = 191, last: int = 0):
        self._mav = dialect.common().MAVLink(None, srcSystem=system, srcComponent=component)
        signing = self._mav.signing
        signing.secret_key, signing.sign_outgoing, signing.link_id = key, True, 0
        self.last = last
        self.recent: deque[int] = deque(maxlen=256)

    def __call__(self, message: Any, utc: int) -> bytes:
        """Signed bytes of a message of the dialect, sent at utc (µs of Unix time)."""
        self.last = max(stamp_at(utc), self.last + 1)
        self.recent.append(self.last)
        self._mav.signing.timestamp = self.last
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) & 0xFF
        return data


class Received(NamedTuple):
    """A genuine message: sender, its stamp, number of the message, and its payload without trailing zeros."""

    system: int
    stamp: int
    message: int
    payload: bytes

    @property
    def values(self) -> dict[str, Any]:
        """Its fields by name."""
        return dialect.values(self.message, self.payload)


class Receiver:
    """Accepts signed frames of known senders, each once, and near the own time.

    key     : secret of the mission
    own     : own system id, from which nothing is accepted
    senders : number of a message → the systems that may send it
    started : own time when the receiver was made, µs of Unix time: nothing that was sent before is accepted, so that a
              restart accepts no replay
    heard   : system → last stamp, kept from before a restart
    spread  : how far a sender's clock may be from the own, s
    """

    def __init__(
        self,
        key: bytes,
        own: int,
        senders: Mapping[int, Collection[int]],
        *,
        started: int,
        heard: Mapping[int, int] | None = None,
        spread: float = 1.0,
    ):
        self._key, self._own = key, own
        self._senders = {message: frozenset(systems) for message, systems in senders.items()}
        self._floor, self._spread = stamp_at(started), round(spread * STAMPS_PER_SECOND)
        self.heard = {int(system): stamp for system, stamp in (heard or {}).items() if 0 <= stamp <= LAST_STAMP}
        self._last: dict[int, bytes] = {}  # system → the last datagram of it that was accepted
        self.refused = dict.fromkeys(REFUSALS, 0)
        self.accepted = 0
        self.own_heard: int | None = None  # stamp of the last genuine, fresh frame that bears our own system id

    def __call__(self, datagram: bytes, utc: int) -> Received | None:
        """The message of a datagram that arrived at utc (µs of Unix time); None if it is refused."""
        fault = self._fault(datagram, utc)
        if fault:
            self.refused[fault] += 1
            if fault == "own":
                self.own_heard = _stamp_of(datagram)
            return None
        system, stamp, message = datagram[5], _stamp_of(datagram), message_number(datagram)
        self.heard[system] = stamp
        self._last[system] = bytes(datagram)
        self.accepted += 1
        payload = bytes(datagram[HEADER : HEADER + datagram[1]])
        return Received(system, stamp, message, payload)

    def _fault(self, data: bytes, utc: int) -> str:
        """Why a datagram is refused; empty if it is not. Changes nothing."""
        if len(data) < HEADER + CHECKSUM + SIGNATURE + 1:
            return "short"
        message = message_number(data)
        if data[0] != MAGIC or data[2] != SIGNED or message not in self._senders:
            return "header"
        known = dialect.layout(message)
        length = data[1]
        if known is None or not 0 < length <= known.size or len(data) != HEADER + length + CHECKSUM + SIGNATURE:
            return "length"
        if data[5] != self._own and data[5] not in self._senders[message]:
            return "stranger"
        if data != self._last.get(data[5]):
            tag = hashlib.sha256(self._key + data[:-6]).digest()[:6]
            if not hmac.compare_digest(tag, bytes(data[-6:])):
                return "signature"
        stamp = _stamp_of(data)
        if abs(stamp - stamp_at(utc)) > self._spread:
            return "clock"
        if stamp <= max(self.heard.get(data[5], 0), self._floor):
            return "replay"
        return "own" if data[5] == self._own else ""


def _stamp_of(data: bytes) -> int:
    return int.from_bytes(data[-12:-6], "little")
