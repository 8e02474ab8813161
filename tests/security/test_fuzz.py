"""A short part of the fuzz; `fuzz.py` runs as much as one likes of each. The seed is --seed, and is printed."""

import subprocess
import sys

import fuzz
import mutations
import pytest

from airflock.recordings import isolated


@pytest.mark.parametrize(
    ("what", "count"),
    [
        ("scenarios", 2000),
        ("studies", 500),
        ("files", 200),
        ("commands", 300),
        ("caches", 12),
        ("disks", 40),
    ],
)
def test_no_input_leaves_a_foreign_exception_a_hang_or_other_numbers(what, count, seed, tmp_path, monkeypatch):
    for name in ("subprocess", "LEAST_TIME"):
        monkeypatch.setattr(isolated, name, getattr(isolated, name))  # given back at the end
    mutations.warm(what)
    failures, _ = fuzz.attack(fuzz.CASES[what], count, seed, folder=tmp_path, hang=fuzz.PATIENCE.get(what, fuzz.HANG))
    assert failures == [], f"repeat with: python tests/security/fuzz.py {what} --seed {seed} --only NUMBER"


def test_no_recording_leaves_a_foreign_exception_a_hang_or_other_numbers(seed):
    """In a small process of its own: a reader is forked for each, and a fork copies the tables of all memory."""
    asked = ["recordings", "300", "--seed", str(seed), "--batch", str(fuzz.BATCH)]
    done = subprocess.run([sys.executable, fuzz.__file__, *asked], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert "300 of 300 cases" in done.stdout and " 0 failures" in done.stdout
