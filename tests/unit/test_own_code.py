"""Files of the user's own run as the text that they hold now, whatever bytecode lies beside them."""

import importlib
import linecache
import os
import random
import re
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

import airflock
from airflock import model
from airflock.engine import Flight, driver_text
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


OWN = """
from dataclasses import dataclass
import airflock
COMMAND = "velocity"
{globals}
@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
def preferred_speed(p):
    return p.speed
def inner(x):
    return {inner} * x
def outer(x):
    return inner(x) + {outer}
def decide(p):
    return {decide} * outer(GAIN * p.speed), 0.0, 0.0
"""
SHORT = {"duration": 2.0, "agents": 2, "sensors.kind": "perfect", "start.kind": "ball", "start.radius": 9.0}


def drawn_law(rng):
    """Text of a law whose numbers stand in a global, in helpers, and in the rule; some are whole, as people write."""
    names = dict(zip(("inner", "outer", "decide"), (round(rng.uniform(0.2, 2.0), 2) for _ in range(3)), strict=True))
    return OWN.format(globals=f"GAIN = {rng.choice([rng.randint(1, 3), round(rng.uniform(0.2, 2.0), 2)])}", **names)


def texts(scenario):
    """Text of a scenario's driver, and that of the law as if nothing had ever been flown before in this process."""
    rule = scenario.model.decide
    fresh, name = {"__name__": rule.__module__}, f"<fresh {len(linecache.cache)}>"
    source = rule.__globals__["SOURCE"]
    linecache.cache[name] = len(source), None, source.splitlines(keepends=True), name
    exec(compile(source, name, "exec"), fresh)
    law = model(fresh, scenario.model.name)
    return driver_text(scenario), driver_text(airflock.load("vasarhelyi_2018/4ms", SHORT, law=law))


def test_a_law_whose_cells_are_run_again_compiles_as_it_is_now(seed):
    """Each cell is a text of its own, as in a notebook: the rule stays, what it refers to is defined anew."""
    rng, cells, book = random.Random(seed), [], {"__name__": "__main__"}

    def run(source):
        name = f"<cell {seed} {len(cells)}>"
        cells.append(source)
        linecache.cache[name] = len(source), None, source.splitlines(keepends=True), name
        exec(compile(source, name, "exec"), book)

    run(book.setdefault("SOURCE", drawn_law(rng)))
    kept = airflock.load("vasarhelyi_2018/4ms", SHORT, law=model(book, "mine"))
    for _ in range(50):
        before = re.split(r"(?=^def )", book["SOURCE"], flags=re.M)
        after = re.split(r"(?=^def )", drawn_law(rng), flags=re.M)
        piece = rng.choice([0, 2, 3, 4])  # the numbers, a helper's helper, a helper, the rule
        run(after[piece] if piece else next(line for line in after[0].splitlines() if line.startswith("GAIN")))
        before[piece] = after[piece]
        book["SOURCE"] = "".join(before)
        now = airflock.load("vasarhelyi_2018/4ms", SHORT, law=model(book, "mine"))
        assert len(set(texts(now))) == 1, cells[-1]
        if piece == 4:
            kept = now  # a scenario holds the rules themselves; what they refer to is looked up
        assert len(set(texts(kept))) == 1, f"a scenario that was loaded before: {cells[-1]}"
    speeds = [airflock.simulate(kept, 1, device=device).velocity[-1] for device in ("cpu", "python")]
    assert np.allclose(*speeds, atol=1e-4), "compiled and plain Python fly one law"


def test_a_module_that_is_reloaded_compiles_as_it_is_now(tmp_path, monkeypatch, seed):
    rng, path = random.Random(seed), tmp_path / f"reloaded{seed}.py"
    monkeypatch.syspath_prepend(tmp_path)
    module = None
    for _ in range(20):
        source = drawn_law(rng)
        path.write_text(source)
        importlib.invalidate_caches()
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        module = importlib.reload(module) if module else importlib.import_module(path.stem)
        module.SOURCE = source
        scenario = airflock.load("vasarhelyi_2018/4ms", SHORT, law=module)
        assert len(set(texts(scenario))) == 1


def test_a_rule_whose_file_was_changed_since_is_refused_and_not_half_of_each(tmp_path):
    rng, path = random.Random(4), tmp_path / "mine.py"
    for lines in ("", "# a line more\n", "'''several\nlines\nmore'''\n"):
        path.write_text(drawn_law(rng))
        scenario = airflock.load("vasarhelyi_2018/4ms", SHORT, law=path)
        path.write_text(lines + drawn_law(rng))
        with pytest.raises(RuleError, match=r"mine.py:\d+: rule \w+: the file has changed since it was imported"):
            driver_text(scenario)
        assert driver_text(airflock.load("vasarhelyi_2018/4ms", SHORT, law=path))


def test_a_variable_of_the_function_around_a_rule_hides_a_global_of_its_name():
    def made(GAIN):
        def decide(p):
            return GAIN * p.speed, 0.0, 0.0

        return decide

    for gain in (1.5, 2.5):
        names = {"COMMAND": "velocity", "Parameters": OneSpeed, "decide": made(gain)}
        assert f"real({gain}) * p.speed" in driver_text(airflock.load("vasarhelyi_2018/4ms", SHORT, law=names))


GAIN = 7.5


@dataclass(frozen=True, kw_only=True)
class OneSpeed(airflock.Parameters):
    """One speed."""

    speed: float = airflock.quantity(4.0, "m/s", low=0.1, high=30.0, meaning="preferred speed")
