"""A live page in a real browser: it shows the flock, and its controls reach the flight."""

import threading
import time
from contextlib import contextmanager

import pytest
from pixels import coloured, places, shot

from airflock.studio.browser_view import BrowserView
from airflock.studio.flight_page import FlightPage
from airflock.studio.player import FlightRequest, Player

pytestmark = pytest.mark.browser
PATIENCE = 120.0  # s


@contextmanager
def flying(where="vasarhelyi_2018/4ms", settings=None, **more):
    """A page that flies in a thread of its own."""
    player = Player(FlightRequest(where, {"agents": 20, **(settings or {})}, seed=1, **more))
    view = BrowserView("127.0.0.1", 0, player.where)
    page = FlightPage(player, view)
    thread = threading.Thread(target=page.run)
    thread.start()
    try:
        yield player, view, page
    finally:
        page.stop()
        thread.join(30.0)
        assert not thread.is_alive()
        view.stop()


@pytest.fixture
def live(browser):
    with flying() as found:
        yield found


def until(holds, what):
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.2)


def opened(tab, view):
    tab.goto(view.address, timeout=PATIENCE * 1000)
    until(lambda: view.clients > 0, "no page opened")
    tab.get_by_text("Pause").first.wait_for(timeout=PATIENCE * 1000)


SHOWN = """Object.values(window.__viserTestpoints?.uplots ?? {})
    .map(({chart}) => [chart.scales.x.min, chart.scales.x.max, chart.data[0][0], chart.data[0].at(-1)])"""


def test_charts_show_all_of_a_flight_also_after_they_were_hidden(live, tab):
    player, view, _ = live
    opened(tab, view)
    until(lambda: player.time > 8.0, "it does not fly")
    tab.get_by_role("tab", name="Measure").click()
    end = player.time + 3.0
    until(lambda: player.time > end, "it does not fly on")
    shown = tab.evaluate(SHOWN)
    assert len(shown) >= 5
    assert all(
        low <= first and last <= high <= first + 2.5 * max(last - first, 1.0) for low, high, first, last in shown
    )
    assert max(last for _, _, _, last in shown) > 8.0


def test_the_flock_is_seen_moves_pauses_and_takes_changes(live, tab):
    player, view, _ = live
    opened(tab, view)
    until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
    first = coloured(shot(tab), right=640)
    until(lambda: (coloured(shot(tab), right=640) ^ first).mean() > 1e-3, "nothing moves")

    tab.get_by_text("Pause", exact=True).first.click()
    until(lambda: player.is_paused, "the button did not pause")
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
    tab.get_by_text("Let it fail", exact=True).click()
    player.ask(player.toggle_pause)
    until(lambda: player.flight.faults, "no motor fails")
    assert [event.kind for event in player.flight.events][-2:] == ["push", "fault"]
    assert player.flight.faults[0]["kind"] == "motor" and not tab.faults


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
    assert view.clients == 2
    other.close()
    until(lambda: view.clients == 1, "a closed page still counts")
    then = player.flight.time
    until(lambda: player.flight.time > then, "the flight stopped with a page")
    tab.reload(timeout=PATIENCE * 1000)
    until(lambda: view.clients == 1, "a page that was loaded again does not count")
    until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents after a reload")
    assert player.flight.time > then and view.clients == 1 and not tab.faults


def test_a_fork_flies_beside_and_what_is_changed_is_its_own(live, tab):
    player, view, page = live
    opened(tab, view)
    until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
    tab.get_by_text("Pause", exact=True).first.click()
    until(lambda: player.is_paused, "the button did not pause")
    tab.get_by_text("Compare", exact=True).click()
    tab.get_by_text("Fork here", exact=True).click()
    until(lambda: len(player.sides) == 2, "no fork")
    until(lambda: "controls act on" in tab.inner_text("body"), "the page does not say whom its controls act on")
    time.sleep(2.0)
    picture = coloured(shot(tab))
    assert places(picture[:, :330]) >= 5 and places(picture[:, 330:640]) >= 5, "two flocks are not seen"

    tab.get_by_text("Tune", exact=True).click()
    slider = tab.locator('[role=slider][aria-label*="p_rep"]').first
    slider.focus(timeout=PATIENCE * 1000)
    slider.press("ArrowRight")
    a, b = player.sides
    until(lambda: b.flight.events, "no change came")
    assert [event.kind for event in b.flight.events] == ["change"] and not a.flight.events
    player.ask(player.toggle_pause)
    then = a.flight.time
    until(lambda: a.flight.time > then + 1.0, "nothing flies")
    player.ask(player.toggle_pause)
    until(lambda: player.is_paused, "no pause")
    assert a.flight.time == b.flight.time and (a.flight.state != b.flight.state).any()
    tab.get_by_text("Compare", exact=True).click()
    until(lambda: "model.p_rep" in tab.inner_text("body"), "the difference is not in the table")
    tab.get_by_text("End comparison", exact=True).click()
    until(lambda: len(player.sides) == 1, "the comparison goes on")
    assert player.flight is b.flight and not tab.faults


