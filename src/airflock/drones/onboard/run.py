"""Run a node: its sockets, its clock, its files. The only part on board that does input and output."""

import argparse
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple, NoReturn, Protocol, TextIO

from airflock.drones.mavlink.frames import FrameStream
from airflock.drones.mavlink.keys import read_key
from airflock.drones.onboard.card import FlightCard, read_card
from airflock.drones.onboard.log import LoggingNode, memory_json, read_node_memory
from airflock.drones.onboard.node import Node, NodeOutput
from airflock.drones.onboard.ports import Port, SerialPort, open_port
from airflock.drones.onboard.resting import DataHandler, TaskRest, hand_on_data, run_alone
from airflock.support import AirflockError, CardError, LinkError, atomic, collect_errors

COMMAND_HELP = (
    "Fly one member of a flock: this computer beside its autopilot. Nothing arms before the operator orders it."
)
COMMAND_EXAMPLE = """example:
  python -m airflock.drones.onboard mission.json --member 3 --autopilot udp:127.0.0.1:14540 \\
      --radio 'udp:0.0.0.0:14600>192.168.1.255:14600' --radio serial:/dev/ttyUSB0:57600 --i-am-the-pilot

The first radio sends every safety.status_period, the others every safety.slow_period; what arrives by several counts
once. A person with a transmitter must be able to take over each drone at any time."""
SAVE_PERIOD = 1.0  # s between two writes of what outlives a restart


class ArgumentParser(argparse.ArgumentParser):
    """Arguments whose faults are one line, as all others are."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and end with status 2."""
        self.exit(2, f"airflock: {message}; {self.prog} --help lists all options\n")


