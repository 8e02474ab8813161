"""The machine: the processor and the memory of this process. Two kinds of processor may round differently."""

import ctypes
import os
import platform
from functools import cache
from pathlib import Path
from typing import Any

CPUINFO = Path("/proc/cpuinfo")
LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container


def processor_name() -> str:
    """Return the model name of the processor, or the system's name for its kind."""
    if CPUINFO.is_file():  # Linux
        for line in CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


@cache
def target() -> tuple[str, frozenset[str]]:
    """Return the kind of processor for which drivers are compiled, such as znver4, and its features, such as avx2.

    They are those of this machine unless NUMBA_CPU_NAME and NUMBA_CPU_FEATURES name others.
    Everything that depends on a processor is decided by these two.
    """
    import llvmlite.binding as llvm
    from numba import config

    named: Any = config  # whose settings Numba makes when it is imported
    features = llvm.get_host_cpu_features().flatten() if named.CPU_FEATURES is None else named.CPU_FEATURES
    name = llvm.get_host_cpu_name() if named.CPU_NAME is None else named.CPU_NAME
    return str(name), frozenset(word[1:] for word in features.split(",") if word.startswith("+"))


def processor_kind() -> str:
    """Return the kind of processor for which drivers are compiled: flights of one seed have its bits."""
    return target()[0]


def vector_bits() -> int:
    """Return the width of the vectors of drivers."""
    # From Ice Lake and Zen 4 on processors keep their clock with vectors of 512 bits; avx512vbmi2
    # marks them, as avx512f is also set on Skylake, which lowers it.
    features = target()[1]
    return 512 if "avx512vbmi2" in features else 256 if "avx2" in features else 128


@cache
def toolchain_versions() -> str:
    """Return the versions and the processor that compiled code depends on."""
    import llvmlite
    import numba
    import numpy

    # Compiled code is kept under this text: if any of these changes, it is compiled again.
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
    """Return the bytes that this process may still take, of the machine or of its container; None if unknown."""
    limits = []
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                limits.append(1024 * int(line.split()[1]))
    except (OSError, ValueError):
        names = os.sysconf_names if hasattr(os, "sysconf_names") else {}
        if {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(names):
            limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    # In a container the machine's free memory is more than the process may take.
    for limit in map(Path, LIMITS):
        try:
            limits.append(int(limit.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no container, or one without a limit
            continue
    return min(limits, default=None)


def trim_heap() -> None:
    """Return freed small pieces of memory to the system, where the C library can (glibc)."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (OSError, AttributeError, TypeError):  # another C library: nothing to do
        return
