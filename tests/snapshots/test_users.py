"""Files that users wrote at 66fb6ba3 fly today, to the same bits; compiled flights are compared by the snapshot."""

import json
import math
import tomllib

import pytest
import run

users = run.module("users")
STUDIES = [name for name in users.names() if name.startswith("study_")]


def test_forty_files_of_users_are_on_record():
    assert len(users.names()) >= 40
    for known in json.loads(run.record("users").read_text()).values():
        assert sorted(known) == users.names()


@pytest.mark.parametrize("name", sorted(set(users.names()) - set(STUDIES)))
def test_a_file_of_a_user_flies_to_the_bits_of_66fb6ba3(name):
    found, known = users.fly(name, **users.INTERPRETED), run.recorded("users")
    if known is None:
        pytest.skip(f"flies, but its bits are not on record for {run.processor()}")
    assert found == known[name]["interpreted"]


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_of_a_user_finds_numbers_in_its_ranges(name):
    space = tomllib.loads((users.FOLDER / f"{name}.toml").read_text())["space"]
    found = {key: float.fromhex(value) for key, value in users.search(name).items()}
    assert math.isfinite(found.pop("fitness")) and set(found) == set(space)
    assert all(space[key]["low"] <= value <= space[key]["high"] for key, value in found.items())
