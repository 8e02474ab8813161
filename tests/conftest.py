"""Options and fixtures of all tests."""

import pytest


def pytest_addoption(parser):
    parser.addoption("--seed", type=int, default=2018, help="seed of every random test")
    parser.addoption("--papers", action="store_true", help="also run the long reproductions of papers")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--papers"):
        skip = pytest.mark.skip(reason="long reproduction: add --papers")
        for item in items:
            if item.get_closest_marker("papers"):
                item.add_marker(skip)


@pytest.fixture
def seed(request):
    """Seed of a random test; printed, so that a failure shows it."""
    value = request.config.getoption("--seed")
    print(f"--seed {value}")  # noqa: T201
    return value
