"""Files of the user's own run as the text that they hold now, whatever bytecode lies beside them."""

import os
import subprocess
import sys

import pytest

import airflock
from airflock.engine import Flight
from airflock.scenarios.named_code import import_user_file
from airflock.studio.player import FlightRequest, Player
from airflock.support.errors import RuleError, ScenarioError


def test_a_file_that_was_changed_within_a_second_runs_as_it_is(tmp_path, monkeypatch):
    """Of the same size and of the same time, as an editor or a script can leave it: bytecode would look fresh."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", None)
    path = tmp_path / "mine.py"
    for number in "123":
        path.write_text(f"GAIN = 0.{number}\n")
        os.utime(path, (1e9, 1e9))
        module = import_user_file(path, "model.kind = 'mine.py'", trust=True)
        assert float(f"0.{number}") == module.GAIN
        assert (module.__name__, module.__file__) == ("mine", str(path))
    assert list(tmp_path.iterdir()) == [path], "nothing is left beside a user's file"


@pytest.mark.parametrize("name", ["mine.txt", "mine.pyc"])
def test_what_is_no_text_of_python_is_refused(tmp_path, name):
    (tmp_path / name).write_text("GAIN = 0.1\n")
    with pytest.raises(ScenarioError, match="is not a Python file"):
        import_user_file(tmp_path / name, "model.kind", trust=True)


def test_a_fault_of_its_own_names_the_line_and_the_word_that_was_meant(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text('import airflock\n\n\ndef made():\n    return airflock.quantiti(1.0, "m")\n\n\nGAIN = made()\n')
    with pytest.raises(RuleError) as fault:
        import_user_file(path, "model.kind", trust=True)
    said = "AttributeError: module 'airflock' has no attribute 'quantiti'; did you mean quantity?"
    assert str(fault.value) == f"{path}:5: {said}"


LAW = """
from dataclasses import dataclass
from typing import NamedTuple
import airflock
COMMAND = "velocity"
@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    pull: float = airflock.quantity(1.0, "m/s", low=0.0, high=9.0, meaning="how fast it flies")
class Sums(NamedTuple):
    x: float
    y: float
def lean(x):
    return 0.1 * x
def neighbour(dx, dy):
    return Sums(lean(dx), lean(dy))
def decide(own, sums, p):
    return p.pull * own.hx + sums.x, p.pull * own.hy + sums.y, 0.0
"""
BODY = """
from dataclasses import dataclass
import airflock
ACCEPTS = "velocity"
INTEGRATION = "new"
@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    gain: float = airflock.quantity(0.5, "1", low=0.0, high=1.0, meaning="share of the command")
def move(cx, cy, cz, b):
    return b.gain * cx, b.gain * cy, b.gain * cz
