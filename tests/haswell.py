"""Run the command as one kind of processor: floating-point results depend on it, so snapshots are taken as a Haswell."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

SOURCES = [str(Path(__file__).parents[1] / folder) for folder in ("src", "papers/src")]
FEATURES = (
    "64bit avx avx2 bmi bmi2 cmov crc32 cx16 cx8 f16c fma fsgsbase fxsr invpcid lzcnt mmx movbe pclmul popcnt rdrnd"
    " sahf sse sse2 sse3 sse4.1 sse4.2 ssse3 xsave xsaveopt"
).split()


def environment():
    """Return the environment of a process that computes as a Haswell does, in Numba, NumPy, OpenBLAS and the C library.

    It has a cache of its own: the folders of the usual one do not tell of `NUMBA_CPU_NAME`.
    """
    usual = os.environ.get("AIRFLOCK_CACHE")
    cache = Path(usual) / "haswell" if usual else Path(tempfile.gettempdir()) / f"airflock-haswell-{os.getuid()}"
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    return os.environ | {
        "AIRFLOCK_CACHE": str(cache),
        "COLUMNS": "100",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-AVX512CD",
        "MPLBACKEND": "agg",
        "NO_COLOR": "1",
        "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
        "NUMBA_CPU_FEATURES": ",".join(f"+{feature}" for feature in FEATURES),
        "NUMBA_CPU_NAME": "haswell",
        "OPENBLAS_CORETYPE": "Haswell",
        "PYTHONHASHSEED": "0",
        "PYTHONPATH": os.pathsep.join([*SOURCES, os.environ.get("PYTHONPATH", "")]),
        "PYTHONWARNINGS": "ignore::ImportWarning",
        "TZ": "UTC",
    }


def airflock(folder, *words, seconds=600):
    """Run a command line of airflock in a folder; return the finished process with its texts."""
    command = [sys.executable, "-m", "airflock", *map(str, words)]
    return subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True, timeout=seconds)
