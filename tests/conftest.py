"""Options and fixtures of all tests."""

import gc
import os
from importlib import import_module

import hypothesis
import pytest

too_slow = [hypothesis.HealthCheck.too_slow]  # a draw is slow where others use the machine
hypothesis.settings.register_profile("untimed", deadline=None, suppress_health_check=too_slow)  # no test asserts a time
hypothesis.settings.load_profile("untimed")
gc.set_threshold(100_000, 50, 50)  # a compilation makes millions of objects that stay: looking at them takes a tenth


@pytest.hookimpl(wrapper=True, optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One worker more than processors: some tests wait for processes of their own."""
    return (yield) + 1


def pytest_addoption(parser):
    parser.addoption("--seed", type=int, default=2018, help="seed of every random test")
    parser.addoption("--nightly", action="store_true", help="also run what .ci/nightly runs")
    parser.addoption("--papers", action="store_true", help="also run the long reproductions of papers")


def pytest_collection_modifyitems(config, items):
    for option, reason in (("papers", "long reproduction"), ("nightly", "many compilations")):
        if not config.getoption(f"--{option}"):
            skip = pytest.mark.skip(reason=f"{reason}: add --{option}")
            for item in items:
                if item.get_closest_marker(option):
                    item.add_marker(skip)
    for item in items:
        if item.get_closest_marker("gpu") and not os.environ.get("AIRFLOCK_NEED_GPU"):
            item.fixturenames.insert(0, "gpu")


@pytest.fixture
def gpu():
    """Skips a test where no GPU can be used; with AIRFLOCK_NEED_GPU set nothing is skipped, and the test fails."""
    from airflock.support.gpu import unavailable_reason

    if unavailable_reason() is not None:
        pytest.skip(f"{unavailable_reason()}; AIRFLOCK_NEED_GPU makes this a failure")


@pytest.fixture
def undrawn(monkeypatch):
    """Studies end without their pictures, which take longer than all the rest; tests/unit/test_studies.py has them."""
    monkeypatch.setattr(import_module("airflock.search.evolution"), "draw_study", lambda *_: [])


@pytest.fixture
def scored_plainly(monkeypatch):
    """Recordings are scored by plain Python: one of few frames in less time than its driver takes to compile."""
    from flocks import measured_plainly

    monkeypatch.setattr(import_module("airflock.recordings.scores"), "measure_frames", measured_plainly)


@pytest.fixture
def seed(request):
    """Seed of a random test; printed, so that a failure shows it."""
    value = request.config.getoption("--seed")
    print(f"--seed {value}")  # noqa: T201
    return value
