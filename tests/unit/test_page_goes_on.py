"""A page goes on: whatever a hand on it asks for, the flight of everybody who looks is not lost."""

import errno

import pytest

from airflock import atomic
from airflock.engine import Flight
from airflock.studio.opening import Opening
from airflock.studio.player import Player

PRESET = "vasarhelyi_2018/4ms"


@pytest.fixture
def player(monkeypatch):
    """An interpreted flight that has begun, and what is told of it."""
    plainly = lambda *given, **named: Flight(*given, **{**named, "device": "python"})  # noqa: E731
    monkeypatch.setattr("airflock.studio.side.Flight", plainly)
    made = Player(PRESET, {"agents": 5}, seed=3)
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
    assert player.flight is flown and player.time > then and not player.failure
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
    room = object.__new__(Opening)
    room.player, room.page = player, None
    (line,) = asked(player, lambda: room.take(name, b"agents = 3"))
    assert said in line and line.isprintable() and not list(tmp_path.iterdir())


def test_what_nobody_foresaw_is_told_and_the_flight_goes_on(player, monkeypatch):
    def breaks(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Player, "_open", breaks)
    (line,) = asked(player, lambda: player.reset(seed=8))
    assert line == "unexpected ZeroDivisionError: division by zero; please report it" and player.seed == 3
