"""A live page in a real browser: it shows the flock, and its controls reach the flight."""

import threading
import time

import pytest
from pixels import coloured, places, shot

from airflock.studio.page import Page
from airflock.studio.player import Player
from airflock.studio.view import View

pytestmark = pytest.mark.browser
PATIENCE = 120.0  # s


@pytest.fixture
def live(browser):
    player = Player("vasarhelyi_2018/4ms", {"agents": 20}, seed=1)
    view = View("127.0.0.1", 0, player.where)
    page = Page(player, view)
    thread = threading.Thread(target=page.run)
    thread.start()
    yield player, view, page
    page.stop()
    thread.join(30.0)
    assert not thread.is_alive()
    view.stop()


def until(holds, what):
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.2)


def opened(tab, view):
    tab.goto(view.address, timeout=PATIENCE * 1000)
    until(lambda: view.clients > 0, "no page opened")
    tab.get_by_text("Pause").first.wait_for(timeout=PATIENCE * 1000)


def test_the_flock_is_seen_moves_pauses_and_takes_changes(live, tab):
    player, view, _ = live
    opened(tab, view)
    until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
    first = coloured(shot(tab), right=640)
    until(lambda: (coloured(shot(tab), right=640) ^ first).mean() > 1e-3, "nothing moves")

    tab.get_by_text("Pause", exact=True).first.click()
    until(lambda: player.paused, "the button did not pause")
    step = player.flight.step
    tab.get_by_text("Step", exact=True).click()
    until(lambda: player.flight.step > step, "no step was flown")
    assert player.flight.step - step <= 20

    tab.get_by_text("Tune", exact=True).click()
    slider = tab.locator('[role=slider][aria-label*="p_rep"]').first
    slider.focus(timeout=PATIENCE * 1000)
    cameras = [client.camera.position for client in view.server.get_clients().values()]
    for _ in range(3):
        slider.press("ArrowRight")
    until(lambda: any(e.kind == "change" and "model.p_rep" in e.data for e in player.flight.events), "no change came")
    after = [client.camera.position for client in view.server.get_clients().values()]
    assert all((a == b).all() for a, b in zip(cameras, after, strict=True)), "a key on a slider turned the camera"
    tab.get_by_text("Undo", exact=True).click()
    until(lambda: len(player.flight.events) >= 2, "nothing was undone")

    tab.get_by_text("Play", exact=True).click()
    tab.get_by_text("Next", exact=True).click()
    tab.get_by_text("agent 0", exact=True).wait_for(timeout=PATIENCE * 1000)
    tab.get_by_text("Push", exact=True).click()
    until(lambda: player.flight.events[-1].kind == "push", "nobody was pushed")
    assert not tab.faults


def test_nobody_comes_in_without_the_token(live, browser):
    _, view, _ = live
    context = browser.new_context()
    answer = context.new_page().goto(view.address.partition("?")[0], timeout=PATIENCE * 1000)
    assert answer.status == 403
    context.close()


def test_a_page_that_is_closed_can_be_opened_again(live, browser, tab):
    player, view, _ = live
    opened(tab, view)
    other = browser.new_page()
    opened(other, view)
    other.close()
    until(lambda: view.clients == 1, "a closed page still counts")
    time_then = player.flight.time
    until(lambda: player.flight.time > time_then, "the flight stopped with a page")
    tab.reload(timeout=PATIENCE * 1000)
    until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents after a reload")
