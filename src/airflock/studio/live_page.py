"""airflock.watch: open a page in the browser that shows a live flight, or a fleet that flies."""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from airflock.drones import FlightCard, FrameStream, Port, SerialPort, open_port, read_card, read_key
from airflock.fleets import DEFAULT_WATCH_ADDRESS, FleetObserver
from airflock.studio.player import FlightRequest, Player
from airflock.support import CardError, StudioError, collect_errors, expand_path


def watch(
    scenario: str | os.PathLike[str],
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    *,
    law: Any = None,
    trust: bool = False,
    host: str = "127.0.0.1",
    port: int = 8080,
    against: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    radios: Sequence[str] = (),
    key: str | os.PathLike[str] | None = None,
    say: Callable[[str], None] = print,
) -> None:
    """Open a page that flies a scenario live, until Ctrl-C: play it, turn its sliders, save what is found.

    Of a flight card (.json) it shows the fleet that carries it instead, by the packets that its
    radios hear: where the drones are, their phases, links and faults. It listens only, and can do
    nothing to them.

    Parameters
    ----------
    scenario : str or path (PRESET|FILE)
        A preset, a scenario file, a recording (.nc) to fly again, or the flight card (.json) of a fleet.
    settings : mapping, optional
        Keys like "model.p_rep" with the values that replace the file's.
    seed : int in [0, inf]
        Seed of the flight.
    law : optional
        A law of your own that flies instead of the file's, as for `airflock.load`.
    trust : bool
        Whether code that the file names, such as a law in a Python file, may run.
    host : str
        Address to listen at; 0.0.0.0 lets other machines in.
    port : int in [0, 65535]
        Port to listen at; 0 picks a free one.
    against : str, path or mapping (PRESET|FILE|KEY=VALUE), optional
        Fly this beside it on the same clock, with the same seed and noise: another preset or file, or keys with
        values, such as {"model.p_rep": 0.2}, for a command one KEY=VALUE each.
    radios : sequence of str (PORT)
        For a fleet: where to receive its packets, such as "udp:0.0.0.0:14600" or "serial:/dev/ttyUSB0:57600"; by
        default udp:127.0.0.1:14600, as a fleet in software uses.
    key : str or path (FILE), optional
        For a fleet: file of the mission's key; by default beside the card.
    say : callable
        Called with each line: notes, the address of the page, errors.

    Returns
    -------
    None
        When the page is ended with Ctrl-C; what was found is saved from the page.

    Raises
    ------
    AirflockError
        ScenarioError for a scenario that cannot be flown, CardError for card, key and radios of a fleet, and
        StudioError for a port in use, one line each.

    Examples
    --------
    >>> import airflock
    >>> airflock.watch("vasarhelyi_2018/4ms", {"agents": 30})  # doctest: +SKIP
    >>> airflock.watch("mission.json", radios=["udp:0.0.0.0:14600"])  # doctest: +SKIP
    """
    if str(scenario).lower().endswith(".json"):
        idle = {"settings": settings, "seed": seed, "law": law, "trust": trust, "against": against}
        _check_unused(f"{scenario}: is a flight card; its fleet is shown as it flies", idle, "a scenario")

        watch_fleet(scenario, key, radios, host, port, say)
        return
    _check_unused(f"{scenario}: is flown here", {"radios": radios, "key": key}, "the flight card of a fleet (.json)")
    rival = against if against is None or isinstance(against, Mapping) else str(against)
    request = FlightRequest(str(scenario), dict(settings or {}), seed, law, trust, rival, interpret_first=True)
    player = Player(request)
    for note in dict.fromkeys(note for side in player.sides for note in side.scenario.notes):
        say(f"note: {note}")
    from airflock.studio.browser_view import BrowserView
    from airflock.studio.flight_page import FlightPage

    player.fault = say
    if player.is_compiling:
        say("compiling ... (flying interpreted meanwhile)")
    player.start()
    view = BrowserView(host, port, player.where)
    try:
        page = FlightPage(player, view)
        try:
            say(f"watch at {view.address}  (Ctrl-C ends)")
            page.run()
        except KeyboardInterrupt:
            say(f"ended at t = {player.time:.1f} s")
    finally:
        view.stop()


def _check_unused(subject: str, options: Mapping[str, Any], needed: str) -> None:
    """Raise StudioError for options that would have no effect."""
    useless = [name for name, value in options.items() if value]
    if useless:
        raise StudioError(f"{subject}; {' and '.join(useless)} need{'s' * (len(useless) == 1)} {needed}")


DEFAULT_RADIOS = (f"udp:{DEFAULT_WATCH_ADDRESS[0]}:{DEFAULT_WATCH_ADDRESS[1]}",)  # where fleets in software are heard


class ListeningRadios:
    """Open radios that only listen: pieces of a serial line are joined to frames."""

    def __init__(self, ports: Sequence[Port]):
        self._ports_and_streams = [(port, FrameStream() if isinstance(port, SerialPort) else None) for port in ports]

    def __call__(self) -> Iterator[bytes]:
        """Yield the datagrams that have arrived."""
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
    """Return card, key and open radios. Raises CardError with all errors at once, and leaves nothing open."""
    errors: list[str] = []
    flight_card, secret, ports = None, b"", []
    with collect_errors(errors):
        flight_card = read_card(card)
    with collect_errors(errors):
        secret = read_key(key or card.with_suffix(".key"))
    for text in radios or DEFAULT_RADIOS:
        with collect_errors(errors):
            ports.append(open_port(text))
    if errors or flight_card is None:
        ListeningRadios(ports).close()
        raise CardError(errors)
    return flight_card, secret, ListeningRadios(ports)


def watch_fleet(
    card: str | os.PathLike[str], key: str | os.PathLike[str] | None, radios: Sequence[str], host: str, port: int,
    notify: Callable[[str], None],
) -> None:  # fmt: skip
    """Open a page that shows the fleet of a flight card by what its radios hear, until Ctrl-C. It sends nothing.

    Raises CardError for card, key and radios, all faults at once, and StudioError for a port in
    use.
    """
    flight_card, secret, heard = open_card_and_radios(expand_path(card), expand_path(key) if key else None, radios)
    try:
        if time.time() >= flight_card.expires:
            notify(f"note: {card} has expired; its drones no longer start")
        from airflock.studio.browser_view import BrowserView
        from airflock.studio.fleet_page import FleetPage

        observer = FleetObserver(flight_card, secret, now=time.monotonic(), utc=time.time_ns() // 1000)
        view = BrowserView(host, port, flight_card.name)
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
