"""Watch: a page in the browser that shows a flight and lets it be played, tuned and measured; or a fleet that flies."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from airflock.studio.flights import FlightRequest
from airflock.studio.player import Player
from airflock.support import StudioError


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

    Of a flight card (.json) it shows the fleet that carries it instead, by the packets that its radios hear: where the
    drones are, their phases, links and faults. It listens only, and can do nothing to them.

    scenario : name of a preset, of a scenario file, or of a recording (.nc), which is flown again; or of a flight card
    settings : keys like "model.p_rep" with the values that replace the file's
    seed     : seed of the flight
    law      : a law of your own that flies instead of the file's, as for `airflock.load`
    trust    : whether code that the file names, such as a law in a Python file, may run
    host     : address to listen at; 0.0.0.0 lets other machines in
    port     : port to listen at; 0 takes any free one
    against  : what flies beside it on the same clock, with the same seed and noise: another preset or file, or keys
               with values, such as {"model.p_rep": 0.2}
    radios   : of a fleet: where its packets are heard, such as "udp:0.0.0.0:14600" or "serial:/dev/ttyUSB0:57600";
               by default where a fleet in software is heard, udp:127.0.0.1:14600
    key      : of a fleet: file of the mission's key; by default beside the card
    say      : called with each line: notes, the address of the page, faults

    Raises ScenarioError for a scenario that cannot be flown, CardError for card, key and radios of a fleet, and
    StudioError for a port in use, one line each.

    Returns
    -------
    Nothing, when the page is ended with Ctrl-C; what was found is saved from the page.

    Examples
    --------
    >>> import airflock
    >>> airflock.watch("vasarhelyi_2018/4ms", {"agents": 30})  # doctest: +SKIP
    >>> airflock.watch("mission.json", radios=["udp:0.0.0.0:14600"])  # doctest: +SKIP
    """
    if str(scenario).lower().endswith(".json"):
        idle = {"settings": settings, "seed": seed, "law": law, "trust": trust, "against": against}
        _check_unused(f"{scenario}: is a flight card; its fleet is shown as it flies", idle, "a scenario")
        from airflock.studio.fleet_watch import watch_fleet

        watch_fleet(scenario, key, radios, host, port, say)
        return
    _check_unused(f"{scenario}: is flown here", {"radios": radios, "key": key}, "the flight card of a fleet (.json)")
    rival = against if against is None or isinstance(against, Mapping) else str(against)
    request = FlightRequest(str(scenario), dict(settings or {}), seed, law, trust, rival, interpret_first=True)
    player = Player(request)
    for note in dict.fromkeys(note for side in player.sides for note in side.scenario.notes):
        say(f"note: {note}")
    from airflock.studio.page import FlightPage
    from airflock.studio.view import BrowserView

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
    """Raise StudioError for what was given and would do nothing."""
    given = [name for name, value in options.items() if value]
    if given:
        raise StudioError(f"{subject}; {' and '.join(given)} need{'s' * (len(given) == 1)} {needed}")