def make_parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    found = ArgumentParser(
        prog="python -m airflock.drones.onboard", description=COMMAND_HELP, epilog=COMMAND_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    found.add_argument("card", type=Path, help="flight card, written by `airflock fly prepare`")
    found.add_argument("--member", type=int, required=True, help="system id of this drone")
    found.add_argument("--autopilot", required=True, metavar="PORT", help="udp:HOST:PORT or serial:/dev/NAME:BAUD")
    found.add_argument(
        "--radio", action="append", required=True, metavar="PORT", help="radio to the others; repeatable"
    )
    found.add_argument("--key", type=Path, help="key of the mission (default: beside the card, ending .key)")
    found.add_argument("--log", type=Path, help="log of the flight (default: beside the card, with the time)")
    found.add_argument("--i-am-the-pilot", action="store_true", help="somebody holds the transmitter and may take over")
    found.add_argument("--check", action="store_true", help="check card, key and ports, and stop")
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run; exit status 2 and one line per fault for whatever cannot be flown."""
    given = make_parser().parse_args(arguments)
    if threading.current_thread() is threading.main_thread():  # only there are signals heard
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # a service that is stopped ends as by Ctrl-C
        if hasattr(signal, "SIGHUP"):  # none on Windows
            signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the terminal that it was started from has gone, as ssh does
    try:
        return _run(given)
    except AirflockError as fault:
        for line in str(fault).splitlines():
            sys.stderr.write(f"airflock: {line}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("airflock: stopped; the autopilot acts on lost setpoints by its own parameters\n")
        return 2


def check_arguments(arguments: argparse.Namespace) -> tuple[FlightCard, bytes, list[Port]]:
    """Card, key and open ports; all faults at once."""
    faults: list[str] = []
    card, key = None, b""
    with collect_errors(faults):
        card = read_card(arguments.card)
        if arguments.member not in card.members:
            faults.append(f"--member {arguments.member}: the card's members are {', '.join(map(str, card.members))}")
        if time.time() >= card.expires:
            faults.append(
                f"{arguments.card}: expired at {time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime(card.expires))}"
            )
    with collect_errors(faults):
        key = read_key(arguments.key or arguments.card.with_suffix(".key"))
    if not arguments.i_am_the_pilot and not arguments.check:
        faults.append("--i-am-the-pilot is missing: somebody must hold the transmitter, know the law of the place, and "
                      "be able to take over each drone at any time")  # fmt: skip
    if card is not None and find_spec("cryptography") is None:
        sys.stderr.write("airflock: note: cryptography is not installed, so no order can be checked or obeyed\n")
    ports: list[Port] = []
    for text in (arguments.autopilot, *arguments.radio):
        with collect_errors(faults):
            ports.append(open_port(text))
    if faults or card is None:
        for port in ports:
            port.close()
        raise CardError(faults)
    for text in arguments.radio:
        if text.startswith("udp:") and ">" not in text:
            sys.stderr.write(
                f"airflock: note: --radio {text} sends to nobody before it has heard somebody; where no router speaks "
                f"first, write {text}>HOST:PORT\n"
            )
    return card, key, ports


def _run(arguments: argparse.Namespace) -> int:
    card, key, ports = check_arguments(arguments)
    stem = f"{arguments.card.stem}-{arguments.member}"
    memory_file = arguments.card.with_name(f"{stem}.memory")
    log_file = arguments.log or arguments.card.with_name(f"{stem}-{time.strftime('%Y%m%dT%H%M%SZ', time.gmtime())}.log")
    try:
        if arguments.check:
            sys.stdout.write(
                f"{arguments.card}: {card.name}, {len(card.members)} members, hash {card.hash[:8]}: fits\n"
            )
            return 0
        with open(log_file, "x", encoding="utf-8", buffering=1 << 16) as log:
            run_node(card, arguments.member, key, ports, memory_file, log, write_line=_write_line)
    except OSError as fault:
        raise LinkError(f"{fault.filename or log_file}: {fault.strerror}") from fault
    finally:
        for port in ports:
            port.close()
    return 0


def _write_line(text: str) -> None:
    """Say a line, if anybody can still hear it: a terminal that has gone or a full disk must not bring a drone down."""
    with suppress(OSError):
        sys.stdout.write(text + "\n")
        sys.stdout.flush()


def run_node(
    card: FlightCard, member: int, key: bytes, ports: Sequence[Port], memory_file: Path, log: TextIO,
    write_line: Callable[[str], None], has_ended: Callable[[], bool] = lambda: False,
) -> None:  # fmt: skip
    """Make a node, and let it live on the real clock with a log and a memory; the first port is the autopilot's."""
    s, memory = card.safety, read_node_memory(memory_file)
    radios = (s.status_period, *(s.slow_period,) * (len(ports) - 2))
    now, utc = time.monotonic(), time.time_ns() // 1000
    node = Node(card, member, key, now=now, utc=utc, memory=memory, radios=radios)

    ended: set[str] = set()  # files that cannot be written any more

    def kept(name: str, action: Callable[[], object]) -> None:
        """Write to a file; where that fails, say it once and fly on: a full disk must not bring a drone down."""
        if name in ended:
            return
        try:
            action()
        except OSError as fault:
            ended.add(name)
            tell(f"the {name} can no longer be written: {fault.strerror}; the flight goes on without it")

    def write(line: str) -> None:
        kept("log", lambda: log.write(line + "\n"))

    logged = LoggingNode(node, write, now=now, memory=memory, radios=radios)

    def save() -> None:
        kept("memory", lambda: atomic.write_file(memory_file, memory_json(node.memory)))
        kept("log", log.flush)

    def tell(note: str) -> None:
        write_line(f"{time.strftime('%H:%M:%S')} drone {member}: {note}")

    try:
        ticks = run_alone(tick_task(logged, ports, s.tick, tell, has_ended, save))
    finally:
        save()
    tell(f"{ticks.total} ticks, {ticks.late} of them late by more than half a period, at most {ticks.worst:.3f} s")


class NodeLike(Protocol):
    """A node, or what is used like one."""

    def autopilot(self, data: bytes, now: float, /) -> None:
        """Take bytes that came from the autopilot."""

    def radio(self, datagram: bytes, now: float, /) -> None:
        """Take a datagram that came by radio."""

    def tick(self, now: float, /) -> NodeOutput:
        """Let the node decide."""


class TickCounts(NamedTuple):
    """Ticks of a node on the real clock: how many, how many were late by more than half a period, the worst (s)."""

    total: int
    late: int
    worst: float


def tick_task(
    node: NodeLike, ports: Sequence[Port], period: float, notify: Callable[[str], None],
    has_ended: Callable[[], bool], save: Callable[[], None] = lambda: None,
) -> Generator[TaskRest, None, TickCounts]:  # fmt: skip
    """Tick a node every `period` s on the real clock until `until` says so, and pass bytes.

    What the autopilot and serial lines send is read as it comes: an own state holds when it arrives, and a line keeps
    little. Datagrams of radios tell themselves when they hold; they wait for the tick that looks at them, which spares
    the computer a wake-up for each.

    ports : the autopilot's first, then those of the radios; tell: takes the node's notes; save: called every second
    """
    at_once: list[tuple[Port, DataHandler]] = [(ports[0], node.autopilot)]
    at_ticks: list[tuple[Port, DataHandler]] = []
    for port in ports[1:]:
        (at_once if isinstance(port, SerialPort) else at_ticks).append((port, _whole_frames(port, node.radio)))
    due = save_at = time.monotonic()
    count, late, worst = 0, 0, 0.0
    while not has_ended():
        for port, hand in at_ticks:
            hand_on_data(port, hand)
        now = time.monotonic()
        count, late, worst = count + 1, late + (now - due > 0.5 * period), max(worst, now - due)
        out = node.tick(now)
        for data in out.autopilot:
            ports[0].write(data)
        for port, datagrams in zip(ports[1:], out.radios, strict=True):
            for datagram in datagrams:
                port.write(datagram)
        for note in out.notes:
            notify(note)
        if now >= save_at:
            save_at = now + SAVE_PERIOD
            save()
        due = max(due + period, now)
        yield TaskRest(due, at_once)
    return TickCounts(count, late, worst)


def _whole_frames(port: Port, hand: DataHandler) -> DataHandler:
    """Hand on whole signed frames: a serial radio gives pieces of a stream, UDP gives datagrams."""
    if not isinstance(port, SerialPort):
        return hand
    line = FrameStream()

    def whole(data: bytes, now: float) -> None:
        for raw in line.whole_frames(data):
            hand(raw, now)

    return whole
