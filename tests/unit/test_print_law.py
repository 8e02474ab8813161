"""Rules printed as C99 give the bits of plain Python, part by part and as whole decisions."""

import ctypes
import random
import re
import shutil
import subprocess

import pytest

from airflock.core import HeardNeighbour, State, decide, number_names
from airflock.engine import c_printing as print_module
from airflock.engine.c_printing import CasePercept, print_law, printed_part
from airflock.engine.text.c99 import REAL, WHOLE
from airflock.parts import BODIES, FAULTS, LAWS, RADIOS, SENSORS
from airflock.support import AirflockError, RuleError

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


@pytest.mark.parametrize("law", [name for name in LAWS if LAWS[name].flock is None])
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


@pytest.mark.parametrize("law", ["vasarhelyi_2018", "viragh_2014", "formation", "vicsek_1995", "chen_2014"])
def test_a_whole_decision_in_c_has_the_bits_of_a_pilot(law, tmp_path):
    rng = random.Random(law)
    printed = printed_part(law, "law", None, False)
    print_module.command_text(printed)
    print_law(law, out=tmp_path)
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
        )  # fmt: skip
        percept = wanted["Percept"](*offsets)
        percept.normal, percept.uniform = (ctypes.cast(each, ctypes.c_void_p) for each in (normal, uniform))
        rows = [wanted["Heard"](wanted["State"](*h.state), h.age, h.who, h.group) for h in heard]
        walls = [wanted["Surface"](*each) for each in surfaces]
        found = command(
            ctypes.byref(numbers), ctypes.byref(wanted["State"](*own)), index, ctypes.c_double(1.0),
            (wanted["Heard"] * len(rows))(*rows), len(rows), (wanted["Surface"] * len(walls))(*walls), len(walls),
            ctypes.byref(percept), ctypes.c_double(0.1),
        )  # fmt: skip
        rounding = 1e-12 if law in ("vicsek_1995", "chen_2014") else 0.0  # they call sin, cos, exp or pow
        assert (found.v0, found.v1, found.v2) == pytest.approx(expected.command, rel=rounding, abs=rounding)


LAW = """
import math
from airflock import Parameters

COMMAND = "velocity"

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
    ],
)
def test_a_law_that_has_no_form_in_c_is_refused_with_file_line_and_what_to_write(body, says, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(LAW.format(body=body))
    with pytest.raises(RuleError, match=r"mine\.py:\d+: rule decide: ") as raised:
        print_law(file, out=tmp_path / "law")
    assert says in str(raised.value) and "\n" not in str(raised.value)
    assert not (tmp_path / "law").exists()


def test_a_law_for_the_whole_flock_and_an_unknown_part_are_refused_in_one_line(tmp_path):
    with pytest.raises(RuleError, match="whole flock at once"):
        print_law("dimock_2003", out=tmp_path)
    with pytest.raises(AirflockError, match="no such part; .*body"):
        print_law("vasarhelyi_2018/4ms", part="bdy", out=tmp_path)


def test_numbers_of_a_preset_are_the_defaults_of_the_header(tmp_path):
    files = print_law("vasarhelyi_2018/4ms", settings={"model.p_rep": 0.25}, out=tmp_path)
    assert "R(0.25)" in files[0].read_text().partition("_DEFAULTS")[2].partition("}")[0]
    assert "1/s, 0 to 10: repulsion gain" in files[0].read_text()
