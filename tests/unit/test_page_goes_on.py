"""A page goes on: whatever a hand on it asks for, the flight of everybody who looks is not lost."""

import errno
from types import SimpleNamespace

import pytest

from airflock.engine import Flight
from airflock.parts import FAULTS
from airflock.studio.browser_view import BrowserView, Widgets
from airflock.studio.flight_page import FlightPage
from airflock.studio.page_panels import OpeningPanel, PlaybackPanel
from airflock.studio.player import FlightRequest, Player
from airflock.support import atomic

PRESET = "vasarhelyi_2018/4ms"


@pytest.fixture
def player(monkeypatch):
    """An interpreted flight that has begun, and what is told of it."""
    plainly = lambda *given, **named: Flight(*given, **{**named, "device": "python"})  # noqa: E731
    monkeypatch.setattr("airflock.studio.flight_pane.Flight", plainly)
    made = Player(FlightRequest(PRESET, {"agents": 5}, seed=3))
    made.faults = []
    made.fault = made.faults.append
    made.fly(20)
    return made


@pytest.fixture
def full(monkeypatch):
    """A disk without room for a byte."""

    def refuse(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(atomic.Path, "write_bytes", refuse)


def asked(player, action):
    """What is told after a hand asked for something; the flight must go on."""
    player.faults.clear()
    flown = player.flight
    player.ask(action)
    player.tick(0.0)
    then = player.time
    player.fly(20)
    assert player.flight is flown and player.time > then and not player.failure_message
    return player.faults


def test_a_full_disk_is_told_and_the_flight_goes_on(player, full, tmp_path):
    path = tmp_path / "tuned.toml"
    assert asked(player, lambda: player.save_toml(path)) == [f"{path}: No space left on device"]
    assert player.status == f"{path}: No space left on device" and not list(tmp_path.iterdir())


def test_a_folder_that_is_gone_is_told_and_the_flight_goes_on(player, tmp_path):
    path = tmp_path / "gone" / "tuned.toml"
    assert asked(player, lambda: player.save_toml(path)) == [f"{path}: no such file"]


@pytest.mark.parametrize(("name", "said"), [("\0.toml", "NUL"), (f"{300 * 'a'}.toml", "File name too long")])
def test_a_name_that_no_file_may_have_is_told_and_the_flight_goes_on(player, tmp_path, monkeypatch, name, said):
    monkeypatch.chdir(tmp_path)
    room = object.__new__(OpeningPanel)
    room.player, room.page = player, None
    (line,) = asked(player, lambda: room.take(name, b"agents = 3"))
    assert said in line and line.isprintable() and not list(tmp_path.iterdir())


def test_what_nobody_foresaw_is_told_and_the_flight_goes_on(player, monkeypatch):
    def breaks(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Player, "_open", breaks)
    (line,) = asked(player, lambda: player.reset(seed=8))
    assert line == "unexpected ZeroDivisionError: division by zero; please report it" and player.seed == 3


class Fields:
    """Stands for viser's: a number field that tells what a client typed."""

    def add_number(self, label, value, **_):
        field = SimpleNamespace(value=value)
        field.on_update = lambda told: setattr(field, "told", told)
        return field


def typed(field, value):
    field.value = value
    field.told(SimpleNamespace(target=field, client=object()))


def test_a_number_beyond_the_ends_of_its_field_is_not_heard():
    heard = []
    field = Widgets(SimpleNamespace(gui=Fields())).number("agents", 10, 1, 1000, heard.append)
    for value in (25, 999_999, 0, -3, 1000, 1):
        typed(field, value)
    assert heard == [25, 1000, 1]


def test_a_field_shows_what_flies_where_another_number_is_refused(player):
    room = object.__new__(PlaybackPanel)
    room.player, room.seed, room.agents = player, SimpleNamespace(value=3), SimpleNamespace(value=1000)
    (line,) = asked(player, lambda: room.reset(agents=1000))
    assert "do not fit" in line and room.agents.value == 5


def test_the_end_of_the_longest_flight_is_told(player, monkeypatch):
    assert not player.over and player.status == ""
    monkeypatch.setattr("airflock.studio.flight_pane.MAX_DURATION", 1.0)
    player.reset()
    player.fly(100)
    then = player.flight.step
    assert player.tick(1.0) is False and player.flight.step == then
    assert player.over and player.status == "a page flies at most 1 s; Reset starts again"
    player.go_back(0.5)
    assert not player.over and player.time == pytest.approx(0.5)


def test_whoever_goes_back_further_than_is_kept_is_told_so(player):
    for _ in range(10):
        player.fly(100)
    player.go_back(3.0)
    assert player.note == "back at t = 3 s"
    player.fork()
    player.fly(20)
    player.join()
    player.go_back(1.0)
    assert player.note == "no earlier moment is kept" and player.time == pytest.approx(3.2)
    player.fly(100)
    player.fly(100)
    player.go_back(1.0)
    assert player.note == "back at t = 3.2 s; no earlier moment is kept"


def test_the_command_holds_every_digit(player):
    number = 0.1234567890123456
    player.change("model.p_rep", number)
    assert f"--set model.p_rep={number!r}" in player.command and "agents=5" in player.command


@pytest.fixture
def page(player):
    """A page of that flight with nobody before it, on which every press of a button is heard at once."""
    view = BrowserView("127.0.0.1", 0, "nobody")
    made = FlightPage(player, view)
    yield made
    view.stop()


def test_a_fault_begun_by_hand_and_given_up_leaves_no_controls_behind(player, page):
    for kind in FAULTS:
        page.selection.select(2)
        page.selection.fault.value = kind
        assert asked(player, page.selection.begin_fault) == []
        page.frame(True)
        assert asked(player, lambda: page.playback.go_back(0.0)) == []
        page.frame(True)
        assert not player.flight.faults and not [key for key in page.tuning._handles if key.startswith("faults")], kind


def test_a_page_shows_every_colouring_of_a_flock_without_faults(player, page):
    for name in page.playback.colouring_menu.options:
        page.scene.colouring.name = name
        page.frame(True)
        assert page.scene.colouring.shown.name == name
