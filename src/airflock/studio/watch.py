"""Watch: a page in the browser that shows a flight and lets it be played, tuned and measured."""

import os
from collections.abc import Callable, Mapping
from typing import Any

from airflock.studio.player import Player


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
    say: Callable[[str], None] = print,
) -> None:
    """Open a page that flies a scenario live, until Ctrl-C: play it, turn its sliders, save what is found.

    scenario : name of a preset, of a scenario file, or of a recording (.nc), which is flown again
    settings : keys like "model.p_rep" with the values that replace the file's
    seed     : seed of the flight
    law      : a law of your own that flies instead of the file's, as for `airflock.load`
    trust    : whether code that the file names, such as a law in a Python file, may run
    host     : address to listen at; 0.0.0.0 lets other machines in
    port     : port to listen at; 0 takes any free one
    against  : what flies beside it on the same clock, with the same seed and noise: another preset or file, or keys
               with values, such as {"model.p_rep": 0.2}
    say      : is told each line: notes, the address of the page, faults

    Raises ScenarioError for a scenario that cannot be flown, and StudioError for a port in use, one line each.

    Returns
    -------
    Nothing, when the page is ended with Ctrl-C; what was found is saved from the page.

    Examples
    --------
    >>> import airflock
    >>> airflock.watch("vasarhelyi_2018/4ms", {"agents": 30})  # doctest: +SKIP
    """
    rival = against if against is None or isinstance(against, Mapping) else str(against)
    player = Player(str(scenario), dict(settings or {}), seed, law=law, trust=trust, against=rival, at_once=True)
    for note in dict.fromkeys(note for side in player.sides for note in side.scenario.notes):
        say(f"note: {note}")
    from airflock.studio.page import Page
    from airflock.studio.view import View

    player.fault = say
    if player.compiling:
        say("compiling ... (interpreted meanwhile)")
    player.start()
    view = View(host, port, player.where)
    try:
        page = Page(player, view)
        try:
            say(f"watch at {view.address}  (Ctrl-C ends)")
            page.run()
        except KeyboardInterrupt:
            say(f"ended at t = {player.time:.1f} s")
        finally:
            page.evolving.stop()
    finally:
        view.stop()
