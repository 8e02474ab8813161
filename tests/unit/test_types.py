"""The removed verb `types` and function `check_types` say in one line what to use."""

import pytest

import airflock
from airflock.cli.main import main

REMOVED = 'airflock types and airflock.check_types were removed; use mypy and airflock.check_model("mine.py")'


@pytest.mark.parametrize("words", ["types", "types mine.py", "types mine.py other.py --out typed --json"])
def test_removed_verb_types_ends_with_what_to_use(words, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["airflock", *words.split()])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capsys.readouterr()
    assert ended.value.code == 2 and printed.out == ""
    assert printed.err == f"airflock: {REMOVED}\n"


def test_removed_function_check_types_raises_what_to_use():
    with pytest.raises(airflock.AirflockError) as raised:
        airflock.check_types(["mine.py"], out="typed")
    assert str(raised.value) == REMOVED
