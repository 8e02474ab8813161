"""Modules of the compiler are out of the garbage collector's way, and nothing of the user's is."""

import os
import subprocess
import sys

import pytest

from inside import never_collected

BEGIN = """
import gc, weakref, airflock

class Held:
    pass

def cycle():
    held = Held()
    held.itself = held
    return weakref.ref(held)

"""


def told(text, **variables):
    """What a process of its own prints."""
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + text], env=os.environ | variables, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_compiler_leaves_no_garbage_behind(tmp_path):
    text = """
flight = airflock.open('vicsek_1995/ordered', precision=64).compile()
print(sum(1 for found in [gc.collect()] if found > 1000))
"""
    assert told(text, AIRFLOCK_CACHE=str(tmp_path)) == ["0"]  # an empty cache: it compiles


def test_a_full_collection_looks_at_a_tenth_of_what_the_compiler_brings():
    opened = "airflock.open('vicsek_1995/ordered'); print(len(gc.get_objects()), gc.get_freeze_count(), gc.isenabled())"
    seen, kept, collecting = told(opened)
    assert int(kept) > 50_000 and int(seen) < int(kept) / 10
    assert collecting == "True"


def test_garbage_of_a_user_is_not_kept():
    """Cycles that are garbage, or become it later, are found as ever."""
    assert told("""
before = cycle()
airflock.open('vicsek_1995/ordered')
after = cycle()
print(before() is None)
gc.collect()
print(after() is None)
""") == ["True", "True"]


def test_who_collects_by_himself_goes_on_doing_so():
    assert told("gc.disable(); airflock.open('vicsek_1995/ordered'); print(gc.isenabled())") == ["False"]


def test_who_has_imported_the_compiler_before_keeps_his_objects_under_the_collector():
    assert told("import numba; airflock.open('vicsek_1995/ordered'); print(gc.get_freeze_count())") == ["0"]


def test_a_program_with_many_objects_of_its_own_keeps_them_under_the_collector():
    opened = "mine = [[k] for k in range(100_000)]; airflock.open('vicsek_1995/ordered'); print(gc.get_freeze_count())"
    assert told(opened) == ["0"]


def test_an_import_that_fails_leaves_the_collector_as_it_was():
    import gc

    usual = gc.isenabled()
    try:
        with pytest.raises(ImportError), never_collected():
            raise ImportError("no such library")
        assert gc.isenabled() == usual
    finally:
        gc.unfreeze()
