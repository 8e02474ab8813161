"""Watching a running fleet: its card, its key and its radios, and the page that shows what is heard by them."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from airflock.drones import FlightCard, FrameStream, Port, SerialPort, open_port, read_card, read_key
from airflock.fleets import DEFAULT_WATCH_ADDRESS, FleetObserver
from airflock.support import CardError, collect_errors, expand_path

DEFAULT_RADIOS = (f"udp:{DEFAULT_WATCH_ADDRESS[0]}:{DEFAULT_WATCH_ADDRESS[1]}",)  # where fleets in software are heard


class ListeningRadios:
    """Open radios that are only listened to: pieces of a serial line are put together to frames."""

    def __init__(self, ports: Sequence[Port]):
        self._ports_and_streams = [(port, FrameStream() if isinstance(port, SerialPort) else None) for port in ports]

    def __call__(self) -> Iterator[bytes]:
        """Datagrams that have arrived."""
        for port, line in self._ports_and_streams:
            for data in port.read():
                yield from [data] if line is None else line.whole_frames(data)

    def close(self) -> None:
        """Close all."""
        for port, _ in self._ports_and_streams:
            port.close()


def open_card_and_radios(
    card: Path, key: Path | None, radios: Sequence[str]
) -> tuple[FlightCard, bytes, ListeningRadios]:
    """Card, key and open radios. Raises CardError with all faults at once, and leaves nothing open."""
    faults: list[str] = []
    found, secret, ports = None, b"", []
    with collect_errors(faults):
        found = read_card(card)
    with collect_errors(faults):
        secret = read_key(key or card.with_suffix(".key"))
    for text in radios or DEFAULT_RADIOS:
        with collect_errors(faults):
            ports.append(open_port(text))
    if faults or found is None:
        ListeningRadios(ports).close()
        raise CardError(faults)
    return found, secret, ListeningRadios(ports)


def watch_fleet(
    card: str | os.PathLike[str], key: str | os.PathLike[str] | None, radios: Sequence[str], host: str, port: int,
    notify: Callable[[str], None],
) -> None:  # fmt: skip
    """Open a page that shows the fleet of a flight card by what its radios hear, until Ctrl-C. It sends nothing.

    Raises CardError for card, key and radios, all faults at once, and StudioError for a port in use.
    """
    found, secret, heard = open_card_and_radios(expand_path(card), expand_path(key) if key else None, radios)
    try:
        if time.time() >= found.expires:
            notify(f"note: {card} has expired; its drones no longer start")
        from airflock.studio.fleet_page import FleetPage
        from airflock.studio.view import BrowserView

        observer = FleetObserver(found, secret, now=time.monotonic(), utc=time.time_ns() // 1000)
        view = BrowserView(host, port, found.name)
        try:
            page = FleetPage(observer, view, heard)
            notify(f"listening at {', '.join(radios or DEFAULT_RADIOS)}; watch at {view.address}  (Ctrl-C ends)")
            page.run()
        except KeyboardInterrupt:
            notify(f"ended; {observer.accepted_count} packets were heard")
        finally:
            view.stop()
    finally:
        heard.close()
