"""The log of a flight on board: every input with its time, and the digest of every output, one JSON line each.

A log can be flown again through the same node, bit for bit: what was decided and why can be looked at in a debugger.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from airflock.errors import LinkError
from airflock.onboard.card import Card
from airflock.onboard.node import Memory, Node, Out

VERSION = 1


class Logged:
    """A node whose inputs and outputs are written down; it is used like the node itself.

    write : takes one line without its end
    """

    def __init__(
        self, node: Node, write: Callable[[str], None], *, now: float, memory: Memory, radios: tuple[float, ...]
    ):
        self.node, self._write = node, write
        self._line(
            log=VERSION, card=node.card.hash, member=node.member, now=now, utc=node.utc(now), sent=memory.sent,
            heard=memory.heard, order=memory.order, radios=radios, since=node.since,
        )  # fmt: skip

    def _line(self, **what: Any) -> None:
        self._write(json.dumps(what, separators=(",", ":")))

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self._line(a=data.hex(), t=now)
        self.node.autopilot(data, now)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by radio."""
        self._line(r=datagram.hex(), t=now)
        self.node.radio(datagram, now)

    def tick(self, now: float) -> Out:
        """Let the node decide."""
        out = self.node.tick(now)
        s = self.node.wire.state
        told = {"phase": self.node.phase.name, "own": None if s is None else list(s), "set": list(self.node.command)}
        notes = {"notes": out.notes} if out.notes else {}
        self._line(t=now, out=digest(out), **told, **notes)
        return out


def digest(out: Out) -> str:
    """First 16 digits of the SHA-256 of everything that a tick gave."""
    text = repr((out.autopilot, out.radios, out.notes))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Replayed(NamedTuple):
    """One tick of a log flown again: its time, what the log tells, what the node gave, and whether they agree."""

    time: float
    told: dict[str, Any]
    out: Out
    same: bool


def replay(lines: Iterable[str], card: Card, key: bytes) -> Iterator[Replayed]:
    """Fly a log again; LinkError where it is of another card or is no log."""
    rows = iter(_rows(lines))
    head = next(rows, {})
    if head.get("log") != VERSION:
        raise LinkError("this is not a log of a flight on board")
    if head["card"] != card.hash:
        raise LinkError("the log is of another card")
    heard = {int(k): v for k, v in head["heard"].items()}
    memory = Memory(head["sent"], heard, head["order"])
    node = Node(
        card, head["member"], key, now=head["now"], utc=head["utc"], memory=memory, radios=tuple(head["radios"]),
        since=head["since"],
    )  # fmt: skip
    for row in rows:
        if "a" in row:
            node.autopilot(bytes.fromhex(row["a"]), row["t"])
        elif "r" in row:
            node.radio(bytes.fromhex(row["r"]), row["t"])
        else:
            out = node.tick(row["t"])
            yield Replayed(row["t"], row, out, digest(out) == row["out"])


def _rows(lines: Iterable[str]) -> Iterator[dict[str, Any]]:
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            return  # the last line of a log that ended with the power
        if isinstance(row, dict):
            yield row


def read_memory(path: Path) -> Memory:
    """What outlived a restart; nothing where there is no file yet."""
    try:
        row = json.loads(path.read_text(encoding="utf-8"))
        return Memory(int(row["sent"]), {int(k): int(v) for k, v in row["heard"].items()}, int(row["order"]))
    except FileNotFoundError:
        return Memory()
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
        raise LinkError(f"{path}: cannot be read as the memory of a node; remove it on the ground only") from fault


def memory_text(memory: Memory) -> str:
    """The text of the file that `read_memory` reads."""
    return json.dumps(memory._asdict())
