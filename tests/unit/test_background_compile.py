"""Drivers compiled by another process: this one loads what that one kept, and compiles by itself where it cannot."""

import json
import random
import subprocess
import sys
from types import SimpleNamespace

import pytest
from numba.core.errors import NumbaError

from inside import SCRIPT, DriverState, load_driver

compile_aside = DriverState.compile_in_background
TEXT = "from numba import njit\n\n@njit(cache=True)\ndef advance(first, last):\n    return {answer}\n"


@pytest.fixture
def state(tmp_path, monkeypatch):
    """What stands for the state of a flight, with a driver of one line that no cache holds yet."""
    monkeypatch.setenv("AIRFLOCK_CACHE", str(tmp_path))

    def made(answer):
        driver = load_driver(TEXT.format(answer=answer), "aside")
        return SimpleNamespace(
            driver=driver, arguments=lambda first, last: (first, last), compile=lambda: driver.advance(3, 10)
        )

    return made


def counts(state):
    """How often a driver's code was read from the cache, and how often it was compiled in this process."""
    stats = state.driver.advance.stats
    return sum(stats.cache_hits.values()), sum(stats.cache_misses.values())


def test_this_process_loads_what_the_other_one_has_compiled(state):
    number = random.randrange(10**9)
    flight = state(f"first + last + {number}")
    assert compile_aside(flight) == 13 + number
    assert counts(flight) == (1, 0)


@pytest.mark.parametrize("python", ["/nowhere/python", "", None, sys.executable])
def test_this_process_compiles_where_no_other_can(state, monkeypatch, python):
    number = random.randrange(10**9)
    flight = state(f"first * last + {number}")
    monkeypatch.setattr(sys, "executable", python)
    if python == sys.executable:  # one that starts, and does not find what it needs
        monkeypatch.setattr(sys.modules[load_driver.__module__], "SCRIPT", "/nowhere/script.py")
    assert compile_aside(flight) == 30 + number
    assert counts(flight) == (0, 1)


def test_what_does_not_compile_is_told_by_this_process(state):
    with pytest.raises(NumbaError, match="nobody_knows_this"):
        compile_aside(state("nobody_knows_this"))


def test_the_other_process_ends_with_its_input():
    asked = {"paths": sys.path, "text": "import time\n\ntime.sleep(1000.0)\n", "label": "aside", "types": ""}
    with subprocess.Popen([sys.executable, "-I", "-S", SCRIPT], stdin=subprocess.PIPE) as process:
        process.stdin.write(f"{json.dumps(asked)}\n".encode())
        process.stdin.close()
        assert process.wait(timeout=60.0) == 1
