"""A short part of the fuzz; `fuzz.py` runs as much as one likes of each. The seed is --seed, and is printed."""

import subprocess
import sys

import pytest

FUZZ = f"{__file__.rpartition('/')[0]}/fuzz.py"


@pytest.mark.parametrize(
    ("what", "count"),
    [
        ("scenarios", 2000),
        ("studies", 500),
        ("files", 200),
        ("commands", 300),
        ("caches", 12),
        ("disks", 40),
        ("recordings", 300),
    ],
)
def test_no_input_leaves_a_foreign_exception_a_hang_or_other_numbers(what, count, seed):
    """In a small process of its own: it forks, which copies the tables of all memory, and leaves all threads behind."""
    asked = [FUZZ, what, str(count), "--seed", str(seed)]
    done = subprocess.run([sys.executable, "-W", "always::DeprecationWarning", *asked], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert f"{count} of {count} cases" in done.stdout and " 0 failures" in done.stdout
    assert "multi-threaded" not in done.stderr, "it forked beside another thread"
