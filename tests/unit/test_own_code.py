"""Files of the user's own run as the text that they hold now, whatever bytecode lies beside them."""

import os
import sys

import pytest

from airflock.errors import RuleError, ScenarioError
from airflock.scenarios.own_code import own_module


def test_a_file_that_was_changed_within_a_second_runs_as_it_is(tmp_path, monkeypatch):
    """Of the same size and of the same time, as an editor or a script can leave it: bytecode would look fresh."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)
    path = tmp_path / "mine.py"
    for number in "123":
        path.write_text(f"GAIN = 0.{number}\n")
        os.utime(path, (1e9, 1e9))
        module = own_module(path, "model.kind = 'mine.py'", trust=True)
        assert float(f"0.{number}") == module.GAIN
        assert (module.__name__, module.__file__) == ("mine", str(path))
    assert list(tmp_path.iterdir()) == [path], "nothing is left beside a user's file"


@pytest.mark.parametrize("name", ["mine.txt", "mine.pyc"])
def test_what_is_no_text_of_python_is_refused(tmp_path, name):
    (tmp_path / name).write_text("GAIN = 0.1\n")
    with pytest.raises(ScenarioError, match="is not a Python file"):
        own_module(tmp_path / name, "model.kind", trust=True)


def test_a_fault_of_its_own_names_the_line_and_the_word_that_was_meant(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text('import airflock\n\n\ndef made():\n    return airflock.quantiti(1.0, "m")\n\n\nGAIN = made()\n')
    with pytest.raises(RuleError) as fault:
        own_module(path, "model.kind", trust=True)
    said = "AttributeError: module 'airflock' has no attribute 'quantiti'; did you mean quantity?"
    assert str(fault.value) == f"{path}:5: {said}"
