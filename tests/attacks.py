"""Attacks on a receiver: datagrams of twelve kinds with genuine ones between them. As a script: how many, and a seed.

python tests/attacks.py 1000000 7
"""

import random
import sys

from airflock.drones.mavlink.messages import STATUS_MESSAGE, DroneStatus, status_message
from airflock.drones.mavlink.signing import MAX_STAMP, SIGNING_EPOCH, PacketReceiver, PacketSigner
from airflock.support.coordinates import FlightSite

KEY, NOW = bytes(range(32)), 1_800_000_000_000_000
SITE = FlightSite(47.5, 19.0, 120.0)
KINDS = (
    "random", "random after a header", "mutated", "unsigned", "wrong key", "replayed", "own id", "stranger", "old",
    "future", "lock-out", "poisoned time", "MAVLink 1",
)  # fmt: skip


def attacks(count, seed):
    """Send this many false datagrams and a genuine one before every fiftieth; how many were accepted, and crashes."""
    rng = random.Random(seed)
    receiver = PacketReceiver(KEY, 1, {STATUS_MESSAGE: range(2, 60)}, started=NOW - 10**7)
    genuine, wrong = PacketSigner(KEY, 7), PacketSigner(bytes(32), 7)
    told, seen, utc = DroneStatus(NOW, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0), 1.0, 6, True, 7, b"card"), [], NOW
    counts = {"sent": 0, "accepted": 0, "crashes": 0, "genuine": 0, "genuine_accepted": 0}
    plain = bytearray(genuine(status_message(told, SITE), NOW - 10**6))
    plain[2] = 0
    for k in range(count):
        utc += 1000
        if k % 50 == 0:
            frame = genuine(status_message(told, SITE), utc)
            counts["genuine"] += 1
            counts["genuine_accepted"] += receiver(frame, utc) is not None
            seen = [*seen[-50:], frame]
        data = false_datagram(KINDS[k % len(KINDS)], rng, seen, wrong, told, utc, bytes(plain[:-13]))
        if data in seen[-1:] and KINDS[k % len(KINDS)] == "mutated":
            continue
        counts["sent"] += 1
        before = dict(receiver.heard)
        try:
            accepted = receiver(data, utc) is not None
        except Exception:
            counts["crashes"] += 1
            continue
        counts["accepted"] += accepted or receiver.heard != before
    return counts


def false_datagram(kind, rng, seen, wrong, told, utc, unsigned):
    """One datagram that must not be accepted."""
    last, packet = seen[-1], status_message(told, SITE)
    if kind == "random":
        return rng.randbytes(rng.randrange(0, 300))
    if kind == "random after a header":
        return bytes([0xFD, rng.randrange(256), 1, 0, 0, 7, 191, 84, 1, 0]) + rng.randbytes(rng.randrange(0, 300))
    if kind == "mutated":
        return mutated(last, rng)
    if kind == "lock-out":
        return last[:-12] + MAX_STAMP.to_bytes(6, "little") + rng.randbytes(6)
    if kind == "MAVLink 1":
        return b"\xfe" + last[1:]
    made = {
        "unsigned": lambda: unsigned,
        "wrong key": lambda: wrong(packet, utc),
        "replayed": lambda: rng.choice(seen),
        "own id": lambda: PacketSigner(KEY, 1)(packet, utc),
        "stranger": lambda: PacketSigner(KEY, 200)(packet, utc),
        "old": lambda: PacketSigner(KEY, 8)(packet, utc - 60 * 10**6),
        "future": lambda: PacketSigner(KEY, 8)(packet, utc + 60 * 10**6),
        "poisoned time": lambda: PacketSigner(KEY, 9)(packet, SIGNING_EPOCH + 10 * (MAX_STAMP - 1)),
    }
    return made[kind]()


def mutated(frame, rng):
    """A frame with bits turned, cut off or put in."""
    data = bytearray(frame)
    for _ in range(rng.choice((1, 1, 2, 5))):
        way = rng.random()
        if way < 0.6 and data:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif way < 0.8:
            data = data[: rng.randrange(len(data) + 1)] or bytearray(b"\0")
        else:
            data[rng.randrange(len(data) + 1) : 0] = rng.randbytes(rng.randrange(1, 9))
    return bytes(data)


if __name__ == "__main__":
    sys.stdout.write(f"{attacks(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)}\n")
