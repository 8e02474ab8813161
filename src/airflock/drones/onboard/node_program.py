"""The program of a node: its sockets, its clock, its files. Only this part does input and output on board."""

import argparse
import os
import select
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Protocol, TextIO, TypeVar

from airflock.drones.mavlink.frames import FrameStream, frames_in
from airflock.drones.mavlink.signing import read_key
from airflock.drones.onboard.card import FlightCard, read_card
from airflock.drones.onboard.flight_log import LoggingNode, memory_json, read_node_memory
from airflock.drones.onboard.node import Node, NodeOutput
from airflock.drones.onboard.peers import AUTOPILOT_COMPONENT
from airflock.support import AirflockError, CardError, LinkError, atomic, collect_errors

termios: Any
try:
    import termios
except ImportError:  # Windows
    termios = None

PORT_FORMS = "give udp:HOST:PORT, udp:HOST:PORT>HOST:PORT or serial:/dev/NAME:BAUD"
MAX_DATAGRAM = 2048  # bytes read at once
MAX_DATAGRAMS = 1000  # datagrams read at one look; what a flood brings beyond waits, or is lost as on a jammed radio
PARTNER_SILENCE = 3.0  # s; our choice: an autopilot whose address changes has restarted, and was silent for longer
RECEIVE_BUFFER = 1 << 20  # bytes that wait unread in a socket, as far as the system allows


class Port(Protocol):
    """One open port."""

    def fileno(self) -> int:
        """Return the number of the open file."""

    def read(self) -> list[bytes]:
        """Return what has arrived: datagrams, or one piece of a stream."""

    def write(self, data: bytes) -> bool:
        """Send; False if the port could not take it now."""

    def close(self) -> None:
        """Close it."""


class UdpAddresses(NamedTuple):
    """Addresses at which a UDP port listens and to which it sends."""

    here: tuple[str, int]
    destination: tuple[str, int] | None


def open_port(text: str) -> Port:
    """Open a port from its text; raise LinkError, one line, where it cannot be opened."""
    kind, _, rest = text.partition(":")
    try:
        if kind == "udp":
            here, there = _addresses(rest, text)
            # The look-up happens once, before the first packet, to fail early.
            return UdpPort(UdpAddresses(here, there and (socket.gethostbyname(there[0]), there[1])))
        if kind == "serial":
            return SerialPort(rest, text)
    except OSError as error:
        raise LinkError(f"{text}: {error.strerror}") from error
    except UnicodeError as error:
        raise LinkError(f"{text}: is not a valid name of a computer") from error
    raise LinkError(f"{text}: {PORT_FORMS}")


def check_port(text: str) -> None:
    """Check the text of a port before it is opened; raise LinkError, one line, where it is invalid."""
    kind, _, rest = text.partition(":")
    if kind == "udp":
        _addresses(rest, text)
    elif kind != "serial":
        raise LinkError(f"{text}: {PORT_FORMS}")


def _addresses(rest: str, text: str) -> UdpAddresses:
    """Return the two addresses in the text of a port; names are not looked up."""
    here, _, there = rest.partition(">")
    return UdpAddresses(_address(here, text), _address(there, text) if there else None)


