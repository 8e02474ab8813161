"""Rules printed as C99 give the bits of plain Python, part by part and as whole decisions."""

import ctypes
import random
import re
import shutil
import subprocess

import pytest

import airflock
from airflock.core import HeardNeighbour, State, decide, number_names
from airflock.engine.text.c99 import REAL, WHOLE
from airflock.parts import BODIES, FAULTS, LAWS, RADIOS, SENSORS
from airflock.support import AirflockError, RuleError
from inside import c_printing as print_module

CasePercept, print_law, printed_part = (
    getattr(print_module, name) for name in ("CasePercept", "print_law", "printed_part")
)

STRICT = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
CARRIERS = {"heading": "couzin_2002/torus", "steered": "kidger/city", "fixed_wing": "vasarhelyi_2018/fixed_wing"}


@pytest.fixture(autouse=True)
def _few_cases(monkeypatch):
    monkeypatch.setattr(print_module, "CASES", 500)


def compiled(files, *flags):
    """Compile a printed part with its test; return the program."""
    folder, name = files[0].parent, files[0].stem
    program = folder / "replay"
    sources = [folder / f"{name}.c", folder / f"test_{name}.c"]
    done = subprocess.run(["gcc", *STRICT, *flags, *sources, "-lm", "-o", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


def assert_same_bits(files):
    cases = files[0].with_suffix(".cases")
    program = compiled(files, "-DAIRFLOCK_PRECISION=64", "-fsanitize=undefined", "-fno-sanitize-recover=all")
    done = subprocess.run([program, cases], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    # Functions of math.h but the root may differ in the last place from those that Python was built with.
    if not set(re.findall(r"r_(\w+)\(", files[1].read_text())) - {"sqrt", "fabs", "floor", "ceil", "fmod"}:
        assert all(" 0 with other bits" in line for line in done.stdout.splitlines()), done.stdout
    single = subprocess.run([compiled(files, "-DAIRFLOCK_PRECISION=32"), cases], capture_output=True, text=True)
    assert single.returncode == 0, single.stdout + single.stderr


# One solves for the whole flock at once, the other has weights of no fixed number.
PRINTED = [name for name in LAWS if LAWS[name].flock is None and name != "network"]


@pytest.mark.parametrize("law", PRINTED)
def test_a_printed_law_gives_the_bits_of_plain_python(law, tmp_path):
    assert_same_bits(print_law(law, out=tmp_path))


@pytest.mark.parametrize(
    ("part", "kind"),
    [("body", name) for name in BODIES]
    + [("radio", name) for name in RADIOS if name != "constant"]  # it has no rule
    + [("sensors", name) for name in SENSORS],
)
def test_printed_bodies_radios_and_sensors_give_the_bits_of_plain_python(part, kind, tmp_path):
    preset = CARRIERS.get(kind, "vasarhelyi_2018/4ms")
    settings = {} if kind in CARRIERS else {f"{part}.kind": kind}
    assert_same_bits(print_law(preset, part=part.rstrip("s"), settings=settings, out=tmp_path))


@pytest.mark.parametrize("kind", list(FAULTS))
def test_printed_faults_give_the_bits_of_plain_python(kind, tmp_path):
    settings = {"faults": [{"kind": kind, "at": 1.0, "agents": [0]}]}
    assert_same_bits(print_law("vasarhelyi_2018/4ms", part=kind, settings=settings, out=tmp_path))


def struct_of(printer, kind, known):
    """Return a struct of the printed header as a class of ctypes."""
    if kind in (REAL, WHOLE):
        return ctypes.c_double if kind == REAL else ctypes.c_int
    if kind not in known:
        fields = [(name, struct_of(printer, each, known)) for name, each in printer.structs[kind].items()]
        if kind.endswith("_Percept"):
            fields += [(name, ctypes.c_void_p) for name in ("ray", "cast", "normal", "uniform", "context")]
        known[kind] = type(kind, (ctypes.Structure,), {"_fields_": fields})
    return known[kind]


@pytest.mark.parametrize(
    ("law", "body"),
    [(law, "") for law in ("vasarhelyi_2018", "viragh_2014", "formation", "vicsek_1995", "chen_2014")]
    + [("couzin_2002", "multirotor"), ("reynolds_1987", "multirotor"), ("viragh_2014", "steered")],
)
def test_a_whole_decision_in_c_has_the_bits_of_a_pilot(law, body, tmp_path):
    """With a body that takes another kind of command, too: then C converts as the pilot does."""
    rng = random.Random(law)
    flown = airflock.load("vasarhelyi_2018/4ms", {"body.kind": body}, law=law) if body else law
    printed = printed_part(flown, "law", None, False)
    assert (printed.steer is not None) == bool(body)
    print_module.command_text(printed)
    print_law(flown, out=tmp_path)
    library = tmp_path / "law.so"
    flags = [*STRICT, "-DAIRFLOCK_PRECISION=64", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, tmp_path / f"{law}.c", "-lm", "-o", library], check=True)
    printer, known = printed.printer, {}
    wanted = {
        name: struct_of(printer, f"{law}_{name}", known)
        for name in ("Parameters", "State", "Heard", "Surface", "Percept")
    }
    command = getattr(ctypes.CDLL(str(library)), f"{law}_command")
    command.restype = struct_of(printer, printed.functions["decide"].returned, known)
    numbers = wanted["Parameters"](*(getattr(printed.numbers, name) for name in number_names(printed.numbers)))

    def state(spread, speed):
        return State(*(rng.gauss(0.0, spread) for _ in range(3)), *(rng.gauss(0.0, speed) for _ in range(3)))

    normal = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_int)(
        lambda _, draw: CasePercept(*[0.0] * 7).normal(draw)
    )
    uniform = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_int)(
        lambda _, draw: CasePercept(*[0.0] * 7).uniform(draw)
    )
    ray = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, *[ctypes.c_double] * 4)(
        lambda _, *direction: CasePercept(*[0.0] * 7).ray(*direction)
    )
    memory = []
    if printed.part.Memory is not None:
        kind = struct_of(printer, printed.functions["decide"].arguments["memory"], known)
        memory = [ctypes.byref(kind(*printed.part.Memory()))]
    for _ in range(200):
        own, index = state(20.0, 3.0), 4
        heard = [
            HeardNeighbour(who, state(20.0, 3.0), rng.random(), group=float(who % 2))
            for who in range(9)
            if who != index
        ]
        surfaces = [(rng.gauss(5.0, 5.0), *direction) for direction in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0))]
        offsets = [rng.gauss(0.0, 30.0) for _ in range(7)]
        expected = decide(
            printed.part, printed.numbers, own, heard, surfaces,
            time=offsets[0], period=0.1, index=index, group=1.0, percept=CasePercept(*offsets),
            steer=printed.steer,
        )  # fmt: skip
        percept = wanted["Percept"](*offsets)
        percept.normal, percept.uniform, percept.ray = (
            ctypes.cast(each, ctypes.c_void_p) for each in (normal, uniform, ray)
        )
        rows = [wanted["Heard"](wanted["State"](*h.state), h.age, h.who, h.group) for h in heard]
        walls = [wanted["Surface"](*each) for each in surfaces]
        found = command(
            ctypes.byref(numbers), ctypes.byref(wanted["State"](*own)), index, ctypes.c_double(1.0),
            (wanted["Heard"] * len(rows))(*rows), len(rows), (wanted["Surface"] * len(walls))(*walls), len(walls),
            *memory, ctypes.byref(percept), ctypes.c_double(0.1),
        )  # fmt: skip
        rounding = 1e-12 if law in ("vicsek_1995", "chen_2014", "couzin_2002") else 0.0  # they call sin, exp or pow
        assert (found.v0, found.v1, found.v2) == pytest.approx(expected.command, rel=rounding, abs=rounding)


