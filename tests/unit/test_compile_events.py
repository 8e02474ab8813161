"""Whoever waits for the compiler is told, once, and nobody else is."""

import threading
import time

from airflock.engine import drivers as compile_events
from airflock.engine.drivers import COMPILING, message_if_slow


def sit_down(monkeypatch):
    """A person at a terminal who is told after a moment."""
    monkeypatch.setattr(compile_events.sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(compile_events, "PATIENCE", 0.02)


def waited(seconds):
    with message_if_slow():
        time.sleep(seconds)


def test_a_long_wait_is_told_once_and_a_short_one_is_not(monkeypatch, capsys):
    sit_down(monkeypatch)
    waited(0.5)
    assert capsys.readouterr().err == f"{COMPILING}\n"
    waited(0.0)
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_threads_that_compile_beside_say_nothing(monkeypatch, capsys):
    sit_down(monkeypatch)
    beside = threading.Thread(target=waited, args=(0.2,))
    beside.start()
    beside.join()
    assert capsys.readouterr().err == ""


def test_nothing_is_said_into_a_file(monkeypatch, capsys):
    monkeypatch.setattr(compile_events, "PATIENCE", 0.02)
    waited(0.2)
    assert capsys.readouterr().err == ""
