"""The compiler of drivers: Numba's machine code, without what nobody calls."""

import gc
import os
import platform
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit, prange
from numba.core.codegen import JITCodeLibrary
from numba.core.errors import NumbaError

import airflock
from airflock.engine import plan_of
from inside import CALLED, INNER, flight_driver, is_tested

by_own_compiler = pytest.mark.skipif(not is_tested(), reason="drivers are compiled by plain njit here")

OPTIONS = {"fastmath": True, "error_model": "numpy", "nogil": True, "forceinline": True, "_nrt": False}


def pair_of_functions(inner, called):
    """A loop over agents that calls a rule, each compiled with options of its own."""

    @njit(**inner)
    def rule(x, y):
        return np.float32(2.0) * x if x * x + y * y < np.float32(1.0) else y

    @njit(**called)
    def loop(xs, ys):
        total = np.float32(0.0)
        for i in range(xs.shape[0]):
            total += rule(xs[i], ys[i])
            xs[i] = total
        return total

    return rule, loop


def instructions(function):
    """Machine code of what Python calls, from its first label to its end, without the names that Numba makes up."""
    text = function.inspect_asm(function.signatures[0])
    name = next(
        line for line in text.splitlines() if line.startswith("_ZN8__main__") or re.match(r"_ZN.*loop.*:$", line)
    )
    found = text[text.index(name) :].partition("\n.Lfunc_end")[0].splitlines()[1:]
    lines = [line.strip() for line in found if line.startswith("\t") and not line.strip().startswith(".")]
    return [re.sub(r"\.L\w+", ".L", line) for line in lines]


@pytest.fixture
def whole_lines(monkeypatch):
    """Vectors on the stack of Numba's own code lie as those of a driver do."""
    usual = JITCodeLibrary.add_ir_module

    def with_whole_lines(library, module):
        for function in module.functions:
            if function.blocks:
                function.attributes.alignstack = 64
        usual(library, module)

    monkeypatch.setattr(JITCodeLibrary, "add_ir_module", with_whole_lines)


@by_own_compiler
def test_machine_code_is_that_of_numba(whole_lines):
    xs, ys = np.linspace(-2.0, 2.0, 101, dtype=np.float32), np.ones(101, np.float32)
    (_, ours), (_, theirs) = pair_of_functions(OPTIONS | INNER, OPTIONS | CALLED), pair_of_functions(OPTIONS, OPTIONS)
    found = [loop(xs.copy(), ys) for loop in (ours, theirs)]
    assert found[0] == found[1] != 0.0
    assert len(instructions(ours)) > 10
    assert instructions(ours) == instructions(theirs)


@by_own_compiler
def test_a_function_is_compiled_once_for_all_whole_numbers_that_its_callers_write_out():
    @njit(**OPTIONS | INNER)
    def times(x, k):
        return x * k

    @njit(**OPTIONS | CALLED)
    def of_all(n):
        return times(n, 2) + times(n, 3) + times(n, n)

    assert of_all(5) == 50
    assert len(times.signatures) == 1


def test_a_function_that_adds_up_an_array_knows_the_length_that_its_caller_writes_out():
    """LLVM adds up otherwise if it knows how long a loop is: lifting lines keep their bits."""

    @njit(**OPTIONS | INNER)
    def total(x, n):
        found = np.float32(0.0)
        for i in range(n):
            found += x[i]
        return found

    @njit(**OPTIONS | CALLED)
    def of_both(x, n):
        return total(x, 20) + total(x, n)

    assert of_both(np.ones(30, np.float32), 30) == 50.0
    assert len(total.signatures) == 2


@by_own_compiler
@pytest.mark.skipif(platform.machine() != "x86_64", reason="names a register of x86-64")
@pytest.mark.parametrize("spread", [False, True], ids=["one thread", "all cores"])
def test_vectors_on_the_stack_lie_whole_in_lines_of_the_cache(spread):
    options = OPTIONS | {"_nrt": spread}

    @njit(**options | INNER | {"parallel": spread})
    def pairs(xs, out):  # more sums than there are registers
        for i in prange(xs.shape[0]):
            a = b = c = d = e = f = g = h = k = m = np.float32(0.0)
            for j in range(xs.shape[0]):
                x = xs[j] - xs[i]
                y, z = x * x + np.float32(1.0), np.sqrt(abs(x))
                a, b, c, d, e = a + x * y, b + y / z, c + z * x, d + x / y, e + y * y
                f, g, h, k, m = f + z / y, g + x / z, h + y * z, k + z * z * z, m + x * x * y
            out[i] = a * b + c * d + e * f + g * h + k * m

    @njit(**options | CALLED)
    def loop(xs, out):
        pairs(xs, out)
        return 0

    xs = np.linspace(0.0, 1.0, 200, dtype=np.float32)
    loop(xs, np.zeros_like(xs))
    assert re.search(r"and[lq]\s+\$-64, %[er]sp", loop.inspect_asm(loop.signatures[0]))


