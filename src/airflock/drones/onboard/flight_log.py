"""The log of a flight on board: every input with its time, and the digest of every output, one JSON line each.

A log can be flown again through the same node, bit for bit: each decision can be looked at in a
debugger.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from airflock import __version__
from airflock.core import State
from airflock.drones.mavlink.frames import FrameStream, MavlinkFrame
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.node import Node, NodeMemory, NodeOutput
from airflock.drones.onboard.peers import AUTOPILOT_COMPONENT
from airflock.drones.onboard.steering import Velocity
from airflock.support import (
    FormatError,
    LinkError,
    TextError,
    as_error,
    parse_json,
    parse_json_object,
    read_text,
    swap_enu_ned,
)

LOG_VERSION = 1
NO_LOG_TEXT = "this is not a log of a flight on board"
MAX_RADIOS = 16
MAX_GAP = 3600.0  # s between two lines; a node ticks many times a second
MAX_CLOCK = 1e12  # s; clocks count from the start of a computer
DECIDING_ROOMS = ("core", "drones", "parts", "support", "world")  # rooms whose code decides on board


@cache
def code_version() -> str:
    """Return the version of the package, and a digest of the code that decides on board."""
    root = Path(__file__).parents[2]
    files = sorted(file for room in DECIDING_ROOMS for file in (root / room).rglob("*.py"))
    return f"{__version__}+{hashlib.sha256(b''.join(file.read_bytes() for file in files)).hexdigest()[:8]}"


class LoggingNode:
    """A node whose inputs and outputs are written to a log; it is used like the node itself.

    write : function that takes one line without its end
    """

    def __init__(
        self, node: Node, write: Callable[[str], None], *, now: float, memory: NodeMemory, radios: tuple[float, ...]
    ):
        self.node, self._write = node, write
        self._line(
            log=LOG_VERSION, version=code_version(), card=node.card.hash, member=node.member, now=now,
            utc=node.utc(now), sent=memory.sent,
            heard=memory.heard, order=memory.order, radios=radios, since=node.accepted_since,
        )  # fmt: skip

    def _line(self, **values: Any) -> None:
        self._write(json.dumps(values, separators=(",", ":")))

    def autopilot(self, data: bytes, now: float) -> None:
        """Take bytes that came from the autopilot."""
        self._line(a=data.hex(), t=now)
        self.node.autopilot(data, now)

    def radio(self, datagram: bytes, now: float) -> None:
        """Take a datagram that came by radio."""
        self._line(r=datagram.hex(), t=now)
        self.node.radio(datagram, now)

    def tick(self, now: float) -> NodeOutput:
        """Let the node decide, and log the digest of its output."""
        out = self.node.tick(now)
        s = self.node.autopilot_link.state
        entry = {"phase": self.node.phase.name, "own": None if s is None else list(s), "set": list(self.node.command)}
        notes = {"notes": out.notes} if out.notes else {}
        self._line(t=now, out=output_digest(out), **entry, **notes)
        return out


def output_digest(out: NodeOutput) -> str:
    """Return the first 16 digits of the SHA-256 of all that a tick gave."""
    # Outputs are logged as digests: a replay makes their bytes again.
    text = repr((out.autopilot, out.radios, out.notes))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class ReplayedTick(NamedTuple):
    """One tick of a log flown again: time, entry of the log, output and phase of the node, and whether they agree.

    version : of the code that wrote the log; empty where it did not say so yet
    """

    time: float
    entry: dict[str, Any]
    out: NodeOutput
    same: bool
    phase: MissionPhase
    version: str


class LoggedTick(NamedTuple):
    """One tick in a log: line, time of the own clock (s), phase, own state, command (m/s), and stamp of the state.

    own   : x, y, z (m), vx, vy, vz (m/s); None where the node did not know its state
    stamp : arrival of the state (s of the own clock) and the autopilot's time of it since boot (s);
            None where the autopilot's bytes since the tick before do not hold it
    """

    line: int
    time: float
    phase: MissionPhase
    own: State | None
    command: Velocity
    stamp: tuple[float, float] | None = None


class LogTicks(NamedTuple):
    """Ticks of a log that is not flown again, with the member, and Unix time (µs) at a time of its clock (s)."""

    member: int
    now: float
    utc: int
    ticks: list[LoggedTick]


def read_log_ticks(path: Path) -> LogTicks:
    """Read the ticks of a log file; LinkError names the file and the line that is no log."""
    with _log_lines(path) as lines:
        rows = enumerate(_rows(lines), 1)
        _, head = next(rows, (0, {}))
        begun, utc, member = _numbers_or_none([head.get("now")], 1), head.get("utc"), head.get("member")
        if head.get("log") != LOG_VERSION or begun is None or type(utc) is not int or type(member) is not int:
            raise LinkError(NO_LOG_TEXT)
        ticks, before, stream = [], begun[0], FrameStream()
        stamps: dict[tuple[float, float, float], tuple[float, float]] = {}
        for number, row in rows:
            before, data = _time_and_bytes(row, number, before)
            if "a" in row:
                for frame in stream(data):
                    if (frame.system, frame.component) == (member, AUTOPILOT_COMPONENT):
                        _stamp(frame, before, stamps)
            if "out" in row:
                tick = _tick(row, number, before)
                ticks.append(tick._replace(stamp=None if tick.own is None else stamps.get(tick.own[3:])))
                stamps.clear()
        return LogTicks(member, begun[0], utc, ticks)


@contextmanager
def _log_lines(path: Path) -> Iterator[Iterable[str]]:
    """Open the lines of a log; LinkError names its file."""
    with as_error(path, LinkError), open(path, encoding="utf-8") as lines:
        try:
            yield lines
        except LinkError as error:
            raise LinkError(f"{path}: {error}") from error
        except UnicodeDecodeError as error:
            raise LinkError(f"{path}: {NO_LOG_TEXT}") from error


def _stamp(frame: MavlinkFrame, now: float, stamps: dict[tuple[float, float, float], tuple[float, float]]) -> None:
    """Keep arrival and time since boot of an own state, by its velocity: a state has one, a tick does not name it."""
    factor = {32: 1.0, 33: 0.01}.get(frame.message)
    if factor is not None:
        v = frame.values()
        stamps[swap_enu_ned(*(factor * v[key] for key in ("vx", "vy", "vz")))] = now, v["time_boot_ms"] * 1e-3


def _tick(row: Mapping[str, Any], number: int, now: float) -> LoggedTick:
    """Read the tick of a line; raise LinkError where no node wrote such a line."""
    given, phase = row.get("own"), str(row.get("phase"))
    own, command = _numbers_or_none(given, 6), _numbers_or_none(row.get("set"), 3)
    if (own is None and given is not None) or command is None or phase not in MissionPhase.__members__:
        raise LinkError(f"line {number}: was not written by a node")
    return LoggedTick(
        number, now, MissionPhase[phase], None if own is None else State(*own), (command[0], command[1], command[2])
    )


def replay(lines: Iterable[str], card: FlightCard, key: bytes) -> Iterator[ReplayedTick]:
    """Fly a log again; raise LinkError where it belongs to another card or is no log."""
    rows = enumerate(_rows(lines), 1)
    _, head = next(rows, (0, {}))
    if head.get("log") != LOG_VERSION:
        raise LinkError(NO_LOG_TEXT)
    if head.get("card") != card.hash:
        raise LinkError("the log belongs to another card")
    node = _node_at_start(head, card, key)
    now = float(head["now"])
    for number, row in rows:
        now, data = _time_and_bytes(row, number, now)
        if "a" in row:
            node.autopilot(data, now)
        elif "r" in row:
            node.radio(data, now)
        else:
            out = node.tick(now)
            same, version = output_digest(out) == row["out"], str(head.get("version", ""))
            yield ReplayedTick(now, row, out, same, node.phase, version)


def _node_at_start(head: Mapping[str, Any], card: FlightCard, key: bytes) -> Node:
    """Make the node as it was at the start of the log; raise LinkError where the first line lacks it."""
    heard, radios = head.get("heard"), head.get("radios")
    # A replay starts the node as it was: the same memory, clock and radios, or the first packet is
    # judged differently.
    stamps = [head.get(name) for name in ("sent", "order", "utc", "since")]
    stamps += list(heard.values()) if isinstance(heard, dict) else [None]
    periods: list[Any] = radios if isinstance(radios, list) and 0 < len(radios) <= MAX_RADIOS else [None]
    sound = all(type(stamp) is int and 0 <= stamp < 2**63 for stamp in stamps) and head.get("member") in card.members
    sound = sound and all(_is_number(period) and period > 0.0 for period in periods) and _is_number(head.get("now"))
    if not sound or not isinstance(heard, dict) or not all(who.isascii() and who.isdigit() for who in heard):
        raise LinkError("line 1: does not say how the node began")
    memory = NodeMemory(head["sent"], {int(who): stamp for who, stamp in heard.items()}, head["order"])
    return Node(
        card, head["member"], key, now=float(head["now"]), utc=head["utc"], memory=memory, radios=tuple(periods),
        since=head["since"],
    )  # fmt: skip


def _time_and_bytes(row: Mapping[str, Any], number: int, before: float) -> tuple[float, bytes]:
    """Read time (s) and bytes of a line; raise LinkError where no node wrote such a line."""
    now: Any
    try:
        now, data = row["t"], bytes.fromhex(row.get("a", row.get("r", "")))
    except (KeyError, TypeError, ValueError):
        now, data = None, b""
    # Times that run backwards or jump by hours mean a damaged file.
    if not _is_number(now) or not before <= now <= before + MAX_GAP or not {"a", "r", "out"} & set(row):
        raise LinkError(f"line {number}: was not written by a node")
    return float(now), data


def _numbers_or_none(values: Any, count: int) -> tuple[float, ...] | None:
    """Return this many numbers of a line; None if it does not hold them."""
    sound = isinstance(values, list) and len(values) == count and all(map(_is_number, values))
    return tuple(map(float, values)) if sound else None


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < MAX_CLOCK


def replay_log_file(path: Path, card: FlightCard, key: bytes) -> Iterator[ReplayedTick]:
    """Fly the log of a file again; LinkError names the file that belongs to another card or is no log."""
    with _log_lines(path) as lines:
        yield from replay(lines, card, key)


def _rows(lines: Iterable[str]) -> Iterator[dict[str, Any]]:
    for line in lines:
        try:
            row = parse_json(line)
        except FormatError:
            return  # the last line of a log that ended with the power
        if isinstance(row, dict):
            yield row


def read_node_memory(path: Path) -> NodeMemory:
    """Read a node's memory from before a restart; empty where there is no file yet."""
    try:
        row = parse_json_object(read_text(path))
        return NodeMemory(int(row["sent"]), {int(k): int(v) for k, v in row["heard"].items()}, int(row["order"]))
    except FileNotFoundError:
        return NodeMemory()
    except (OSError, TextError, ValueError, OverflowError, KeyError, TypeError, AttributeError) as error:
        raise LinkError(f"{path}: cannot be read as the memory of a node; remove it, on the ground only") from error


def memory_json(memory: NodeMemory) -> str:
    """Return the text of the file that `read_node_memory` reads."""
    return json.dumps(memory._asdict())
