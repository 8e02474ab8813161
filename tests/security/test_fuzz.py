"""A short part of the fuzz; `fuzz.py` runs as much as one likes of each. The seed is --seed, and is printed."""

import fuzz
import mutations
import pytest


@pytest.mark.parametrize(
    ("what", "count"),
    [("scenarios", 1500), ("studies", 300), ("recordings", 12), ("commands", 100), ("caches", 12), ("disks", 40)],
)
def test_no_input_leaves_a_foreign_exception_a_hang_or_other_numbers(what, count, seed, tmp_path):
    mutations.warm(what)
    failures, _ = fuzz.attack(fuzz.CASES[what], count, seed, folder=tmp_path, hang=fuzz.PATIENCE.get(what, fuzz.HANG))
    assert failures == [], f"repeat with: python tests/security/fuzz.py {what} --seed {seed} --only NUMBER"