def test_an_obstacle_is_thrown_in_a_gust_blows_and_agents_are_removed(browser, tab):
    with flying("vasarhelyi_2018/obstacles", {"agents": 12}) as (player, view, page):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        player.ask(player.toggle_pause)
        tab.get_by_text("Act on the world", exact=True).click()
        tab.get_by_text("Throw an obstacle in", exact=True).click()
        until(lambda: page.actions.is_aiming, "the button did nothing")
        before, known = coloured(shot(tab), right=640), len(player.scenario.world.obstacles)
        tab.mouse.click(330, 420)
        until(lambda: player.flight.events or player.note, "the click did nothing")
        assert player.flight.events, player.note
        assert player.flight.events[-1].kind == "change" and list(player.flight.events[-1].data) == ["world.obstacles"]
        assert len(player.scenario.world.obstacles) == known + 1
        until(lambda: coloured(shot(tab), right=640)[390:450, 290:370].sum() > 200, "no obstacle is seen")
        assert before[390:450, 290:370].sum() < 200

        tab.get_by_text("Gust", exact=True).click()
        player.ask(player.toggle_pause)
        until(lambda: player.scenario.wind.east == 8.0, "no gust")
        player.ask(lambda: setattr(player.clock, "speed", 20.0))
        until(lambda: player.scenario.wind.east == 0.0, "the gust does not end")
        assert [list(event.data) for event in player.flight.events[-2:]] == [["wind.east", "wind.north"]] * 2

        player.ask(lambda: page.playback.reset(agents=1))
        until(lambda: player.flight.agents == 1, "agents stay")
        time.sleep(2.0)
        inside = shot(tab)[160:615, 140:640]  # of the arena's blue walls
        teal = (inside[..., 1] - inside[..., 0] > 60) & (inside[..., 2] > 60)  # darts, not orange obstacles
        assert places(teal) <= 4, "agents that were removed are still seen"
        assert not tab.faults


def test_sliders_of_faults_change_them_also_of_one_that_was_set_off_by_hand(browser, tab):
    faults = [{"kind": "motor", "at": 0.0, "agents": [1], "share": 0.5}]
    with flying(settings={"agents": 12, "faults": faults}) as (player, view, _):
        opened(tab, view)
        tab.get_by_text("Tune", exact=True).click()

        def pressed(folder, number):
            tab.get_by_text(folder, exact=True).click(timeout=PATIENCE * 1000)
            slider = tab.locator(f'[role=slider][aria-label*="{number}"]').last
            slider.wait_for(timeout=PATIENCE * 1000)
            tab.wait_for_timeout(1000)  # the folder unfolds
            slider.focus(timeout=PATIENCE * 1000)
            slider.press("ArrowRight")

        pressed("fault 0: motor", "share")
        until(lambda: player.scenario.faults[0].numbers.share > 0.5, "the slider of a fault changes nothing")
        until(lambda: "--set faults.0.share=" in tab.inner_text("body"), "the command does not tell it")
        player.ask(lambda: player.flight.fault("pretender", [3], wait=False))
        pressed("fault 1: pretender", "east")
        until(lambda: player.scenario.faults[1].numbers.east > 20.0, "that of one set off by hand changes nothing")
        assert not tab.faults


def test_sliders_of_a_group_change_that_group_alone(browser, tab):
    """One number that the file gives it, and one of a law that only it has; the flock's own stay."""
    groups = [
        {"name": "heavy", "agents": 5, "body": {"tau": 2.0}},
        {"name": "repelled", "agents": [0, 1], "model": {"kind": "viragh_2014"}},
    ]
    with flying(settings={"agents": 12, "groups": groups}) as (player, view, _):
        opened(tab, view)
        tab.get_by_text("Tune", exact=True).click()
        for folder, number in (("group heavy: body", "tau"), ("group repelled: model", "p_rep")):
            tab.get_by_text(folder, exact=True).click()
            slider = tab.locator(f'[role=slider][aria-label*="{number}"]').last
            slider.wait_for(timeout=PATIENCE * 1000)
            tab.wait_for_timeout(1000)  # the folder unfolds
            slider.focus(timeout=PATIENCE * 1000)
            slider.press("ArrowRight")
        keys = {"groups.heavy.body.tau", "groups.repelled.model.p_rep"}
        changed = lambda: {key for event in player.flight.events for key in event.data}  # noqa: E731
        until(lambda: changed() == keys, "the sliders changed something else, or nothing")
        scenario = player.scenario
        assert scenario.groups[0].numbers["b", "tau"] > 2.0 and scenario.body.tau == 1.0
        until(lambda: "--set groups.heavy.body.tau=" in tab.inner_text("body"), "the command does not tell it")
        assert not tab.faults
