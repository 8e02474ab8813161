"""The engine has one door for all others (import-linter), with few names, and one for tests."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import inside
from airflock import engine

TESTS = Path(__file__).parents[1]
MOST = 16


def test_the_door_has_few_names_and_each_is_what_it_says():
    assert len(engine.__all__) <= MOST
    for name in engine.__all__:
        assert getattr(engine, name).__name__ == name
    with pytest.raises(AttributeError, match="No airflock.engine attribute flyy"):
        _ = engine.flyy


def test_tests_look_inside_through_their_own_door():
    found = []
    for path in TESTS.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            found += [
                f"{path.name}: {module}"
                for module in modules
                if module.startswith("airflock.engine.")
                and not module.startswith(("airflock.engine.text", "airflock.engine.drivers"))
            ]
            if modules == ["airflock.engine"] and path.name != "test_compile_events.py":
                found += [f"{path.name}: {alias.name}" for alias in node.names if alias.name not in engine.__all__]
    assert not found


def test_everything_behind_the_door_of_tests_is_asked_for_by_one():
    words = "".join(path.read_text(encoding="utf-8") for path in TESTS.rglob("*.py") if path.name != "inside.py")
    assert [name for name in (*inside.MODULES, *inside.NAMES) if name not in words] == []


def test_the_door_loads_no_compiler_before_it_is_asked():
    code = "import sys, airflock.engine; print('numba' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
