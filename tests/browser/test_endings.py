"""What happens to a live page when a network is cut, when the terminal says Ctrl-C, when two people watch."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from cable import Cable
from pixels import coloured, places, shot
from test_watch import PATIENCE, flying, opened, until

from processes import hear_interrupts

pytestmark = pytest.mark.browser


def test_a_page_whose_network_was_cut_comes_back_to_the_same_flight(browser, tab):
    with flying() as (player, view, _):
        port = int(re.search(r":(\d+)/", view.address)[1])
        cable = Cable(port)
        try:
            tab.goto(view.address.replace(f":{port}/", f":{cable.port}/"), timeout=PATIENCE * 1000)
            until(lambda: view.clients == 1, "no page opened")
            player.ask(lambda: player.change("model.p_rep", 0.2))
            cable.loop_over_lanes()
            until(lambda: view.clients == 0, "a page that is gone still counts")
            then = player.flight.time
            until(lambda: player.flight.time > then + 1.0, "the flight waits for a page that is gone")
            cable.mend()
            until(lambda: view.clients == 1, "the page does not come back")
            until(lambda: places(coloured(shot(tab), right=640)) >= 10, "no agents after the network came back")
            assert [event.kind for event in player.flight.events] == ["change"] and not tab.faults
        finally:
            cable.close()


def test_two_pages_see_one_flight_and_both_have_its_controls(browser, tab):
    with flying() as (player, view, _):
        opened(tab, view)
        other = browser.new_page()
        opened(other, view)
        tab.get_by_text("Pause", exact=True).first.click()
        until(lambda: player.is_paused, "the first page does not pause")
        other.get_by_text("Fly", exact=True).first.click(timeout=PATIENCE * 1000)
        until(lambda: not player.is_paused, "the second page does not fly on")
        for page in (tab, other):
            page.get_by_text("Pause", exact=True).first.wait_for(timeout=PATIENCE * 1000)
        other.close()
        assert not tab.faults


@pytest.mark.parametrize("watched", [True, False])
def test_ctrl_c_in_mid_flight_ends_at_once_with_one_line(browser, tab, tmp_path, watched):
    command = [sys.executable, "-m", "airflock", "watch", "vasarhelyi_2018/4ms", "--agents", "20", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=tmp_path,
                               env={**os.environ, "PYTHONUNBUFFERED": "1"}, preexec_fn=hear_interrupts)  # fmt: skip
    try:
        address = next(line for line in process.stdout if "watch at" in line).split()[2]
        if watched:
            tab.goto(address, timeout=PATIENCE * 1000)
            tab.get_by_text("Pause", exact=True).first.wait_for(timeout=PATIENCE * 1000)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=PATIENCE)[0].strip().splitlines()
    finally:
        process.kill()
    assert len(rest) == 1 and re.fullmatch(r"ended at t = \d+\.\d s", rest[0]), rest
    assert process.returncode == 0 and not list(tmp_path.iterdir())
