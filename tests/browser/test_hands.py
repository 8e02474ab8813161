"""Hands on a live page: a goal that is dragged, the keyboard alone, the width of a phone, agents in colours."""

import numpy as np
import pytest
from pixels import coloured, places, shot
from test_watch import flying, opened, until

pytestmark = pytest.mark.browser
GOALS = {"goals.kind": "points", "goals.points": [[40.0, 0.0, 0.0], [-60.0, 50.0, 0.0]]}


def on_screen(view, place, size):
    """Where a place of the scene, m, is in the picture of the one open page, in pixels."""
    (client,) = view.server.get_clients().values()
    camera = client.camera
    position, target = np.array(camera.position), np.array(camera.look_at)
    ahead = (target - position) / np.linalg.norm(target - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    away = np.asarray(place, float) - position
    scale = 0.5 * size["height"] / np.tan(0.5 * camera.fov) / (away @ ahead)
    return 0.5 * size["width"] + scale * (away @ right), 0.5 * size["height"] - scale * (away @ up)


def test_a_goal_is_dragged_by_its_handle_with_the_mouse(browser, tab):
    with flying(settings={**GOALS, "agents": 8}) as (player, view, page):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 5, "no agents are seen")
        player.ask(player.toggle)
        player.ask(lambda: page.acting._drag(True))
        until(lambda: page.acting.dragging, "no handles")
        until(lambda: any("goal_0" in node.name for node in view._standing), "no handles")
        tab.wait_for_timeout(3000)
        size = 2.0 * page.drawing.size
        x, y = on_screen(view, [40.0 + 0.7 * size, 0.0, 0.0], tab.viewport_size)
        far, _ = on_screen(view, [10.0 + 0.7 * size, 0.0, 0.0], tab.viewport_size)
        tab.mouse.move(x, y)
        tab.wait_for_timeout(500)
        tab.mouse.down()
        for share in np.linspace(0.0, 1.0, 8):
            tab.mouse.move(x + share * (far - x), y)
            tab.wait_for_timeout(150)
        tab.mouse.up()
        until(lambda: player.flight.events or player.note, "nothing was dragged")
        event = player.flight.events[-1]
        assert event.kind == "change" and set(event.data) == {"goals.kind", "goals.points"}
        first, second = event.data["goals.points"]
        assert abs(first[0] - 10.0) < 3.0 and abs(first[1]) < 0.5 and second == [-60.0, 50.0, 0.0]
        assert len(player.flight.events) == 1 and not tab.faults


def test_the_keyboard_alone_plays_pauses_steps_selects_and_goes_back(browser, tab):
    with flying() as (player, view, page):
        opened(tab, view)

        def gust_blows():
            return player.scenario.wind.east > 0.0 or player.flight.waiting or player.flight.events

        tab.keyboard.press("p")
        until(lambda: player.paused, "P does not pause")
        then = player.flight.step
        tab.keyboard.press("n")
        until(lambda: player.flight.step > then, "N does not step")
        tab.keyboard.press("s")
        until(lambda: page.selecting.chosen == 0, "S selects nobody")
        tab.keyboard.press("s")
        until(lambda: page.selecting.chosen == 1, "S does not select the next")
        tab.keyboard.press("p")
        until(lambda: not player.paused, "P does not fly on")
        tab.keyboard.press("r")
        until(lambda: page.selecting.chosen is None, "R does not begin anew")
        for name, there in (("Pause", lambda: player.paused), ("Act on the world", lambda: True), ("Gust", gust_blows)):
            for _ in range(80):  # every control can be reached
                tab.keyboard.press("Tab")
                if tab.evaluate("document.activeElement.textContent.trim()") == name:
                    break
            tab.keyboard.press("Enter")
            until(there, f"Enter on {name} does nothing")
            tab.wait_for_timeout(1000)
        unnamed = "[...document.querySelectorAll('button, [role=slider]')].filter(e => !e.ariaHidden && e.offsetParent"
        assert tab.evaluate(f"{unnamed} && !e.textContent.trim() && !e.getAttribute('aria-label')).length") <= 1
        assert not tab.faults


def test_a_page_of_a_phones_width_shows_the_flock_and_its_controls(browser):
    context = browser.new_context(viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
    tab = context.new_page()
    with flying() as (player, view, _):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab)), cell=10) >= 8, "no agents are seen")
        button = tab.get_by_text("Pause", exact=True).first
        box = button.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390
        button.tap()
        until(lambda: player.paused, "the button does nothing")
        assert tab.evaluate("document.documentElement.scrollWidth") <= 391
    context.close()


def test_agents_take_the_colours_of_what_the_menu_names(browser, tab):
    groups = [{"name": "slow", "agents": 10, "model": {"v_flock": 3.0}}, {"name": "rest"}]
    with flying(settings={"groups": groups}) as (player, view, page):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        player.ask(player.toggle)
        tab.get_by_label("colour by").first.click()
        tab.get_by_role("option", name="group", exact=True).click()
        until(lambda: page.drawing.shading.shown.name == "group", "the menu does nothing")
        until(lambda: "slow" in tab.inner_text("body"), "no key")

        def tinted(tone):
            picture = shot(tab)[160:615, 140:640]
            return places(np.abs(picture - tone).max(axis=2) < 60)

        until(lambda: tinted((0, 114, 178)) >= 4 and tinted((0, 158, 115)) >= 4, "two colours are not seen")
        assert not tab.faults
