"""Machine: the processor that this process runs on. Two kinds may round differently."""

import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

CPUINFO = Path("/proc/cpuinfo")
LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container


def processor_name() -> str:
    """Model name of the processor, or what the system says of its kind."""
    if CPUINFO.is_file():  # Linux
        for line in CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


@cache
def target() -> tuple[str, frozenset[str]]:
    """Kind of the processor for which drivers are compiled, for instance znver4, and its features, for instance avx2.

    They are those of this machine unless NUMBA_CPU_NAME and NUMBA_CPU_FEATURES name others. Everything that depends on
    a processor is decided by these two.
    """
    import llvmlite.binding as llvm
    from numba import config

    named: Any = config  # whose settings Numba makes when it is imported
    features = llvm.get_host_cpu_features().flatten() if named.CPU_FEATURES is None else named.CPU_FEATURES
    name = llvm.get_host_cpu_name() if named.CPU_NAME is None else named.CPU_NAME
    return str(name), frozenset(word[1:] for word in features.split(",") if word.startswith("+"))


def processor_kind() -> str:
    """Kind of the processor for which drivers are compiled: flights of one seed have its bits."""
    return target()[0]


def vector_bits() -> int:
    """Width of the vectors of drivers: 512 from Ice Lake and Zen 4 on, which keep their clock with them."""
    features = target()[1]
    return 512 if "avx512vbmi2" in features else 256 if "avx2" in features else 128


@cache
def toolchain_versions() -> str:
    """Versions and processor that compiled code depends on."""
    import llvmlite
    import numba
    import numpy

    return "|".join(
        (
            platform.python_version(),
            numba.__version__,
            llvmlite.__version__,
            numpy.__version__,
            processor_kind(),
        )
    )


def free_memory() -> int | None:
    """Bytes that this process may still take: of the machine, or of its container if that is less; None if unknown."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024 * int(line.split()[1]))
    except (OSError, ValueError):
        names = os.sysconf_names if hasattr(os, "sysconf_names") else {}
        if {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(names):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for limit in map(Path, LIMITS):
        try:
            found.append(int(limit.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no container, or one without a limit
            continue
    return min(found, default=None)
