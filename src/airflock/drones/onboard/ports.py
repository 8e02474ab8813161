"""Ports of a node: UDP and serial lines, by a short text each; non-blocking, without a library.

udp:HOST:PORT listens there and answers to who spoke last; udp:HOST:PORT>HOST:PORT listens at the first and sends to
the second (a broadcast address for a radio; a name is looked up once, when the port is opened); serial:/dev/NAME:BAUD
opens a serial line.
"""

import os
import socket
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from airflock.support import LinkError

termios: Any
try:
    import termios
except ImportError:  # Windows
    termios = None

PORT_FORMS = "give udp:HOST:PORT, udp:HOST:PORT>HOST:PORT or serial:/dev/NAME:BAUD"
MAX_DATAGRAM = 2048  # bytes read at once
MAX_DATAGRAMS = 1000  # datagrams read at one look; what a flood brings beyond waits, or is lost as on a jammed radio
RECEIVE_BUFFER = 1 << 20  # bytes that wait unread in a socket, as far as the system allows


class Port(Protocol):
    """One open port."""

    def fileno(self) -> int:
        """Number of the open file."""

    def read(self) -> list[bytes]:
        """What has arrived: datagrams, or one piece of a stream."""

    def write(self, data: bytes) -> bool:
        """Send; False if the port could not take it now."""

    def close(self) -> None:
        """Close it."""


class UdpAddresses(NamedTuple):
    """Where a UDP port listens and sends."""

    here: tuple[str, int]
    destination: tuple[str, int] | None


def open_port(text: str) -> Port:
    """Open a port from its text; LinkError in one line if it cannot be."""
    kind, _, rest = text.partition(":")
    try:
        if kind == "udp":
            return UdpPort(_place(rest, text))
        if kind == "serial":
            return SerialPort(rest, text)
    except OSError as fault:
        raise LinkError(f"{text}: {fault.strerror}") from fault
    except UnicodeError as fault:
        raise LinkError(f"{text}: is not a valid name of a computer") from fault
    raise LinkError(f"{text}: {PORT_FORMS}")


def check_port(text: str) -> None:
    """Refuse the text of a port that can be none, before it is opened. Raises LinkError, one line."""
    kind, _, rest = text.partition(":")
    if kind == "udp":
        here, _, there = rest.partition(">")
        for told in (here, there) if there else (here,):
            _address(told, text)
    elif kind != "serial":
        raise LinkError(f"{text}: {PORT_FORMS}")


def _place(rest: str, text: str) -> UdpAddresses:
    here, _, there = rest.partition(">")
    return UdpAddresses(_address(here, text), _resolved(*_address(there, text)) if there else None)


def _resolved(host: str, port: int) -> tuple[str, int]:
    """An address by its number: a name is looked up once, before the first packet, so a wrong one is found early."""
    return socket.gethostbyname(host), port


def _address(address: str, text: str) -> tuple[str, int]:
    host, _, port = address.rpartition(":")
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise LinkError(f"{text}: {address!r} is not HOST:PORT with a port from 1 to 65535")
    return host, int(port)


class UdpPort:
    """A UDP socket."""

    def __init__(self, addresses: UdpAddresses):
        self._destination = addresses.destination
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket.setblocking(False)
        try:
            self._socket.bind(addresses.here)
        except OSError:
            self._socket.close()
            raise
        self._answers_last_sender = addresses.destination is None

    @property
    def here(self) -> tuple[str, int]:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def fileno(self) -> int:
        """Number of the open file."""
        return self._socket.fileno()

    def aim(self, there: tuple[str, int]) -> None:
        """Send there from now on, whoever speaks."""
        self._destination, self._answers_last_sender = there, False

    def read(self) -> list[bytes]:
        """The datagrams that have arrived."""
        return [data for data, _ in self.read_from()]

    def read_from(self) -> list[tuple[bytes, tuple[str, int]]]:
        """The datagrams that have arrived, each with who sent it; at most MOST of them."""
        found: list[tuple[bytes, tuple[str, int]]] = []
        take = self._socket.recvfrom
        while len(found) < MAX_DATAGRAMS:
            try:
                found.append(take(MAX_DATAGRAM))
            except OSError:  # nothing more has arrived, or the network is down
                break
        if self._answers_last_sender and found:
            self._destination = found[-1][1]
        return found

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
        path, _, told = rest.rpartition(":")
        speed: Callable[..., int] | int | None = getattr(termios, f"B{told}", None) if told.isdigit() else None
        if not path or not isinstance(speed, int):
            raise LinkError(f"{text}: give serial:/dev/NAME:BAUD with a usual baud rate such as 57600 or 921600")
        self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            mode = termios.tcgetattr(self._file)
            mode[0] = mode[1] = mode[3] = 0
            mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
            mode[4] = mode[5] = speed
            termios.tcsetattr(self._file, termios.TCSANOW, mode)
        except BaseException as fault:
            os.close(self._file)
            if isinstance(fault, termios.error):  # is no OSError
                raise LinkError(f"{text}: {fault}") from fault
            raise

    def fileno(self) -> int:
        """Number of the open file."""
        return self._file

    def read(self) -> list[bytes]:
        """The bytes that have arrived."""
        try:
            data = os.read(self._file, MAX_DATAGRAM)
        except OSError:  # nothing has arrived, or the line was pulled out
            return []
        return [data] if data else []

    def write(self, data: bytes) -> bool:
        """Send bytes; what the line cannot take at once is dropped as a whole frame."""
        try:
            return os.write(self._file, data) == len(data)
        except OSError:
            return False

    def close(self) -> None:
        """Close it."""
        os.close(self._file)
