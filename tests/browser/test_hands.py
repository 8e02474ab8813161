"""Hands on a live page: a goal that is dragged, the keyboard alone, the width of a phone, agents in colours."""

import numpy as np
import pytest
from pixels import chart, coloured, places, shot
from test_watch import flying, opened, until

from airflock.scenarios.files import presets

pytestmark = pytest.mark.browser
GOALS = {"goals.kind": "points", "goals.points": [[40.0, 0.0, 0.0], [-60.0, 50.0, 0.0]]}

STEEP = """
from dataclasses import dataclass
import airflock
COMMAND = "velocity"
@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    pull: float = airflock.quantity(1.0, "m/s", low=0.0, high=3e38, meaning="how fast it flies")
def decide(own, p):
    return p.pull * (own.hx + 2.0), own.hy, own.hz
"""


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
        player.ask(player.toggle_pause)
        player.ask(lambda: page.actions._drag(True))
        until(lambda: page.actions.is_dragging, "no handles")
        until(lambda: any("goal_0" in node.name for node in view._standing), "no handles")
        tab.wait_for_timeout(3000)
        size = 2.0 * page.scene.size
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
        until(lambda: player.is_paused, "P does not pause")
        then = player.flight.step
        tab.keyboard.press("n")
        until(lambda: player.flight.step > then, "N does not step")
        tab.keyboard.press("s")
        until(lambda: page.selection.chosen == 0, "S selects nobody")
        tab.keyboard.press("s")
        until(lambda: page.selection.chosen == 1, "S does not select the next")
        tab.keyboard.press("p")
        until(lambda: not player.is_paused, "P does not fly on")
        tab.keyboard.press("r")
        until(lambda: page.selection.chosen is None, "R does not begin anew")
        for name, there in (
            ("Pause", lambda: player.is_paused),
            ("Act on the world", lambda: True),
            ("Gust", gust_blows),
        ):
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
        until(lambda: player.is_paused, "the button does nothing")
        assert tab.evaluate("document.documentElement.scrollWidth") <= 391
    context.close()


def test_agents_take_the_colours_of_what_the_menu_names(browser, tab):
    groups = [{"name": "slow", "agents": 10, "model": {"v_flock": 3.0}}, {"name": "rest"}]
    with flying(settings={"groups": groups}) as (player, view, page):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        player.ask(player.toggle_pause)
        tab.get_by_label("colour by").first.click()
        tab.get_by_role("option", name="group", exact=True).click()
        until(lambda: page.scene.colouring.shown.name == "group", "the menu does nothing")
        until(lambda: "slow" in tab.inner_text("body"), "no key")

        def tinted(tone):
            picture = shot(tab)[160:615, 140:640]
            return places(np.abs(picture - tone).max(axis=2) < 60)

        until(lambda: tinted((0, 114, 178)) >= 4 and tinted((0, 158, 115)) >= 4, "two colours are not seen")
        assert not tab.faults


def test_three_kinds_of_control_reach_the_flight(browser, tab):
    with flying() as (player, view, page):
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        tab.get_by_text("Tune", exact=True).click()
        slider = tab.locator('[role=slider][aria-label*="p_rep"]').first
        slider.focus()
        slider.press("ArrowRight")
        until(lambda: player.flight.events and "model.p_rep" in player.flight.events[-1].data, "no slider")
        tab.get_by_label("limit").first.click()
        tab.get_by_role("option", name="cap", exact=True).click()
        until(lambda: player.flight.events[-1].data == {"model.limit": "cap"}, "no menu")
        tab.get_by_label("any key").fill("delay = 400 ms")
        tab.get_by_text("Set", exact=True).click()
        until(lambda: player.flight.events[-1].data == {"radio.delay": "400 ms"}, "no line of text")
        until(lambda: player.scenario.radio.delay == 0.4 and player.scenario.parameters.limit == "cap", "not in force")
        count = len(player.flight.events)
        tab.get_by_label("any key").fill("p_rap = 1")
        tab.get_by_text("Set", exact=True).click()
        until(lambda: "did you mean" in tab.inner_text("body"), "a key that is not there is not told")
        assert len(player.flight.events) == count
        tab.get_by_text("Copy command", exact=True).click()
        until(lambda: tab.get_by_text("Copied", exact=True).count(), "nothing was copied")
        tab.get_by_text("Back to preset", exact=True).click()
        until(lambda: not player.changed, "the preset is not back")
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "the flock is gone")
        assert not tab.faults