@by_own_compiler
def test_a_function_that_only_others_call_refuses_python():
    rule, loop = pair_of_functions(OPTIONS | INNER, OPTIONS | CALLED)
    xs = np.ones(3, np.float32)
    assert loop(xs.copy(), xs) == 3.0
    with pytest.raises(KeyError, match="rule, which only other functions"):
        rule(np.float32(1.0), np.float32(1.0))


def test_the_garbage_collector_is_left_as_it_was():
    usual = gc.get_threshold()

    @njit(**CALLED)
    def wrong(x):
        return x + "m"

    for threshold in ((700, 10, 10), (0, 10, 10), (10**6, 100, 100)):
        gc.set_threshold(*threshold)
        try:
            with pytest.raises(NumbaError):
                wrong(1.0)
            assert gc.get_threshold() == threshold
        finally:
            gc.set_threshold(*usual)


def test_closures_lists_and_whole_arrays_are_compiled_where_there_are_any():
    @njit(**CALLED)
    def of_all(xs):
        def doubled(x):
            return 2.0 * x

        whole = 3.0 * xs + np.sqrt(xs) - xs
        return whole.sum() + np.array([doubled(x) for x in xs]).sum()

    xs = np.array([1.0, 4.0, 9.0])
    assert of_all(xs) == 14.0 * 2.0 + 6.0 + 14.0 * 2.0


@by_own_compiler
def test_a_driver_compiles_without_scipy_and_whoever_needs_it_has_it():
    text = """
import sys
import numpy as np
from numba import njit, prange
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
sys.path.insert(0, {tests!r})
from inside import CALLED, implementations
with global_compiler_lock:
    implementations()
ours = njit(lambda x: x + 1.0, **CALLED)
assert ours(1.0) == 2.0
assert "scipy.linalg" not in sys.modules
from numba.np import arraymath, linalg
assert arraymath.ensure_blas is linalg.ensure_blas is not None
theirs = njit(lambda a, b: np.dot(a, b) + np.correlate(a, b)[0] + np.linalg.norm(a))
a = np.array([3.0, 4.0])
assert theirs(a, a) == 25.0 + 25.0 + 5.0
assert "scipy.linalg" in sys.modules
"""
    given = text.replace("{tests!r}", repr(str(Path(__file__).parents[1])))
    subprocess.run([sys.executable, "-c", given], check=True)


def test_loops_of_noise_stand_in_a_driver_once():
    driver = flight_driver(plan_of(airflock.load("vasarhelyi_2018/4ms", {"agents": 4, "duration": 1.0})))
    text = driver.TEXT
    assert text.count("= random_philox(") == 1 and text.count(" draw(m, ") == 3  # itself, perceive, move
    assert text.count("normal_pair(u") == 0 and text.count(" normal(m, ") == 5  # itself, two of each
    assert text.count("= langevin_error(") == 1 and text.count(" wander(m, ") == 5  # itself, four rows


def test_outside_the_tested_versions_plain_numba_flies_the_same_bits(tmp_path):
    """The guard: no private module is imported, and a flight has the bits of the driver compiler."""
    text = """
import sys
import airflock
flight = airflock.simulate(airflock.load("vasarhelyi_2018/4ms", {"agents": 6, "duration": 5.0}), seed=3)
private = [name for name in sys.modules if name.startswith("airflock.engine.numba_private.")]
print(len(private), flight["position"].values.tobytes().hex())
"""
    runs = []
    for plain in ("", "1"):
        own = os.environ | {"AIRFLOCK_CACHE": str(tmp_path), "AIRFLOCK_PLAIN_NUMBA": plain}
        process = subprocess.run([sys.executable, "-c", text], env=own, check=True, capture_output=True, text=True)
        runs.append(process.stdout.split())
    assert runs[1][0] == "0"
    assert runs[0][1] == runs[1][1]
