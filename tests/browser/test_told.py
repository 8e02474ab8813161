"""What a live page tells: collisions and their times, the paper's value as a band, a fault that was set off."""

import re

import numpy as np
import pytest
from pixels import chart, coloured, places, shot
from test_watch import flying, opened, until

from airflock.view import agent_colours

pytestmark = pytest.mark.browser
NEAR = {"metrics.r_coll": 8.0}  # m; so that there are many


def test_collisions_ahead_are_forgotten_when_the_flight_goes_back_and_listed_when_they_come_again(browser, tab):
    with flying(settings=NEAR) as (player, view, page):
        opened(tab, view)

        def told():
            words = tab.inner_text("body").partition("Pairs that collided")[2]
            return [float(time) for time in re.findall(r"t = ([\d.]+) s: \d+ and \d+", words)]

        player.ask(lambda: setattr(player.clock, "speed", 5.0))
        until(lambda: player.time > 15.0 and told() and told()[0] > 10.5, "nobody comes near")
        player.ask(player.toggle_pause)
        until(lambda: player.is_paused, "no pause")
        first = page.scene.collisions.listed
        tab.get_by_text("Back 10 s", exact=True).click()
        until(lambda: player.time < 12.0, "it does not go back")
        until(lambda: all(time <= player.time + 0.05 for time in told()), "collisions that lie ahead stay listed")
        early = page.scene.collisions.listed
        assert early == [c for c in first if c.time <= player.time] and len(early) < len(first)
        player.ask(player.toggle_pause)
        until(lambda: len(page.scene.collisions.listed) > len(early), "no collision after going back")
        assert not tab.faults


def test_what_the_paper_reports_is_a_shaded_band(browser, tab):
    with flying(settings={"agents": 30}) as (player, view, page):
        opened(tab, view)
        player.ask(lambda: setattr(player.clock, "speed", 5.0))
        tab.get_by_text("Measure", exact=True).click()
        until(lambda: player.time > 10.0 and page.measurement.name == "fitness", "it does not fly")

        def shaded():
            return np.argwhere(np.abs(chart(tab) - (250, 236, 205)).max(axis=2) < 10)

        until(lambda: len(shaded()) > 1000, "no band")
        rows, columns = np.ptp(shaded(), axis=0) + 1
        assert rows < 0.4 * columns, "the band is no band"
        tab.get_by_label("order parameter").first.click()
        tab.get_by_role("option", name="phi_corr", exact=True).click()
        until(lambda: page.measurement.name == "phi_corr" and coloured(chart(tab)).any(), "no other chart")
        until(lambda: len(shaded()) < 50, "a band where no paper reports a value")
        assert not tab.faults


def test_a_radio_that_is_silenced_in_flight_is_heard_by_nobody(browser, tab):
    with flying(settings={"agents": 12}) as (player, view, page):
        opened(tab, view)

        def ages(silent):
            """Ages of what is heard of agent 0, or of the others."""
            heard = [other for agent in range(12) for other in player.flight.look(agent).heard]
            return [other.age for other in heard if (other.who == 0) == silent]

        def stopped(on):
            player.ask(player.toggle_pause)
            until(lambda: player.is_paused == on, "no pause")

        until(lambda: player.time > 4.0, "it does not fly")
        stopped(True)
        assert min(ages(True)) < 2.0 and min(ages(False)) < 2.0
        tab.get_by_text("Next", exact=True).click()
        until(lambda: page.selection.chosen == 0, "nobody is selected")
        tab.get_by_label("fault").first.click()
        tab.get_by_role("option", name="radio_silent", exact=True).click()
        tab.get_by_text("Let it fail", exact=True).click()
        begun = player.time
        stopped(False)
        until(lambda: player.flight.faults, "the radio is not silent")
        event = player.flight.events[-1]
        assert (event.kind, event.data["kind"]) == ("fault", "radio_silent")
        until(lambda: player.time > player.flight.faults[0]["begin"] + 5.0, "it does not fly on")
        stopped(True)
        assert player.time > begun + 5.0 and min([*ages(True), np.inf]) > 4.0 and min(ages(False)) < 2.0
        tab.get_by_label("colour by").first.click()
        tab.get_by_role("option", name="fault", exact=True).click()
        until(lambda: "radio_silent" in tab.inner_text("body"), "the key does not name the fault")
        tone = agent_colours.category_colours(1)[0]
        until(lambda: places(np.abs(shot(tab)[160:615, 140:640] - tone).max(axis=2) < 70) >= 1, "nobody is coloured")
        assert not tab.faults
