"""Packages of the extras: without one its tests are skipped, unless AIRFLOCK_NEED_ALL is set; then they fail."""

import importlib
import os

import pytest


def needed(name):
    """A package of the extras, imported."""
    if os.environ.get("AIRFLOCK_NEED_ALL"):
        return importlib.import_module(name)
    return pytest.importorskip(name, reason=f"needs {name}: pip install 'airflock[test]'")
