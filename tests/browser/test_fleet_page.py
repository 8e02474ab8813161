"""The page of a running fleet in a real browser: drones where their packets say, phases, links, faults, silence."""

import threading
from contextlib import contextmanager

import numpy as np
import pytest
from pixels import chart, coloured, places, shot
from test_watch import until

from airflock.core.contract import State
from airflock.drones.mavlink.orders import OrderKind
from airflock.fleets.drone_faults import InjectedFault
from airflock.fleets.fleet_observer import FleetObserver, TelemetryBroadcast
from airflock.fleets.lockstep import START_TIME
from airflock.fleets.radio_channel import SOFTWARE_KEY
from airflock.studio.browser_view import BrowserView
from airflock.studio.fleet_page import FleetPage
from fleets import fleet, scenario

pytestmark = pytest.mark.browser
START = [State(30.0 * (i % 3) - 30.0, 30.0 * (i // 3) - 15.0, 0.0, 0.0, 0.0, 0.0) for i in range(6)]
BLUE = (0, 114, 178)


class Flown:
    """Six drones in lock-step, flown a little at each call; some of them say nothing."""

    def __init__(self):
        self.fleet = fleet(scenario(6), start=START)
        self.teller = TelemetryBroadcast(self.fleet.card.members, [InjectedFault("loss", (5,), 0.0, 1e6, 0.5)])
        self.mute, self.orders = set(), []

    def __call__(self):
        """Datagrams of a fifth of a second of flight."""
        f = self.fleet
        f.advance(0.2)
        for order in self.orders:
            f.order(order)
        self.orders = []
        said = {node.member: node.status_datagrams(f.now) for node in f.nodes if node.member not in self.mute}
        for to in range(6):
            for who, datagrams in said.items():
                if who != f.card.members[to] and 1 not in (who, f.card.members[to]):
                    self.teller.note_arrival(to, datagrams[0], f.now)
        return [*sum(said.values(), []), *self.teller.report(f.now, START_TIME + round(f.now * 1e6))]


@contextmanager
def shown():
    flown = Flown()
    observer = FleetObserver(flown.fleet.card, SOFTWARE_KEY, now=0.0, utc=START_TIME - 1)
    view = BrowserView("127.0.0.1", 0, "fleet")
    page = FleetPage(observer, view, flown, clock=lambda: flown.fleet.now)
    thread = threading.Thread(target=page.run)
    thread.start()
    try:
        yield flown, view, page
    finally:
        page.stop()
        thread.join(30.0)
        assert not thread.is_alive()
        view.stop()


def opened(tab, view):
    tab.goto(view.address, timeout=120_000)
    until(lambda: view.clients > 0, "no page opened")
    tab.get_by_text("Fleet", exact=True).first.wait_for(timeout=120_000)


def test_a_running_fleet_is_seen_with_phases_links_faults_and_silence(browser, tab):
    with shown() as (flown, view, page):
        opened(tab, view)
        body = lambda: tab.inner_text("body")  # noqa: E731
        until(lambda: "6 of 6 drones heard, 6 fly" in body(), "the drones are not heard")
        assert body().count("flock") >= 6 and "fault loss: drone 5" in body()

        def tinted(tone):
            return places(np.abs(shot(tab)[100:, :640] - tone).max(axis=2) < 60, cell=10)

        until(lambda: tinted(BLUE) >= 5, "no drones in the colour of their phase")
        until(lambda: len(page.observer.links(flown.fleet.now)) == 10, "no links but those of drone 1")
        flown.mute.add(6)
        until(lambda: "drone 6: silent" in body() and "5 of 6 drones heard" in body(), "silence is not told")
        flown.orders.append(OrderKind.RETURN)
        until(lambda: "FLOCK → RETURN" in body(), "another phase is not told")
        until(lambda: tinted((204, 121, 167)) >= 3, "no drones in the colour of the new phase")

        tab.keyboard.press("s")
        until(lambda: page.chosen == 0 and "known to" in body(), "S selects nobody")
        tab.get_by_label("colour by").first.click()
        tab.get_by_role("option", name="battery", exact=True).click()
        until(lambda: page.scene.shown.name == "battery", "the menu does nothing")
        tab.get_by_text("Measure", exact=True).click()

        until(lambda: places(coloured(chart(tab, 1)), cell=10) >= 5, "the chart of the smallest distance is empty")
        assert not tab.faults and not page.observer.refused
