"""A replay from disk in a real browser."""

import time

import numpy as np
import pytest
from pixels import coloured, places, shot

import airflock

pytestmark = pytest.mark.browser
PATIENCE = 120_000  # ms


@pytest.fixture(scope="module")
def recording():
    return airflock.simulate(airflock.load("vasarhelyi_2018/obstacles", {"agents": 20, "duration": 30.0}), 2)


def opened(tab, recording, folder):
    path = airflock.replay(recording).save(folder / "show.html")
    asked = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(path.as_uri(), timeout=PATIENCE)
    tab.wait_for_function("window.replay && window.replay.time > 0", timeout=PATIENCE)
    assert all(url.startswith(("file:", "data:", "blob:")) for url in asked)


def test_a_replay_plays_from_disk_and_shows_the_recorded_places(recording, tab, tmp_path):
    opened(tab, recording, tmp_path)
    kept = recording["position"].values[:, :, 0]
    span = np.ptp(kept, axis=(0, 2))
    shown = np.array(tab.evaluate("[0, 7, 19].map(a => [0, 10, 100].map(f => replay.position(a, f)))"))
    stride = round(0.1 / float(recording["time"][1] - recording["time"][0])) or 1
    for row, agent in zip(shown, (0, 7, 19), strict=True):
        for place, frame in zip(row, (0, 10, 100), strict=True):
            assert (np.abs(place - kept[frame * stride, :, agent]) <= 0.51 * span / 65535 + 1e-4).all()
    assert places(coloured(shot(tab), right=740)) >= 15
    assert not tab.faults


def test_a_replay_in_a_cell_of_a_notebook_plays_in_place(recording, tab, tmp_path):
    cell = airflock.replay(recording, rate=2.0)._repr_html_()
    page = tmp_path / "notebook.html"
    page.write_text(f"<!DOCTYPE html><meta charset='utf-8'><h1>A notebook</h1><div>{cell}</div>", encoding="utf-8")
    tab.goto(page.as_uri(), timeout=PATIENCE)
    frame = tab.locator("iframe").element_handle().content_frame()
    frame.wait_for_function("window.replay && window.replay.time > 1", timeout=PATIENCE)
    assert places(coloured(shot(tab)[:, :740])) >= 10 and not tab.faults
    frame.get_by_role("button", name="play or pause").click()
    assert frame.evaluate("replay.playing") is False


def test_pause_seek_and_space(recording, tab, tmp_path):
    opened(tab, recording, tmp_path)
    tab.get_by_role("button", name="play or pause").click()
    assert tab.evaluate("replay.playing") is False
    then = tab.evaluate("replay.time")
    first = shot(tab)
    time.sleep(1.0)
    assert tab.evaluate("replay.time") == then
    tab.evaluate("replay.seek(25)")
    tab.wait_for_function("document.getElementById('clock').textContent === '25.0 s'", timeout=PATIENCE)
    assert (np.abs(shot(tab) - first).max(axis=2) > 60).mean() > 1e-3
    tab.get_by_role("button", name="3-D").click()
    time.sleep(1.0)
    assert places(coloured(shot(tab), right=740)) >= 10
    assert not tab.faults


def test_whoever_wants_less_motion_starts_it_by_hand(recording, browser, tmp_path):
    page = browser.new_page(reduced_motion="reduce")
    page.goto(airflock.replay(recording).save(tmp_path / "show.html").as_uri(), timeout=PATIENCE)
    page.wait_for_function("window.replay", timeout=PATIENCE)
    time.sleep(1.0)
    assert page.evaluate("replay.time") == 0.0 and page.locator("#play").inner_text() == "Play"
    page.locator("#play").click()
    page.wait_for_function("window.replay.time > 0", timeout=PATIENCE)
    page.close()


def test_colours_stand_for_what_the_menu_says(tab, tmp_path):
    given = {"agents": 12, "duration": 12.0, "groups": [{"agents": [4, 5], "name": "slow"}, {"name": "rest"}]}
    scenario = airflock.load("vasarhelyi_2018/4ms", given)
    events = [{"step": 300, "kind": "fault", "data": {"kind": "motor", "agents": [7]}}]
    flown = airflock.simulate(scenario, 1, events=events)
    opened(tab, flown, tmp_path)
    menu = tab.get_by_label("colour by")

    def tones():
        found = np.array(tab.evaluate("Array.from({length: 12}, (_, a) => replay.colour(a))"))
        return [tuple(tone) for tone in found.round(6).tolist()]

    tab.evaluate("replay.play(false)")
    menu.select_option("group")
    tab.evaluate("replay.seek(2)")
    tab.wait_for_function("document.getElementById('names').textContent.includes('slow')", timeout=PATIENCE)
    tab.wait_for_function("new Set([0, 1, 4].map(a => replay.colour(a).join())).size === 2", timeout=PATIENCE)
    found = tones()
    assert len(set(found)) == 2 and found[4] == found[5] != found[0]
    menu.select_option("fault")
    tab.wait_for_function("new Set([0, 4, 7].map(a => replay.colour(a).join())).size === 1", timeout=PATIENCE)
    tab.evaluate("replay.seek(8)")
    tab.wait_for_function("replay.colour(7).join() !== replay.colour(0).join()", timeout=PATIENCE)
    assert [agent for agent, tone in enumerate(tones()) if tone != tones()[0]] == [7]
    assert not tab.faults


def test_whoever_has_left_is_gone_from_the_picture(tab, tmp_path):
    scenario = airflock.load("vasarhelyi_2018/4ms", {"agents": 12, "duration": 12.0})
    events = [{"step": 500, "kind": "remove", "data": {"agent": agent}} for agent in range(1, 12)]
    opened(tab, airflock.simulate(scenario, 1, events=events), tmp_path)
    tab.evaluate("replay.play(false)")
    tab.get_by_label("trail").select_option("0")
    tab.evaluate("replay.seek(2)")
    time.sleep(1.0)
    before = places(coloured(shot(tab), right=740))
    tab.evaluate("replay.seek(9)")
    time.sleep(1.0)
    assert places(coloured(shot(tab), right=740)) <= before - 10
    assert not tab.faults