"""


@pytest.mark.parametrize("name", ["my-law", "a law", "3law", 'c\'est "ça"; #', "class", "v1.2"])
def test_a_file_of_any_name_flies_as_one_of_a_plain_name(tmp_path, name):
    """Its name stands in the text of the driver, where a blank or a hyphen ended it."""
    for stem in ("plain", name):
        (tmp_path / f"{stem}.py").write_text(LAW)
        (tmp_path / f"{stem} body.py").write_text(BODY)
    flown = []
    for stem in ("plain", name):
        settings = {"agents": 4, "body.kind": str(tmp_path / f"{stem} body.py")}
        scenario = airflock.load("vasarhelyi_2018/4ms", settings, tmp_path / f"{stem}.py", trust=True)
        flown.append(airflock.open(scenario, 7, device="python").advance(steps=120).state)
    assert flown[0].std() > 0.0 and (flown[0] == flown[1]).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("def neighbour(dx, dy)", "def neighbour(dx, dy, gain=2.0)", "declared in Parameters, and read as p.gain"),
        ("def neighbour(dx, dy)", "def neighbour(self, dx, dy)", "asks for 'self'; a rule is a plain function"),
        ('COMMAND = "velocity"', "", "lacks COMMAND"),
        ("quantity(1.0", "quantity(11.0", "Parameters.pull = 11 m/s lies outside [0, 9] m/s"),
        ("@dataclass(frozen=True, kw_only=True)", "", "is not a dataclass"),
        ("    pull: float", "    push: float = 0.2\n    pull: float", "parameter push is not declared by quantity()"),
    ],
)
def test_what_is_wrong_with_a_file_of_a_law_names_the_file(tmp_path, old, new, said):
    path = tmp_path / "mine.py"
    assert LAW.count(old) == 1
    path.write_text(LAW.replace(old, new))
    with pytest.raises(airflock.AirflockError) as fault:
        airflock.load("vasarhelyi_2018/4ms", law=path)
    assert str(fault.value).count("mine.py") == 1 and said in str(fault.value)


def test_a_second_file_that_lies_beside_a_law_is_to_be_written_into_it(tmp_path):
    (tmp_path / "soft.py").write_text("def lean(x):\n    return 0.1 * x\n")
    for name, more in (("soft", "; code of your own is one file"), ("hard", "")):
        path = tmp_path / f"{name}_law.py"
        path.write_text(f"from {name} import lean\n{LAW}")
        with pytest.raises(RuleError) as fault:
            import_user_file(path, "model.kind", trust=True)
        told = str(fault.value).removeprefix(f"{path}:1: ModuleNotFoundError: No module named '{name}'")
        assert told.startswith(more) and bool(told) == bool(more)


@pytest.fixture
def raising(tmp_path):
    """A law that raises near a wall, and where. The probe of its rules does not come there."""
    path = tmp_path / "mine.py"
    walls = "class Walls(NamedTuple):\n    x: float\ndef boundary(nx):\n    return Walls(math.acos(3.0 * nx))\n"
    late = LAW.replace("import airflock", "import airflock, math").replace(
        "def decide(own, sums, p)", "def decide(own, sums, walls, p)"
    )
    path.write_text(late.replace("def decide", f"{walls}def decide").replace("+ sums.x", "+ sums.x + walls.x"))
    line = next(k for k, text in enumerate(path.read_text().splitlines(), 1) if "acos" in text)
    return path, f"{path}:{line}: ValueError: math domain error"


@pytest.mark.parametrize("make", ["partial(other)", "Lean()"])
def test_a_rule_that_is_no_function_is_told_so(tmp_path, make):
    path = tmp_path / "mine.py"
    more = "from functools import partial\nclass Lean:\n    def __call__(self, dx):\n        return Sums(dx, dx)\n"
    path.write_text(
        LAW.replace("def neighbour", "def other").replace("def decide", f"{more}neighbour = {make}\ndef decide")
    )
    with pytest.raises(RuleError, match="a rule is a plain function"):
        airflock.open(airflock.load("vasarhelyi_2018/4ms", {"agents": 3}, law=path), device="python")


def test_a_rule_that_raises_in_flight_ends_in_a_line_with_its_place(raising):
    """Interpreted; compiled, a rule gives a number that is none, which a flight is refused for."""
    path, told = raising
    words = ["run", "vasarhelyi_2018/4ms", "--law", str(path), "--agents", "3", "--duration", "1", "--device", "python"]
    done = subprocess.run([sys.executable, "-m", "airflock", *words], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"airflock: {told}\n"


def test_a_page_stops_the_flight_of_a_rule_that_raises_and_goes_on(raising, monkeypatch):
    """As the first seconds are flown, until there is a driver."""
    plainly = lambda *given, **named: Flight(*given, **{**named, "device": "python"})  # noqa: E731
    monkeypatch.setattr("airflock.studio.flight_pane.Flight", plainly)
    path, told = raising
    player = Player(FlightRequest("vasarhelyi_2018/4ms", {"agents": 3}, law=path))
    assert not player.fly(50) and player.failure_message == f"stopped: {told}"