def test_any_earlier_moment_is_reached_by_its_time(browser, tab):
    with flying() as (player, view, page):
        opened(tab, view)
        player.ask(lambda: setattr(player.clock, "speed", 20.0))
        until(lambda: player.time > 12.0, "it does not fly")
        player.ask(player.toggle_pause)
        until(lambda: player.is_paused, "no pause")
        before = shot(tab)
        tab.get_by_label("moment (s)").fill("3.4")
        tab.get_by_text("Go to this moment", exact=True).click()
        until(lambda: abs(player.time - 3.4) < 0.02, "it does not go there")
        until(lambda: (np.abs(shot(tab) - before).max(axis=2) > 60).mean() > 1e-3, "the picture stays")
        tab.get_by_label("moment (s)").fill("99")
        tab.get_by_text("Go to this moment", exact=True).click()
        until(lambda: "give a time from 0 to" in tab.inner_text("body"), "a time to come is not refused")
        assert abs(player.time - 3.4) < 0.02 and not tab.faults


def test_a_file_is_opened_and_one_that_is_no_toml_is_told(browser, tab, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with flying() as (player, view, page):
        lines = []
        player.fault = lines.append
        opened(tab, view)
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        tab.get_by_text("Open another scenario", exact=True).click()
        field = tab.locator("input[type=file]")
        flown = player.flight
        field.set_input_files({"name": "story.toml", "mimeType": "text/plain", "buffer": b"Once upon a time"})
        until(lambda: "story.toml: is not a scenario file (TOML)" in tab.inner_text("body"), "the page does not tell")
        assert player.flight is flown and lines and not list(tmp_path.iterdir())
        text = presets()["vasarhelyi_2018/obstacles"].read_bytes()
        field.set_input_files({"name": "mine.toml", "mimeType": "text/plain", "buffer": text})
        until(lambda: player.side.origin.where == "mine.toml", "the file is not flown")
        until(lambda: "mine.toml" in tab.inner_text("body"), "the page does not name it")

        def orange():
            red, green, blue = np.moveaxis(shot(tab)[160:615, 140:640], 2, 0)
            return places((red > 180) & (green < 160) & (blue < 90))

        until(lambda: orange() >= 6, "its obstacles are not seen")
        tab.get_by_label("preset").first.click()
        tab.get_by_role("option", name="vasarhelyi_2018/4ms", exact=True).click()
        until(lambda: player.side.origin.where == "vasarhelyi_2018/4ms", "the preset is not flown")
        until(lambda: orange() == 0, "the obstacles of before are still seen")
        assert not tab.faults


def test_a_law_that_stops_flying_says_so_and_the_moment_before_is_a_button(browser, tab, tmp_path):
    law = tmp_path / "steep.py"
    law.write_text(STEEP)
    with flying(law=str(law), trust=True) as (player, view, page):
        lines = []
        player.fault = lines.append
        opened(tab, view)
        player.ask(lambda: setattr(player.clock, "speed", 5.0))
        until(lambda: player.time > 5.0, "it does not fly")
        player.ask(lambda: player.change("model.pull", 3e38))
        until(lambda: player.failure_message, "it does not fail")
        button = tab.get_by_text("Go back one moment", exact=True)
        until(lambda: "agent" in tab.inner_text("body") and button.is_visible(), "the page does not tell")
        assert any(line.startswith("stopped:") and "agent" in line for line in lines)
        failed = player.time
        button.click()
        until(lambda: not player.failure_message and player.is_paused, "the button does nothing")
        assert failed - 4.0 < player.time < failed and np.isfinite(player.flight.state).all()
        until(lambda: not button.is_visible(), "the button stays")
        until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents are seen")
        assert not tab.faults


def test_an_order_parameter_that_no_paper_reports_is_drawn(browser, tab):
    with flying("vasarhelyi_2018/real_gnss") as (player, view, page):
        opened(tab, view)
        player.ask(lambda: setattr(player.clock, "speed", 5.0))
        tab.get_by_text("Measure", exact=True).click()
        until(lambda: player.time > 20.0, "it does not fly")

        def lines():
            return places(np.abs(chart(tab) - (0, 114, 178)).max(axis=2) < 60, cell=10)

        until(lambda: lines() >= 8, "the chart of the order parameter is empty")
        tab.get_by_label("order parameter").first.click()
        tab.get_by_role("option", name="phi_vel", exact=True).click()
        until(lambda: page.measurement.name == "phi_vel" and lines() >= 8, "another order parameter is not drawn")
        assert not tab.faults