def _address(address: str, text: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise LinkError(f"{text}: {address!r} is not HOST:PORT with a port from 1 to 65535")
    return host, int(port)


class UdpPort:
    """A UDP socket. Without a destination it sends nothing, until `answer` or `aim` says where to."""

    def __init__(self, addresses: UdpAddresses):
        self._destination, self._partner_at, self._has_rival = addresses.destination, -1e9, False
        self._is_partner: Callable[[bytes], bool] | None = None
        self._notify: Callable[[str], None] = lambda line: None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket.setblocking(False)
        try:
            self._socket.bind(addresses.here)
        except OSError:
            self._socket.close()
            raise

    @property
    def here(self) -> tuple[str, int]:
        """Return the address at which it listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def fileno(self) -> int:
        """Return the number of the open file."""
        return self._socket.fileno()

    def aim(self, there: tuple[str, int]) -> None:
        """Send to this address from now on."""
        self._destination = there

    def answer(self, is_partner: Callable[[bytes], bool], notify: Callable[[str], None]) -> None:
        """Where no destination is known, answer whose datagrams `is_partner` accepts, and read nobody else's."""
        if self._destination is None:
            self._is_partner, self._notify = is_partner, notify

    def _counts(self, data: bytes, sender: tuple[str, int]) -> bool:
        """Return True if a datagram is to be read; note once where the partner is, and who else speaks as it."""
        if self._is_partner is None:
            return True
        # MAVLink on this wire is not signed: any process of the network may send here. So the first
        # partner keeps the link until it is silent.
        now, address = time.monotonic(), "{}:{}".format(*sender)
        if sender != self._destination and self._is_partner(data):
            if now - self._partner_at > PARTNER_SILENCE:
                self._notify(f"the autopilot is heard from {address}; commands go there")
                self._destination = sender
            elif not self._has_rival:
                self._has_rival = True
                self._notify(f"{address} speaks as this autopilot, too: nothing of it is read")
        if sender == self._destination:
            self._partner_at = now
        # While it is silent others are read: a wrong system id would never be noticed otherwise.
        return sender == self._destination or now - self._partner_at > PARTNER_SILENCE

    def read(self) -> list[bytes]:
        """Return the datagrams that have arrived."""
        return [data for data, _ in self.read_from()]

    def read_from(self) -> list[tuple[bytes, tuple[str, int]]]:
        """Return the datagrams that have arrived, each with its sender; at most MAX_DATAGRAMS of them."""
        datagrams: list[tuple[bytes, tuple[str, int]]] = []
        take = self._socket.recvfrom
        while len(datagrams) < MAX_DATAGRAMS:
            try:
                datagrams.append(take(MAX_DATAGRAM))
            except OSError:  # nothing more has arrived, or the network is down
                break
        return [(data, sender) for data, sender in datagrams if self._counts(data, sender)]

    def write(self, data: bytes) -> bool:
        """Send a datagram."""
        return self._destination is not None and self.send(data, self._destination)

    def send(self, data: bytes, there: tuple[str, int]) -> bool:
        """Send a datagram to an address; False if the port could not take it now."""
        try:
            self._socket.sendto(data, there)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close it."""
        self._socket.close()


class SerialPort:
    """A serial line, raw, eight bits."""

    def __init__(self, rest: str, text: str):
        if termios is None:
            raise LinkError(f"{text}: serial lines need a POSIX system such as Linux; give udp:HOST:PORT")
        path, _, rate = rest.rpartition(":")
        speed: Callable[..., int] | int | None = getattr(termios, f"B{rate}", None) if rate.isdigit() else None
        if not path or not isinstance(speed, int):
            raise LinkError(f"{text}: give serial:/dev/NAME:BAUD with a usual baud rate such as 57600 or 921600")
        self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            mode = termios.tcgetattr(self._file)
            mode[0] = mode[1] = mode[3] = 0
            mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
            mode[4] = mode[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, mode)
        except BaseException as error:
            os.close(self._file)
            if isinstance(error, termios.error):  # is no OSError
                raise LinkError(f"{text}: {error}") from error
            raise

    def fileno(self) -> int:
        """Return the number of the open file."""
        return self._file

    def read(self) -> list[bytes]:
        """Return the bytes that have arrived."""
        try:
            data = os.read(self._file, MAX_DATAGRAM)
        except OSError:  # nothing has arrived, or the line was pulled out
            return []
        return [data] if data else []

    def write(self, data: bytes) -> bool:
        """Send bytes; a frame that the line cannot take at once is dropped as a whole."""
        try:
            return os.write(self._file, data) == len(data)
        except OSError:
            return False

    def close(self) -> None:
        """Close it."""
        os.close(self._file)


Result = TypeVar("Result")
DataHandler = Callable[[bytes, float], None]  # takes bytes, and when they were read, s


class TaskRest(NamedTuple):
    """A rest of a task.

    until    : end of the rest by time.monotonic, s
    handlers : ports that are read as soon as anything arrives, each with the function that takes it
    """

    until: float
    handlers: Sequence[tuple[Port, DataHandler]] = ()


def hand_on_data(port: Port, handler: DataHandler) -> None:
    """Hand the data that has arrived to its handlers."""
    for data in port.read():
        handler(data, time.monotonic())


def run_alone(task: Generator[TaskRest, None, Result]) -> Result:
    """Run a task to its end, and return its result.

    Ports are read at least once at each rest, however late the task is.
    """
    hears: Sequence[tuple[Port, DataHandler]] = ()
    poll, hands = select.poll(), {}  # type: ignore[var-annotated]
    while True:
        try:
            rest = next(task)
        except StopIteration as end:
            result: Result = end.value
            return result
        if rest.handlers is not hears:
            hears, poll, hands = (
                rest.handlers,
                select.poll(),
                {port.fileno(): (port, hand) for port, hand in rest.handlers},
            )
            for number in hands:
                poll.register(number, select.POLLIN)
        while True:
            for number, events in poll.poll(1e3 * max(0.0, rest.until - time.monotonic())):
                hand_on_data(*hands[number])
                if events & select.POLLHUP:
                    poll.unregister(number)  # a serial line that was pulled out would wake it without end
            if time.monotonic() >= rest.until:
                break


COMMAND_HELP = (
    "Fly one member of a flock: this computer beside its autopilot. Nothing arms before the operator orders it."
)
COMMAND_EXAMPLE = """example:
  python -m airflock.drones.onboard mission.json --member 3 --autopilot udp:127.0.0.1:14540 \\
      --radio 'udp:0.0.0.0:14600>192.168.1.255:14600' --radio serial:/dev/ttyUSB0:57600 --i-am-the-pilot

The first radio sends every safety.status_period, the others every safety.slow_period; what arrives by several counts
once. A person with a transmitter must be able to take over each drone at any time."""
LONGEST_CARD, NEVER = 604_800.0, 2**32  # s
SAVE_PERIOD = 1.0  # s between two writes of what outlives a restart


class ArgumentParser(argparse.ArgumentParser):
    """A parser of arguments whose errors are one line, as all others are."""

    def error(self, message: str) -> NoReturn:
        """Print the error and end with status 2."""
        self.exit(2, f"airflock: {message}; {self.prog} --help lists all options\n")


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the command."""
    parser = ArgumentParser(
        prog="python -m airflock.drones.onboard", description=COMMAND_HELP, epilog=COMMAND_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    parser.add_argument("card", type=Path, help="flight card, written by `airflock fly prepare`")
    parser.add_argument("--member", type=int, required=True, help="system id of this drone")
    parser.add_argument("--autopilot", required=True, metavar="PORT", help="udp:HOST:PORT or serial:/dev/NAME:BAUD")
    parser.add_argument(
        "--radio", action="append", required=True, metavar="PORT", help="radio to the others; repeatable"
    )
    parser.add_argument("--key", type=Path, help="key of the mission (default: beside the card, ending .key)")
    parser.add_argument("--log", type=Path, help="log of the flight (default: beside the card, with the time)")
    parser.add_argument(
        "--i-am-the-pilot", action="store_true", help="somebody holds the transmitter and may take over"
    )
    parser.add_argument("--check", action="store_true", help="check card, key and ports, and stop")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; exit with status 2 and one line per error where nothing can be flown."""
    given = make_parser().parse_args(arguments)
    if threading.current_thread() is threading.main_thread():  # only there are signals heard
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # a service that is stopped ends as by Ctrl-C
        if hasattr(signal, "SIGHUP"):  # none on Windows
            signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the terminal that it was started from has gone, as ssh does
    try:
        return _run(given)
    except AirflockError as error:
        for line in str(error).splitlines():
            sys.stderr.write(f"airflock: {line}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("airflock: stopped; the autopilot acts on lost setpoints by its own parameters\n")
        return 2


def check_arguments(arguments: argparse.Namespace) -> tuple[FlightCard, bytes, list[Port]]:
    """Return card, key and open ports; raise all errors together."""
    errors: list[str] = []
    card, key = None, b""
    with collect_errors(errors):
        card = read_card(arguments.card)
        if arguments.member not in card.members:
            errors.append(f"--member {arguments.member}: the card's members are {', '.join(map(str, card.members))}")
        if time.time() >= card.expires:
            errors.append(
                f"{arguments.card}: expired at {time.strftime('%Y-%m-%d %H:%M UTC', time.gmtime(card.expires))}"
            )
        # `fly prepare` writes cards for a week at most; those of fleets in software never expire.
        if time.time() + LONGEST_CARD < card.expires < NEVER:
            now, end = (time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(t)) for t in (time.time(), card.expires))
            sys.stderr.write(
                f"airflock: note: this computer's clock says {now}, and {arguments.card} is valid until {end}, more "
                "than a week later: was the clock set after it had started?\n"
            )
    with collect_errors(errors):
        key = read_key(arguments.key or arguments.card.with_suffix(".key"))
    # Typing it is the point: nobody starts a node by accident or from a script that was copied.
    if not arguments.i_am_the_pilot and not arguments.check:
        errors.append("--i-am-the-pilot is missing: somebody must hold the transmitter, know the law of the place, and "
                      "be able to take over each drone at any time")  # fmt: skip
    if card is not None and find_spec("cryptography") is None:
        sys.stderr.write("airflock: note: cryptography is not installed, so no order can be checked or obeyed\n")
    ports: list[Port] = []
    for text in (arguments.autopilot, *arguments.radio):
        with collect_errors(errors):
            ports.append(open_port(text))
            # It could answer only who sends to it: any process could draw the packets of this drone to itself.
            if text in arguments.radio and text.startswith("udp:") and ">" not in text:
                errors.append(f"--radio {text}: nobody would hear this drone; write {text}>HOST:PORT")
    if errors or card is None:
        for port in ports:
            port.close()
        raise CardError(errors)
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
        # Mode x: a log is evidence and is never overwritten. The buffer keeps the disk out of the
        # tick.
        with open(log_file, "x", encoding="utf-8", buffering=1 << 16) as log:
            run_node(card, arguments.member, key, ports, memory_file, log, write_line=_write_line)
    except OSError as error:
        raise LinkError(f"{error.filename or log_file}: {error.strerror}") from error
    finally:
        for port in ports:
            port.close()
    return 0


def _write_line(text: str) -> None:
    """Print a line, and ignore a closed terminal or a full disk: neither may bring a drone down."""
    with suppress(OSError):
        sys.stdout.write(text + "\n")
        sys.stdout.flush()


def run_node(
    card: FlightCard, member: int, key: bytes, ports: Sequence[Port], memory_file: Path, log: TextIO,
    write_line: Callable[[str], None], has_ended: Callable[[], bool] = lambda: False,
) -> None:  # fmt: skip
    """Run a node on the real clock with a log and a memory; the first port is the autopilot's."""
    s, memory = card.safety, read_node_memory(memory_file)
    # The first radio is the fast one; all others repeat the same packets at the slow rate.
    radios = (s.status_period, *(s.slow_period,) * (len(ports) - 2))
    now, utc = time.monotonic(), time.time_ns() // 1000
    node = Node(card, member, key, now=now, utc=utc, memory=memory, radios=radios)

    # One report for each file: at twenty ticks a second the terminal would be full of them.
    ended: set[str] = set()  # files that cannot be written any more

    def kept(name: str, action: Callable[[], object]) -> None:
        """Write to a file; report the first failure and fly on: a full disk must not bring a drone down."""
        if name in ended:
            return
        try:
            action()
        except OSError as error:
            ended.add(name)
            notify(f"the {name} can no longer be written: {error.strerror}; the flight goes on without it")

    def write(line: str) -> None:
        kept("log", lambda: log.write(line + "\n"))

    logged = LoggingNode(node, write, now=now, memory=memory, radios=radios)

    def save() -> None:
        kept("memory", lambda: atomic.write_file(memory_file, memory_json(node.memory)))
        kept("log", log.flush)

    def notify(note: str) -> None:
        write_line(f"{time.strftime('%H:%M:%S')} drone {member}: {note}")

    def speaks_as_member(data: bytes) -> bool:
        return any(frame.system == member and frame.component == AUTOPILOT_COMPONENT for frame in frames_in(data))

    if isinstance(ports[0], UdpPort):
        ports[0].answer(speaks_as_member, notify)
    try:
        ticks = run_alone(tick_task(logged, ports, s.tick, notify, has_ended, save))
    finally:
        save()
    notify(f"{ticks.total} ticks, {ticks.late} of them late by more than half a period, at most {ticks.worst:.3f} s")


class NodeLike(Protocol):
    """The interface of a node and of its wrappers."""

    def autopilot(self, data: bytes, now: float, /) -> None:
        """Take bytes that came from the autopilot."""

    def radio(self, datagram: bytes, now: float, /) -> None:
        """Take a datagram that came by radio."""

    def tick(self, now: float, /) -> NodeOutput:
        """Let the node decide."""


class TickCounts(NamedTuple):
    """Ticks of a node on the real clock: total, late by more than half a period, the worst delay (s)."""

    total: int
    late: int
    worst: float


def tick_task(
    node: NodeLike, ports: Sequence[Port], period: float, notify: Callable[[str], None],
    has_ended: Callable[[], bool], save: Callable[[], None] = lambda: None,
) -> Generator[TaskRest, None, TickCounts]:  # fmt: skip
    """Tick a node every `period` s on the real clock until `has_ended` returns True, and pass bytes.

    Bytes from the autopilot and from serial lines are read as they come: an own state holds when it
    arrives, and a line buffers little. Datagrams of radios carry the time at which they hold; they
    wait for the next tick.

    ports : the autopilot's first, then those of the radios
    notify: function that takes the node's notes
    save  : function that is called every second
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
        for datagram in out.texts:
            ports[1].write(datagram)
        for note in out.notes:
            notify(note)
        if now >= save_at:
            save_at = now + SAVE_PERIOD
            save()
        due = max(due + period, now)
        yield TaskRest(due, at_once)
    return TickCounts(count, late, worst)


def _whole_frames(port: Port, hand: DataHandler) -> DataHandler:
    """Hand on whole signed frames: a serial radio delivers pieces of a stream, UDP delivers datagrams."""
    if not isinstance(port, SerialPort):
        return hand
    line = FrameStream()

    def whole(data: bytes, now: float) -> None:
        for raw in line.whole_frames(data):
            hand(raw, now)

    return whole