LAW = """
import math
from airflock import Parameters

COMMAND = "velocity"

def halved(x):
    return x if x < 1.0 else halved(0.5 * x)

def decide(own, percept):
    {body}
    return own.vx, own.vy, own.vz
"""


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("double = own.vx", "double is a name that C reserves; give the variable another name"),
        ("for x in (own.vx, own.vy): pass", "has a loop that is not printed; write for k in range(...)"),
        ("x = math.gamma(own.vx)", "calls math.gamma, which has no form in C"),
        ("x = halved(own.vx)", "calls itself; a rule that is printed has a loop instead"),
        ("for k in range(3): pass\n    else: pass", "has an else behind a loop"),
        ("while own.vx > 1.0: break\n    else: pass", "has an else behind a loop"),
        ("x = own.vx / 1e-50", "1e-50 is no number of single precision"),
        ("n = 3000000000", "3000000000 has no form in C"),
        ("NAN = own.vx", "NAN is a name that C reserves"),
    ],
)
def test_a_law_that_has_no_form_in_c_is_refused_with_file_line_and_what_to_write(body, says, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(LAW.format(body=body))
    with pytest.raises(RuleError, match=r"mine\.py:\d+: rule (decide|halved): ") as raised:
        print_law(file, out=tmp_path / "law")
    assert says in str(raised.value) and "\n" not in str(raised.value)
    assert not (tmp_path / "law").exists()


OWN = '''
"""A law whose text */ would end a comment."""
from dataclasses import dataclass
from typing import NamedTuple
import airflock

COMMAND = "velocity"

@dataclass(frozen=True, kw_only=True)
class Parameters(airflock.Parameters):
    weights: tuple = airflock.quantity((1.0, 2.0), "1", size=2, low=0.0, high=9.0, meaning="weights /* of two */")
    sign: str = airflock.choice("plus", ("plus", "minus"), meaning="sign")

class Memory(NamedTuple):
    before: float = 0.25

class Pair(NamedTuple):
    first: float
    second: float

def scaled(x, by=2.0):
    return max(x, 0.5) * by

def counted(x):
    """The end of a loop is that of its first turn, and names may end as those do that C needs."""
    n, total = 3, 0.0
    for k in range(n):
        n, t1_ = 1, x * k
        total += t1_
    sqrt, sqrt_ = abs(x), 2.0
    return total + sqrt * sqrt_ + ((x > 0.0) + (x > 1.0))

def decide(own, memory, percept, p):
    total = 0.0
    for k in range(2):
        total += p.weights[k] * percept.normal(k)
    if p.sign == "minus":
        total = -total
    pair = Pair(second=scaled(by=total, x=own.vx), first=scaled(own.vz))
    return pair.second - pair.first + counted(own.vy), own.vy % 3.0, memory.before, Memory(total)
'''


def test_a_law_of_ones_own_with_vectors_a_memory_and_draws_gives_the_bits_of_plain_python(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    files = print_law(tmp_path / "mine.py", out=tmp_path / "law")
    assert_same_bits(files)
    assert "#define mine_START {R(0.25)}" in files[0].read_text()


def test_stubs_come_only_with_laws_that_call_nothing_of_a_percept_and_the_bare_one_compiles(tmp_path):
    """The percept of a stub has no functions: a law that calls one would jump to address zero on board."""
    for law in PRINTED:
        files = print_law(law, out=tmp_path / law)
        if any("stub" in file.name for file in files):
            assert "percept->context" not in files[1].read_text(), law
            bare = [*STRICT, "-c", tmp_path / law / "stub_stm32.c", "-o", tmp_path / "stub.o"]
            subprocess.run(["gcc", *bare], check=True)


def test_the_replay_of_a_law_fails_where_c_gives_another_number_or_none(tmp_path):
    files = print_law("viragh_2014", out=tmp_path)
    text = files[1].read_text()
    head, brace, body = text.partition("viragh_2014_boundary(")[2].partition("{\n")
    for wrong in ("R(1e-6)", "(real)NAN"):
        broken = body.replace("return (viragh_2014_Walls){", f"return (viragh_2014_Walls){{{wrong} + ", 1)
        assert broken != body
        files[1].write_text(text.replace(brace + body, brace + broken))
        program = compiled(files, "-DAIRFLOCK_PRECISION=64")
        assert subprocess.run([program, files[0].with_suffix(".cases")], capture_output=True).returncode != 0


def test_a_header_notes_what_of_the_scenario_it_has_not(tmp_path):
    settings = {"groups": [{"name": "fish", "agents": 2, "model": {"kind": "viragh_2014"}}], "topology.kind": "nearest"}
    header = print_law("vasarhelyi_2018/4ms", settings=settings, out=tmp_path)[0].read_text()
    for what in ("group fish", "topology nearest", "in a plane"):
        assert what in header


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (OWN.replace("own.vy % 3.0", "(own.vy - own.vy) / (own.vx - own.vx)"), "gives hardly ever a finite number"),
        (OWN.replace("weights: tuple", "far: float | None = airflock.quantity(None, 'm', low=0.0, high=9.0, "
                     "meaning='far')\n    weights: tuple"), "far = None"),
    ],
)  # fmt: skip
def test_numbers_that_are_none_or_never_finite_are_refused_in_one_line(text, says, tmp_path):
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(AirflockError, match=says) as raised:
        print_law(tmp_path / "mine.py", out=tmp_path / "law")
    assert "\n" not in str(raised.value) and not (tmp_path / "law").exists()


def test_a_law_for_the_whole_flock_and_an_unknown_part_are_refused_in_one_line(tmp_path):
    with pytest.raises(RuleError, match="whole flock at once"):
        print_law("dimock_2003", out=tmp_path)
    for part in ("bdy", "wind"):
        with pytest.raises(AirflockError, match="no such part; .*body"):
            print_law("vasarhelyi_2018/4ms", part=part, out=tmp_path)
    with pytest.raises(AirflockError, match="couzin_2002 is a law alone"):
        print_law("couzin_2002", part="body", out=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(AirflockError, match="file: "):
        print_law("vasarhelyi_2018/4ms", out=tmp_path / "file")


def test_numbers_of_a_preset_are_the_defaults_of_the_header(tmp_path):
    files = print_law("vasarhelyi_2018/4ms", settings={"model.p_rep": 0.25}, out=tmp_path)
    assert "R(0.25)" in files[0].read_text().partition("_DEFAULTS")[2].partition("}")[0]
    assert "1/s, 0 to 10: repulsion gain" in files[0].read_text()
