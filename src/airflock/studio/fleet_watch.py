"""Watching a running fleet: its card, its key and its radios, and the page that shows what is heard by them."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from airflock.drones.mavlink.frames import Stream
from airflock.drones.mavlink.keys import read_key
from airflock.drones.onboard.card import Card, read_card
from airflock.drones.onboard.ports import Port, Serial, open_port
from airflock.fleets.observer import Observer
from airflock.fleets.teller import WATCHED
from airflock.support.errors import CardError, gathering
from airflock.support.untrusted import own_path

RADIOS = (f"udp:{WATCHED[0]}:{WATCHED[1]}",)  # where fleets in software are heard


class Radios:
    """Open radios that are only listened to: pieces of a serial line are put together to frames."""

    def __init__(self, ports: Sequence[Port]):
        self._lines = [(port, Stream() if isinstance(port, Serial) else None) for port in ports]

    def __call__(self) -> Iterator[bytes]:
        """Datagrams that have arrived."""
        for port, line in self._lines:
            for data in port.read():
                yield from [data] if line is None else line.raw(data)

    def close(self) -> None:
        """Close all."""
        for port, _ in self._lines:
            port.close()


def opened(card: Path, key: Path | None, radios: Sequence[str]) -> tuple[Card, bytes, Radios]:
    """Card, key and open radios. Raises CardError with all faults at once, and leaves nothing open."""
    faults: list[str] = []
    found, secret, ports = None, b"", []
    with gathering(faults):
        found = read_card(card)
    with gathering(faults):
        secret = read_key(key or card.with_suffix(".key"))
    for text in radios or RADIOS:
        with gathering(faults):
            ports.append(open_port(text))
    if faults or found is None:
        Radios(ports).close()
        raise CardError(faults)
    return found, secret, Radios(ports)


def watch_fleet(
    card: str | os.PathLike[str], key: str | os.PathLike[str] | None, radios: Sequence[str], host: str, port: int,
    say: Callable[[str], None],
) -> None:  # fmt: skip
    """Open a page that shows the fleet of a flight card by what its radios hear, until Ctrl-C. It sends nothing.

    Raises CardError for card, key and radios, all faults at once, and StudioError for a port in use.
    """
    found, secret, heard = opened(own_path(card), own_path(key) if key else None, radios)
    try:
        if time.time() >= found.expires:
            say(f"note: {card} has expired; its drones no longer start")
        from airflock.studio.fleet_page import FleetPage
        from airflock.studio.view import View

        observer = Observer(found, secret, now=time.monotonic(), utc=time.time_ns() // 1000)
        view = View(host, port, found.name)
        try:
            page = FleetPage(observer, view, heard)
            say(f"listening at {', '.join(radios or RADIOS)}; watch at {view.address}  (Ctrl-C ends)")
            page.run()
        except KeyboardInterrupt:
            say(f"ended; {observer.accepted} packets were heard")
        finally:
            view.stop()
    finally:
        heard.close()
