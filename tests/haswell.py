"""Run the command as one kind of processor, a Haswell: floating-point results depend on the kind."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = [str(ROOT / folder) for folder in ("src", "papers/src")]


def environment():
    """Return the environment of a process in which NumPy, OpenBLAS and the C library compute as a Haswell does.

    `.ci/haswell` says the same to Numba.
    """
    return os.environ | {
        "COLUMNS": "100",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-AVX512CD",
        "MPLBACKEND": "agg",
        "NO_COLOR": "1",
        "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
        "OPENBLAS_CORETYPE": "Haswell",
        "PYTHONHASHSEED": "0",
        "PYTHONPATH": os.pathsep.join([*SOURCES, os.environ.get("PYTHONPATH", "")]),
        "PYTHONWARNINGS": "ignore::ImportWarning",
        "TZ": "UTC",
    }


def python(folder, *words, seconds=600, **more):
    """Run Python with some arguments in a folder; return the finished process with its texts."""
    return subprocess.run(
        [ROOT / ".ci/haswell", sys.executable, *map(str, words)], cwd=folder, env=environment() | more,
        capture_output=True, text=True, timeout=seconds, stdin=subprocess.DEVNULL,
    )  # fmt: skip


def airflock(folder, *words, **more):
    """Run a command line of airflock in a folder; return the finished process with its texts."""
    return python(folder, "-m", "airflock", *words, **more)
